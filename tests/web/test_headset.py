"""A headset without a headset: Meta's WebXR emulator stands in, and a controller's trigger takes hold of the organ."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.viewer import Server

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

EMULATOR = Path(__file__).resolve().parents[2] / "viewer" / "node_modules" / "iwer" / "build" / "iwer.min.js"
# A Quest 3 whose controllers a test moves; the emulated headset replaces the browser's own.
HEADSET = """
window.headset = new IWER.XRDevice(IWER.metaQuest3);
window.headset.installRuntime({ forceInstall: true });
"""
# Puts the right controller at a place of the room and turns its beam, which leaves along -z, to another.
POINT = """([from, to]) => {
    const { position, quaternion } = window.headset.controllers.right;
    position.set(...from);
    const d = to.map((x, i) => x - from[i]);
    const size = Math.hypot(...d);
    const [x, y, z] = d.map((c) => c / size);
    // The shortest turn from (0, 0, -1) to (x, y, z).
    const q = [y, -x, 0, 1 - z], length = Math.hypot(...q);
    quaternion.set(...q.map((c) => c / length));
}"""
# Where a point of the organ [m] is in the room.
IN_ROOM = """(point) => {
    const { world } = window.viscera.stage;
    world.updateWorldMatrix(true, false);
    const e = world.matrixWorld.elements;
    return [0, 1, 2].map((i) => e[i] * point[0] + e[4 + i] * point[1] + e[8 + i] * point[2] + e[12 + i]);
}"""
TOP = (0.3, 0.05, 0.1)


@pytest.fixture(scope="module")
def viewer(browser: Any, look_at: Callable[..., Viewer], server: Server) -> Iterator[Viewer]:
    if not EMULATOR.exists():
        pytest.skip("no WebXR emulator here; `npm --prefix viewer ci` brings it")
    opened = look_at(server.url, scripts=[EMULATOR.read_text(encoding="utf-8"), HEADSET])
    yield opened
    assert opened.complaints == []
    opened.close()


def pull(viewer: Viewer, trigger: float) -> None:
    """Pull the right trigger and let some frames pass."""
    viewer.page.evaluate("(value) => window.headset.controllers.right.updateButtonValue('trigger', value)", trigger)
    frames(viewer)


def frames(viewer: Viewer, count: int = 4) -> None:
    viewer.page.evaluate(
        """async (count) => {
            const session = window.viscera.stage.renderer.xr.getSession();
            for (let k = 0; k < count; k++) await new Promise((next) => session.requestAnimationFrame(next));
        }""",
        count,
    )


@pytest.fixture
def headset(viewer: Viewer) -> Iterator[Viewer]:
    """The page with its headset on."""
    # Once taken off, the emulator leaves its canvas above the button, out of reach of a pointer.
    viewer.page.get_by_role("button", name="VR").dispatch_event("click")
    viewer.page.wait_for_function("() => window.viscera.stage.renderer.xr.isPresenting")
    yield viewer
    viewer.page.evaluate("() => window.viscera.stage.renderer.xr.getSession().end()")
    viewer.page.wait_for_function("() => !window.viscera.stage.renderer.xr.isPresenting")


def test_a_trigger_takes_hold_of_the_organ(headset: Viewer, touch: vs.Touch) -> None:
    viewer, page = headset, headset.page
    target = page.evaluate(IN_ROOM, list(TOP))
    # The organ's z is up in the room: from above, 20 cm over the surface.
    above = [target[0], target[1] + 0.2, target[2]]
    page.evaluate(POINT, [above, target])
    frames(viewer)
    pull(viewer, 1)
    assert viewer.state["activity"] == "held"
    assert np.linalg.norm(np.subtract(viewer.state["point"], TOP)) < 2e-3
    # Down in the room by what is 1 cm of the organ, which hangs there 0.6 m large.
    down = 0.01 * 0.6 / touch.metadata["diagonal"]
    page.evaluate(POINT, [np.subtract(above, (0, down, 0)).tolist(), np.subtract(target, (0, down, 0)).tolist()])
    frames(viewer)
    state = viewer.state
    assert state["displacement"] == pytest.approx([0.0, 0.0, -0.01], abs=1e-4)
    point, push = state["point"], state["displacement"]
    full = touch.surface_displacement(point, push)
    assert np.allclose(np.reshape(state["field"], (-1, 3)), full, atol=1e-5 * np.abs(full).max())
    assert state["force"] == pytest.approx(touch(point, push).force, rel=1e-5, abs=1e-6)
    pull(viewer, 0)
    page.wait_for_function("() => window.viscera.state().activity === 'rest'")


def test_a_trigger_beside_the_organ_holds_nothing(headset: Viewer) -> None:
    headset.page.evaluate(POINT, [[0, 1.5, 0], [0, 5, 0.5]])
    frames(headset)
    pull(headset, 1)
    assert headset.state["activity"] == "rest"
    pull(headset, 0)


def test_without_the_headset_the_mouse_works_as_before(viewer: Viewer) -> None:
    x, y = viewer.place(TOP)
    viewer.page.mouse.move(x, y)
    viewer.page.mouse.down()
    assert viewer.state["activity"] == "held"
    viewer.page.mouse.up()
