"""Places and lengths in words, the same in Python, case files and on the command line: `x < 10%`, `12 mm`.

A condition compares an axis with a bound, or puts it between two: `z > 3 cm`, `20% < y < 30 mm`. A percentage counts
along the mesh's bounding box from its low end; a length needs its unit (m, cm, mm, um or inch). `and` joins conditions.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.meshfile import METRES
from viscera.quantity import Number, brief

Floats = NDArray[np.float64]
AXES = "xyz"
METRIC = Number("m")
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


def is_condition(words: str) -> bool:
    """Whether words that are no set's name are a condition."""
    return "<" in words or ">" in words


def conditional(places: Floats, words: str, box: Floats) -> NDArray[np.bool_]:
    """Which of the places (k, 3) [m] meet a condition, in a bounding box (2, 3) [m]; it may be none.

    >>> conditional(np.eye(3), "x < 10% and z >= 50 cm", np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])).tolist()
    [False, False, True]
    """
    inside = np.ones(len(places), dtype=bool)
    for condition in re.split(r"\s+and\s+", words.strip()):
        inside &= _holds(places, box, condition, words)
    return inside


def extent(box: Floats) -> str:
    """A bounding box (2, 3) in words."""
    low, high = 1e3 * box
    return "the mesh spans " + ", ".join(f"{axis} {low[k]:.4g}..{high[k]:.4g} mm" for k, axis in enumerate(AXES))


def length(value: Any, whole: float, name: str) -> float:
    """A length [m] from a number [m] or from words such as "12 mm", or "10%" of `whole` [m].

    >>> length("12 mm", whole=0.2, name="radius"), length("10%", whole=0.2, name="radius")
    (0.012, 0.02)
    """
    if isinstance(value, str):
        if not re.fullmatch(BOUND, value.strip()):
            raise VisceraError(f"{name} {brief(value)} is not a length; write it as '12 mm' or '10%'")
        value = _metres(value, 0.0, whole, name)
    return METRIC(value, name)


def _holds(places: Floats, box: Floats, condition: str, place: str) -> NDArray[np.bool_]:
    match = CONDITION.fullmatch(condition.strip())
    if not match or not (match["low"] or match["high"]):
        raise VisceraError(
            f"cannot read {condition.strip()!r} in {place!r}; write conditions such as 'x < 10%' or 'z > 3 cm', "
            "joined by 'and'"
        )
    parts = match.groupdict()
    axis = AXES.index(parts["axis"])
    coordinate, (start, end) = places[:, axis], box[:, axis].tolist()
    whole = end - start
    inside = np.ones(len(coordinate), dtype=bool)
    if parts["high"]:
        inside &= COMPARISONS[parts["right"]](coordinate, _metres(parts["high"], start, whole, place))
    if parts["low"]:
        inside &= COMPARISONS[MIRRORED[parts["left"]]](coordinate, _metres(parts["low"], start, whole, place))
    return inside


def _metres(bound: str, start: float, whole: float, name: str) -> float:
    number, unit = re.fullmatch(r"(\S*?)\s*(%|[a-z]*)", bound.strip()).groups()  # type: ignore[union-attr]
    if unit == "%":
        return start + float(number) / 100.0 * whole
    if unit not in METRES:
        wrong = f"unit {unit!r} is unknown" if unit else f"{number} has no unit"
        raise VisceraError(f"in {name!r}: {wrong}; use %, {', '.join(METRES)}")
    return float(number) * METRES[unit]
