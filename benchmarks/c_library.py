"""Sizes of the C libraries as `make c-library` builds them, and of a program with one, in MB of 10^6 bytes:

python benchmarks/c_library.py [--write]
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path

from machine import ROOT, describe

BUILT = ROOT / "target" / "c"
SOURCES = ROOT / "bindings" / "c"


def sizes(folder: Path) -> dict[str, int]:
    """Bytes of the libraries."""
    end = "so" if (folder / "libviscera.so").exists() else "dylib"
    names = [f"libviscera.{end}", "libviscera.a", f"libviscera_hands.{end}"]
    return {name: (folder / name).stat().st_size for name in names}


def program(folder: Path, flags: list[str]) -> int:
    """Bytes of the example of a haptic loop, linked statically."""
    system = (folder / "viscera.pc").read_text().split("Libs.private:")[1].split()
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "haptic"
        sources = [f"-I{SOURCES / 'include'}", str(SOURCES / "examples" / "haptic.c"), str(folder / "libviscera.a")]
        subprocess.run(["cc", "-O2", *flags, *sources, *system, "-lm", "-o", str(path)], check=True)
        return path.stat().st_size


def table() -> list[str]:
    """The table of docs/c-library.md."""
    rows = sizes(BUILT)
    rows["haptic.c with libviscera.a"] = program(BUILT, [])
    rows["the same, cc -s"] = program(BUILT, ["-s"])
    rows = {name: rows[name] for name in sorted(rows, key=lambda name: "hands" in name)}
    return [f"{name:<28} {size / 1e6:5.2f} MB" for name, size in rows.items()]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true", help="keep it in benchmarks/results")
    arguments = parser.parse_args()
    found = "\n".join([describe(), *table()]) + "\n"
    print(found, end="")
    if arguments.write:
        (ROOT / "benchmarks" / "results" / "c_library.txt").write_text(found, encoding="utf-8")


if __name__ == "__main__":
    main()
