"""What can go wrong, in one clear sentence: the place, the value, what to do.

Bad input raises `VisceraError` before any work begins. Failure to converge is a status in the result;
it becomes the exception `NotConverged` only where the caller asks for it.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viscera.state import State


class VisceraError(ValueError):
    """Bad input. The message gives the place, the value and the remedy."""


class NotConverged(VisceraError):
    """A solve that did not reach its load; `state` holds the last equilibrium found."""

    def __init__(self, state: State) -> None:
        super().__init__(f"the solve did not converge: {state.message or state.status}")
        self.state = state


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The closing words of an error about an unknown name: the nearest known one, and all of them.

    >>> did_you_mean("hillum", ["anterior", "hilum"])
    "did you mean 'hilum'? (known: 'anterior', 'hilum')"
    """
    words = sorted(known)
    if not words:
        return "there are none to choose from"
    listing = f"known: {', '.join(map(repr, words))}"
    near = difflib.get_close_matches(name, words, n=1, cutoff=0.4)
    return f"did you mean {near[0]!r}? ({listing})" if near else listing
