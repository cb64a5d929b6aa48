"""A stepper that a page shows and Python holds: what it tells of touches, and what it refuses."""

from __future__ import annotations

import itertools
import json
import warnings
import weakref
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.stepping.anew import begin_anew
from viscera.viewer.stepped import PlayedStepper, radius

TOP = (0.35, 0.05, 0.1)
PUSH = (0.0, 0.0, -0.01)
NOWHERE = (5.0, 5.0, 5.0)
SETTLED, UNSTABLE = 9, 6


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


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"density": 1000, "time_step": 0.01, "dynamics": "newmark"},
        {"time_step": 0.05, "relaxation": vs.Prony(g=[0.5], tau=[5.0])},
    ],
)
def test_a_page_that_begins_anew_begins_from_rest(organ: vs.Organ, settings: dict[str, Any]) -> None:
    stepper = organ.stepper(iterations=10, **settings)
    shown = PlayedStepper(lambda: stepper, "Bar", again=lambda: begin_anew(stepper))
    for _ in range(20):
        frame(shown, grab=TOP, move=PUSH)
    assert np.abs(stepper.displacement).max() > 5e-3
    last = frame(shown, laws=["NeoHookean"])
    assert np.abs(last[15:]).max() < 1e-9
    assert np.abs(stepper.displacement).max() < 1e-9  # the notebook's own stepper
    assert stepper.velocity is None or np.abs(stepper.velocity).max() < 1e-9
    assert frame(shown, grab=TOP, move=PUSH)[3] < 0.0


def test_a_stepper_that_begins_anew_keeps_its_tools_and_what_the_notebook_holds(organ: vs.Organ) -> None:
    stepper = organ.stepper(iterations=20)
    hand = stepper.grasp("tip")
    hand.displacement = (0, 0, -0.02)
    gone, tool = (stepper.tool(vs.Sphere(0.03), position=(0.2, 0.05, height)) for height in (0.3, 0.131))
    gone.remove()
    tool.move((0, 0, -0.005))
    for _ in range(3):
        before = stepper.frame()
    begin_anew(stepper)
    assert not stepper.displacement.any()
    for _ in range(3):
        after = stepper.frame()
    size = np.linalg.norm(before.reaction(hand))
    assert after.reaction(hand) == pytest.approx(before.reaction(hand), abs=1e-3 * size)
    assert after.force(tool) == pytest.approx(before.force(tool), rel=1e-3, abs=1e-3 * size)


def test_a_force_that_the_page_marks_is_not_trusted(organ: vs.Organ) -> None:
    shown = played(organ.stepper(iterations=20))
    # Pressed towards its root, so far that it is about to buckle.
    told = shown.answer((0.4, 0.05, 0.05), (-0.15, 0.0, 0.0))
    facts = frame(shown)
    assert (facts[SETTLED], facts[UNSTABLE]) == (1.0, 1.0)
    assert told["is_trusted"] is False


def views(shown: PlayedStepper, view: str, **request: Any) -> dict[str, Any]:
    """Who holds what after a request of a view."""
    assert isinstance(shown.reply(json.dumps(request), view), bytes)
    return shown.held()


def test_the_view_that_took_hold_last_holds_the_organ(organ: vs.Organ) -> None:
    shown = played(organ.stepper(iterations=10))
    other = (0.2, 0.05, 0.1)
    assert views(shown, "one", grab=TOP, move=PUSH)["holder"] == "one"
    [held, _] = views(shown, "two", move=(0, 0, -0.03), release=True)["hands"]
    assert held == {"point": list(TOP), "displacement": pytest.approx(PUSH)}
    # What the other view cannot hold leaves the organ to the one that holds it.
    assert "no free surface" in json.loads(shown.reply(json.dumps({"grab": NOWHERE}), "two"))["error"]
    assert shown.held()["holder"] == "one"
    taken = views(shown, "two", second={"grab": other, "move": PUSH})
    assert (taken["holder"], taken["hands"][0]) == ("two", None)
    assert len(shown._stepper._hands) == 1
    assert views(shown, "one", release=True, second={"release": True})["holder"] == "two"
    assert views(shown, "two", second={"release": True}) == {"holder": None, "hands": [None, None]}
    # A touch from Python is nobody's: any view may let it go, and none moves it without taking hold.
    shown.answer(TOP, PUSH)
    assert views(shown, "one", move=(0, 0, -0.03))["hands"][0]["displacement"] == pytest.approx(PUSH)
    assert views(shown, "two", release=True)["hands"] == [None, None]


def test_a_stepper_shown_again_is_in_the_same_hands(organ: vs.Organ) -> None:
    pytest.importorskip("anywidget")
    stepper = organ.stepper(iterations=10)
    first = stepper.view("Bar")
    first.touch(TOP, PUSH)
    again = stepper.view("Again", height=300)
    again.touch(TOP, (0.0, 0.0, -0.005))
    assert len(stepper._hands) == 1
    assert first.force == again.force
    assert first.displacement == pytest.approx([0.0, 0.0, -0.005])
    assert (json.loads(again._played.reply(""))["name"], again.height) == ("Again", 300)
    assert views(again._played, "two", laws=["NeoHookean"]) == {"holder": None, "hands": [None, None]}
    assert stepper._hands == []
    assert np.abs(stepper.displacement).max() < 1e-9
    with pytest.raises(vs.VisceraError, match="height"):
        stepper.view(height=0)


def test_a_tool_that_comes_later_is_in_the_next_view_which_closes_the_earlier(organ: vs.Organ) -> None:
    pytest.importorskip("anywidget")
    stepper = organ.stepper(iterations=10)
    first = stepper.view("Bar")
    first.touch(TOP, PUSH)
    stepper.tool(vs.Sphere(0.03), position=(0.2, 0.05, 0.3))
    second = stepper.view("Bar")
    assert len(json.loads(second._played.reply(""))["bodies"]) == 1
    assert stepper._hands == []
    with pytest.raises(vs.VisceraError, match="this view is closed; show the organ anew"):
        first.touch(TOP, PUSH)
    second.touch(TOP, PUSH)
    assert stepper.view("Bar") is second


def test_a_page_that_begins_anew_reads_frames_without_the_tools_that_came_later(organ: vs.Organ) -> None:
    stepper = organ.stepper(iterations=10)
    shown = PlayedStepper(lambda: stepper, "Bar", again=lambda: begin_anew(stepper))
    before = frame(shown, stress=True)
    stepper.tool(vs.Sphere(0.03), position=(0.2, 0.05, 0.3))
    assert len(frame(shown, laws=["NeoHookean"])) == len(before)
    assert json.loads(shown.reply(""))["bodies"] == []


def test_a_closed_view_lets_go_and_keeps_no_stepper(organ: vs.Organ) -> None:
    pytest.importorskip("anywidget")
    stepper = organ.stepper(iterations=10)
    closed = stepper.view("Bar")
    closed.touch(TOP, PUSH)
    closed.close()
    assert stepper._hands == []
    stepper.view("Bar").touch(TOP, PUSH)  # as nobody holds that place any more
    stepper.view("Bar").close()
    kept = weakref.ref(stepper)
    del stepper
    assert kept() is None, "without the collector of cycles"
    assert closed.model == b""


def interrupted(stepper: vs.Stepper, monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """Ctrl-C comes in a frame, after so many others."""
    frames, whole = itertools.count(), stepper.frame

    def frame(**loads: Any) -> vs.Frame:
        if next(frames) == after:
            monkeypatch.undo()
            raise KeyboardInterrupt
        return whole(**loads)

    monkeypatch.setattr(stepper, "frame", frame)


@pytest.mark.parametrize("after", [0, 1])
def test_widget_and_organ_agree_after_a_touch_that_was_interrupted(
    organ: vs.Organ, monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    pytest.importorskip("anywidget")
    stepper = organ.stepper(iterations=1)
    widget = stepper.view("Bar")
    interrupted(stepper, monkeypatch, after)
    with pytest.raises(KeyboardInterrupt):
        widget.touch(TOP, PUSH)
    assert (stepper._hands, widget.point, widget.is_trusted) == ([], None, None)
    widget.touch(TOP, PUSH)
    force, number = widget.force, widget.asked["number"]
    interrupted(stepper, monkeypatch, after)
    with pytest.raises(KeyboardInterrupt):
        widget.touch((0.2, 0.05, 0.1), (0.0, 0.0, 0.02))
    assert (widget.point, widget.force, widget.is_trusted) == (list(TOP), force, False)
    assert widget.asked == {**widget._told(), "number": number + 1}  # the page looks again
    [held, _] = widget._played.held()["hands"]
    assert held == {"point": list(TOP), "displacement": pytest.approx(PUSH)}
    for _ in range(20):
        last = frame(widget._played)
    assert last[1:4] == pytest.approx(force, rel=1e-2, abs=1e-2 * np.linalg.norm(force))
    interrupted(stepper, monkeypatch, after)
    with pytest.raises(KeyboardInterrupt):
        widget.release()
    assert (stepper._hands, widget.point, widget.is_trusted) == ([], None, None)


def test_a_warning_that_is_an_error_undoes_the_touch(organ: vs.Organ, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("anywidget")
    monkeypatch.setattr("viscera.viewer.stepped.MOVING_FRAMES", 3)
    stepper = organ.stepper(density=1000, time_step=1e-3, dynamics="backward_euler", iterations=10)
    widget = stepper.view("Bar")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(UserWarning, match="still moves"):
            widget.touch(TOP, PUSH)
    assert (stepper._hands, widget.point) == ([], None)


def test_the_page_hears_of_a_touch_whose_handler_fails(organ: vs.Organ, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("anywidget")
    widget = organ.stepper(iterations=10).view("Bar")
    page: dict[str, Any] = {}
    monkeypatch.setattr(widget, "_send", lambda message, buffers=None: page.update(message["state"]))

    def fails(change: Any) -> None:
        raise RuntimeError("a handler's own")

    widget.observe(fails, "point")
    with pytest.raises(RuntimeError, match="a handler's own"):
        widget.touch(TOP, PUSH)
    assert widget.point == list(TOP)
    assert page == {**widget._told(), "asked": widget.asked}
    assert page["asked"]["force"] == widget.force
