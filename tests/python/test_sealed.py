"""What results give out is read-only, and reading it again tells the same."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import viscera as vs

LAW = vs.NeoHookean(young=1e5, poisson=0.3)
DOWN = (0, 0, -1.0)


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, LAW, "root")


@pytest.fixture(scope="module")
def touch(organ: vs.Organ) -> vs.Touch:
    return organ.reduce("tip", depth="2%", order=2)


def touched(organ: vs.Organ) -> tuple[vs.State, vs.Tool]:
    tool = vs.Tool(vs.Sphere(0.03), position=(0.35, 0.05, 0.13))
    return organ.solve(contact=[tool]), tool


def of_state(organ: vs.Organ) -> Iterator[Any]:
    state, tool = touched(organ)
    yield from (state.displacement, state.internal_force, state.external_force, state.force(tool), state.torque(tool))
    yield from (state.contact(tool).pressures, state.stress("pk1", "points"), state.energy_density("points"))
    values = state.at([[0.2, 0.05, 0.05]])
    yield from (values.displacement, values.places, values.cells)
    yield organ.mesh.facts["cell_volumes"]


def of_frame(organ: vs.Organ) -> Iterator[Any]:
    stepper = organ.stepper(iterations=10)
    hand, patch = stepper.grasp("tip"), stepper.grasp(organ.patch((0.2, 0.05, 0.1), "5 cm"))
    forceps = stepper.forceps(vs.Sphere(0.02), (0.2, 0.05, 0.05), (0, 0, np.pi / 2), opening=0.12)
    tool = stepper.tool(vs.Sphere(0.03), position=(0.35, 0.05, 0.14))
    tool.move((0, 0, -0.01))
    frame = stepper.frame()
    yield from (frame.displacement, frame.force(tool), frame.contact(tool).pressures, frame.force(forceps))
    yield from (frame.force(hand), hand.force, hand.torque, frame.force(patch), patch.torque)


def of_others(organ: vs.Organ) -> Iterator[Any]:
    yield from (organ.moved(organ.solve(force={"tip": DOWN})).displacement,)
    expansion = organ.path(force={"tip": DOWN}, order=3).expansions[0]
    yield from (expansion.displacement, expansion.load)
    rest = organ.unloaded(gravity=DOWN, density=100)
    yield from (rest.state.displacement, rest.from_scan(rest.state).displacement)
    test = vs.MaterialTest("uniaxial", [0.9, 1.1, 1.2], [-340, 280, 494])
    yield from (test.stretch, test.stress, *vs.fit(vs.NeoHookean, [test]).stresses)


@pytest.mark.parametrize("arrays", [of_state, of_frame, of_others])
def test_no_array_of_a_result_is_written_to(organ: vs.Organ, arrays: Callable[[vs.Organ], Iterator[Any]]) -> None:
    for number, array in enumerate(arrays(organ)):
        with pytest.raises(ValueError, match="read-only"):
            array *= 1e3
        assert not array.flags.writeable, number


def test_no_array_of_an_answer_is_written_to(touch: vs.Touch) -> None:
    answer = touch((0.4, 0.05, 0.1), (0, 0, -1e-3))
    felt = touch.probe().place((0.4, 0.05, 0.1))
    held = touch.galerkin().grasp([(0.4, 0.05, 0.1)])
    moved = held.solve([(0, 0, -1e-3)])
    for result in (answer, felt, moved):
        for array in (result.displacement, result.force):
            assert not array.flags.writeable, result
    for array in (answer.stiffness, answer.contact_point, answer.target("x > 90%").displacement, held.points):
        assert not array.flags.writeable
    assert not touch.points.flags.writeable
    for indices in (touch.surface_nodes, touch.touchable_triangles):
        assert not indices.flags.writeable


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing))])
def test_a_copy_is_read_only_too(organ: vs.Organ, again: Callable[[Any], Any]) -> None:
    state = organ.solve(force={"tip": DOWN})
    other = again(state)
    for array in (other.displacement, other.internal_force, other.stress("pk1", "points")):
        assert not array.flags.writeable
    assert np.array_equal(other.displacement, state.displacement)


def test_what_is_given_stays_writable(organ: vs.Organ) -> None:
    given = np.zeros_like(organ.mesh.points)
    moved = organ.moved(given)
    given[:] = 1.0
    assert not moved.displacement.any()
