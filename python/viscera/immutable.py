"""What other objects are made of does not change: they have compiled or copied it, and would not follow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from viscera.errors import VisceraError
from viscera.sealed import read_only


class Immutable:
    """Base of such objects: a public attribute is assigned once, when the object is made, and an array is kept as a
    read-only copy. To assign one again raises `VisceraError`, as it would show and not be computed with.

    >>> import viscera as vs
    >>> vs.Sphere("8 mm").radius = 0.01
    Traceback (most recent call last):
    viscera.errors.VisceraError: the radius of a Sphere cannot be changed: what it is in would not follow; make another
    """

    _others: ClassVar[Mapping[str, str]] = {}
    """What to do instead of assigning an attribute, by its name; by default to make another object."""

    def __setattr__(self, name: str, value: Any) -> None:
        """Raises `VisceraError` for a public attribute or property that the object has."""
        if name.startswith("_"):
            super().__setattr__(name, value)
            return
        kind = type(self)
        if name in vars(self) or isinstance(getattr(kind, name, None), property):
            article = "an" if kind.__name__[0] in "AEIOU" else "a"
            raise VisceraError(
                f"the {name} of {article} {kind.__name__} cannot be changed: what it is in would not follow; "
                f"{self._others.get(name, 'make another')}"
            )
        super().__setattr__(name, _kept(value))

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """For pickle and copy, which make arrays writable."""
        vars(self).update({name: _kept(value) for name, value in state.items()})


def _kept(value: Any) -> Any:
    """An array as a read-only copy, anything else as it is."""
    if not isinstance(value, np.ndarray):
        return value
    return read_only(value.copy())
