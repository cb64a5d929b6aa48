"""What a benchmark says before its numbers: the machine, the versions, and the stamp of the run.

    python benchmarks/machine.py [THREADS]

prints both for what is no Python program.
"""

import os
import platform
import subprocess
import sys
from datetime import date
from pathlib import Path

import numpy as np

import viscera

ROOT = Path(__file__).resolve().parent.parent


def describe(threads: int | None = None) -> str:
    """Two lines: processor, cores, system and versions; then the stamp."""
    return (
        f"{_processor()}, {_cores()} cores, {platform.system()}; "
        f"viscera {viscera.__version__}, Python {platform.python_version()}, NumPy {np.__version__}\n{stamp(threads)}"
    )


def stamp(threads: int | None = None) -> str:
    """One line: date, commit, load of the machine over the last minute, threads (those of the core by default)."""
    count = threads or int(os.environ.get("RAYON_NUM_THREADS") or _cores())
    return (
        f"printed on {date.today().isoformat()} at commit {_commit()}; load {os.getloadavg()[0]:.2f}, "
        f"{count} thread{'s' if count > 1 else ''}"
    )


def _commit() -> str:
    """The commit of the working tree, and whether anything but kept results differs from it."""
    head = _git("rev-parse", "--short=7", "HEAD").strip()
    changed = _git("status", "--porcelain", "--untracked-files=no", "--", ".", ":!benchmarks/results", ":!*.md")
    return f"{head} with changes" if changed else head


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


if __name__ == "__main__":
    print(describe(int(sys.argv[1]) if sys.argv[1:] else None))
