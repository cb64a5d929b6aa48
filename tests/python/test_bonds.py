"""How bonds are asked for, what they hold, and what reduced models know of them."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.python.test_scene import ELEMENTS, SIDE, SOFT
from tests.python.test_scene import block as raised
from tests.python.test_supports import block
from tests.python.test_thin_contact import sheet

import viscera as vs
from viscera.boundary.elastic_support import LINEAR
from viscera.boundary.ties import Ties, rows

TISSUE = vs.NeoHookean(young=10e3, poisson=0.3)


@pytest.mark.parametrize("reach", [0, -0.01, "-1 mm", "0%", float("nan"), True])
def test_the_reach_of_a_bond_is_a_length_above_0(reach: Any) -> None:
    with pytest.raises(vs.VisceraError, match=r"^the reach of a bond must be a number above 0 and at most 1000 \[m\]"):
        vs.Bond("lower", "upper", reach=reach)
    with pytest.raises(vs.VisceraError, match="the reach of a bond 'far' is not a length"):
        vs.Bond("lower", "upper", reach="far")


def test_surfaces_are_joined_once() -> None:
    """Twice, each joint tells a part of the force. Springs may lie side by side, and other places may be joined too."""
    organs = bonded().organs
    first, back = vs.Bond("lower", ("upper", "bottom")), vs.Bond("upper/bottom", "lower", sliding=True)
    pair = vs.ContactPair(("upper", "bottom"), "lower")
    with pytest.raises(vs.VisceraError, match=r"^Bond\(lower, .*\) and Bond\(upper .*same surfaces.*; name them once$"):
        vs.Scene(organs, bonds=[first, back])
    with pytest.raises(
        vs.VisceraError, match=r"^Bond\(lower, .*\) and ContactPair\(upper .*; leave the contact pair out"
    ):
        vs.Scene(organs, bonds=[first], contacts=[pair])
    springs = [vs.Spring("lower/top", "upper/bottom", stiffness=1.0) for _ in range(2)]
    scene = vs.Scene(organs, bonds=[vs.Bond("lower/x < 51%", "upper"), vs.Bond("lower/x > 49%", "upper"), *springs])
    again = scene.with_mesh(scene.mesh).with_law(TISSUE)
    assert len(again.bonds) == 4


def test_a_chain_of_bonds_must_be_held_somewhere() -> None:
    """Bonds join what they hold; a scene that slides as a whole is refused."""
    soft = [vs.ElasticSupport("west", 1e3, 0.0)]
    lower, upper = vs.Organ(raised(2), SOFT, supports=soft), vs.Organ(raised(3, SIDE), SOFT, supports=soft)
    scene = vs.Scene({"lower": lower, "upper": upper}, bonds=[vs.Bond("lower", "upper")])
    with pytest.raises(vs.VisceraError, match="3 of its 6 rigid motions are free"):
        scene.solve(force={"upper/top": (0.1, 0.0, 0.0)})


@pytest.mark.parametrize("element", ELEMENTS)
def test_bonds_alone_hold_an_organ(element: str) -> None:
    """As they do where a support too weak to be felt holds it too: in statics and in frames."""
    lower = vs.Organ(raised(2), SOFT, fixed="base", element=element)
    free = vs.Organ(raised(3, SIDE), SOFT, element=element)
    weak = vs.Organ(free.mesh.linear(), SOFT, supports=[vs.ElasticSupport("top", 1e-3)], element=element)
    load = {"upper/top": (0.2, 0.0, -0.5)}
    held, bonded = (
        vs.Scene({"lower": lower, "upper": upper}, bonds=[vs.Bond("lower", "upper")]) for upper in (weak, free)
    )
    expected = held.solve(force=load, throw=True).displacement
    assert abs(bonded.solve(force=load, throw=True).displacement - expected).max() < 1e-7
    frame = bonded.stepper(iterations=20, settled=1e-9).frame(force=load)
    assert frame.is_settled
    assert abs(frame.displacement - expected).max() < 1e-7


def test_an_organ_that_its_bonds_do_not_hold_is_named() -> None:
    """A sliding bond leaves it three motions, and without a bond it has all six."""
    organs = {"lower": vs.Organ(raised(2), SOFT, fixed="base"), "upper": vs.Organ(raised(3, SIDE), SOFT)}
    slides = vs.Scene(organs, bonds=[vs.Bond("lower", "upper", sliding=True)])
    with pytest.raises(vs.VisceraError, match=r"the part with node \d+ of 'upper' .* \(3 of its 6 rigid motions"):
        slides.solve()
    with pytest.raises(vs.VisceraError, match=r"1 of the mesh's 2 disconnected parts .* \(node 0 of 'upper' among"):
        vs.Scene(organs).stepper()


def bonded(element: str = "P1", **told: Any) -> vs.Scene:
    """A cube on another, turned about the vertical: soft below, of another law above."""
    lower, turn = block(2), np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    middle = np.array([0.05, 0.05, 0.0])
    points = (block(3).points - middle) @ turn.T + middle + np.array([0.0, 0.0, 0.1])
    upper = vs.mesh(points, block(3).cells, {"top": points[:, 2] > 0.199, "bottom": points[:, 2] < 0.101})
    organs = {
        "lower": vs.Organ(lower, TISSUE, fixed="base", element=element),
        "upper": vs.Organ(upper, vs.Yeoh(c10=4e3, poisson=0.3), element=element),
    }
    return vs.Scene(organs, bonds=[vs.Bond(("lower", "top"), ("upper", "bottom"), **told)])


@pytest.mark.parametrize("element", ["P1", "P2"])
@pytest.mark.parametrize("told", [{}, {"sliding": True}])
def test_an_answer_tells_the_force_of_a_bond(element: str, told: dict[str, Any], tmp_path: Path) -> None:
    """Also in a posture, whose shape at rest is computed back: rounding cuts the pieces of the bond otherwise."""
    weak = vs.ElasticSupport("top", 1e3)
    scene = bonded(element, **told)
    upper = vs.Organ(scene.organ("upper").mesh.linear(), scene.organ("upper").law, supports=[weak], element=element)
    scene = vs.Scene({**scene.organs, "upper": upper}, bonds=scene.bonds)
    (bond,) = scene.bonds
    hanging = scene.solve(gravity=(0, 0.3, -1.0), density=1000.0, throw=True)
    for start in (None, hanging):
        touch = scene.reduce("upper/top", radius=0.06, depth=0.002, order=2, start=start)
        touch.save(tmp_path / "two.viscera")
        for model in (touch, vs.load(tmp_path / "two.viscera")):
            answer = model((0.05, 0.05, 0.2), (0.001, 0.0, -0.0005))
            before = 0.0 if model.preload is None else model.preload
            moved = before + answer.displacement
            expected = scene.moved(moved).support_force(bond)
            (samples,) = answer._its_ties(bond)
            assert samples.force(moved) == pytest.approx(expected, rel=1e-9, abs=1e-9)
            assert np.linalg.norm(answer.support_force(bond) - expected) < 0.02 * np.linalg.norm(expected)


def test_a_bond_that_a_model_does_not_keep_is_refused() -> None:
    scene = bonded()
    answer = scene.reduce("upper/top", radius=0.06, depth=0.002, order=2)((0.05, 0.05, 0.2), (0.0, 0.0, -0.0005))
    (bond,) = scene.bonds
    assert isinstance(bond, vs.Bond)
    sides: Any = bond.sides
    for other in (vs.Bond(*sides, stiffness=50.0), vs.Bond(*sides, sliding=True), vs.Bond("lower", "middle")):
        with pytest.raises(vs.VisceraError, match=r"is not found among the supports of this model.* bonds too"):
            answer.support_force(other)
    alone = vs.Organ(block(2), TISSUE, fixed="base").reduce("top", radius=0.06, depth=0.002, order=2)
    with pytest.raises(vs.VisceraError, match="is no elastic support of this organ"):
        alone((0.05, 0.05, 0.1), (0.0, 0.0, -0.0005)).support_force(scene.bonds[0])


@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
def test_an_answer_tells_one_organ_as_a_state_does(element: str, tmp_path: Path) -> None:
    """With its law, its supports, its sets and those of its cells, also about a posture."""
    core = block(2).with_cell_sets(core="x < 50%")
    above = vs.mesh(block(3).points + np.array([0.0, 0.0, 0.1]), block(3).cells, block(3).sets)
    west = [vs.ElasticSupport("west", 1e5) for _ in range(2)]  # alike, of which a model knows only where they are
    organs = {
        "lower": vs.Organ(core, TISSUE, fixed="base", supports=west[:1], element=element),
        "upper": vs.Organ(above, vs.Yeoh(c10=4e3, poisson=0.3), supports=west[1:], element=element),
    }
    scene = vs.Scene(organs, bonds=[vs.Bond("lower", "upper")])
    hanging = scene.solve(gravity=(0, 0.3, -1.0), density=1000.0, throw=True)
    touch = scene.reduce("upper/top", radius=0.06, depth=0.002, order=2, start=hanging)
    touch.save(tmp_path / "two.viscera")
    for model in (touch, vs.load(tmp_path / "two.viscera")):
        answer = model((0.05, 0.05, 0.2), (0.001, 0.0, -0.0005))
        assert model.preload is not None
        expected = scene.moved(model.preload + answer.displacement)
        for (name, organ), support in zip(organs.items(), west, strict=True):
            part, whole = answer[name], expected[name]
            assert np.abs(part.displacement - whole.displacement).max() < 1e-15
            assert np.abs(part.von_mises() - whole.von_mises()).max() < 1e-9 * whole.von_mises().max()
            assert part.support_force(support) == pytest.approx(whole.support_force(support), rel=1e-9)
            assert np.array_equal(part.organ.fixed, organ.fixed)
            assert part.organ.mesh.sets.keys() == organ.mesh.sets.keys()
            assert part.organ.mesh.cell_sets.keys() == organ.mesh.cell_sets.keys()
    assert np.array_equal(answer["lower"].organ.mesh.cells_in("core"), organs["lower"].mesh.cells_in("core"))
    with pytest.raises(vs.VisceraError, match="no organ of the scene is called 'uper'; did you mean 'upper'"):
        answer["uper"]
    with pytest.raises(vs.VisceraError, match=r"2 organs .* `answer\['NAME'\]\.support_force"):
        answer.support_force(west[0])


def test_a_part_has_no_more_stress_than_the_whole() -> None:
    """A frame of tissue that relaxes does not hold the past; an answer warns where its stress is not balanced."""
    scene = bonded()
    stepper = scene.stepper(relaxation=vs.Prony(g=[0.5], tau=[1.0]), time_step=0.1, iterations=5)
    with pytest.raises(vs.VisceraError, match="depends on its past, which a frame does not hold"):
        stepper.frame(force={"upper/top": (0, 0, -0.1)})["upper"].stress()
    answer = scene.reduce("upper/top", radius=0.06, depth=0.002, order=2)((0.05, 0.05, 0.2), (0.0, 0.0, -0.0005))
    answer.stress_error_estimate = 0.5
    with pytest.warns(UserWarning, match="the stress of this answer is not balanced"):
        answer["upper"].stress()


def cut(fan: list[int], stiffness: float = 1.0) -> Ties:
    """Samples of a bond on the common quadrilateral of two faces, cut into two triangles from one of its corners."""
    square = np.array([[0.1, 0.1], [0.5, 0.1], [0.4, 0.5], [0.1, 0.4]])
    nodes, weights, stiff = [], [], []
    for triangle in (square[fan[:3]], square[[fan[0], *fan[2:]]]):
        inside = LINEAR[0] @ triangle
        first = np.column_stack([1.0 - inside.sum(axis=1), inside])
        nodes += [[0, 1, 2, 3, 4, 5]] * 3
        weights += np.hstack([first, -first[:, [2, 0, 1]]]).tolist()
        area = np.linalg.det(triangle[1:] - triangle[0])
        stiff += [stiffness * area / 3.0 * np.diag([1.0, 2.0, 3.0])] * 3
    return rows(np.array(nodes), np.array(weights), np.array(stiff))


def test_samples_of_a_bond_are_the_same_however_their_piece_is_cut() -> None:
    one, other = cut([0, 1, 2, 3]), cut([1, 2, 3, 0])
    assert one.holds(other)
    displacement = np.random.default_rng(0).normal(size=(6, 3))
    assert one.force(displacement) == pytest.approx(other.force(displacement), rel=1e-12)
    assert not one.holds(cut([1, 2, 3, 0], stiffness=1.0 + 1e-6))


@pytest.mark.parametrize(("degrees", "is_told"), [(0, False), (10, False), (40, True)])
def test_a_sliding_bond_whose_surfaces_have_turned_says_so(degrees: int, is_told: bool) -> None:
    """Sheets that are turned as a whole about the x axis: the bond keeps the normals of rest."""
    organs = {
        "lower": vs.Organ(sheet(0.05), TISSUE),
        "upper": vs.Organ(sheet(0.05, 0.05), TISSUE, supports=[vs.ElasticSupport("x > -1%", 1e3)]),
    }
    for sliding in (True, False):
        scene = vs.Scene(organs, bonds=[vs.Bond("lower", "upper", sliding=sliding)])
        (c, s), points = (np.cos(np.radians(degrees)), np.sin(np.radians(degrees))), scene.mesh.points
        turned = points @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]]) - points
        held = {(int(node),): tuple(turned[node]) for node in scene.place("lower", "z < 1%")}
        state = scene.solve(displacement=held, start=turned, throw=True)
        told = f"have turned, those of Bond(lower, upper, sliding) by {degrees} degrees"
        assert (told in state.message) == (is_told and sliding)
        stepper = scene.stepper(held, start=state, iterations=20)
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            stepper.frame(held)
            stepper.frame(held)
        assert [told in str(each.message) for each in warned] == [True] * (is_told and sliding), "once"
