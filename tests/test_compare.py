"""The comparison of two revisions: what it reads of the benchmarks, and how it counts rows."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent


def _load(path: Path) -> ModuleType:
    spec = spec_from_file_location(path.stem, path)
    assert spec
    assert spec.loader
    module = module_from_spec(spec)
    sys.modules[path.stem] = module  # dataclasses look for the module that they are of
    spec.loader.exec_module(module)
    return module


compare = _load(ROOT / "scripts" / "compare.py")
SIDE = compare.Side("a revision", ROOT, ROOT, ROOT / "none.viscera", ROOT / "none.viscera")


def test_every_row_of_the_benchmark_of_cells_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    printed = (ROOT / "benchmarks" / "results" / "assembly.txt").read_text(encoding="utf-8")
    monkeypatch.setattr(compare, "run", lambda side, command: printed)
    found = compare.cells(SIDE)
    lines = [line for line in printed.splitlines() if line[31:].lstrip().startswith("P")]
    assert len(found) == 3 * len(lines) > 100
    assert found["linear, P1 mean volume: force [us]"] == float(
        next(line for line in lines if line.startswith("linear ") and "mean" in line).split()[-2]
    )


def test_the_median_of_touches_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    printed = "random touches  whole surface                  11.10     12.20     13.30     14.40"
    monkeypatch.setattr(compare, "run", lambda side, command: printed)
    assert compare.touches(SIDE) == {
        "random touches, whole surface, own model [us]": 12.2,
        "random touches, whole surface, A's model [us]": 12.2,
    }


def test_the_least_time_counts_and_slow_rows_have_more_rounds() -> None:
    sides, calls = [SIDE, compare.Side("another", ROOT, ROOT, ROOT, ROOT)], []

    def group(side: object) -> dict[str, float]:
        calls.append(side)
        slow = 1.2 if side is sides[1] else 1.0
        return {"fast": 2.0 - 0.01 * len(calls), "slow": slow} | ({"new": 1.0} if side is sides[1] else {})

    found = dict(compare.least(group, sides))
    assert len(calls) == 2 * compare.ROUNDS * compare.REPEATS
    assert calls[:4] == [*sides, *sides]
    assert compare.ratio(found["slow"]) == pytest.approx(1.2)
    assert min(found["fast"]) == pytest.approx(2.0 - 0.01 * len(calls))
    assert found["new"] == ["no such row", 1.0]
    assert compare.ratio(found["new"]) == 0.0


def test_a_group_that_a_revision_cannot_run_says_why() -> None:
    def group(side: object) -> dict[str, float]:
        if side is SIDE:
            raise subprocess.CalledProcessError(1, "rows", stderr="Traceback\nAttributeError: no Organ")
        return {"row": 1.0}

    found = dict(compare.least(group, [SIDE, compare.Side("another", ROOT, ROOT, ROOT, ROOT)]))
    assert found == {"row": ["AttributeError: no Organ", 1.0]}


def test_an_unknown_revision_is_refused_in_a_sentence() -> None:
    with pytest.raises(SystemExit, match="git knows no commit 'no-such'; name one, as in `make compare REV=main`"):
        compare.built("no-such")
