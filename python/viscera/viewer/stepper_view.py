"""The widget of a stepper in a notebook: one for all cells that show it, as one pair of hands holds the organ."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary, ref

from viscera.stepping.anew import begin_anew
from viscera.viewer.notebook import HEIGHT, widget
from viscera.viewer.stepped import PlayedStepper

if TYPE_CHECKING:
    from viscera.stepping.stepper import Stepper

_VIEWS: WeakKeyDictionary[Stepper, ref[Any]] = WeakKeyDictionary()
"""The widget of each stepper that has one. Both are weak: nothing is kept alive here."""


def view_of(stepper: Stepper, name: str, height: int) -> Any:
    """The widget of `Stepper.view`: that of before if it is open, with this name and height in cells shown from now on.

    All views of a widget read each other's frames, which hold its tools in their order. Where the stepper has got
    others, the widget of before is therefore closed for a new one.
    """
    found = _VIEWS.get(stepper)
    shown: Any = None if found is None else found()
    played = None if shown is None else shown._played
    if isinstance(played, PlayedStepper):
        if played.has_all_tools:
            shown.height, played.name = HEIGHT(height, "height"), name
            return shown
        shown.close()
    made = widget(PlayedStepper(lambda: stepper, name, again=lambda: begin_anew(stepper)), height)
    _VIEWS[stepper] = ref(made)
    return made
