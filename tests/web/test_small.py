"""Small windows: short telephones, a page at 200 % and 400 % zoom. What is said stays in sight or within a scroll."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import pytest

from viscera.viewer import Server

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

TOP = (0.3, 0.05, 0.1)
SIZES = [(360, 520), (320, 480), (240, 480), (320, 256), (667, 320), (640, 400), (480, 360)]
# A panel that has come waits for the next frame, in which the organ is fitted; the one after it draws that.
FRAMES = """() => new Promise((done) => {
    const after = (frames) => requestAnimationFrame(() => (frames > 0 ? after(frames - 1) : done()));
    after(3);
})"""
BOXES = """() => {
    const { root } = viscera.plan;
    const names = ["header", "header p", ".clearing", ".legend:not([hidden])", ".readings", ".tools"];
    return Object.fromEntries(names.map((name) => {
        const { left, top, right, bottom } = root.querySelector(name).getBoundingClientRect();
        return [name, [left, top, right, bottom]];
    }));
}"""
# Panels that a pointer goes through are found, too.
ON_TOP = """() => {
    const { root } = viscera.plan;
    const warning = root.querySelector(".warning");
    warning.style.pointerEvents = "auto";
    const { left, top, width, height } = warning.getBoundingClientRect();
    const parts = [0.1, 0.3, 0.5, 0.7, 0.9];
    const found = parts.flatMap((x) => parts.map((y) => {
        const [across, down] = [left + x * width, top + y * height];
        return root.getRootNode().elementFromPoint(across, down) === warning;
    }));
    warning.style.pointerEvents = "";
    return found.every(Boolean);
}"""


@pytest.fixture(scope="module")
def small(look_at: Callable[..., Viewer], server: Server) -> Iterator[Viewer]:
    """A touch that is not trusted, in colour."""
    viewer = look_at(server.url, reduced_motion="reduce")
    viewer.call("setColouring", "displacement")
    viewer.call("touch", TOP, (0.0, 0.0, -0.028))
    yield viewer
    assert viewer.complaints == []
    viewer.close()


def resize(viewer: Viewer, width: int, height: int) -> dict[str, list[float]]:
    """Left, top, right and bottom of the panels in a window of this size [px]."""
    viewer.page.set_viewport_size({"width": width, "height": height})
    viewer.page.wait_for_function("([w, h]) => innerWidth === w && innerHeight === h", arg=[width, height])
    viewer.page.evaluate(FRAMES)
    boxes: dict[str, list[float]] = viewer.page.evaluate(BOXES)
    return boxes


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_panels_stay_in_the_window_and_leave_room(small: Viewer, width: int, height: int) -> None:
    boxes = resize(small, width, height)
    for name, (left, top, right, bottom) in boxes.items():
        inside = (0 <= left < right <= width) and (0 <= top < bottom <= height)
        assert inside, f"{name} at {left, top, right, bottom}"
    below = boxes["header"][3]
    for name in (".clearing", ".legend:not([hidden])", ".tools"):
        assert boxes[name][1] >= below, f"{name} lies over what is above it"
        below = boxes[name][3]
    left, top, right, bottom = boxes[".clearing"]
    assert bottom - top >= 0.19 * height
    x, y = small.place(small.page.evaluate("() => viscera.middle"))
    assert left < x < right
    assert top < y < bottom


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_what_is_said_of_trust_is_not_covered(small: Viewer, width: int, height: int) -> None:
    resize(small, width, height)
    assert "Not trusted" in small.page.locator(".warning.is-shown").inner_text()
    assert small.page.evaluate(ON_TOP)


@pytest.mark.parametrize(("width", "height"), [(640, 400), (320, 256)])
def test_the_line_and_the_stiffness_stay_within_reach(small: Viewer, width: int, height: int) -> None:
    boxes = resize(small, width, height)
    line = small.page.locator("header p")
    assert boxes["header p"][3] - boxes["header p"][1] >= 15
    assert line.get_attribute("title") == line.inner_text()
    slider = small.page.get_by_label("stiffness", exact=True)
    slider.scroll_into_view_if_needed()
    box, (left, top, right, bottom) = slider.bounding_box(), boxes[".tools"]
    assert box is not None
    assert left <= box["x"] < box["x"] + box["width"] <= right
    assert top <= box["y"] < box["y"] + box["height"] <= bottom
    slider.press("ArrowRight")
    assert small.state["stiffness_factor"] == pytest.approx(2**0.1)
    slider.press("ArrowLeft")


def test_no_scale_where_nothing_is_seen(small: Viewer) -> None:
    """A frame of another page may be lower than its panels."""
    resize(small, 500, 130)
    assert not small.page.locator(".gauge").is_visible()
    resize(small, 640, 400)
    assert small.page.locator(".gauge").is_visible()
    bar = small.page.evaluate("() => Number(viscera.display.gauge.bar.dataset.metres)")
    assert 0 < bar < 3 * small.page.evaluate("() => viscera.stage.diagonal")
