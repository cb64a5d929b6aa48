"""Whether one revision is slower than another: the same measurements of both, in turns.

    python scripts/compare.py REVISION [OTHER] [--only GROUP]

OTHER is the working tree unless it is given. Each revision is checked out and built in out/compare/, once. Every group
of measurements runs in a process of its own on one thread, of the two revisions in turn, and the least time of several
rounds counts. Groups with a row beyond `LIMIT` get more rounds, both revisions as many, since other work on the machine
only adds time. Times are those of the processor, but for cells and touches, which are the least or the median of many
short runs. Where a revision cannot run a row, the table says why.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "out" / "compare"
LIMIT = 1.03  # times as long
ROUNDS, REPEATS = 4, 3  # in turn, and how often so many if a row is beyond the limit
BENCHES = ("assembly", "online")
NO_ROW = "no such row"

Times = dict[str, "float | str"]
"""By row, the time, or why there is none."""


@dataclass(frozen=True)
class Side:
    """A revision that is built."""

    name: str
    package: Path  # the folder that holds the package
    benches: Path  # the folder that holds the compiled benchmarks of the core
    model: Path  # where its reduced model is kept
    first: Path  # that of the first revision, which the second one must still read


def git(*words: str, folder: Path = ROOT) -> str:
    return subprocess.run(["git", *words], cwd=folder, check=True, capture_output=True, text=True).stdout.strip()


def title(revision: str) -> str:
    return git("log", "-1", "--format=%h of %ad: %s", "--date=short", "--abbrev=7", revision)


def compiled(folder: Path, target: Path) -> dict[str, Path]:
    """The extension and the benchmarks of the core, by name: in one call, so that they share what they depend on."""
    command = ["cargo", "build", "--release", "--locked", "--package", "viscera-python", "--package", "viscera-core"]
    command += ["--lib", *(word for name in BENCHES for word in ("--bench", name)), "--message-format=json"]
    environment = {**os.environ, "CARGO_TARGET_DIR": str(target)}
    told = subprocess.run(command, cwd=folder, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout
    made = [json.loads(line) for line in told.splitlines() if line.startswith("{")]
    return {one["target"]["name"]: Path(one["filenames"][0]) for one in made if one["reason"] == "compiler-artifact"}


def working_tree(groups: list[str], first: Path) -> Side:
    """What `make setup` has built here; benchmarks are compiled if they are asked for."""
    changes = git("status", "--porcelain", "--untracked-files=no", "--", ":/", ":!/benchmarks/results", ":!/*.md")
    own = FOLDER / "tree"
    if not {"cells", "touches"}.isdisjoint(groups):
        keep(compiled(ROOT, ROOT / "target"), own)
    return Side(
        title("HEAD") + (" (with changes)" if changes else ""), ROOT / "python", own, FOLDER / "tree.viscera", first
    )


def keep(made: dict[str, Path], folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name in BENCHES:
        shutil.copy(made[name], folder / name)


def built(revision: str, first: Path | None = None) -> Side:
    """A revision in a folder of its own. All are built in one checkout, so that what they share is compiled once."""
    try:
        commit = git("rev-parse", "--short=7", f"{revision}^{{commit}}")
    except subprocess.CalledProcessError:
        sys.exit(f"git knows no commit {revision!r}; name one, as in `make compare REV=main`")
    folder, tree = FOLDER / commit, FOLDER / "checkout"
    if not (folder / "python").exists():
        if not tree.exists():
            subprocess.run(["git", "clone", "--quiet", "--shared", "--no-checkout", ROOT, tree], check=True)
        git("checkout", "--quiet", "--force", commit, folder=tree)
        made = compiled(tree, FOLDER / "target")
        keep(made, folder)
        shutil.copytree(tree / "python", folder / "building", dirs_exist_ok=True)
        shutil.copy(made["_core"], folder / "building" / "viscera" / "_core.abi3.so")
        (folder / "building").rename(folder / "python")
    model = folder / "end.viscera"
    return Side(title(commit), folder / "python", folder, model, first or model)


def run(side: Side, command: list[str | Path]) -> str:
    """What a command prints with the package of a side, on one thread."""
    alone = {**os.environ, "PYTHONPATH": str(side.package), "RAYON_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    return subprocess.run(command, env=alone, check=True, capture_output=True, text=True).stdout


def of_python(group: str) -> Callable[[Side], Times]:
    """A group of scripts/compare_rows.py."""
    script = Path(__file__).with_name("compare_rows.py")
    return lambda side: json.loads(run(side, [sys.executable, script, group, side.model]))


def cells(side: Side) -> Times:
    """Energy, force and tangent of a cell, by law and element [us]."""
    columns = ("energy", "force", "force and tangent")
    row = re.compile(r"^(.+?)\s{2,}(P1 mean volume|P1|P2)\s+([\d.]+)\s+([\d.]+)\s+([\d.]+)$", re.MULTILINE)
    return {
        f"{law}, {element}: {column} [us]": float(time)
        for law, element, *times in row.findall(run(side, [side.benches / "assembly", "--bench"]))
        for column, time in zip(columns, times, strict=True)
    }


def touches(side: Side) -> Times:
    """The median of a touch [us], random and of a hand that wanders: of the revision's own model, and of A's,
    so that what a model holds is told from what the evaluator takes for it."""
    row = re.compile(r"^(random touches|wandering hand)\s+(.+?)\s+[\d.]+\s+([\d.]+)\s+[\d.]+\s+[\d.]+$", re.MULTILINE)
    return {
        f"{hand}, {what}, {whose} model [us]": float(time)
        for whose, model in (("own", side.model), ("A's", side.first))
        for hand, what, time in row.findall(run(side, [side.benches / "online", "--bench", model]))
    }


GROUPS: dict[str, Callable[[Side], Times]] = {
    "cells": cells,
    "solutions": of_python("solutions"),
    "frames": of_python("frames"),
    "offline": of_python("offline"),
    "touches": touches,
    "fingers": of_python("fingers"),
}
"""In this order: the off-line stage writes the model that the next two read."""


def tried(group: Callable[[Side], Times], side: Side) -> Times:
    """The times of a group; where it could not be run, the end of what it said as the reason for all of its rows."""
    try:
        return group(side)
    except subprocess.CalledProcessError as error:
        return {"": (error.stderr.strip().splitlines() or ["failed"])[-1]}
    except OSError as error:
        return {"": str(error)}


def least(group: Callable[[Side], Times], sides: list[Side]) -> Iterator[tuple[str, list[float | str]]]:
    """Each row, with the least time of each side or why it has none."""
    best: list[Times] = [{} for _ in sides]
    for _ in range(REPEATS):
        for _ in range(ROUNDS):
            for side, times in zip(sides, best, strict=True):
                for row, time in tried(group, side).items():
                    before = times.get(row, time)
                    times[row] = time if isinstance(time, str) or isinstance(before, str) else min(before, time)
        if not any(ratio(found) > LIMIT for found in rows(best).values()):
            break
    yield from rows(best).items()


def rows(best: list[Times]) -> dict[str, list[float | str]]:
    names = dict.fromkeys(row for times in best for row in times)
    return {row: [times.get(row, times.get("", NO_ROW)) for times in best] for row in names if row}


def ratio(found: list[float | str]) -> float:
    """Of the second time to the first; 0 where one is missing."""
    first, second = found
    return second / first if isinstance(first, float) and isinstance(second, float) else 0.0


def main(revision: str, other: str | None, groups: list[str]) -> None:
    """Print one line per row."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    import machine  # type: ignore[import-not-found]

    FOLDER.mkdir(parents=True, exist_ok=True)
    first = built(revision)
    sides = [first, built(other, first.model) if other else working_tree(groups, first.model)]
    print(machine.describe(1))
    for letter, side in zip("AB", sides, strict=True):
        print(f"{letter}: {side.name}")
    print(f"least of at least {ROUNDS} runs of each in turn; * more than {LIMIT} times as long")
    print(f"{'':66}{'A':>10}{'B':>10}{'B / A':>8}", flush=True)
    slower = 0
    for group in groups:
        of_one = 0
        for row, found in least(GROUPS[group], sides):
            if NO_ROW in found:
                of_one += 1
                continue
            missing = [f"{letter}: {time}" for letter, time in zip("AB", found, strict=True) if isinstance(time, str)]
            if missing:
                print(f"{row:66}  {'; '.join(missing)}", flush=True)
                continue
            slower += ratio(found) > LIMIT
            times = "".join(f"{time:10.3f}" for time in found)
            print(f"{row:66}{times}{ratio(found):8.3f}{' *' if ratio(found) > LIMIT else ''}", flush=True)
        if of_one:
            print(f"{group}: {of_one} rows that one of the revisions does not have", flush=True)
    print(f"rows that take more than {LIMIT} times as long: {slower}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Measure two revisions in turns.")
    parser.add_argument("revision")
    parser.add_argument("other", nargs="?")
    parser.add_argument("--only", action="append", choices=GROUPS, help="a group of rows; may be given more than once")
    given = parser.parse_args()
    main(given.revision, given.other, given.only or list(GROUPS))
