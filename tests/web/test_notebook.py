"""`touch.view()`: what the notebook gets, and that the widget's module shows it in a browser."""

from __future__ import annotations

import base64
import sys
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.touch import load_bytes
from viscera.viewer import Server

TOP = (0.3, 0.05, 0.1)
# A notebook's front end, reduced to what anywidget asks of it.
NOTEBOOK = """<!doctype html><title>notebook</title><div id="cell"></div><script type="module">
import widget from "./viewer.js";
const bytes = Uint8Array.from(atob("%s"), (c) => c.charCodeAt(0));
const model = { get: (name) => ({ model: new DataView(bytes.buffer), height: 420 })[name] };
window.ready = widget.render({ model, el: document.getElementById("cell") });
</script>"""


def test_the_widget_carries_the_model(touch: vs.Touch, server: Server) -> None:
    pytest.importorskip("anywidget")
    widget = touch.view("Bar", height=420)
    assert widget.height == 420
    carried = load_bytes(widget.model)
    assert carried.metadata["user"]["name"] == "Bar"
    push = (0.0, 1e-3, -8e-3)
    assert np.array_equal(carried(TOP, push).force, touch(TOP, push).force)
    assert np.array_equal(carried.surface_displacement(TOP, push), touch.surface_displacement(TOP, push))
    state = widget.get_state()
    assert state["model"] == widget.model
    assert "render" in state["_esm"]


def test_the_widget_shows_in_a_browser(browser: Any, touch: vs.Touch, server: Server) -> None:
    pytest.importorskip("anywidget")
    widget = touch.view("Bar", height=420)
    page = NOTEBOOK % base64.b64encode(widget.model).decode()
    files = {"index.html": page.encode(), "viewer.js": widget._esm.encode()}
    with Server(files) as notebook:
        context = browser.new_context(bypass_csp=True)  # the cell above is a script in the page
        tab = context.new_page()
        complaints: list[str] = []
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.goto(notebook.url)
        canvas = tab.locator(".view canvas.stage")
        canvas.wait_for()
        assert canvas.bounding_box()["height"] == 420
        assert tab.locator("h1").inner_text() == "Bar"
        dispose = tab.evaluate("async () => { (await window.ready)(); return document.querySelector('#cell div div') }")
        assert dispose is None
        assert complaints == []
        context.close()


def test_without_anywidget_it_is_a_sentence(touch: vs.Touch, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(vs.VisceraError, match="pip install 'viscera\\[notebook\\]'"):
        touch.view()
