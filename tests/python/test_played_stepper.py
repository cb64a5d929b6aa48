"""A stepper that a page shows and Python holds: what it tells of touches, and what it refuses."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.viewer.stepped import PlayedStepper, radius

TOP = (0.35, 0.05, 0.1)
PUSH = (0.0, 0.0, -0.01)
NOWHERE = (5.0, 5.0, 5.0)
SETTLED = 9


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")


def played(stepper: vs.Stepper) -> PlayedStepper:
    return PlayedStepper(lambda: stepper, "Bar")


def frame(shown: PlayedStepper, **request: Any) -> np.ndarray[Any, Any]:
    answer = shown.reply(json.dumps(request))
    assert isinstance(answer, bytes), answer
    return np.frombuffer(answer, "<f4")


def static_force(organ: vs.Organ) -> np.ndarray[Any, Any]:
    patch = organ.patch(TOP, radius(organ))
    return organ.solve(displacement={patch: PUSH}).reaction(patch)


def test_with_inertia_a_touch_lasts_until_the_organ_is_at_rest(organ: vs.Organ) -> None:
    shown = played(organ.stepper(density=1000, time_step=0.1, dynamics="backward_euler", iterations=10))
    told = shown.answer(TOP, PUSH)
    assert told["is_trusted"]
    # A frame settles to 1e-3 of all forces, and a vibration of a thousandth of the displacement counts as rest.
    assert told["force"] == pytest.approx(static_force(organ), rel=5e-3, abs=5e-3 * np.linalg.norm(told["force"]))
    shown.release()
    assert np.abs(shown._stepper.displacement).max() < 1e-2 * 0.01


def test_a_force_is_not_trusted_while_the_organ_moves(organ: vs.Organ, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("viscera.viewer.stepped.MOVING_FRAMES", 30)
    shown = played(organ.stepper(density=1000, time_step=1e-3, dynamics="backward_euler", iterations=10))
    with pytest.warns(UserWarning, match="the organ still moves after 30 frames, so the force is not trusted"):
        told = shown.answer(TOP, PUSH)
    assert told["is_trusted"] is False


def test_the_page_is_told_to_go_on_while_the_organ_moves(organ: vs.Organ) -> None:
    shown = played(organ.stepper(density=1000, time_step=0.1, dynamics="backward_euler", iterations=10))
    first = frame(shown, grab=TOP, move=PUSH)
    assert first[4] < 1e-3  # the frame itself is in balance
    assert not first[SETTLED]
    while not (last := frame(shown))[SETTLED]:
        pass
    force = static_force(organ)
    assert last[1:4] == pytest.approx(force, rel=5e-3, abs=5e-3 * np.linalg.norm(force))


def test_a_touch_of_relaxing_tissue_lasts_until_it_has_relaxed(organ: vs.Organ) -> None:
    shown = played(organ.stepper(time_step=0.1, relaxation=vs.Prony(g=[0.3, 0.2], tau=[0.2, 1.0]), iterations=6))
    told = shown.answer(TOP, PUSH)
    assert told["is_trusted"]
    # All of the stress relaxes to a half, but for the thousandth that counts as rest.
    assert told["force"] == pytest.approx(0.5 * static_force(organ), rel=2e-3, abs=2e-3 * np.linalg.norm(told["force"]))
    shown.release()
    assert np.abs(shown._stepper.displacement).max() < 2e-3 * 0.01


def test_the_page_is_told_to_go_on_while_tissue_relaxes(organ: vs.Organ) -> None:
    shown = played(organ.stepper(time_step=0.1, relaxation=vs.Prony(g=[0.5], tau=[0.5]), iterations=6))
    frame(shown)
    first = frame(shown, grab=TOP, move=PUSH)
    assert first[4] < 1e-3  # the frame itself is in balance
    assert not first[SETTLED]
    while not (last := frame(shown))[SETTLED]:
        pass
    force = 0.5 * static_force(organ)
    assert last[1:4] == pytest.approx(force, rel=2e-3, abs=2e-3 * np.linalg.norm(force))
    assert not frame(shown, release=True)[SETTLED]


def test_a_force_is_not_trusted_while_tissue_relaxes(organ: vs.Organ, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("viscera.viewer.stepped.MOVING_FRAMES", 30)
    shown = played(organ.stepper(time_step=0.01, relaxation=vs.Prony(g=[0.5], tau=[1.0]), iterations=6))
    with pytest.warns(UserWarning, match="the organ still relaxes after 30 frames, so the force is not trusted"):
        told = shown.answer(TOP, PUSH)
    assert told["is_trusted"] is False


@pytest.mark.parametrize("inertia", [{}, {"density": 1000, "dynamics": "backward_euler"}])
def test_what_a_tool_alone_presses_comes_to_rest(organ: vs.Organ, inertia: dict[str, Any]) -> None:
    stepper = organ.stepper(time_step=0.1, relaxation=vs.Prony(g=[0.5], tau=[0.1]), iterations=10, **inertia)
    stepper.tool(vs.Sphere(0.03), position=(0.35, 0.05, 0.131)).move((0, 0, -0.01))
    shown = played(stepper)
    assert not frame(shown)[SETTLED]
    assert any(frame(shown)[SETTLED] for _ in range(100))


def test_a_touch_beyond_the_reach_of_a_hand_is_refused(organ: vs.Organ) -> None:
    shown = played(organ.stepper(iterations=10))
    told = shown.answer(TOP, PUSH)
    with pytest.raises(vs.VisceraError, match=r"is 300 mm long, and a hand of the page reaches 212\.1 mm, 50%"):
        shown.answer(TOP, (0.0, 0.0, -0.3))
    assert frame(shown)[1:4] == pytest.approx(told["force"], rel=1e-3)


def test_a_hold_stays_where_another_is_refused(organ: vs.Organ) -> None:
    shown = played(organ.stepper(iterations=10))
    told = shown.answer(TOP, PUSH)
    with pytest.raises(vs.VisceraError, match="there is no free surface within"):
        shown.answer(NOWHERE, PUSH)
    assert frame(shown)[1:4] == pytest.approx(told["force"], rel=1e-3)
    assert "no free surface" in json.loads(shown.reply(json.dumps({"grab": NOWHERE, "move": PUSH})))["error"]
    with pytest.raises(vs.VisceraError, match=r"the surface is fixed at the point \(0, 40, 60\) mm; take hold beside"):
        shown.answer((0.0, 0.04, 0.06), PUSH)
    assert frame(shown)[1:4] == pytest.approx(told["force"], rel=1e-3)
    frame(shown, second={"grab": (0.2, 0.05, 0.1), "move": (0, 0, 0)})
    with pytest.raises(vs.VisceraError, match="both hands hold the same place"):
        shown.answer((0.2, 0.05, 0.1), PUSH)
    assert len(shown._stepper._hands) == 2


def test_stress_of_tissue_that_relaxes_is_refused_and_frames_still_come(organ: vs.Organ) -> None:
    relaxing = organ.stepper(time_step=0.01, relaxation=vs.Prony(g=[0.5], tau=[0.1]), iterations=6)
    shown = played(relaxing)
    assert json.loads(shown.reply(""))["has_stress"] is False
    assert "relaxes" in json.loads(shown.reply('{"stress": true}'))["error"]
    assert np.isfinite(frame(shown, grab=TOP, move=PUSH)).all()
    assert json.loads(played(organ.stepper()).reply(""))["has_stress"] is True
