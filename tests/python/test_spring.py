"""Springs and cables between places: closed forms, solvers, frames, scenes, and refusals."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs

SOFT = vs.NeoHookean(young=1e5, poisson=0.3)
STIFF = vs.Linear(young=1e12, poisson=0.3)


def beam(*springs: vs.Spring, law: vs.laws.Law = SOFT, element: str = "P1") -> vs.Organ:
    return vs.Organ(vs.organs.beam(), law, fixed="clamp", supports=list(springs), element=element)


def test_a_stiff_beam_on_guides_hangs_on_its_spring() -> None:
    """It moves along z alone, held by one spring: F / k, and farther by what the spring pulls already at rest."""
    mesh = vs.organs.beam()
    middle = mesh.points[mesh.nodes("top")].mean(axis=0)
    for length, sunk in ((None, 0.02), (0.9, 0.02 - 0.1)):
        spring = vs.Spring("top", point=middle + np.array([0, 0, 1.0]), stiffness=50.0, length=length)
        organ = vs.Organ(mesh, STIFF, supports=[spring])
        guides = {"y < 1%": (0, 0, None), "y > 99%": (0, 0, None)}
        state = organ.solve(force={"top": (0.0, 0.0, -1.0)}, displacement=guides)
        assert state.is_converged
        assert state.displacement[:, 2] == pytest.approx(-sunk, rel=1e-4)
        assert state.support_force(spring) == pytest.approx([0.0, 0.0, 1.0], abs=1e-4)


MATRIX_FREE = vs.ConjugateGradients("block_jacobi", 1e-3, 2000, matrix_free=True)


@pytest.mark.parametrize(
    ("solver", "element"),
    # Without a matrix a bending beam of quadratic cells takes long, and a spring is added to it as to linear ones.
    [("cholesky", "P1"), ("cholesky", "P2"), ("cg", "P1"), ("cg", "P2"), (MATRIX_FREE, "P1")],
    ids=str,
)
def test_a_spring_across_a_bending_beam_balances_it(element: str, solver: vs.ConjugateGradients | str) -> None:
    spring = vs.Spring("tip", point=(1.0, 0.6, 0.4), stiffness=30.0)
    organ, load = beam(spring, element=element), {"tip": (0.0, 0.0, -8.0)}
    state = organ.solve(force=load, solver=solver)
    assert state.is_converged, state.message
    pull = state.support_force(spring)
    assert state.reaction("clamp") == pytest.approx(-pull + np.array([0.0, 0.0, 8.0]), abs=1e-5)
    (link,) = spring.ties(organ.mesh).links
    between = link.rest + link.offset(state.displacement)
    now = np.linalg.norm(between)
    assert pull == pytest.approx(-30.0 * (now - link.length) * between / now)
    assert np.linalg.norm(pull) > 1.0
    stepper = organ.stepper(iterations=40, settled=1e-6, solver=solver)
    for _ in range(4):
        frame = stepper.frame(force=load)
    assert frame.is_settled
    assert abs(frame.displacement - state.displacement).max() < 1e-4 * state.max_displacement


def test_a_cable_bears_no_compression() -> None:
    load = {"tip": (0.0, 0.0, -8.0)}
    free = beam().solve(force=load)
    below = vs.Spring("tip", point=(1.0, 0.1, -0.5), stiffness=100.0, cable=True)
    above = vs.Spring("tip", point=(1.0, 0.1, 0.7), stiffness=100.0, cable=True)
    slack, taut = beam(below).solve(force=load), beam(above).solve(force=load)
    assert abs(slack.displacement - free.displacement).max() < 1e-9
    assert slack.support_force(below) == pytest.approx([0.0, 0.0, 0.0])
    assert taut.max_displacement < 0.6 * free.max_displacement
    long = vs.Spring("tip", point=(1.0, 0.1, 0.7), stiffness=100.0, length=2.0, cable=True)
    assert abs(beam(long).solve(force=load).displacement - free.displacement).max() < 1e-9


def test_a_percentage_of_a_spring_is_of_the_diagonal_of_the_mesh(tmp_path: Path) -> None:
    """It pulls as at that length in metres; a case file has it in metres, and on a longer beam it is longer."""
    mesh = vs.organs.beam()
    ends: dict[str, Any] = {"point": (1.0, 0.1, 0.6), "stiffness": 100.0}
    share, metres = vs.Spring("tip", **ends, length="10%"), vs.Spring("tip", **ends, length=0.1 * mesh.diagonal)
    forces = [beam(spring).solve().support_force(spring) for spring in (share, metres)]
    assert forces[0] == pytest.approx(forces[1])
    assert forces[0][2] > 10.0
    longer = vs.mesh(2.0 * mesh.points, mesh.cells, mesh.sets)
    assert share.on(mesh).ties(longer).links[0].length == pytest.approx(0.1 * mesh.diagonal)
    assert share.ties(longer).links[0].length == pytest.approx(0.2 * mesh.diagonal)
    bond = vs.Spring("beam/tip", **ends, length="10%")
    case = vs.Scene({"beam": beam()}, bonds=[bond]).to_case(tmp_path / "sprung.toml")
    assert case.springs[0]["length"] == pytest.approx(0.1 * mesh.diagonal)


def test_a_tightened_spring_acts_by_itself() -> None:
    ends: dict[str, Any] = {"point": (1.0, 0.1, 0.6), "stiffness": 100.0}
    tight, slack = vs.Spring("tip", **ends, length=0.3), vs.Spring("tip", **ends, length=2.0, cable=True)
    for spring, words in ((tight, "converged in"), (slack, "nothing acts"), (vs.Spring("tip", **ends), "nothing acts")):
        assert beam(spring).solve().message.startswith(words)


def test_a_spring_between_organs_of_a_scene() -> None:
    other = vs.organs.beam()
    lifted = vs.mesh(other.points + np.array([0.0, 0.0, 0.5]), other.cells, other.sets)
    spring = vs.Spring("lower/tip", "upper/tip", stiffness=40.0)
    organs = {"lower": beam(), "upper": vs.Organ(lifted, SOFT, fixed="clamp")}
    scene = vs.Scene(organs, bonds=[spring])
    state = scene.solve(force={"lower/tip": (0.0, 0.0, -8.0)})
    pull = state.support_force(spring)
    assert pull[2] > 1.0
    assert state.reaction("upper/clamp") == pytest.approx(pull, abs=1e-5)
    assert state.reaction("lower/clamp") == pytest.approx(-pull + np.array([0.0, 0.0, 8.0]), abs=1e-5)


def test_a_spring_without_a_direction_is_refused(bar: vs.Mesh) -> None:
    centre = bar.points[bar.sets["tip"]].mean(axis=0)
    for length in (0.1, "1%"):
        with pytest.raises(vs.VisceraError, match="has no direction; move an end, or give length=0"):
            vs.Organ(bar, SOFT, fixed="root", supports=[vs.Spring("tip", point=centre, stiffness=9.0, length=length)])
    for told in ({"length": 0}, {}, {"length": 0.1, "cable": True}):
        held = vs.Organ(bar, SOFT, fixed="root", supports=[vs.Spring("tip", point=centre, stiffness=9.0, **told)])
        assert held.solve(force={"tip": (0, 0, 1e-3)}).is_converged


def test_series_refuse_springs() -> None:
    organ = beam(vs.Spring("tip", "top", stiffness=1.0))
    for series in (
        lambda: organ.path(force={"tip": (0, 0, -1.0)}),
        lambda: organ.reduce("tip"),
        lambda: organ.pgd("tip", load=1.0),
    ):
        with pytest.raises(vs.VisceraError, match="a series does not know springs and cables"):
            series()
    with pytest.raises(vs.VisceraError, match="a case file has no word for springs"):
        organ.to_case("sprung.toml")


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"stiffness": 1.0}, "give one of `second` and `point`"),
        ({"stiffness": 1.0, "second": "clamp", "point": (0, 0, 1)}, "give one of `second` and `point`"),
        ({"stiffness": -1.0, "second": "clamp"}, "the stiffness of a spring must be a number above 0"),
        ({"stiffness": 1.0, "point": (0, 0, np.nan)}, "the point of a spring must be"),
        ({"stiffness": 1.0, "second": "clamp", "length": -0.1}, "must not be negative"),
        ({"stiffness": 1.0, "second": "clamp", "length": "-10%"}, "length of a spring is '-10%'; it must not be"),
        ({"stiffness": 1.0, "second": "clamp", "length": "long"}, "the length of a spring 'long' is not a length"),
        ({"stiffness": 1.0, "second": "clamp", "cable": 1}, "cable must be true or false"),
    ],
)
def test_wrong_springs_are_refused(told: dict[str, object], said: str) -> None:
    with pytest.raises(vs.VisceraError, match=said):
        vs.Spring("tip", **told)  # type: ignore[arg-type]
