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


@pytest.mark.parametrize("shape", ["plate", "wedge"])
def test_thin_and_sharp_bodies_sink_deeper_than_their_own_cells_are_high(shape: str) -> None:
    """Half the height of a cell of the block is allowed, not of theirs."""
    if shape == "plate":
        lower = vs.mesh(*block((4, 3, 1), (0.12, 0.08, 0.06)))
        points, cells = block((8, 6, 1), (0.06, 0.05, 5e-4))
        points, law, depth = points + np.array([0.03, 0.015, 0.0602]), vs.NeoHookean(young=1e6, poisson=0.3), -0.012
    else:
        lower = vs.mesh(*block((6, 4, 2), (0.12, 0.08, 0.03)))
        points, cells = block((4, 4, 4), (0.04, 0.08, 0.04))
        points[:, 0] = 0.02 + (points[:, 0] - 0.02) * (0.02 + 0.98 * points[:, 2] / 0.04)
        points, law, depth = points + np.array([0.043, 0.003, 0.0305]), vs.NeoHookean(young=1e5, poisson=0.3), -0.006
    organs = {"block": vs.Organ(lower, LAW, fixed="z < 1%"), "thin": vs.Organ(vs.mesh(points, cells), law)}
    scene = vs.Scene(organs, contacts=[vs.ContactPair("block", "thin")])
    pushed, pair = {scene.place("thin", "z > 99%"): (0.0, 0.0, depth)}, scene.contacts[0]
    state = scene.solve(displacement=pushed, throw=True)
    assert not state.contact(pair).is_inside
    frame = scene.stepper(pushed, start=state, iterations=20).frame(pushed)
    assert frame.is_settled
    assert not frame.contact(pair).is_inside
    assert frame.force(pair) == pytest.approx(state.force(pair), rel=5e-3, abs=1e-2)


def test_organs_that_are_apart_again_after_they_were_crushed_are_not_inside() -> None:
    """Pressed far too deep at once, then lifted. How they come apart, tangled, differs from machine to machine."""
    lower = vs.mesh(*block((6, 4, 2), (0.12, 0.08, 0.03)))
    points, cells = block((5, 3, 1), (0.1, 0.07, 0.01))
    above = vs.mesh(points + np.array([0.01, 0.005, 0.031]), cells)
    organs = {"block": vs.Organ(lower, LAW, fixed="z < 1%"), "plate": vs.Organ(above, LAW)}
    was_inside, came_apart = False, False
    for friction, depth in ((0.1, 0.03), (0.1, 0.034), (0.3, 0.03)):
        scene = vs.Scene(organs, contacts=[vs.ContactPair("block", "plate", friction=friction)])
        top, pair = scene.place("plate", "z > 99%"), scene.contacts[0]
        stepper = scene.stepper(iterations=40, grasped={top: (0.0, 0.0, 0.0)})
        frames = [stepper.frame({top: (0.0, 0.0, height)}) for height in [-depth] + 40 * [0.02]]
        was_inside |= any(frame.contact(pair).is_inside for frame in frames)
        if _is_above(scene, frames[-2]):
            came_apart = True
            assert not frames[-1].contact(pair).is_inside
            assert frames[-1].is_settled
    assert was_inside
    assert came_apart


def _is_above(scene: vs.Scene, frame: vs.Frame) -> bool:
    """Whether the plate lies above the block."""
    height = (scene.mesh.points + frame.displacement)[:, 2]
    return bool(height[scene.mesh.nodes("plate")].min() > height[scene.mesh.nodes("block")].max())
