"""Sets of nodes or cells in words, for the command line and case files: a set's name, or conditions such as `x < 10%`.

A condition compares an axis with a bound, or puts it between two: `z > 3 cm`, `20% < y < 30 mm`. A percentage counts
along the mesh's bounding box from its low end; a length needs its unit (m, cm, mm, um or inch). `and` joins conditions.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.loads import AXES
from viscera.mesh import Floats, Indices, Mesh
from viscera.meshfile import METRES

COMPARISONS: dict[str, Callable[..., NDArray[np.bool_]]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}

BOUND = r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?\s*(?:%|[a-z]+)?"
LEFT, RIGHT = rf"(?P<low>{BOUND})\s*(?P<left>[<>]=?)\s*", rf"\s*(?P<right>[<>]=?)\s*(?P<high>{BOUND})"
CONDITION = re.compile(rf"(?:{LEFT})?(?P<axis>[xyz])(?:{RIGHT})?")


def select(mesh: Mesh, place: str | Sequence[int]) -> Indices:
    """The nodes that a set's name, a condition or a list of indices selects; an error where they are none.

    >>> import viscera as vs
    >>> mesh = vs.mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    >>> select(mesh, "x < 10% and z >= 50 cm")
    array([3], dtype=uint32)
    """
    if isinstance(place, str) and place not in mesh.sets and re.search("[<>]", place):
        return _conditional(mesh, mesh.points, place, "node")
    return mesh.nodes(place)


def select_cells(mesh: Mesh, place: str | Sequence[int]) -> Indices:
    """The cells that a cell set's name, a condition on their centroids or a list of indices selects.

    >>> import viscera as vs
    >>> len(select_cells(vs.organs.beam(), "x < 10%"))
    192
    """
    if isinstance(place, str) and place not in mesh.cell_sets and re.search("[<>]", place):
        return _conditional(mesh, mesh.centroids, place, "cell")
    return mesh.cells_in(place)


def _conditional(mesh: Mesh, places: Floats, words: str, noun: str) -> Indices:
    inside = np.ones(len(places), dtype=bool)
    for condition in re.split(r"\s+and\s+", words.strip()):
        inside &= _holds(mesh, places, condition, words)
    found = np.flatnonzero(inside).astype(np.uint32)
    if len(found) == 0:
        raise VisceraError(f"{words!r} selects no {noun}; {_extent(mesh)}")
    return found


def length(value: float | str, whole: float, name: str) -> float:
    """A length [m] from a number [m] or from words such as "12 mm", or "10%" of `whole` [m].

    >>> length("12 mm", whole=0.2, name="radius"), length("10%", whole=0.2, name="radius")
    (0.012, 0.02)
    """
    if isinstance(value, str):
        if not re.fullmatch(BOUND, value.strip()):
            raise VisceraError(f"{name} {value!r} is not a length; write it as '12 mm' or '10%'")
        return _metres(value, 0.0, whole, name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise VisceraError(f"{name} {value!r} is not a length; give a number [m] or words such as '12 mm'")
    return float(value)


def _holds(mesh: Mesh, places: Floats, condition: str, place: str) -> NDArray[np.bool_]:
    match = CONDITION.fullmatch(condition.strip())
    if not match or not (match["low"] or match["high"]):
        raise VisceraError(
            f"cannot read {condition.strip()!r} in {place!r}; write conditions such as 'x < 10%' or 'z > 3 cm', "
            "joined by 'and'"
        )
    parts = match.groupdict()
    axis = AXES.index(parts["axis"])
    coordinate, (start, end) = places[:, axis], mesh.bounding_box[:, axis].tolist()
    extent = end - start
    inside = np.ones(len(coordinate), dtype=bool)
    if parts["high"]:
        inside &= COMPARISONS[parts["right"]](coordinate, _metres(parts["high"], start, extent, place))
    if parts["low"]:
        inside &= COMPARISONS[MIRRORED[parts["left"]]](coordinate, _metres(parts["low"], start, extent, place))
    return inside


def _metres(bound: str, start: float, extent: float, name: str) -> float:
    number, unit = re.fullmatch(r"(\S*?)\s*(%|[a-z]*)", bound.strip()).groups()  # type: ignore[union-attr]
    if unit == "%":
        return start + float(number) / 100.0 * extent
    if unit not in METRES:
        wrong = f"unit {unit!r} is unknown" if unit else f"{number} has no unit"
        raise VisceraError(f"in {name!r}: {wrong}; use %, {', '.join(METRES)}")
    return float(number) * METRES[unit]


def _extent(mesh: Mesh) -> str:
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    return "the mesh spans " + ", ".join(
        f"{axis} {1e3 * low[k]:.4g}..{1e3 * high[k]:.4g} mm" for k, axis in enumerate(AXES)
    )
