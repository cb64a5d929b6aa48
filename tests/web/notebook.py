"""A notebook's front end, reduced to what anywidget asks of it; traits go both ways, as a kernel would hold them."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from viscera.viewer import Server

CONVERSATION = """<!doctype html><title>notebook</title><img data-viscera="%s"><div id="cell"></div>
<script type="module">
import widget from "./viewer.js";
const bytes = Uint8Array.from(atob("%s"), (c) => c.charCodeAt(0));
const traits = { model: new DataView(bytes.buffer), height: 420, picture: "%s", ...%s };
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
UNASKED: Mapping[str, Any] = {"asked": {"number": 0}}


@contextmanager
def opened(browser: Any, widget: Any, traits: Mapping[str, Any] = UNASKED) -> Iterator[Any]:
    """The page below a cell that shows a widget, when the widget is there; `traits` are those that it has by then."""
    model = base64.b64encode(widget.model).decode()
    page = CONVERSATION % (widget.picture, model, widget.picture, json.dumps(traits))
    with Server({"index.html": page.encode(), "viewer.js": widget._esm.encode()}) as notebook:
        context = browser.new_context(bypass_csp=True, viewport={"width": 760, "height": 560})
        tab = context.new_page()
        tab.set_default_timeout(60_000)
        tab.goto(notebook.url)
        tab.wait_for_function("() => window.remove")
        yield tab
        context.close()


ANSWERED = """<!doctype html><title>notebook</title>%s
<script type="module">
import widget from "./viewer.js";
const heard = {};
const traits = { model: new DataView(new ArrayBuffer(0)), height: %d, picture: "none", asked: { number: 0 } };
const tell = (name) => (heard[`change:${name}`] ?? []).forEach((hear) => hear());
window.saved = [];
window.isDead = false;
window.fromPython = (state) => Object.entries(state).forEach(([name, value]) => ((traits[name] = value), tell(name)));
const model = {
    get: (name) => traits[name],
    set: (name, value) => (traits[name] = value),
    save_changes: () => window.saved.push(structuredClone({ ...traits, model: null })),
    on: (name, hear) => (heard[name] ??= []).push(hear),
    off: (name, hear) => (heard[name] = (heard[name] ?? []).filter((other) => other !== hear)),
    async send(content) {
        while (window.isDead) await new Promise((done) => setTimeout(done, 20));
        for (const [message, frame] of await window.kernel(content)) {
            const buffers = frame ? [new DataView(Uint8Array.from(frame).buffer)] : [];
            heard["msg:custom"].slice().forEach((hear) => hear(message, buffers));
        }
    },
};
for (const el of document.querySelectorAll("[id^=cell]")) await widget.render({ model, el });
window.isReady = true;
</script>"""
"""The same with a kernel that answers every view, as Jupyter carries its messages; a dead one does not answer."""


@contextmanager
def answered(browser: Any, widget: Any, views: int = 1, script: str = "", height: int = 300) -> Iterator[Any]:
    """The page below cells that each show a widget that Python steps: `#cell0`, `#cell1`; `script` runs before it."""
    sent: list[tuple[dict[str, Any], Any]] = []
    widget.send = lambda content, buffers=(): sent.append((content, buffers))

    def kernel(content: dict[str, Any]) -> list[Any]:
        sent.clear()
        widget._converse(None, content, None)
        return [[message, list(buffers[0]) if buffers else None] for message, buffers in sent]

    cells = "".join(f'<div id="cell{k}"></div>' for k in range(views))
    page = ANSWERED % (cells, height)
    with Server({"index.html": page.encode(), "viewer.js": widget._esm.encode()}) as notebook:
        context = browser.new_context(bypass_csp=True, viewport={"width": 760, "height": 640}, device_scale_factor=0.5)
        tab = context.new_page()
        tab.set_default_timeout(60_000)
        tab.complaints = []
        tab.on("pageerror", lambda error: tab.complaints.append(str(error)))
        tab.expose_function("kernel", kernel)
        if script:
            tab.add_init_script(script)
        tab.goto(notebook.url)
        tab.wait_for_function("() => window.isReady")
        yield tab
        context.close()
