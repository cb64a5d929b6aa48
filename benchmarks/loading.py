"""Loading a model file: every array is checked against its checksum, which must take less than half a second for 91 MB.

    python benchmarks/loading.py [MODEL]      (default: out/liver.viscera, which `make demo` writes)

One thread, the least of some runs with the file in the system's cache; beside it the same bytes through zlib's CRC-32
alone, and read without a look at them.
"""

from __future__ import annotations

import os

os.environ.setdefault("RAYON_NUM_THREADS", "1")

import sys
import zlib
from pathlib import Path

from machine import ROOT, describe
from timing import least

import viscera as vs

RUNS = 7
MEGABYTES, LIMIT = 91, 0.5  # [s]


def main(path: Path) -> None:
    """Print one line per way to read the file."""
    if not path.exists():
        sys.exit(f"{path}: no such model; `make demo` writes out/liver.viscera")
    data = path.read_bytes()
    size = 1e-6 * len(data)
    print(describe())
    print(f"a model of {size:.0f} MB       time [s]   for {MEGABYTES} MB   over {LIMIT} s")
    ways = {"loaded": lambda: vs.load(path), "CRC-32 by zlib": lambda: zlib.crc32(data), "read": path.read_bytes}
    for name, work in ways.items():
        seconds = least(work, RUNS)
        scaled = seconds * MEGABYTES / size
        print(f"{name:20} {seconds:12.3f} {scaled:11.3f} {scaled / LIMIT:12.2f}", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else ROOT / "out" / "liver.viscera")
