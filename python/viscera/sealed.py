"""What a result gives out is read-only: changed in place, the result would tell, draw and write something else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = TypeVar("Array", bound=NDArray[Any])


class Sealed:
    """Base of results: the arrays of an object are read-only from when it was made, or made again by copy or pickle.

    A data class is sealed by itself; others call `_seal` at the end of their constructor. Nothing is copied.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> beam.solve(force={"tip": (0, 0, -10.0)}).displacement[:] = 0.0
    Traceback (most recent call last):
    ValueError: assignment destination is read-only
    """

    def __post_init__(self) -> None:
        """For data classes."""
        self._seal()

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """For pickle, which makes arrays writable."""
        vars(self).update(state)
        self._seal()

    def _seal(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray | tuple):
                _seal(value)


def _seal(value: Any) -> None:
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, tuple):
        for each in value:
            _seal(each)


def read_only(array: Array) -> Array:
    """The array, read-only from now on."""
    array.flags.writeable = False
    return array
