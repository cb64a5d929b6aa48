"""Other screens and other ways to get the page: a telephone, the dark, a static server, a damaged model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import viscera as vs
from viscera.viewer import Server, export, page

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]
    Offer = Callable[[Path], str]

TOP = (0.3, 0.05, 0.1)


def test_a_finger_on_a_small_screen(look_at: Look, server: Server, touch: vs.Touch) -> None:
    size = {"width": 390, "height": 780}
    viewer = look_at(server.url, viewport=size, has_touch=True, is_mobile=True, color_scheme="dark")
    x, y = viewer.place(TOP)
    cdp = viewer.page.context.new_cdp_session(viewer.page)

    def finger(kind: str, *points: dict[str, float]) -> None:
        cdp.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": list(points)})

    finger("touchStart", {"x": x, "y": y})
    for step in range(1, 6):
        finger("touchMove", {"x": x, "y": y + 4 * step})
    held = viewer.state
    viewer.shoot("telephone")
    finger("touchEnd")
    assert held["activity"] == "held"
    full = touch.surface_displacement(held["point"], held["displacement"])
    assert np.allclose(np.reshape(held["field"], (-1, 3)), full, atol=1e-5 * np.abs(full).max())
    wide = viewer.page.evaluate("() => document.documentElement.scrollWidth")
    assert wide <= size["width"]
    assert viewer.complaints == []
    viewer.close()


def test_the_exported_page_works_from_any_server(
    look_at: Look, file_server: Offer, server: Server, touch: vs.Touch, tmp_path: Path
) -> None:
    export(touch, tmp_path, "Bar")
    viewer = look_at(file_server(tmp_path), color_scheme="dark")
    web = vs.load(tmp_path / "organ.viscera")
    push = (0.0, 0.002, -0.01)
    viewer.call("touch", TOP, push)
    state = viewer.state
    expected = web.surface_displacement(state["point"], push)
    assert np.allclose(np.reshape(state["field"], (-1, 3)), expected, atol=1e-5 * np.abs(expected).max())
    assert np.allclose(state["force"], touch(TOP, push).force, rtol=1e-5)
    assert "from the full model" in viewer.page.locator("header p").inner_text()
    viewer.shoot("dark")
    assert viewer.complaints == []
    viewer.close()


def test_a_damaged_model_is_a_sentence(browser: Any, server: Server) -> None:
    with Server({**page.files(), page.MODEL: b"not a model"}) as damaged:
        tab = browser.new_page()
        tab.goto(damaged.url)
        words = tab.get_by_text("The organ cannot be shown: not a usable model file")
        words.wait_for()
        tab.close()
