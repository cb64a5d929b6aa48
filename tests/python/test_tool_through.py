"""A tool that tissue held from below cannot let through, however thin it is pressed."""

from __future__ import annotations

import numpy as np
import pytest
from tests.conftest import block

import viscera as vs

START = (0.04, 0.04, 0.0205)
"""Of a ball of 1 cm above a sheet of 1 cm."""


@pytest.fixture(scope="module")
def sheet() -> vs.Organ:
    points, cells = block((8, 8, 2), (0.08, 0.08, 0.01))
    return vs.Organ(vs.mesh(points, cells), vs.NeoHookean(young=1e4, poisson=0.3), fixed="z < 1%")


@pytest.mark.parametrize("down", [-0.021, -0.031, -0.2])
def test_a_solve_ends_before_it_goes_through(sheet: vs.Organ, down: float) -> None:
    """It came to be free below the sheet, and was told to have converged."""
    ball = vs.Tool(vs.Sphere("1 cm"), position=START, displacement=(0.0, 0.0, down))
    state = sheet.solve(contact=[ball])
    assert state.status != "converged"
    reached = START[2] + state.load * down
    assert 0.005 < reached < 0.0125
    assert state.contact(ball).force[2] < -5.0


@pytest.mark.parametrize("step", [-0.003, -0.006, -0.009])
def test_the_frame_in_which_it_goes_through_is_not_settled(sheet: vs.Organ, step: float) -> None:
    """Thin as it is by then, no place at which the frame looks need lie in the sheet."""
    stepper = sheet.stepper(iterations=60)
    ball = stepper.tool(vs.Sphere("1 cm"), position=START)
    while ball.position[2] > 0.0:
        ball.move((0.0, 0.0, step))
        frame = stepper.frame()
    assert frame.contact(ball).is_inside
    assert not frame.is_settled
    # What comes afterwards is a ball below the sheet, and lifted out of the sheet it is free.
    ball.move((0.0, 0.0, -0.05))
    assert np.abs(stepper.frame().force(ball)).max() < 1.0
