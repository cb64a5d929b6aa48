"""Places, points and lengths in words: the same in Python, case files and on the command line.

A place is a set's name, indices such as "3, 14, 15", or conditions joined by `and`. A condition bounds a coordinate on
one side or on both, `z > 3 cm` or `20% < y < 30 mm`; or it is a sphere, `within 8 mm of (100, 50, 80) mm`; or the name
of a set, `capsule and z > 3 cm`. Every length but zero has a unit (m, cm, mm, um or inch) or is a percentage. A
percentage of a coordinate counts along the mesh's bounding box from its low end; of any other length, it is of the
diagonal of that box. Numbers outside of words are metres.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera.errors import VisceraError, did_you_mean
from viscera.files.mesh import METRES
from viscera.quantity import Number, brief, numbers_of, refused, vector

Floats = NDArray[np.float64]
Lengths: TypeAlias = ArrayLike | Sequence[Any]
"""Three lengths: numbers [m], words, or one text for all. To a type checker `[0, 0, "-10 mm"]` is a list of objects."""
AXES = "xyz"
FREE = "free"
"""A component of a displacement that nothing prescribes."""
METRIC = Number("m")
FARTHEST = 1e9
"""Largest coordinate of a place [m]; a mesh may lie anywhere, but beyond this its coordinates have no tenth of a um."""
PLACE = Number("m", low=-FARTHEST, high=FARTHEST)
POSITIVE = Number("m", above=0)
COMPARISONS: dict[str, Callable[..., NDArray[np.bool_]]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}

BOUND = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*(?:%|[a-z]+)?"
LEFT, RIGHT = rf"(?P<low>{BOUND})\s*(?P<left>[<>]=?)\s*", rf"\s*(?P<right>[<>]=?)\s*(?P<high>{BOUND})"
CONDITION = re.compile(rf"(?:{LEFT})?(?P<axis>[xyz])(?:{RIGHT})?")
SPHERE = re.compile(rf"within\s+(?P<radius>{BOUND})\s+of\s+(?P<centre>\(.*)")
BRACKETED = re.compile(r"\((?P<inside>[^()]*)\)\s*(?P<unit>%|[a-z]*)")
INDICES = re.compile(r"\d+(?:[\s,]+\d+)*")


class Sized(Protocol):
    """What percentages refer to: a mesh."""

    @property
    def bounding_box(self) -> Floats:
        """Lowest and highest coordinates (2, 3) [m]."""

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box [m]."""


def is_condition(words: str) -> bool:
    """Whether words that are not the name of a set are conditions."""
    return "<" in words or ">" in words or words.lstrip().startswith("within ") or " and " in words


def indices(words: str) -> NDArray[np.int64] | None:
    """The indices that words list, or None if they list none.

    >>> indices("3, 14, 15").tolist()
    [3, 14, 15]
    """
    if not INDICES.fullmatch(words.strip()):
        return None
    return np.array(re.findall(r"\d+", words), dtype=np.int64)


def conditional(
    places: Floats, words: str, box: Floats, sets: Mapping[str, Any] | None = None, noun: str = "node"
) -> NDArray[np.bool_]:
    """Which of the points (k, 3) [m] meet all conditions, in a bounding box (2, 3) [m]; it may be none.

    sets: indices of points by name.

    >>> conditional(np.eye(3), "x < 10% and z >= 50 cm", np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])).tolist()
    [False, False, True]
    """
    inside = np.ones(len(places), dtype=bool)
    for condition in re.split(r"\s+and\s+", words.strip()):
        inside &= _holds(places, box, condition.strip(), words, sets or {}, noun)
    return inside


def extent(box: Floats) -> str:
    """A bounding box (2, 3) in words."""
    low, high = 1e3 * box
    return "the mesh spans " + ", ".join(f"{axis} {low[k]:.4g}..{high[k]:.4g} mm" for k, axis in enumerate(AXES))


def length(value: Any, whole: float | None, name: str, kind: Number = METRIC) -> float:
    """A length [m] from a number [m] or from words such as "12 mm", or "10%" of `whole` [m]; `kind` limits it.

    whole: None where a percentage would be of nothing.

    >>> length("12 mm", whole=0.2, name="radius"), length("10%", whole=0.2, name="radius")
    (0.012, 0.02)
    """
    if isinstance(value, str):
        if not re.fullmatch(BOUND, value.strip()):
            raise VisceraError(f"{name} {brief(value)} is not a length; write it as {_example(whole)}")
        value = _metres(value, 0.0, whole, name)
    return kind(value, name)


def size(value: Any, whole: float, name: str) -> float:
    """A length [m] above zero and not above `whole` [m], the organ's diagonal; a number [m] or words, as in `length`.

    Raises `VisceraError` for a longer one, which mostly is a number in mm.

    >>> size("5 mm", whole=0.2, name="radius")
    0.005
    """
    metres = length(value, whole, name, POSITIVE)
    if metres > whole:
        raise VisceraError(f"{name} is {metres:g} m; it may be at most the organ's diagonal, {whole:g} m")
    return metres


def point(value: Lengths, mesh: Sized, name: str) -> Floats:
    """A point (3,) [m] from numbers [m] or words: ["100 mm", 0.05, "80%"], or "(100, 50, 80) mm" as a whole."""
    if not has_words(value):
        return place(value, name)
    low, high = mesh.bounding_box
    return _three(value, low, high - low, name, PLACE)


def place(value: Any, name: str) -> Floats:
    """A point (3,) [m] of a mesh or near it, from numbers [m]."""
    numbers = numbers_of(value)
    if numbers is None or numbers.shape != (3,) or not (np.abs(numbers) <= FARTHEST).all():
        raise refused(name, f"three finite numbers [m], none above {FARTHEST:g} in size", value)
    return numbers


def offset(value: Lengths, mesh: Sized, name: str) -> Floats:
    """A displacement (3,) [m] from numbers [m] or words such as [0, 0, "-10 mm"]; percentages are of the diagonal."""
    if not has_words(value):
        return vector(value, name, "m")
    return _three(value, np.zeros(3), np.full(3, mesh.diagonal), name)


def length_in_space(value: Any, name: str) -> float:
    """A length [m] where there is no mesh that a percentage could refer to, such as the size of a tool.

    >>> length_in_space("12 mm", "the radius")
    0.012
    """
    _refuse_percentage(value, name)
    return length(value, None, name)


def in_space(value: Lengths, name: str) -> Floats:
    """A point or a motion (3,) [m] in space, where there is no mesh that a percentage could refer to.

    >>> in_space("(0, 0, 21) cm", "the position").tolist()
    [0.0, 0.0, 0.21]
    """
    if not has_words(value):
        return vector(value, name, "m")
    _refuse_percentage(value, name)
    return _three(value, np.zeros(3), None, name)


def has_words(value: Any) -> bool:
    """Whether a vector is given in words, at least in part."""
    return isinstance(value, str) or (isinstance(value, list | tuple) and any(isinstance(each, str) for each in value))


def _refuse_percentage(value: Any, name: str) -> None:
    if "%" in str(value):
        raise VisceraError(f"{name}: a percentage of what? write {brief(value)} with units, such as '12 mm'")


def _three(value: Any, starts: Floats, wholes: Floats | None, name: str, kind: Number = METRIC) -> Floats:
    """Three lengths [m], each of which `kind` limits; percentages count from `starts` along `wholes`, None where they
    would be of nothing."""
    parts = _split(value, name, wholes) if isinstance(value, str) else value
    if len(parts) != 3:
        last = "50 mm" if wholes is None else "80%"
        raise refused(name, f"three lengths, such as (0.1, '5 cm', '{last}') or '(100, 50, 80) mm'", value)
    along = [None] * 3 if wholes is None else wholes.tolist()
    rows = zip(parts, starts.tolist(), along, strict=True)
    return np.array([_metres_of(part, start, whole, name, kind) for part, start, whole in rows])


def _split(words: str, name: str, wholes: Floats | None) -> list[str]:
    """The parts of "(100, 50, 80) mm", each with the unit that follows them all, or of "(10 cm, 5 cm, 80%)"."""
    match = BRACKETED.fullmatch(words.strip())
    inside, unit = (match["inside"], match["unit"]) if match else (words, "")
    parts = [part.strip() for part in inside.split(",")]
    if len(parts) != 3 or not all(re.fullmatch(BOUND, part) for part in parts):
        last = "50 mm" if wholes is None else "80%"
        raise VisceraError(
            f"{name} {brief(words)} is not a point; write it as '(100, 50, 80) mm' or '(10 cm, 5 cm, {last})'"
        )
    return [part if re.search(r"(%|[a-z])$", part) else part + unit for part in parts]


def _metres_of(part: Any, start: float, whole: float | None, name: str, kind: Number) -> float:
    if not isinstance(part, str):
        return kind(part, name)
    if not re.fullmatch(BOUND, part.strip()):
        raise VisceraError(f"{name}: {brief(part)} is not a length; write it as {_example(whole)}")
    metres = _metres(part, 0.0, whole, name)
    try:
        kind(metres, name)  # without the start: a percentage is limited by its own length, wherever the mesh lies
    except VisceraError:
        raise refused(name, kind, part) from None
    return start + metres if "%" in part else metres


def _example(whole: float | None) -> str:
    """How a length may be written."""
    return "'12 mm'" if whole is None else "'12 mm' or '10%'"


def _holds(
    places: Floats, box: Floats, condition: str, place: str, sets: Mapping[str, Any], noun: str
) -> NDArray[np.bool_]:
    if condition in sets:
        return np.isin(np.arange(len(places)), sets[condition])
    if sphere := SPHERE.fullmatch(condition):
        start, sides = box[0], box[1] - box[0]
        radius = _metres(sphere["radius"], 0.0, float(np.linalg.norm(sides)), place)
        centre = _three(sphere["centre"], start, sides, f"the centre in {place!r}", PLACE)
        return np.asarray(np.linalg.norm(places - centre, axis=1) <= radius)
    match = CONDITION.fullmatch(condition)
    if not match or not (match["low"] or match["high"]):
        if re.fullmatch(r"[\w:. -]+", condition) and not condition.startswith("within "):
            raise VisceraError(
                f"{brief(place)}: the mesh has no {noun} set {brief(condition)}; {did_you_mean(condition, sets)}"
            )
        raise VisceraError(
            f"cannot read {brief(condition)} in {brief(place)}; write conditions such as 'x < 10%', 'z > 3 cm' or "
            "'within 8 mm of (100, 50, 80) mm', joined by 'and'"
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


def _metres(bound: str, start: float, whole: float | None, name: str) -> float:
    number, unit = re.fullmatch(r"(\S*?)\s*(%|[a-z]*)", bound.strip()).groups()  # type: ignore[union-attr]
    if unit == "%" and whole is not None:
        return start + float(number) / 100.0 * whole
    if not unit and float(number) == 0.0:
        return 0.0
    if unit not in METRES:
        wrong = f"unit {unit!r} is unknown" if unit else f"{number} has no unit"
        units = METRES if whole is None else ("%", *METRES)
        raise VisceraError(f"in {name!r}: {wrong}; use {', '.join(units)}")
    return float(number) * METRES[unit]
