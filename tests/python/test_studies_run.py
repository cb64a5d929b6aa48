"""Long studies of benchmarks/ in small, with seeds of their own: what they find in full must hold here too."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def touches(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("touches")


@pytest.mark.parametrize("name", ["as it is", "NeoHookean", "MooneyRivlin", "Yeoh"])
def test_every_touch_of_the_bar_is_answered_by_the_full_organ(touches: ModuleType, name: str) -> None:
    """benchmarks/touches.py: all 312 of the bar's in the full study."""
    case = next(case for case in touches.bodies() if case.body == "bar")
    if name != "as it is":
        law = next(law for law in touches.laws() if type(law).__name__ == name)
        case = replace(case, law=law, element="P1")
    rows = touches.push(case, 2, 4077)
    assert len(rows) == 2 * len(touches.DEPTHS)
    assert [row.status for row in rows] == ["converged"] * len(rows)
    assert not any(row.is_missed or row.is_crushed for row in rows)
    assert touches.mean_iterations(rows) < 8.0  # 4.5 in the full study
