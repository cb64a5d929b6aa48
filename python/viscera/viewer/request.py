"""What a page asks of a stepper that Python drives, checked as `live/src/request.rs` checks what the core is asked."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from viscera.cases.entries import Text, known
from viscera.errors import VisceraError
from viscera.quantity import Check, Flag, Vector, refused
from viscera.select import place


class Laws:
    """The laws of the organs that the page shows anew; one, as Python steps an organ under its own law alone."""

    def __call__(self, value: Any, what: str) -> None:
        if not isinstance(value, list) or len(value) != 1 or not isinstance(value[0], str):
            raise refused(what, self, value)

    def __str__(self) -> str:
        return "a list of one name"


class Gesture:
    """What the second hand does."""

    def __call__(self, value: Any, what: str) -> None:
        _check(value, HAND, what)


HAND: Mapping[str, Check] = {"release": Flag(), "grab": place, "organ": Text(), "move": Vector("m")}
REQUEST: Mapping[str, Check] = {
    "laws": Laws(),
    **HAND,
    "second": Gesture(),
    "gravity": Vector("m/s^2"),
    "stress": Flag(),
}


def read(request: str) -> dict[str, Any]:
    """The entries of a request; raises `VisceraError` if it is no JSON object, or an entry is not what it must be."""
    try:
        asked = json.loads(request)
    except (ValueError, RecursionError) as error:
        raise VisceraError(f"a request cannot be read: {error}") from None
    _check(asked, REQUEST, "a request")
    return dict(asked)


def _check(words: Any, checks: Mapping[str, Check], what: str) -> None:
    if not isinstance(words, Mapping):
        raise refused(what, "a JSON object", words)
    for name, value in known(words, checks, ""):
        checks[name](value, name)
