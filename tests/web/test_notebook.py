"""`touch.view()`: what the notebook gets; the widget's module shows it in a browser and converses with Python."""

from __future__ import annotations

import base64
import json
import sys
from typing import Any

import numpy as np
import pytest
from tests.web.notebook import answered, opened

import viscera as vs
from viscera.reduced.touch import load_bytes
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
    with opened(browser, widget) as tab:
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


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")


def numbers(widget: Any, **request: Any) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Facts of the frame that a widget answers, and what follows them."""
    frame = np.frombuffer(widget._played.reply(json.dumps(request)), "<f4")
    return frame[1:15], frame[15:]


def test_a_stepper_is_driven_from_python_and_from_the_page(organ: vs.Organ, server: Server) -> None:
    pytest.importorskip("anywidget")
    stepper = organ.stepper(iterations=10)
    widget = stepper.view("Bar")
    heard: list[Any] = []
    widget.observe(lambda change: heard.append(change.new), "force")
    widget.touch(TOP, PUSH)
    patch = organ.patch(TOP, 0.1 * organ.mesh.diagonal)
    exact = organ.solve(displacement={patch: PUSH})
    force = exact.reaction(patch)
    assert heard[0] == pytest.approx(force.tolist(), abs=1e-3 * np.linalg.norm(force))
    nodes = organ.mesh.surface_nodes
    facts, field = numbers(widget, stress=True)
    assert field[: 3 * len(nodes)] == pytest.approx(exact.displacement[nodes].ravel(), abs=1e-6)
    assert field[3 * len(nodes) :] == pytest.approx(exact.von_mises("nodes")[nodes], rel=1e-2)
    # A second hand, from the page.
    other, pull = (0.4, 0.05, 0.0), (0.0, 0.005, 0.002)
    numbers(widget, second={"grab": other, "move": pull})
    facts, _ = numbers(widget)
    second = organ.patch(other, 0.1 * organ.mesh.diagonal)
    both = organ.solve(displacement={patch: PUSH, second: pull})
    assert facts[:3] == pytest.approx(both.reaction(patch), rel=1e-3, abs=1e-4)
    assert facts[11:] == pytest.approx(both.reaction(second), rel=1e-3, abs=1e-4)
    widget.release()
    numbers(widget, second={"release": True})
    facts, field = numbers(widget)
    assert not facts[:3].any()
    assert np.abs(field[: 3 * len(nodes)]).max() < 1e-5
    assert "error" in json.loads(widget._played.reply('{"grab": [9, 9, 9]}'))


def test_a_state_is_looked_at(organ: vs.Organ, server: Server) -> None:
    pytest.importorskip("anywidget")
    state = organ.solve(force={"tip": (0, 0, -20.0)})
    widget = state.view("Bar")
    assert json.loads(widget._played.reply(""))["is_still"]
    nodes = organ.mesh.surface_nodes
    _, field = numbers(widget, stress=True)
    expected = np.concatenate([state.displacement[nodes].ravel(), state.von_mises("nodes")[nodes]])
    assert field == pytest.approx(expected, rel=1e-6, abs=1e-9)
    with pytest.raises(vs.VisceraError, match="stepper"):
        widget.touch(TOP, PUSH)


def test_a_solved_state_offers_nothing_to_hold_it_by(browser: Any, organ: vs.Organ, server: Server) -> None:
    pytest.importorskip("anywidget")
    widget = organ.solve(force={"tip": (0, 0, -20.0)}).view("Solved")
    with answered(browser, widget, height=560) as tab:
        tools = tab.locator(".tools")
        expect(tools.get_by_role("button", name="Wireframe")).to_be_visible()
        for name in ("Push", "Drag", "Probe"):
            expect(tools.get_by_text(name, exact=True)).to_be_hidden()
        tab.locator("canvas.stage").focus()
        tab.keyboard.press("?")
        expect(tab.locator(".help")).to_contain_text("Look at the organ")
        expect(tab.locator(".help")).not_to_contain_text("hold")


def test_a_state_from_a_scan_stands_where_it_is(organ: vs.Organ, server: Server) -> None:
    pytest.importorskip("anywidget")
    rest = organ.unloaded(gravity=(0, 0, -5.0), density=1000.0)
    turned = rest.from_scan(rest.organ.solve(gravity=(0, 5.0, 0), density=1000.0, start=rest.state))
    widget = turned.view("Bar")
    at_rest = np.reshape(json.loads(widget._played.reply(""))["rest"], (-1, 3))
    _, field = numbers(widget, stress=False)
    there = (turned.mesh.points + turned.displacement)[turned.mesh.surface_nodes]
    assert at_rest + field.reshape(-1, 3) == pytest.approx(there, abs=1e-6)


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


@pytest.mark.parametrize("height", ["tall", -5, 0, 3.5])
def test_a_height_that_is_none_is_a_sentence(touch: vs.Touch, server: Server, height: Any) -> None:
    pytest.importorskip("anywidget")
    with pytest.raises(vs.VisceraError, match="height must be a whole number from 1 to 10000, got"):
        touch.view(height=height)


def test_without_anywidget_it_is_a_sentence(touch: vs.Touch, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(vs.VisceraError, match="pip install 'viscera\\[notebook\\]'"):
        touch.view()
