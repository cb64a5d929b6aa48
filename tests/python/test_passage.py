"""Organs that a hand drags into each other: they settle as far as they can, and do not count as settled beyond."""

from __future__ import annotations

import numpy as np
import pytest
from tests.conftest import block

import viscera as vs

LAW = vs.NeoHookean(young=1e4, poisson=0.3)


@pytest.fixture(scope="module")
def scene() -> vs.Scene:
    """A plate over a block on the table."""
    lower = vs.mesh(*block((6, 4, 2), (0.12, 0.08, 0.03)))
    points, cells = block((5, 3, 1), (0.1, 0.07, 0.01))
    above = vs.mesh(points + np.array([0.01, 0.005, 0.031]), cells)
    held = vs.Organ(above, LAW, supports=[vs.ElasticSupport("z > 99%", 1.0)])
    organs = {"block": vs.Organ(lower, LAW, fixed="z < 1%"), "plate": held}
    return vs.Scene(organs, contacts=[vs.ContactPair("block", "plate")])


def test_a_plate_dragged_through_a_block_does_not_settle(scene: vs.Scene) -> None:
    stepper, pair = scene.stepper(iterations=60), scene.contacts[0]
    hand = stepper.grasp(scene.place("plate", "z > 99%"))
    frames = []
    # How it goes in there, crushed, differs from machine to machine.
    for step in 6 * [-0.01] + 40 * [0.0]:
        hand.move((0.0, 0.0, step))
        frames.append(stepper.frame())
        if step == 0.0 and frames[-1].contact(pair).is_inside:
            break
    inside = [frame.contact(pair).is_inside for frame in frames]
    assert not inside[0]
    assert inside[-1]
    assert not any(frame.is_settled for frame, is_in in zip(frames, inside, strict=True) if is_in)
    assert not any(frame.is_settled and frame.force(pair)[2] > -10.0 for frame in frames)
    assert "surfaces of ContactPair(block, plate) went through each other" in repr(frames[-1])


@pytest.mark.parametrize("step", [-0.002, -0.006, -0.01])
def test_a_plate_moved_far_into_a_block_at_once_settles(scene: vs.Scene, step: float) -> None:
    stepper, pair = scene.stepper(iterations=12), scene.contacts[0]
    stepper.grasp(scene.place("plate", "z > 99%")).move((0.0, 0.0, step))
    frame = stepper.frame()
    assert frame.is_settled
    assert not frame.contact(pair).is_inside
    assert frame.force(pair)[2] < -2.0


def test_a_plate_pressed_into_a_block_is_not_inside(scene: vs.Scene) -> None:
    stepper, pair = scene.stepper(iterations=60), scene.contacts[0]
    hand = stepper.grasp(scene.place("plate", "z > 99%"))
    for _ in range(4):
        hand.move((0.002, 0.0, -0.003))
        frame = stepper.frame()
    assert frame.is_settled
    assert not frame.contact(pair).is_inside
    assert frame.force(pair)[2] < -10.0


def test_a_layer_too_soft_to_keep_a_plate_out_is_told(scene: vs.Scene) -> None:
    soft = vs.Scene(scene.organs, contacts=[vs.ContactPair("block", "plate", stiffness=0.05)])
    state = soft.solve(displacement={"plate/z > 99%": (0.0, 0.0, -0.012)})
    assert not state.is_converged
    assert "the surfaces of ContactPair(block, plate) go through each other; give the layer" in state.message
    assert 0.3 < state.load < 0.9
