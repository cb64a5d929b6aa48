"""Tools with friction that turn far: what one step or a few large frames say is what many small ones say."""

import numpy as np
import pytest
from tests.conftest import block

import viscera as vs
from viscera.mesh import Floats

SOFT = vs.NeoHookean(young=10e3, poisson=0.3)
RADIUS, DEPTH, FRICTION = 0.01, 0.003, 0.3
AXIS_ALONG_Y = (np.pi / 2, 0, 0)


@pytest.fixture(scope="module")
def organ() -> vs.Organ:
    """A plate, 100 x 60 x 30 mm."""
    return vs.Organ(vs.mesh(*block((10, 4, 3), (0.1, 0.06, 0.03))), SOFT, fixed="z < 1%")


@pytest.fixture(scope="module")
def pressed(organ: vs.Organ) -> tuple[vs.State, vs.Tool]:
    tool = vs.Tool(
        vs.Capsule(RADIUS, 0.1), (0.051, 0.03, 0.03 + RADIUS + 1e-4), AXIS_ALONG_Y, friction=FRICTION,
        displacement=(0, 0, -DEPTH),
    )  # fmt: skip
    return organ.solve(contact=[tool], throw=True), tool.arrived()


def drag(force: Floats) -> float:
    return float(force[0] / force[2])


@pytest.fixture(scope="module")
def small(organ: vs.Organ, pressed: tuple[vs.State, vs.Tool]) -> tuple[float, float]:
    """Half a turn in 36 steps: drag over load, and the energy that the last of them dissipates."""
    return turned(organ, pressed, 180.0, 36)


def turned(organ: vs.Organ, pressed: tuple[vs.State, vs.Tool], degrees: float, steps: int) -> tuple[float, float]:
    state, tool = pressed
    tool = tool.arrived()
    tool.turn = np.array((0, np.radians(degrees), 0))
    contact = organ.solve(contact=[tool], start=state, steps=steps, throw=True).contact(tool)
    return drag(contact.force), contact.dissipation


@pytest.mark.parametrize("degrees", [90.0, 180.0, 360.0])
def test_one_solve_turns_a_tool_as_many_steps_do(
    organ: vs.Organ, pressed: tuple[vs.State, vs.Tool], small: tuple[float, float], degrees: float
) -> None:
    """Its lowest points go towards negative x, and so does the drag; the tissue slides steadily by then."""
    found, _ = turned(organ, pressed, degrees, 1)
    assert small[0] > 0.1  # of 0.3: the capsule lies so deep that much of its friction is upright
    assert found == pytest.approx(small[0], rel=0.02)


@pytest.mark.parametrize("degrees", [60.0, 90.0, 135.0])
def test_large_frames_turn_a_tool_as_small_steps_do(
    organ: vs.Organ, pressed: tuple[vs.State, vs.Tool], small: tuple[float, float], degrees: float
) -> None:
    """The drag of steady sliding, and the work of it over the arc."""
    stepper = organ.stepper(iterations=30, start=pressed[0])
    tool = stepper.tool(pressed[1].arrived())
    for _ in range(3):
        tool.turn((0, np.radians(degrees), 0))
        frame = stepper.frame()
        assert frame.is_settled
        assert drag(frame.force(tool)) == pytest.approx(small[0], rel=0.02)
    assert frame.contact(tool).dissipation == pytest.approx(small[1] * degrees / 5.0, rel=0.03)


def test_half_a_turn_of_a_tool_with_friction_is_refused_in_a_frame(organ: vs.Organ) -> None:
    stepper = organ.stepper()
    for friction in (FRICTION, "bonded"):
        tool = stepper.tool(vs.Sphere(RADIUS), position=(0.05, 0.03, 0.05), friction=friction)
        with pytest.raises(vs.VisceraError, match="by less than 180 degrees a frame, got 360 degrees"):
            tool.turn((0, 2 * np.pi, 0))
        tool.remove()
