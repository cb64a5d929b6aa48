"""How long `make demo` and `make test` take on a machine that has built nothing of them yet, stage by stage.

    python scripts/stage_times.py [REVISION] [--only demo|test]

Each runs in a clone of its own, with the packages that pip, cargo and npm have downloaded. `make stage-times` keeps it
in benchmarks/results/stages.txt; CONTRIBUTING.md says what each stage may take.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).resolve().parent.parent
STAGE = re.compile(r"^([a-z-]+) +(\d+) s$", re.MULTILINE)
GOALS = ("demo", "test")


def main(revision: str, goals: list[str]) -> None:
    """Print one line per stage [s], for each goal."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    import machine  # type: ignore[import-not-found]

    print(machine.describe(), flush=True)
    print(f"of {subject(revision)}", flush=True)
    for goal in goals:
        with tempfile.TemporaryDirectory(dir=ROOT / "out") as folder:
            stages, whole = measure(goal, revision, Path(folder))
        print(f"\n{'make ' + goal:13} {whole:5.0f} s", flush=True)
        for stage, seconds in stages:
            print(f"{stage:13} {seconds:>5} s", flush=True)


def subject(revision: str) -> str:
    command = ["git", "log", "-1", "--format=%h of %ad: %s", "--date=short", "--abbrev=7", revision]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def measure(goal: str, revision: str, folder: Path) -> tuple[list[tuple[str, str]], float]:
    """The stages that a goal reports, and the time from its first step to its last [s]."""
    clone = folder / "clone"
    subprocess.run(["git", "clone", "--quiet", "--no-checkout", ROOT, clone], check=True)
    subprocess.run(["git", "checkout", "--quiet", revision], cwd=clone, check=True)
    began = perf_counter()
    run = subprocess.run(["make", goal], cwd=clone, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    whole = perf_counter() - began
    if run.returncode:
        sys.exit(f"{run.stdout[-4000:]}\nmake {goal} ended with {run.returncode} after {whole:.0f} s")
    return STAGE.findall(run.stdout), whole


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Time the stages of make demo and make test from nothing.")
    parser.add_argument("revision", nargs="?", default="HEAD")
    parser.add_argument("--only", choices=GOALS)
    given = parser.parse_args()
    main(given.revision, [given.only] if given.only else list(GOALS))
