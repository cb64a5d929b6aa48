"""What a benchmark says before its numbers: the machine, the versions, and the stamp of the run."""

from __future__ import annotations

import os
import platform
import subprocess
from datetime import date
from pathlib import Path

import numpy as np

import viscera
from viscera.threads import cores, in_use

PACKAGE = Path(viscera.__file__).resolve().parent


def describe(threads: int | None = None) -> str:
    """Two lines: processor, cores, system and versions; then the stamp."""
    return (
        f"{_processor()}, {cores()} cores, {platform.system()}; "
        f"viscera {viscera.__version__}, Python {platform.python_version()}, NumPy {np.__version__}\n{stamp(threads)}"
    )


def stamp(threads: int | None = None) -> str:
    """One line: date, commit if this is a working tree, load over the last minute, threads (by default the core's)."""
    count = threads or in_use()
    load = f"load {os.getloadavg()[0]:.2f}, " if hasattr(os, "getloadavg") else ""
    return f"printed on {date.today().isoformat()}{_commit()}; {load}{count} thread{'s' if count > 1 else ''}"


def _commit() -> str:
    """The commit of the working tree, and whether anything but kept results differs from it."""
    try:
        head = _git("rev-parse", "--short=7", "HEAD").strip()
        changed = _git("status", "--porcelain", "--untracked-files=no", "--", ":/", ":!/benchmarks/results", ":!/*.md")
    except (OSError, subprocess.CalledProcessError):
        return ""
    return f" at commit {head} with changes" if changed else f" at commit {head}"


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=PACKAGE, check=True, capture_output=True, text=True).stdout


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
