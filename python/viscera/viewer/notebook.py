"""The view below a notebook's cell: the same module that the page loads, as a widget."""

from __future__ import annotations

from typing import Any

from viscera.errors import VisceraError
from viscera.touch import Touch
from viscera.viewer import page
from viscera.viewer.surface import surface_model


def widget(touch: Touch, name: str = "Organ", height: int = 560) -> Any:
    """An anywidget that shows a model; raises `VisceraError` where anywidget is not installed."""
    try:
        import anywidget
        import traitlets
    except ImportError as error:
        raise VisceraError("the notebook needs anywidget: pip install 'viscera[notebook]'") from error

    class TouchWidget(anywidget.AnyWidget):
        """A reduced model to be touched."""

        _esm = page.files()["viewer.js"].decode()
        model = traitlets.Bytes().tag(sync=True)
        height = traitlets.Int().tag(sync=True)

    return TouchWidget(model=surface_model(touch, name), height=height)
