"""Long studies of benchmarks/ in small, with seeds of their own: what they find in full must hold here too."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import viscera as vs
from viscera.reduced.check import allowed_error

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def study(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    """A script of benchmarks/, by name."""
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module


@pytest.fixture(scope="module")
def beam() -> vs.Touch:
    """The upper side of the beam's free end, to 15 % of the diagonal."""
    organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.4), fixed="clamp", element="P1")
    return organ.reduce("x > 70% and z > 99%", depth="15%", order=4, tolerance=0.01)


@pytest.mark.parametrize("name", ["as it is", "NeoHookean", "MooneyRivlin", "Yeoh"])
def test_every_touch_of_the_bar_is_answered_by_the_full_organ(study: Callable[[str], ModuleType], name: str) -> None:
    """benchmarks/touches.py: all 312 of the bar's in the full study."""
    touches = study("touches")
    case = next(case for case in touches.bodies() if case.body == "bar")
    if name != "as it is":
        law = next(law for law in touches.laws() if type(law).__name__ == name)
        case = replace(case, law=law, element="P1")
    rows = touches.push(case, 2, 4077)
    assert len(rows) == 2 * len(touches.DEPTHS)
    assert [row.status for row in rows] == ["converged"] * len(rows)
    assert not any(row.is_missed or row.is_crushed for row in rows)
    assert touches.mean_iterations(rows) < 8.0  # 4.5 in the full study


def test_trusted_answers_of_the_series_are_near_the_full_organ(
    study: Callable[[str], ModuleType], beam: vs.Touch
) -> None:
    """benchmarks/depth.py: a twentieth of its touches, on another body."""
    depth = study("depth")
    polynomial = depth.load_bytes(depth.without(beam._model.to_bytes(), "sketch"))
    comparison = depth.Comparison({"polynomial": polynomial, "Padé": beam}, 2, seed=4077)
    rows = [row for k in range(2) for row in comparison.rows(k)]
    assert [share for share, *_ in rows] == 2 * list(depth.DEPTHS)
    trusted = [(share, max(answer[:2])) for share, _, answers in rows for answer in answers if answer[3]]
    assert len(trusted) >= 4
    assert all(error <= allowed_error(share) for share, error in trusted)


def test_a_finger_that_takes_hold_goes_deeper_than_the_series(
    study: Callable[[str], ModuleType], beam: vs.Touch
) -> None:
    """benchmarks/deep.py: a twentieth of its touches, on another body."""
    deep = study("deep")
    comparison = deep.Comparison(beam, 48, 10, seed=4077)
    rows = [row for k in range(10) for row in comparison.rows(k)]
    assert len(rows) == 10 * len(deep.DEPTHS)
    assert not any(other.is_trusted for other in comparison.others)
    assert len(comparison.holds) == 10
    assert len(comparison.ticks) == 10 * deep.STEPS
    deepest = [errors for share, _, errors in rows if share == max(deep.DEPTHS)]
    of_series, of_galerkin, retrained = (
        np.median([max(e[:2]) for e in column]) for column in zip(*deepest, strict=True)
    )
    assert of_galerkin < of_series
    assert retrained <= of_galerkin


def test_trusted_answers_to_two_fingers_are_near_the_full_organ(
    study: Callable[[str], ModuleType], beam: vs.Touch
) -> None:
    """benchmarks/fingers.py: two of its 24 pairs, on another body."""
    fingers = study("fingers")
    cases = fingers.solved(beam, fingers.pairs(beam, 2, seed=4077), fingers.PAIR_DEPTHS)
    taught = beam.galerkin(snapshots=fingers.SNAPSHOTS)
    found, ratios = fingers.scores(beam, [taught.grasp(case.points) for case in cases], cases)
    trusted = [score for score in found if "trusted" in score.kind]
    assert len(found) - len(trusted) == 4
    assert len(trusted) == len(ratios) >= 2
    assert all(max(score.field, score.force) <= allowed_error(score.depth) for score in trusted)


def test_registration_finds_an_organ_better_than_a_rigid_motion(
    study: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    """benchmarks/registration.py: one truth of another seed, on coarser cells; a lobe has been mobilised."""
    registration = study("registration")
    organ = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=6e3, poisson=0.45), fixed="hilum")
    truth = registration.truth(43, registration.fine_liver(1.2), tmp_path)
    found = registration.score(organ, truth, 43, *registration.TYPICAL)
    assert found["error"] < 0.5 * found["rigid"]
    assert found["error"] < found["spline"]
    assert found["in_band"] > 0.8 * found["observed"] > 0.4 * found["targets"]


def test_the_smallest_body_of_the_off_line_study_is_reduced(study: Callable[[str], ModuleType]) -> None:
    """benchmarks/offline.py: its first row."""
    row = study("offline").measure(5, 1e9)
    assert (row["nodes"], row["cells"], row["positions"]) == (216, 750, 36)
    assert row["seconds"] > 0.0
    assert row["coarse"] < row["file"]
