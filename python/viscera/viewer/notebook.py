"""The view below a notebook's cell, as a widget that Python drives and observes, and the module that the page loads."""

from __future__ import annotations

import base64
import json
import uuid
from typing import Any, Protocol

import numpy as np

from viscera.display import WIDTH
from viscera.errors import VisceraError
from viscera.quantity import Whole
from viscera.reduced.touch import Touch
from viscera.select import Lengths
from viscera.viewer import page
from viscera.viewer.surface import surface_model

Told = dict[str, Any]
"""A touch as the widget's traits hold it; each is None without a touch."""
HEIGHT = Whole(1, 10_000)
"""Pixels."""
UNTOUCHED: Told = {"point": None, "displacement": None, "force": None, "is_trusted": None}
GONE = "this view is closed; show the organ anew, with view()"


class Played(Protocol):
    """Interface of the objects that a widget shows and that answer touches."""

    def model(self) -> bytes:
        """The model that the page evaluates; none if the kernel answers."""

    def picture(self) -> bytes:
        """The picture that stays in a saved notebook, a PNG."""

    def answer(self, point: Lengths, displacement: Lengths) -> Told:
        """A touch: `point`, `displacement`, `force` and `is_trusted`; raises `VisceraError` if there is none."""

    def release(self) -> None:
        """Let go."""

    def let_go(self) -> None:
        """Every hand of the views lets go, without a frame."""

    def held(self) -> dict[str, Any]:
        """Who holds the organ and where, beside a frame; nothing where nobody can."""

    def reply(self, request: str, view: str = "") -> str | bytes:
        """The kernel's answer to a request of a view, which has a name: words, or a frame."""


class PlayedTouch:
    """A reduced model, which the page evaluates itself."""

    def __init__(self, touch: Touch, name: str) -> None:
        self._touch = touch
        self._name = name

    def model(self) -> bytes:
        """The file that the page loads."""
        return surface_model(self._touch, self._name)

    def picture(self) -> bytes:
        """The organ at rest and where it may be touched."""
        return self._touch._repr_png_()[0]

    def answer(self, point: Lengths, displacement: Lengths) -> Told:
        """The model's own answer."""
        answer = self._touch(point, displacement)
        push = self._touch._push(displacement)
        return told(answer.contact_point, push, answer.force, answer.is_trusted)

    def release(self) -> None:
        """Does nothing: the model has no memory."""

    def let_go(self) -> None:
        """Does nothing, likewise."""

    def held(self) -> dict[str, Any]:
        """Nothing: each view has its own touch."""
        return {}

    def reply(self, request: str, view: str = "") -> str:
        """The page of a model asks for nothing."""
        return '{"error": "this model is evaluated in the page"}'


class Closed:
    """What a widget shows once it is closed: nothing. It keeps neither model nor organ."""

    def model(self) -> bytes:
        """None."""
        return b""

    def picture(self) -> bytes:
        """Refused: there is none any more."""
        raise VisceraError(GONE)

    def answer(self, point: Lengths, displacement: Lengths) -> Told:
        """Refused: there is nothing to touch."""
        raise VisceraError(GONE)

    def release(self) -> None:
        """Does nothing: there is no touch."""

    def let_go(self) -> None:
        """Does nothing, likewise."""

    def held(self) -> dict[str, Any]:
        """Nothing."""
        return {}

    def reply(self, request: str, view: str = "") -> str:
        """The sentence that says so."""
        return json.dumps({"error": GONE})


CLOSED = Closed()


def told(point: Any, displacement: Any, force: Any, is_trusted: bool) -> Told:
    """A touch as the widget's traits hold it."""
    vectors = {"point": point, "displacement": displacement, "force": force}
    return {**{name: np.asarray(x, float).tolist() for name, x in vectors.items()}, "is_trusted": is_trusted}


def widget(played: Played, height: int = 560) -> Any:
    """A widget that shows what is played, so many pixels high; raises `VisceraError` if anywidget is not installed.

    Its `touch(point, displacement)` touches [m] as a hand does, `release()` lets go. `point`, `displacement`, `force`
    and `is_trusted` are those of the present touch, made from Python or on the page, and None without a touch. While a
    page shows the touch they are what the page shows: in the order and with the stiffness that are chosen there.
    `observe(handler, "force")` calls the handler at every change.
    """
    pixels = HEIGHT(height, "height")
    return _widget_class()(played, pixels)


def _widget_class() -> type:
    """The class of all widgets, made where it is needed first: anywidget is an extra."""
    try:
        import anywidget
        import traitlets
        from IPython import display
    except ImportError as error:
        raise VisceraError("the notebook needs anywidget: pip install 'viscera[notebook]'") from error

    class Widget(anywidget.AnyWidget):
        """An organ to be touched, by a hand in the page or from Python."""

        _esm = page.files()["viewer.js"].decode()
        model = traitlets.Bytes().tag(sync=True)
        height = traitlets.Int().tag(sync=True)
        picture = traitlets.Unicode().tag(sync=True)
        asked = traitlets.Dict({"number": 0}).tag(sync=True)
        point = traitlets.List(traitlets.Float(), default_value=None, allow_none=True).tag(sync=True)
        displacement = traitlets.List(traitlets.Float(), default_value=None, allow_none=True).tag(sync=True)
        force = traitlets.List(traitlets.Float(), default_value=None, allow_none=True).tag(sync=True)
        is_trusted = traitlets.Bool(default_value=None, allow_none=True).tag(sync=True)
        _played: Played = CLOSED

        def __init__(self, played: Played, height: int) -> None:
            super().__init__(model=played.model(), height=height, picture=uuid.uuid4().hex)
            self._played = played
            self.on_msg(self._converse)

        def close(self) -> None:
            """Take the view out of all cells; its hands let go, and what it showed is no longer kept here."""
            self._played.let_go()
            super().close()
            self._played, self.model = CLOSED, b""

        def touch(self, point: Lengths, displacement: Lengths) -> None:
            """Touch at a point and displace the contact, in metres or in words such as "(1, 2, 3) mm"."""
            try:
                now = self._played.answer(point, displacement)
            except VisceraError:  # refused: nothing has moved
                raise
            except BaseException:  # what was held is held again, and the organ is on its way back there
                self._follow({**self._told(), "is_trusted": None if self.point is None else False})
                raise
            self._follow(now)

        def release(self) -> None:
            """Let go."""
            try:
                self._played.release()
            finally:  # interrupted: nobody holds the organ, which is on its way
                self._follow(UNTOUCHED)

        def _told(self) -> Told:
            """The touch of now."""
            return {name: getattr(self, name) for name in UNTOUCHED}

        def _follow(self, now: Told) -> None:
            # With Python's own answer: a page that shows another one, as of a lower order, tells it back.
            asked = {name: value for name, value in now.items() if value is not None}
            try:
                # All at once: a handler of one sees the others as they belong to it.
                with self.hold_trait_notifications():
                    for name, value in now.items():
                        setattr(self, name, value)
                    self.asked = {"number": self.asked["number"] + 1, **asked}
            except BaseException:  # a handler's own, which keeps the page from hearing
                self.send_state([*now, "asked"])
                raise

        def _converse(self, _: Any, content: dict[str, Any], buffers: Any) -> None:
            # Every view of this widget hears every answer: it says whose it is.
            view = str(content.get("view", ""))
            reply = self._played.reply(content.get("request", ""), view)
            if isinstance(reply, str):
                self.send({"view": view, "words": reply})
            else:
                self.send({"view": view, **self._played.held()}, [reply])

        def _ipython_display_(self) -> None:
            """A picture, which stays in a saved notebook and hides beside the live view; then the view."""
            notebook: Any = display
            if self._played is CLOSED:
                notebook.publish_display_data({"text/plain": GONE})
                return
            data = base64.b64encode(self._played.picture()).decode()
            words = 'alt="The organ; run the cell to touch it"'
            image = f'<img data-viscera="{self.picture}" {words} width="{WIDTH}" src="data:image/png;base64,{data}">'
            notebook.publish_display_data({"text/html": image, "text/plain": "a picture of the organ"})
            found: Any = self._repr_mimebundle_()
            view = found[0] if isinstance(found, tuple) else found
            notebook.publish_display_data({**view, "text/plain": "run the cell to touch the organ"})

    return Widget
