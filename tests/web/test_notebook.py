"""`touch.view()`: what the notebook gets, and that the widget's module shows it in a browser and converses with Python."""

from __future__ import annotations

import base64
import sys
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.touch import load_bytes
from viscera.viewer import Server

expect = pytest.importorskip("playwright.sync_api").expect

TOP = (0.3, 0.05, 0.1)
# A notebook's front end, reduced to what anywidget asks of it.
NOTEBOOK = """<!doctype html><title>notebook</title><div id="cell"></div><script type="module">
import widget from "./viewer.js";
const bytes = Uint8Array.from(atob("%s"), (c) => c.charCodeAt(0));
const model = { get: (name) => ({ model: new DataView(bytes.buffer), height: 420 })[name] };
window.ready = widget.render({ model, el: document.getElementById("cell") });
</script>"""


# The same with traits that go both ways, as a kernel would hold them.
CONVERSATION = """<!doctype html><title>notebook</title><img data-viscera="%s"><div id="cell"></div>
<script type="module">
import widget from "./viewer.js";
const bytes = Uint8Array.from(atob("%s"), (c) => c.charCodeAt(0));
const traits = { model: new DataView(bytes.buffer), height: 420, picture: "%s", asked: { number: 0 } };
const listeners = {};
window.saved = [];
window.traits = traits;
const told = (name) => (listeners[`change:${name}`] ?? []).forEach((listen) => listen());
window.fromPython = (state) => Object.entries(state).forEach(([name, value]) => ((traits[name] = value), told(name)));
const model = {
    get: (name) => traits[name],
    set: (name, value) => (traits[name] = value),
    save_changes: () => window.saved.push(structuredClone({ ...traits, model: null })),
    on: (name, listen) => (listeners[name] ??= []).push(listen),
    off: () => {},
};
window.remove = await widget.render({ model, el: document.getElementById("cell") });
</script>"""
PUSH = (0.0, 1e-3, -8e-3)


def test_python_touches_and_observes(touch: vs.Touch, server: Server) -> None:
    pytest.importorskip("anywidget")
    widget = touch.view("Bar")
    assert widget.force is None
    heard: list[tuple[Any, Any]] = []
    widget.observe(lambda change: heard.append((change.new, widget.displacement)), "force")
    widget.touch(TOP, "(0, 1, -8) mm")
    answer = touch(TOP, PUSH)
    assert heard == [(answer.force.tolist(), pytest.approx(PUSH))]
    assert widget.point == answer.contact_point.tolist()
    assert widget.is_trusted == answer.is_trusted
    widget.release()
    assert (widget.force, widget.point, widget.is_trusted) == (None, None, None)
    assert heard[-1] == (None, None)
    with pytest.raises(vs.VisceraError, match="is not a point"):
        widget.touch(TOP, "8 parsec")
    assert widget.force is None


def test_a_saved_notebook_keeps_a_picture(touch: vs.Touch, server: Server) -> None:
    pytest.importorskip("anywidget")
    from IPython.core.interactiveshell import InteractiveShell
    from IPython.utils.capture import capture_output

    widget = touch.view("Bar")
    InteractiveShell.instance()
    try:
        with capture_output() as shown:
            widget._ipython_display_()
    finally:
        InteractiveShell.clear_instance()
    picture, view = shown.outputs
    assert f'<img data-viscera="{widget.picture}"' in picture.data["text/html"]
    assert base64.b64decode(picture.data["text/html"].split("base64,")[1].split('"')[0]).startswith(b"\x89PNG")
    assert view.data["application/vnd.jupyter.widget-view+json"]["model_id"] == widget.model_id


def test_a_touch_from_python_moves_the_organ_and_a_hand_is_told(browser: Any, touch: vs.Touch, server: Server) -> None:
    pytest.importorskip("anywidget")
    widget = touch.view("Bar", height=420)
    page = CONVERSATION % (widget.picture, base64.b64encode(widget.model).decode(), widget.picture)
    with Server({"index.html": page.encode(), "viewer.js": widget._esm.encode()}) as notebook:
        context = browser.new_context(bypass_csp=True, viewport={"width": 760, "height": 560})
        tab = context.new_page()
        tab.set_default_timeout(60_000)
        tab.goto(notebook.url)
        tab.wait_for_function("() => window.remove")
        display = "() => getComputedStyle(document.querySelector('img')).display"
        assert tab.evaluate(display) == "none"
        widget.touch(TOP, PUSH)
        tab.evaluate("(state) => window.fromPython(state)", {"asked": widget.asked, "force": widget.force})
        force = tab.locator(".view .force")
        expect(force).to_have_text(f"{np.linalg.norm(widget.force):.2f}")
        box = tab.locator(".view canvas.stage").bounding_box()
        assert box["height"] == 420
        widget.release()
        tab.evaluate("(state) => window.fromPython(state)", {"asked": widget.asked})
        expect(force).to_have_text("0.00")
        assert tab.evaluate("() => window.saved") == []  # what Python asked for is not told to it again
        # A hand: found where the page says that one may press.
        tab.locator(".view canvas.stage").focus()
        tab.keyboard.press("Enter")
        tab.wait_for_function("() => window.saved.length > 0 && window.saved.at(-1).force")
        told = tab.evaluate("() => window.saved.at(-1)")
        answer = touch(told["point"], told["displacement"])
        assert told["force"] == pytest.approx(answer.force.tolist(), rel=1e-5, abs=1e-6)
        assert told["is_trusted"] == answer.is_trusted
        tab.keyboard.press("Escape")
        tab.wait_for_function("() => window.saved.at(-1).force === null")
        tab.evaluate("() => window.remove()")
        assert tab.evaluate(display) != "none"
        context.close()


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
