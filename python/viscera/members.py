"""The nodes or cells of a mesh that a name, a condition, indices or a predicate select."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from viscera.errors import VisceraError, did_you_mean
from viscera.select import conditional, extent, indices, is_condition

if TYPE_CHECKING:
    from viscera.mesh import Floats, Indices, Where


def members(where: Where, sets: Mapping[str, Indices], places: Floats, box: Floats, noun: str) -> Indices:
    """The nodes or cells that a set's name, a condition, indices or a predicate on their places (k, 3) select."""
    if isinstance(where, str) and where in sets:
        return sets[where]
    if isinstance(where, str):
        if not is_condition(where):
            raise VisceraError(f"the mesh has no {noun} set {where!r}; {did_you_mean(where, sets)}")
        found = np.flatnonzero(conditional(places, where, box, sets, noun))
        if len(found) == 0:
            raise VisceraError(f"{where!r} selects no {noun}; {extent(box)}")
        return found.astype(np.uint32)
    if callable(where):
        mask = np.asarray(where(places))
        if mask.shape != (len(places),) or mask.dtype != np.bool_:
            of = "points" if noun == "node" else "centroids"
            raise VisceraError(
                f"a predicate takes {of} ({len(places)}, 3) and returns bool ({len(places)},), "
                f"but this one returned {mask.dtype} {mask.shape}"
            )
        found = np.flatnonzero(mask)
        if len(found) == 0:
            low, high = places.min(axis=0), places.max(axis=0)
            of = "points" if noun == "node" else "centroids"
            raise VisceraError(f"the predicate selects no {noun}; the {of} lie between {low} and {high} m")
        return found.astype(np.uint32)
    return indices_of(where, len(places), f"the {noun} set", noun)


def listed_in(where: Where, sets: Mapping[str, Indices]) -> Where:
    """Indices for words that list some and are no set's name; everything else as it is."""
    if not isinstance(where, str) or where in sets:
        return where
    listed = indices(where)
    return where if listed is None else listed


def indices_of(where: ArrayLike, count: int, what: str, noun: str = "node") -> Indices:
    """Ascending, unique indices from integers or a mask (count,)."""
    chosen = np.atleast_1d(np.asarray(where))
    if chosen.dtype == np.bool_ and chosen.shape == (count,):
        chosen = np.flatnonzero(chosen)
    if chosen.size == 0:
        raise VisceraError(f"{what} has no {noun}s")
    if chosen.ndim != 1 or not np.issubdtype(chosen.dtype, np.integer):
        raise VisceraError(f"{what} must be integers (k,) or a mask ({count},), not {chosen.dtype} {chosen.shape}")
    outside = chosen[(chosen < 0) | (chosen >= count)]
    if len(outside):
        raise VisceraError(f"{what} names {noun} {outside[0]}, but the mesh has {count} {noun}s, numbered from 0")
    return np.unique(chosen).astype(np.uint32)
