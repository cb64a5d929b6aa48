"""Other screens and other ways to get the page: a telephone, the dark, a static server, a damaged model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.viewer import Server, export, page, serve
from viscera.viewer.surface import surface_model

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
    assert "of the full model" in viewer.page.locator("header p").inner_text()
    viewer.shoot("dark")
    assert viewer.complaints == []
    viewer.close()


def test_the_page_of_a_coarse_shape_trusts_the_force(look_at: Look, server: Server, touch: vs.Touch) -> None:
    """Few modes: force and its trust are those of the model; of the shape the page says that it is doubtful."""
    coarse, push = touch.compressed(0.2), (0.0, 0.002, -0.004)
    answer = coarse(TOP, push)
    assert answer.is_trusted
    assert not answer.is_shape_trusted
    with serve(coarse, "Bar") as running:
        viewer = look_at(running.url)
        viewer.call("touch", TOP, push)
        state = viewer.state
        assert (state["is_trusted"], state["is_shape_trusted"]) == (True, False)
        assert state["error_estimate"] == pytest.approx(touch(TOP, push).error_estimate, rel=1e-5)
        assert state["shape_error_estimate"] == pytest.approx(answer.shape_error_estimate, rel=1e-5)
        warning = viewer.page.locator(".warning.is-shown").inner_text()
        assert warning.startswith("The force is trusted, the shape is not: its estimated error is ")
        assert viewer.page.locator(".is-doubtful").count() == 0
        viewer.close()


@pytest.mark.parametrize("place", [0, 3, 2000, -1])
def test_a_flipped_bit_of_a_model_is_a_sentence(browser: Any, server: Server, touch: vs.Touch, place: int) -> None:
    data = bytearray(surface_model(touch, "Bar"))
    data[place] ^= 1
    with Server({**page.files(), page.MODEL: bytes(data)}) as damaged:
        tab = browser.new_page()
        tab.goto(damaged.url)
        tab.get_by_text("The organ cannot be shown: not a usable model file").wait_for()
        tab.close()


def test_a_damaged_model_is_a_sentence(browser: Any, server: Server) -> None:
    with Server({**page.files(), page.MODEL: b"not a model"}) as damaged:
        tab = browser.new_page()
        tab.goto(damaged.url)
        words = tab.get_by_text("The organ cannot be shown: not a usable model file")
        words.wait_for()
        tab.close()


def test_a_slow_network_is_a_line(browser: Any, server: Server) -> None:
    """Until the viewer itself has come; the line goes when it has."""
    tab = browser.new_page()
    line = tab.get_by_text("Loading the page")
    seen = []

    def late(route: Any) -> None:
        seen.append(line.is_visible())
        route.continue_()

    tab.route("**/viewer.js", late)
    tab.goto(server.url)
    tab.wait_for_function("() => window.viscera")
    assert seen == [True]
    assert line.count() == 0
    tab.close()
