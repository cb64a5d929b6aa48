"""Forceps: what they hold by friction, when it slips, how far they close, and every way they can be refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.errors import VisceraError
from viscera.rotation import rotation_matrix

Block = Callable[..., tuple[np.ndarray, np.ndarray]]
FRICTION, GRIP = 0.3, 1.0
ALONG_Y = (0, 0, np.pi / 2)
JAW = vs.Box((0.01, 0.06, 0.04), rounding=0.002)


@pytest.fixture(scope="module")
def organ(block: Block) -> vs.Organ:
    """A tab, 40 x 20 x 60 mm, upright on its base."""
    points, cells = block((4, 2, 6), (0.04, 0.02, 0.06))
    mesh = vs.mesh(
        points, cells, {"base": np.flatnonzero(points[:, 2] == 0.0), "top": np.flatnonzero(points[:, 2] == 0.06)}
    )
    return vs.Organ(mesh, vs.NeoHookean(young=10e3, poisson=0.3), fixed="base")


def gripping(organ: vs.Organ, opening: float = 0.021) -> tuple[vs.Stepper, vs.Forceps]:
    """Forceps whose jaws are larger than the upper part of the tab, on both sides of it; forces balance to 1e-4."""
    stepper = organ.stepper(iterations=30, settled=1e-4)
    return stepper, stepper.forceps(JAW, (0.02, 0.01, 0.055), ALONG_Y, opening=opening, friction=FRICTION)


def squeezed(organ: vs.Organ) -> tuple[vs.Stepper, vs.Forceps]:
    stepper, forceps = gripping(organ)
    forceps.squeeze(GRIP, by=0.0005)
    for _ in range(14):
        frame = stepper.frame()
        assert forceps.grip < 1.02 * GRIP
    assert frame.is_settled
    return stepper, forceps


def test_a_squeeze_stops_at_its_force_and_keeps_it(organ: vs.Organ) -> None:
    stepper, forceps = squeezed(organ)
    assert forceps.grip == pytest.approx(GRIP, rel=0.01)
    opening = forceps.opening
    assert 0.015 < opening < 0.0199
    frame = stepper.frame()
    assert forceps.opening == opening
    assert frame.grip(forceps) == forceps.grip
    one, other = forceps.jaws
    assert forceps.grip == min(frame.force(one)[1], -frame.force(other)[1])
    assert frame.force(forceps) == pytest.approx(frame.force(one) + frame.force(other), abs=1e-15)


def test_flat_jaws_that_just_touch_are_closed_on(block: Block) -> None:
    """By friction the frames do not settle while nothing moves, and the squeeze waited for that."""
    points, cells = block((12, 6, 2), (0.12, 0.06, 0.01))
    sheet = vs.Organ(vs.mesh(points, cells), vs.NeoHookean(young=2e4, poisson=0.4), fixed="x < 1%", element="P2")
    stepper = sheet.stepper(iterations=20)
    jaw, turned = vs.Box((0.01, 0.03, 0.02)), (0, np.pi / 2, 0)
    # Less four times 1 mm it is as wide as the sheet is thick.
    forceps = stepper.forceps(jaw, (0.1, 0.03, 0.005), turned, opening=0.014, friction=0.5)
    forceps.squeeze(GRIP, by="1 mm")
    frames = [stepper.frame() for _ in range(30)]
    assert forceps.grip == pytest.approx(GRIP, rel=0.02)
    assert all(frame.is_settled for frame in frames[-5:])


def test_the_tab_is_lifted_by_friction_and_slips_beyond_it(organ: vs.Organ) -> None:
    """It sticks and stretches first. Pulled farther, it slips at twice the coefficient times the grip, within 1 %."""
    stepper, forceps = squeezed(organ)
    top, limit = organ.mesh.nodes("top"), 2.0 * FRICTION * GRIP
    began = stepper.displacement[top, 2].mean()
    pulls, follows = [], []
    for _ in range(12):
        forceps.move((0, 0, 0.0005))
        frame = stepper.frame()
        pulls.append(frame.force(forceps)[2])
        follows.append(frame.displacement[top, 2].mean() - began)
    assert frame.is_settled
    assert pulls[0] < pulls[2] < pulls[4] < 0.8 * limit
    assert follows[4] == pytest.approx(5 * 0.0005, rel=0.05)  # it has followed the jaws
    assert follows[-1] < 0.75 * 12 * 0.0005  # and no more
    assert pulls[-2:] == pytest.approx([limit, limit], rel=0.01)
    for jaw in forceps.jaws:
        contact = frame.contact(jaw)
        assert contact.sliding == contact.touching > 20
    assert frame.reaction("base")[2] == pytest.approx(-pulls[-1], rel=1e-3)


def test_force_and_torque_balance_the_support(organ: vs.Organ) -> None:
    stepper = organ.stepper(iterations=40, settled=1e-8)
    forceps = stepper.forceps(JAW, (0.02, 0.01, 0.055), ALONG_Y, opening=0.021, friction=2.0)
    for _ in range(4):
        forceps.close("0.5 mm")
        stepper.frame()
    forceps.turn((0, 0.05, 0))
    forceps.move((0.0003, 0, 0.0003))
    frame = stepper.frame()
    assert frame.is_settled
    force, torque = frame.force(forceps), frame.torque(forceps)
    forces = frame._reactions[organ.fixed]
    moment = np.cross(organ.mesh.points[organ.fixed], forces).sum(axis=0)
    assert abs(torque[1]) > 1e-4
    assert forces.sum(axis=0) == pytest.approx(-force, abs=1e-6)
    assert moment == pytest.approx(-torque - np.cross(forceps.position, force), abs=1e-7)


def test_an_assigned_pose_or_opening_moves_the_jaws(organ: vs.Organ) -> None:
    """As by `place`, `turn` and `close`, to the last bit, the torque included."""
    told = []
    for assigns in (False, True):
        stepper, forceps = squeezed(organ)
        if assigns:
            forceps.position = np.add(forceps.position, (0, 0, 0.0005))
            forceps.rotation = rotation_matrix((0, 0, 0.02)) @ forceps.rotation
            forceps.opening = forceps.opening - 0.0005
        else:
            forceps.move((0, 0, 0.0005))
            forceps.turn((0, 0, 0.02))
            forceps.close("0.5 mm")
        frame = stepper.frame()
        told.append([*frame.force(forceps), *frame.torque(forceps), forceps.grip])
        assert forceps.grip > 1.1 * GRIP  # the squeeze has ended
    assert told[0] == told[1]


def test_a_pose_is_not_changed_in_place(organ: vs.Organ) -> None:
    _, forceps = gripping(organ)
    for pose in (forceps.position, forceps.rotation):
        with pytest.raises(ValueError, match="read-only"):
            pose += 0.001
    wrong: dict[str, Any] = {"position": (0, 0), "rotation": 2 * np.eye(3), "opening": -0.01}
    for name, value in wrong.items():
        with pytest.raises(vs.VisceraError, match=f"the {name} of forceps must be"):
            setattr(forceps, name, value)
    forceps.opening = "22 mm"
    assert forceps.opening == 0.022
    forceps.remove()
    for name, value in {"position": (0, 0, 0), "rotation": None, "opening": 0.02}.items():
        with pytest.raises(vs.VisceraError, match="these forceps were removed"):
            setattr(forceps, name, value)


def test_jaws_that_meet_stop_and_grip_nothing(organ: vs.Organ) -> None:
    stepper = organ.stepper()
    forceps = stepper.forceps(JAW, (0.02, 0.01, 0.2), opening="3 mm")
    forceps.squeeze(1.0, by="2 mm")
    for _ in range(4):
        frame = stepper.frame()
    assert frame.is_settled
    assert forceps.opening == forceps.grip == 0.0
    forceps.open("1 mm")
    stepper.frame()
    assert forceps.opening == 0.001


def test_what_is_let_go_comes_back(organ: vs.Organ) -> None:
    stepper, forceps = squeezed(organ)
    forceps.open("5 mm")
    for _ in range(4):
        frame = stepper.frame()
    assert forceps.grip == 0.0
    assert np.abs(frame.displacement).max() < 1e-6
    forceps.remove()
    assert stepper.frame().is_settled
    with pytest.raises(VisceraError, match="were not in this frame"):
        stepper.frame().force(forceps)


def squeezing_softly(organ: vs.Organ) -> tuple[vs.Stepper, vs.Forceps]:
    """Jaws that have told a first grip, which is too small, so that the next frame closes them by 0.5 mm."""
    stepper, forceps = gripping(organ)
    forceps.squeeze(GRIP, by=0.0005)
    stepper.frame()
    return stepper, forceps


def test_a_refused_frame_leaves_the_jaws_where_they_are(organ: vs.Organ) -> None:
    stepper, forceps = squeezing_softly(organ)
    other = stepper.forceps(JAW, (0.02, 0.01, 0.2), opening=0.021)
    for _ in range(5):
        with pytest.raises(VisceraError, match="no node set 'nowhere'"):
            stepper.frame(pressure={"nowhere": 1.0})
    without_a_jaw(other)
    for _ in range(5):
        with pytest.raises(VisceraError, match="removed by itself"):
            stepper.frame()
    other.remove()
    assert forceps.opening == 0.021
    stepper.frame()
    assert forceps.opening == pytest.approx(0.0205)


class BrokenOff:
    """A core whose frames are interrupted; all else is that of the true one."""

    def __init__(self, core: Any) -> None:
        self._core = core

    def __getattr__(self, name: str) -> Any:
        return getattr(self._core, name)

    def frame(self, **_: Any) -> Any:
        raise KeyboardInterrupt


def test_frames_that_break_off_close_the_jaws_once(organ: vs.Organ, monkeypatch: pytest.MonkeyPatch) -> None:
    stepper, forceps = squeezing_softly(organ)
    with monkeypatch.context() as patch:
        patch.setattr(stepper, "_core", BrokenOff(stepper._core))
        for _ in range(5):
            with pytest.raises(KeyboardInterrupt):
                stepper.frame()
    stepper.frame()
    assert forceps.opening == pytest.approx(0.0205)
    stepper.frame()
    assert forceps.opening == pytest.approx(0.02)


Act = Callable[[vs.Stepper, vs.Forceps], object]
REFUSED: list[tuple[str, Act]] = [
    ("the jaw of forceps must be", lambda stepper, forceps: stepper.forceps(vs.HalfSpace(), opening=0.1)),  # type: ignore[arg-type]
    ("opening of forceps: a percentage of what", lambda stepper, forceps: stepper.forceps(JAW, opening="10%")),
    ("forceps close by: a percentage of what", lambda stepper, forceps: forceps.close("10%")),
    ("the opening of forceps must be", lambda stepper, forceps: stepper.forceps(JAW, opening=-0.1)),
    (
        r"a box at \(.*\) m, starts .* inside",
        lambda stepper, forceps: stepper.forceps(JAW, (0.02, 0.01, 0.055), ALONG_Y, opening=0.0),
    ),
    ("the position of forceps must be", lambda stepper, forceps: forceps.place((0, 0))),
    ("the rotation of forceps must be", lambda stepper, forceps: forceps.place(rotation=np.ones((3, 3)))),
    ("the motion of forceps must be", lambda stepper, forceps: forceps.move((0, float("nan"), 0))),
    ("the turn of forceps must be", lambda stepper, forceps: forceps.turn("x")),
    ("forceps open by must be", lambda stepper, forceps: forceps.open(-0.001)),
    ("the force of a squeeze must be", lambda stepper, forceps: forceps.squeeze(float("inf"), by=0.001)),
    ("the largest step of a squeeze must be .* above 0", lambda stepper, forceps: forceps.squeeze(1.0, by=0)),
    ("were removed", lambda stepper, forceps: removed(forceps).close(0.001)),
    ("were removed", lambda stepper, forceps: removed(forceps).squeeze(1.0, by=0.001)),
    ("removed by itself", lambda stepper, forceps: without_a_jaw(forceps)._stepper.frame()),
    ("removed by itself; call remove", lambda stepper, forceps: without_a_jaw(forceps).move((0, 0, 0.001))),
    ("none since they were made", lambda stepper, forceps: forceps.grip),
    ("were not in this frame", lambda stepper, forceps: forceps._stepper._organ.stepper().frame().grip(forceps)),
]


def removed(forceps: vs.Forceps) -> vs.Forceps:
    forceps.remove()
    return forceps


def without_a_jaw(forceps: vs.Forceps) -> vs.Forceps:
    forceps.jaws[1].remove()
    return forceps


def test_forceps_without_a_jaw_can_be_removed(organ: vs.Organ) -> None:
    stepper, forceps = gripping(organ)
    without_a_jaw(forceps).remove()
    assert stepper.frame().is_settled


@pytest.mark.parametrize(("message", "act"), REFUSED)
def test_what_makes_no_sense_is_said(organ: vs.Organ, message: str, act: Act) -> None:
    stepper, forceps = gripping(organ)
    with pytest.raises(VisceraError, match=message):
        act(stepper, forceps)


def test_jaws_that_close_fast_do_not_swallow_a_lobe() -> None:
    """It swings from one jaw to the other within a frame. No step leads it through the jaw that it meets there."""
    liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=5e3, poisson=0.45), fixed="hilum")
    gravity = (0, 0, -9.81)
    sagged = liver.solve(gravity=gravity, density=1060, throw=True)
    middle = (liver.mesh.points + sagged.displacement)[liver.mesh.nodes("tip")].mean(axis=0)
    stepper = liver.stepper(start=sagged, density=1060, iterations=40)
    forceps = stepper.forceps(
        vs.Box((0.008, 0.03, 0.04), rounding=0.003), middle, ALONG_Y, opening=0.05, friction=FRICTION
    )
    for _ in range(11):
        forceps.close(0.003)
        frame = stepper.frame(gravity=gravity)
        assert frame.is_settled
        assert not any(frame.contact(jaw).is_inside for jaw in forceps.jaws)
    assert forceps.grip > 1.0
