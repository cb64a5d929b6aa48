"""A headset without a headset: Meta's WebXR emulator stands in. Triggers take hold of the organ, squeezes move it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.cases.case import Case
from viscera.viewer import Server, serve_live

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

EMULATOR = Path(__file__).resolve().parents[2] / "viewer" / "node_modules" / "iwer" / "build" / "iwer.min.js"
# A Quest 3 whose controllers a test moves; the emulated headset replaces the browser's own.
HEADSET = """
window.headset = new IWER.XRDevice(IWER.metaQuest3);
window.headset.installRuntime({ forceInstall: true });
"""
# Puts a controller at a place of the room and turns its beam, which leaves along -z, to another.
POINT = """([side, from, to]) => {
    const { position, quaternion } = window.headset.controllers[side];
    position.set(...from);
    const d = to.map((x, i) => x - from[i]);
    const size = Math.hypot(...d);
    const [x, y, z] = d.map((c) => c / size);
    // The shortest turn from (0, 0, -1) to (x, y, z).
    const q = [y, -x, 0, 1 - z], length = Math.hypot(...q);
    quaternion.set(...q.map((c) => c / length));
}"""
# What the motors of the controllers are told, from now on.
FEEL = """() => {
    window.pulses = [];
    for (const side of ["left", "right"]) {
        const [motor] = window.headset.controllers[side].inputSource.gamepad.hapticActuators;
        motor.pulse = async (strength, milliseconds) => window.pulses.push([side, strength, milliseconds]);
    }
}"""
# The signs that are seen.
SIGNS = """() => viscera.stage.scene.children.filter(({ isSprite, visible }) => isSprite && visible)
    .map(({ name, position }) => [name, position.toArray()])"""
# Where a point of the organ [m] is in the room.
IN_ROOM = """(point) => {
    const { world } = window.viscera.stage;
    world.updateWorldMatrix(true, false);
    const e = world.matrixWorld.elements;
    return [0, 1, 2].map((i) => e[i] * point[0] + e[4 + i] * point[1] + e[8 + i] * point[2] + e[12 + i]);
}"""
# Left or right, by the number that three.js gives a controller.
SIDES = """() => Array.from(viscera.stage.renderer.xr.getSession().inputSources, ({ handedness }) => handedness)"""
# The stepper has answered all that was asked, and stands still.
SETTLED = """() => {
    const { isWaiting, hasWishes } = viscera.conversation;
    return !isWaiting && !hasWishes && viscera.state().specimens[0].isSettled;
}"""
TOP = (0.3, 0.05, 0.1)
UP = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def viewer(browser: Any, look_at: Callable[..., Viewer], server: Server) -> Iterator[Viewer]:
    if not EMULATOR.exists():
        pytest.skip("no WebXR emulator here; `npm --prefix viewer ci` brings it")
    opened = look_at(server.url, scripts=[EMULATOR.read_text(encoding="utf-8"), HEADSET])
    yield opened
    assert opened.complaints == []
    opened.close()


def pull(viewer: Viewer, value: float, side: str = "right", button: str = "trigger") -> None:
    """Pull a button of a controller and let some frames pass."""
    press = "([side, button, value]) => window.headset.controllers[side].updateButtonValue(button, value)"
    viewer.page.evaluate(press, [side, button, value])
    frames(viewer)


def point(viewer: Viewer, start: Any, end: Any, side: str = "right") -> None:
    """Put a controller at a place of the room, its beam towards another."""
    viewer.page.evaluate(POINT, [side, np.asarray(start, float).tolist(), np.asarray(end, float).tolist()])
    frames(viewer)


def in_room(viewer: Viewer, place: Any) -> Any:
    """Where a point of the organ [m] is in the room."""
    return np.array(viewer.page.evaluate(IN_ROOM, list(place)))


def frames(viewer: Viewer, count: int = 4) -> None:
    viewer.page.evaluate(
        """async (count) => {
            const session = window.viscera.stage.renderer.xr.getSession();
            for (let k = 0; k < count; k++) await new Promise((next) => session.requestAnimationFrame(next));
        }""",
        count,
    )


def put_on(viewer: Viewer) -> None:
    # The emulator draws every frame of the headset in the window: a small one is drawn sooner in software.
    viewer.page.set_viewport_size({"width": 640, "height": 420})
    # Once taken off, the emulator leaves its canvas above the button, out of reach of a pointer.
    viewer.page.get_by_role("button", name="VR").dispatch_event("click")
    viewer.page.wait_for_function("() => window.viscera.stage.renderer.xr.isPresenting")
    frames(viewer)
    viewer.page.evaluate(FEEL)


@pytest.fixture
def headset(viewer: Viewer) -> Iterator[Viewer]:
    """The page with its headset on."""
    put_on(viewer)
    yield viewer
    viewer.page.evaluate("() => window.viscera.stage.renderer.xr.getSession().end()")
    viewer.page.wait_for_function("() => !window.viscera.stage.renderer.xr.isPresenting")


def test_a_trigger_takes_hold_of_the_organ(headset: Viewer, touch: vs.Touch) -> None:
    viewer, page = headset, headset.page
    target = in_room(viewer, TOP)
    # The organ's z is up in the room: from above, 20 cm over the surface.
    above = target + 0.2 * UP
    point(viewer, above, target)
    pull(viewer, 1)
    assert viewer.state["activity"] == "held"
    assert np.linalg.norm(np.subtract(viewer.state["point"], TOP)) < 2e-3
    assert page.evaluate("() => window.pulses") == [["right", 0.5, 30]]
    # Down in the room by what is 1 cm of the organ, which hangs there 0.6 m large.
    down = 0.01 * 0.6 / touch.metadata["diagonal"] * UP
    point(viewer, above - down, target - down)
    state = viewer.state
    assert state["displacement"] == pytest.approx([0.0, 0.0, -0.01], abs=1e-4)
    place, push = state["point"], state["displacement"]
    full = touch.surface_displacement(place, push)
    assert np.allclose(np.reshape(state["field"], (-1, 3)), full, atol=1e-5 * np.abs(full).max())
    assert state["force"] == pytest.approx(touch(place, push).force, rel=1e-5, abs=1e-6)
    # The force stands beside the organ, with what it is worth.
    [[words, at]] = page.evaluate(SIGNS)
    assert words == f"{np.linalg.norm(state['force']):.2f} N · trusted"
    assert np.linalg.norm(at - target) < 0.5
    pull(viewer, 0)
    page.wait_for_function("() => window.viscera.state().activity === 'rest'")
    assert page.evaluate(SIGNS) == []


def test_a_force_that_is_not_trusted_is_felt(headset: Viewer, touch: vs.Touch) -> None:
    viewer, page = headset, headset.page
    target = in_room(viewer, TOP)
    above = target + 0.2 * UP
    point(viewer, above, target)
    pull(viewer, 1)
    down = 1.2 * touch.depth * 0.6 / touch.metadata["diagonal"] * UP  # deeper than the model is made for
    point(viewer, above - down, target - down)
    [[words, _]] = page.evaluate(SIGNS)
    assert words.endswith(" N · not trusted")
    assert page.evaluate("() => window.pulses") == [["right", 0.5, 30], ["right", 1, 120]]
    pull(viewer, 0)


def test_two_squeezing_hands_turn_and_scale_the_organ(headset: Viewer) -> None:
    viewer = headset
    point(viewer, (-0.2, 1.2, -0.3), (-0.2, 1.2, -1), "left")
    point(viewer, (0.2, 1.2, -0.3), (0.2, 1.2, -1))
    corners = [(0.0, 0.0, 0.0), (0.4, 0.0, 0.0), (0.0, 0.1, 0.0)]
    before = np.array([in_room(viewer, corner) for corner in corners])
    pull(viewer, 1, "left", "squeeze")
    pull(viewer, 1, "right", "squeeze")
    # A quarter of a turn about the upright axis, twice as far apart, 10 cm higher.
    point(viewer, (0.0, 1.3, -0.7), (0, 1.3, -1), "left")
    point(viewer, (0.0, 1.3, 0.1), (0, 1.3, -1))
    middle, quarter = np.array([0.0, 1.2, -0.3]), np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # x to z, z to -x
    expected = 2 * (before - middle) @ quarter + middle + (0, 0.1, 0)
    after = np.array([in_room(viewer, corner) for corner in corners])
    assert after == pytest.approx(expected, abs=1e-5)
    pull(viewer, 0, "right", "squeeze")
    # The left hand alone takes it along.
    point(viewer, (0.1, 1.3, -0.7), (0.1, 1.3, -1), "left")
    assert in_room(viewer, corners[0]) == pytest.approx(after[0] + (0.1, 0, 0), abs=1e-5)
    pull(viewer, 0, "left", "squeeze")
    point(viewer, (0.4, 1.0, -0.7), (0.4, 1.0, -1), "left")
    assert in_room(viewer, corners[0]) == pytest.approx(after[0] + (0.1, 0, 0), abs=1e-5)


def test_a_trigger_beside_the_organ_holds_nothing(headset: Viewer) -> None:
    point(headset, (0, 1.5, 0), (0, 5, 0.5))
    pull(headset, 1)
    assert headset.state["activity"] == "rest"
    assert headset.page.evaluate("() => window.pulses") == []
    pull(headset, 0)


def test_without_the_headset_the_mouse_works_as_before(viewer: Viewer) -> None:
    x, y = viewer.place(TOP)
    viewer.page.mouse.move(x, y)
    viewer.page.mouse.down()
    assert viewer.state["activity"] == "held"
    viewer.page.mouse.up()


def test_two_controllers_hold_a_stepped_organ_at_once(
    look_at: Callable[..., Viewer], server: Server, bar: vs.Mesh, tmp_path: Path
) -> None:
    if not EMULATOR.exists():
        pytest.skip("no WebXR emulator here; `npm --prefix viewer ci` brings it")
    bar.write(tmp_path / "bar.vtu")
    material = {"law": "NeoHookean", "young": 1e5, "poisson": 0.45}
    case = Case(mesh=str(tmp_path / "bar.vtu"), units="m", fixed="root", material=material)
    with serve_live(case, "Bar", in_page=True) as running:
        viewer = look_at(running.url, scripts=[EMULATOR.read_text(encoding="utf-8"), HEADSET])
        put_on(viewer)
        diagonal = viewer.page.evaluate("() => viscera.surface.diagonal")
        held = {"left": (0.2, 0.05, 0.1), "right": (0.35, 0.05, 0.1)}
        moved = {"left": 0.004, "right": -0.008}  # along the organ's z, which is up in the room
        for side, place in held.items():
            target = in_room(viewer, place)
            point(viewer, target + 0.2 * UP, target, side)
            pull(viewer, 1, side)
        for side, height in moved.items():
            at = in_room(viewer, held[side]) + height * 0.6 / diagonal * UP
            point(viewer, at + 0.2 * UP, at, side)
        hands = viewer.state["hands"]
        assert [hand["displacement"][2] for hand in hands] == pytest.approx(
            [moved[side] for side in viewer.page.evaluate(SIDES)], abs=1e-4
        )
        viewer.page.wait_for_function(SETTLED)
        frames(viewer)
        facts = viewer.state["specimens"][0]
        signs = [words.split(" N · ") for words, _ in viewer.page.evaluate(SIGNS)]
        assert [worth for _, worth in signs] == ["settled", "settled"]
        sizes = [np.linalg.norm(facts[hand]) for hand in ("force", "second")]
        assert [float(force) for force, _ in signs] == pytest.approx(sizes, rel=0.01)  # three digits are written
        assert len(viewer.page.evaluate("() => window.pulses")) == 2
        assert viewer.complaints == []
        viewer.close()
