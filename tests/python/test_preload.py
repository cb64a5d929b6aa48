"""Touches of a loaded organ: a bar that hangs in gravity, reduced about that equilibrium."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.cases.case import read_case

GRAVITY: dict[str, Any] = {"gravity": (0, 0, -9.81), "density": 1000}
TOP: dict[str, Any] = {"touchable": lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.16), "radius": 0.07, "order": 3}


def organ_of(bar: vs.Mesh, **options: Any) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=5e4, poisson=0.3), fixed="root", **options)


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return organ_of(bar)


@pytest.fixture(scope="module")
def loaded(organ: vs.Organ) -> vs.State:
    state = organ.solve(**GRAVITY, throw=True)
    assert state.max_displacement > 0.1 * organ.mesh.diagonal, "gravity bends it visibly"
    return state


@pytest.fixture(scope="module")
def touch(organ: vs.Organ, loaded: vs.State) -> vs.Touch:
    return organ.reduce(**TOP, depth=0.02, start=loaded)


def test_touches_of_the_loaded_organ_pass_the_check(touch: vs.Touch) -> None:
    result = touch.check(touches=6, depths=["0.5%", "2%", "3.5%"])
    assert result.is_passed
    assert result.overall.converged == 18
    assert result.depths[0].trusted == 6
    assert (result.depths[0].worst["displacement_error"] or 1.0) < 0.005


def test_an_answer_is_what_the_touch_adds_to_the_load(touch: vs.Touch, organ: vs.Organ, loaded: vs.State) -> None:
    point = loaded.displacement[80] + organ.mesh.points[80]
    push, patch = np.array([1e-4, 2e-4, -3e-4]), touch.patch(point)
    mean = patch.weights @ loaded.displacement[patch.nodes]
    full = organ.solve(displacement={patch: mean + push}, **GRAVITY, start=loaded)
    answer = touch(point, push)
    assert answer.contact_point == pytest.approx(point, abs=1e-12)
    assert answer.force == pytest.approx(full.reaction(patch), rel=1e-3, abs=1e-3 * np.linalg.norm(answer.force))
    added = full.displacement - loaded.displacement
    assert np.linalg.norm(answer.displacement - added) < 2e-3 * np.linalg.norm(added)


def test_the_load_matters(touch: vs.Touch, organ: vs.Organ) -> None:
    unloaded = organ.reduce(**TOP, depth=0.02)
    points = (model.mesh.points[80] for model in (touch, unloaded))
    under, free = (model(point, (0, 0, -0.01)).force for model, point in zip((touch, unloaded), points, strict=True))
    assert np.linalg.norm(under - free) > 0.1 * np.linalg.norm(free)


def test_the_file_holds_the_loaded_shape_and_the_way_back(touch: vs.Touch, organ: vs.Organ, tmp_path: Path) -> None:
    touch.save(tmp_path / "bar.viscera")
    again = vs.load(tmp_path / "bar.viscera")
    assert again.preload is not None
    assert again.mesh.points == pytest.approx(organ.mesh.points + again.preload, abs=1e-15)
    assert again.organ().mesh.points == pytest.approx(organ.mesh.points, abs=1e-15)
    assert again.organ().law.parameters == pytest.approx(organ.law.parameters)


def test_a_quadratic_organ_is_touched_where_its_midpoints_are(bar: vs.Mesh) -> None:
    organ = organ_of(bar, element="P2")
    state = organ.solve(**GRAVITY)
    touch = organ.reduce(lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.32), radius=0.07, depth=0.02, order=2, start=state)
    assert touch.mesh.points == pytest.approx(organ.mesh.points + state.displacement, abs=1e-15)
    assert touch.organ().mesh.points == pytest.approx(organ.mesh.points, abs=1e-15)
    result = touch.check(touches=2, depths=["0.2%"])
    assert result.is_passed
    assert result.overall.trusted == 2


def test_states_that_cannot_be_reduced_about(organ: vs.Organ, bar: vs.Mesh, cube: vs.Mesh, loaded: vs.State) -> None:
    stiffer = organ.with_law(vs.NeoHookean(young=6e4, poisson=0.3))
    other = vs.Organ(cube, vs.NeoHookean(young=1e5, poisson=0.3), fixed="bottom")
    end = lambda x: x[:, 0] > 0.39  # noqa: E731
    states = {
        "belongs to another mesh: it has 27 points, this one 81": other.solve(),
        "belongs to another organ: nodal forces differ by": stiffer.solve(**GRAVITY),
        "is under pressure, which turns with the surface": organ.solve(pressure={"tip": 100.0}),
        "is held at 9 points besides the fixed ones, such as point": organ.solve(displacement={end: (0, 0, -0.02)}),
        "is not an equilibrium: stopped at load": organ.solve(
            force={"tip": (0, 0, -2000.0)}, settings={"max_iterations": 1, "smallest_step": 0.9}
        ),
    }
    for words, state in states.items():
        with pytest.raises(vs.VisceraError, match=words):
            organ.reduce(**TOP, depth=0.02, start=state)


CASE = """
mesh = "organ:beam"
fixed = "clamp"
[material]
law = "NeoHookean"
young = 2e6
poisson = 0.3
[loads]
gravity = [0, 0, -9.81]
density = 1000
[reduce]
touchable = "x > 90% and z > 99%"
depth = "2%"
order = 2
"""


def touch_of(path: Path, words: str) -> vs.Touch:
    path.write_text(words, encoding="utf-8")
    case = read_case(path)
    return case.reduce(case.organ())


def test_a_case_says_what_its_touches_start_from(tmp_path: Path) -> None:
    path, beam = tmp_path / "beam.toml", vs.organs.beam()
    hanging = touch_of(path, CASE + 'start = "loads"\n')
    assert hanging.preload is not None
    assert hanging.preload[:, 2].min() < -0.03
    assert touch_of(path, CASE).preload is None
    scan = "[scan]\ngravity = [0, 0, -9.81]\n"
    scanned = touch_of(path, CASE + 'start = "scan"\n' + scan)
    assert scanned.mesh.points == pytest.approx(beam.points, abs=1e-8), "the scan is the shape that is touched"
    assert np.abs(scanned.rest.points - beam.points).max() > 0.03
    for start, words in (
        ("", "must say what is touched"),
        ('start = "laods"\n', "did you mean 'loads'"),
    ):
        with pytest.raises(vs.VisceraError, match=words):
            touch_of(path, CASE + start + scan)
    with pytest.raises(vs.VisceraError, match=r"needs the loads of the scan"):
        touch_of(path, CASE + 'start = "scan"\n')
