"""What supports and bonds carry under a touch, by a reduced model and by full solutions."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from tests.python.test_supports import block

import viscera as vs

TISSUE = vs.NeoHookean(young=10e3, poisson=0.3)
PUSH = (1e-3, 0.0, -2e-3)
SMALL: dict[str, Any] = {"radius": 0.04, "depth": 0.004, "order": 3}


def touched(organ: vs.Organ, place: Any = "top", **told: Any) -> tuple[vs.reduced.answer.Answer, vs.State]:
    """The answer of a model in the middle of a place, and the full solution under the same touch."""
    touch = organ.reduce(place, **SMALL, **told)
    at = organ.mesh.points[organ.mesh.nodes(place)].mean(axis=0)
    return touch(at, PUSH), organ.solve(displacement={touch.patch(at): PUSH}, throw=True)


@pytest.mark.parametrize("stiffness", [1e4, 1e8, 1e12])
@pytest.mark.parametrize("element", ["P1", "P2"])
def test_what_alone_holds_an_organ_carries_the_touch(stiffness: float, element: str) -> None:
    """The field says nothing of a spring that hardly yields."""
    base = vs.ElasticSupport("base", stiffness)
    answer, full = touched(vs.Organ(block(2), TISSUE, supports=[base], element=element))
    assert abs(answer.support_force(base) + answer.force).max() < 1e-9 * abs(answer.force).max()
    assert answer.support_force(base) == pytest.approx(full.support_force(base), rel=1e-3, abs=1e-4)


@pytest.mark.parametrize("stiffness", [1e5, 1e9])
def test_what_holds_an_organ_beside_others_is_told_by_what_it_holds(stiffness: float) -> None:
    side = vs.ElasticSupport("x > 99%", stiffness)
    organ = vs.Organ(block(3), TISSUE, fixed="base and x < 50%", supports=[side])
    answer, full = touched(organ, "top and x < 70%")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        told = answer.support_force(side)
    expected = full.support_force(side)
    assert np.linalg.norm(told - expected) < 0.03 * np.linalg.norm(expected)


def test_a_bond_between_held_organs_is_told_by_its_free_side() -> None:
    """Its first organ is fixed where the bond is; on the second an elastic support is in its way at an edge alone."""
    points = block(3).points + np.array([0.0, 0.0, 0.1])
    above = vs.mesh(points, block(3).cells, block(3).sets)
    bond, held = vs.Bond("lower", "upper"), vs.ElasticSupport("x > 99%", 1e5)
    organs = {"lower": vs.Organ(block(2), TISSUE, fixed="base"), "upper": vs.Organ(above, TISSUE, supports=[held])}
    scene = vs.Scene(organs, bonds=[bond])
    answer, full = touched(scene, scene.place("upper", "top and x < 70%"))
    for each in (bond, held):
        told, expected = answer.support_force(each), full.support_force(each)
        assert np.linalg.norm(told - expected) < 0.03 * np.linalg.norm(expected), each


def test_a_force_that_neither_tells_is_warned_of() -> None:
    """The stiff support holds nodes that are fixed."""
    organ = vs.Organ(block(2), TISSUE, fixed="base and x < 60%", supports=[side := vs.ElasticSupport("base", 1e12)])
    answer, _ = touched(organ)
    with pytest.warns(UserWarning, match=r"force of ElasticSupport.* is larger than the force: fixed nodes or other"):
        answer.support_force(side)


def test_a_support_carries_the_preload_too() -> None:
    base = vs.ElasticSupport("base", 1e9)
    organ = vs.Organ(block(2), TISSUE, supports=[base])
    hanging = organ.solve(gravity=(0, 0, -9.81), density=100.0)
    answer, _ = touched(organ, start=hanging)
    expected = hanging.support_force(base) - answer.force
    assert answer.support_force(base) == pytest.approx(expected, rel=1e-6, abs=1e-6)
