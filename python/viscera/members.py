"""The nodes or cells of a mesh that a name, a condition, indices, a predicate or a list of words select."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from viscera.errors import VisceraError, did_you_mean
from viscera.quantity import brief, refuse_masked
from viscera.select import conditional, extent, indices, is_condition

if TYPE_CHECKING:
    from viscera.mesh import Floats, Indices, Where


def members(
    where: Where, sets: Mapping[str, Indices], places: Floats, box: Floats, noun: str, count: int | None = None
) -> Indices:
    """The nodes or cells that a set's name, a condition, indices or a predicate on their places (k, 3) select.

    count: how many a set may name, if not k.
    """
    count = len(places) if count is None else count
    if isinstance(where, str) and where in sets:
        return of_set(where, sets, count, noun)
    if isinstance(where, str):
        if not is_condition(where):
            raise VisceraError(f"the mesh has no {noun} set {brief(where)}; {did_you_mean(where, sets)}")
        known = {name: of_set(name, sets, count, noun) for name in sets}
        found = np.flatnonzero(conditional(places, where, box, known, noun))
        if len(found) == 0:
            raise VisceraError(f"{brief(where)} selects no {noun}; {extent(box)}")
        return found.astype(np.uint32)
    if callable(where):
        chosen = where(places)
        refuse_masked(chosen, f"the mask of {noun}s of a predicate", "an array of booleans")
        mask = np.asarray(chosen)
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


def of_set(name: str, sets: Mapping[str, Any], count: int, noun: str) -> Indices:
    """The members of a set, one that a caller has put among the sets as indices of any kind or as a mask included."""
    held = sets[name]
    is_ours = isinstance(held, np.ndarray) and held.dtype == np.uint32 and not held.flags.writeable
    return held if is_ours else indices_of(held, count, f"the {noun} set {name!r}", noun)


def words_of(where: Any, noun: str = "node") -> list[str] | None:
    """The names and conditions of a list of them, which mean all their places together; None for anything else.

    Raises `VisceraError` for a list of words and indices.

    >>> words_of(["clamp", "x > 99%"]), words_of([3, 14]), words_of("clamp")
    (['clamp', 'x > 99%'], None, None)
    """
    if isinstance(where, np.ndarray) and where.dtype.kind in "OU" and where.ndim == 1:
        where = where.tolist()
    if not isinstance(where, list | tuple) or not any(isinstance(each, str) for each in where):
        return None
    if wrong := [each for each in where if not isinstance(each, str)]:
        raise VisceraError(
            f"a list of places has names and conditions, or {noun} indices, not both: {brief(list(where))} has "
            f"{brief(wrong[0])}; write indices among words as words, such as '3, 14'"
        )
    return list(where)


def united(places: Sequence[Indices]) -> Indices:
    """What is in one of the places or in several, ascending."""
    return np.unique(np.concatenate(places)).astype(np.uint32)


def part_of_set(where: Where, sets: Mapping[str, Indices]) -> tuple[str, str] | None:
    """Set and words of "liver/x > 90%", what the words select within the set; None for anything else.

    The set may be an organ of a scene. Percentages are of its own bounding box, indices count its members.

    >>> part_of_set("liver/x > 90%", {"liver": np.array([0, 1])}), part_of_set("x > 90%", {})
    (('liver', 'x > 90%'), None)
    """
    if not isinstance(where, str) or where in sets:
        return None
    name, _, words = where.rpartition("/")
    is_part = name in sets and (is_condition(words) or indices(words) is not None)
    return (name, words.strip()) if is_part else None


def sets_within(name: str, sets: Mapping[str, Indices], inside: Indices) -> dict[str, Indices]:
    """The sets "liver/hilum" of a set "liver" by their own names, counted among its members `inside`, ascending."""
    own = f"{name}/"
    return {
        word.removeprefix(own): np.flatnonzero(np.isin(inside, chosen)).astype(np.uint32)
        for word, chosen in sets.items()
        if word.startswith(own)
    }


def listed_in(where: Where, sets: Mapping[str, Indices]) -> Where:
    """Indices for words that list some and are no set's name; everything else as it is."""
    if not isinstance(where, str) or where in sets:
        return where
    listed = indices(where)
    return where if listed is None else listed


def indices_of(where: ArrayLike, count: int, what: str, noun: str = "node") -> Indices:
    """Ascending, unique indices from integers or a mask (count,)."""
    refuse_masked(where, what, f"a list of {noun}s, or a mask of booleans")
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
