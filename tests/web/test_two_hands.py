"""Two hands on a reduced model, which has one contact: while both hold on, the page steps the organ."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.web.test_headset import EMULATOR, HEADSET, SIDES, SIGNS, UP, frames, in_room, point, pull, put_on

import viscera as vs
from viscera.viewer import Server, page, serve

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]

LEFT, RIGHT = (0.15, 0.0, 0.05), (0.37, 0.0, 0.05)
TELEPHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 780}, "has_touch": True, "is_mobile": True}
SETTLED = """() => {
    const { isShown, conversation } = viscera.duet;
    const { isSettled, residual } = viscera.state().two;
    return isShown && !conversation.isWaiting && !conversation.hasWishes && isSettled && residual < 1e-6;
}"""


class Fingers:
    """Fingers on the screen of a telephone."""

    def __init__(self, viewer: Viewer) -> None:
        self.viewer = viewer
        self.session = viewer.page.context.new_cdp_session(viewer.page)

    def __call__(self, kind: str, *places: tuple[float, float], first: int = 0) -> None:
        points = [{"x": x, "y": y, "id": first + k} for k, (x, y) in enumerate(places)]
        self.session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


@pytest.fixture
def telephone(look_at: Look, server: Server) -> Iterator[Viewer]:
    if not page.can_step():
        pytest.skip("the page's stepper is not built; `make viewer` builds it")
    viewer = look_at(server.url, **TELEPHONE)
    viewer.call("setTool", "drag")
    yield viewer
    assert viewer.complaints == []
    viewer.close()


def exact(touch: vs.Touch, hands: list[dict[str, Any]]) -> list[Any]:
    """The forces by which the full organ answers the hands, in its own patches."""
    patches = [touch.patch(hand["point"]) for hand in hands]
    pushes = [hand["displacement"] for hand in hands]
    solved = touch.organ().solve(displacement=dict(zip(patches, pushes, strict=True)))
    return [solved.reaction(patch) for patch in patches]


def test_two_fingers_hold_the_organ_of_a_model(telephone: Viewer, touch: vs.Touch) -> None:
    viewer, fingers = telephone, Fingers(telephone)
    (x0, y0), (x1, y1) = viewer.place(LEFT), viewer.place(RIGHT)
    fingers("touchStart", (x0, y0))
    fingers("touchMove", (x0, y0 - 8))
    one = viewer.state
    assert one["two"] is None
    assert one["force"] == pytest.approx(touch(one["point"], one["displacement"]).force, rel=1e-5, abs=1e-6)
    # What answers the second one is loaded meanwhile.
    viewer.page.wait_for_function("() => viscera.hands === 2")
    fingers("touchStart", (x0, y0 - 8), (x1, y1))
    fingers("touchMove", (x0, y0 - 8), (x1, y1 + 40))
    viewer.page.wait_for_function(SETTLED)
    two = viewer.state["two"]
    viewer.shoot("two-hands")
    assert two["hands"][0]["displacement"] == one["displacement"]
    assert two["hands"][0]["displacement"][2] > 1e-3 > -1e-3 > two["hands"][1]["displacement"][2]
    for found, force in zip((two["force"], two["second"]), exact(touch, two["hands"]), strict=True):
        assert found == pytest.approx(force.tolist(), abs=1e-4 * np.linalg.norm(force))
    assert viewer.page.locator(".force-label:visible").count() == 2
    said = viewer.page.get_by_role("region", name="two hands")
    assert said.is_visible()
    assert "second hand" in said.inner_text()
    # One lets go, the other holds on; then the model answers again.
    fingers("touchEnd", (x1, y1 + 40), first=1)
    viewer.page.wait_for_function("() => viscera.state().two.hands.filter(Boolean).length === 1")
    viewer.page.wait_for_function(SETTLED)
    after = viewer.state["two"]
    left = 0 if after["hands"][0] else 1
    assert after["hands"][left] == two["hands"][left]
    [force] = exact(touch, [after["hands"][left]])
    assert after[("force", "second")[left]] == pytest.approx(force.tolist(), abs=1e-4 * np.linalg.norm(force))
    fingers("touchEnd")
    viewer.page.wait_for_function("() => viscera.state().two === null && viscera.state().activity === 'rest'")
    assert said.is_hidden()
    # One finger again: by the model.
    fingers("touchStart", (x0, y0))
    fingers("touchMove", (x0, y0 - 8))
    again = viewer.state
    assert again["two"] is None
    assert again["force"] == pytest.approx(one["force"], rel=1e-6)
    fingers("touchEnd")


def test_a_second_finger_beside_the_organ_turns_the_view(telephone: Viewer) -> None:
    viewer, fingers = telephone, Fingers(telephone)
    (x0, y0) = viewer.place(LEFT)
    fingers("touchStart", (x0, y0))
    viewer.page.wait_for_function("() => viscera.hands === 2")
    fingers("touchStart", (x0, y0), (x0, y0 + 220))
    assert viewer.page.evaluate("() => viscera.pointer.holding.size") == 0
    fingers("touchEnd")
    assert viewer.state["two"] is None


def test_where_the_organ_cannot_be_stepped_one_finger_touches(look_at: Look, touch: vs.Touch, server: Server) -> None:
    gone = (
        "const get = fetch; window.fetch = (url, ...more) => get(String(url).replace('organ.case', 'gone'), ...more);"
    )
    with serve(touch, "Bar") as running:
        viewer = look_at(running.url, scripts=[gone], **TELEPHONE)
        fingers, (x0, y0), (x1, y1) = Fingers(viewer), viewer.place(LEFT), viewer.place(RIGHT)
        with viewer.page.expect_response("**/gone"):
            fingers("touchStart", (x0, y0))
        fingers("touchStart", (x0, y0), (x1, y1))
        state = viewer.state
        assert viewer.page.evaluate("() => viscera.hands") == 1
        assert state["two"] is None
        fingers("touchEnd")
        viewer.close()


def test_two_controllers_hold_the_organ_of_a_model(look_at: Look, server: Server, touch: vs.Touch) -> None:
    if not EMULATOR.exists() or not page.can_step():
        pytest.skip("no WebXR emulator or no stepper here; `npm --prefix viewer ci` and `make viewer` bring them")
    viewer = look_at(server.url, scripts=[EMULATOR.read_text(encoding="utf-8"), HEADSET])
    put_on(viewer)
    viewer.page.wait_for_function("() => viscera.hands === 2")
    diagonal = touch.metadata["diagonal"]
    held = {"left": (0.2, 0.05, 0.1), "right": (0.35, 0.05, 0.1)}
    moved = {"left": 0.004, "right": -0.008}  # along the organ's z, which is up in the room
    for side, place in held.items():
        target = in_room(viewer, place)
        point(viewer, target + 0.2 * UP, target, side)
        pull(viewer, 1, side)
    for side, height in moved.items():
        at = in_room(viewer, held[side]) + height * 0.6 / diagonal * UP
        point(viewer, at + 0.2 * UP, at, side)
    viewer.page.wait_for_function(SETTLED)
    frames(viewer)
    two = viewer.state["two"]
    sides = viewer.page.evaluate(SIDES)
    assert [hand["displacement"][2] for hand in two["hands"]] == pytest.approx([moved[s] for s in sides], abs=1e-4)
    forces = exact(touch, two["hands"])
    for found, force in zip((two["force"], two["second"]), forces, strict=True):
        assert found == pytest.approx(force.tolist(), abs=1e-4 * np.linalg.norm(force))
    signs = [words.split(" N · ") for words, _ in viewer.page.evaluate(SIGNS)]
    assert [worth for _, worth in signs] == ["settled", "settled"]
    sizes = [np.linalg.norm(force) for force in forces]
    assert [float(force) for force, _ in signs] == pytest.approx(sizes, rel=0.01)  # three digits are written
    for side in held:
        pull(viewer, 0, side)
    viewer.page.wait_for_function("() => viscera.state().two === null")
    assert viewer.complaints == []
    viewer.close()
