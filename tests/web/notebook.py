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
