"""Checks of input values: kind, range and unit, the same in Python and in case files.

A check is called with a value and its name. It returns the value or raises `VisceraError`. Its text says what the value
must be, in errors and in the reference of case files. A boolean or a string is never a number. Checks are plain
classes, since each dataclass would add a millisecond to the import of the package.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError, did_you_mean

PLAIN = {float, int, str, type(None)}
"""Classes of what is neither a boolean nor masked, known by a look: a haptic loop asks a thousand times a second."""
LARGEST = {
    "": 1e15,
    "m": 1e3,
    "rad": 1e6,
    "N": 1e9,
    "N m": 1e9,
    "Pa": 1e15,
    "N/m": 1e12,
    "N/m^3": 1e18,
    "m/s": 1e6,
    "m/s^2": 1e6,
    "kg/m^3": 1e6,
    "s": 1e6,
    "1/s": 1e9,
    "bytes": 1e15,
}
"""For each unit the largest magnitude that is accepted. Beyond it, a number is a mistake, and products overflow."""

Check = Callable[[Any, str], Any]


class Number:
    """A finite number in a range, which ends at the largest size of its unit.

    >>> Number("Pa", above=0)(17e4, "young")
    170000.0
    >>> Number("Pa", above=0)(True, "young")
    Traceback (most recent call last):
    viscera.errors.VisceraError: young must be a number above 0 and at most 1e+15 [Pa], got True
    """

    def __init__(
        self,
        unit: str = "",
        *,
        above: float | None = None,
        low: float | None = None,
        below: float | None = None,
        high: float | None = None,
    ) -> None:
        self.unit, self.above, self.low, self.below, self.high = unit, above, low, below, high

    def __call__(self, value: Any, what: str) -> float:
        number = _scalar(value)
        # Compared before it is converted: a whole number may be too large for a float.
        if not (_is_number(number) and self._holds(number)):
            raise refused(what, self, value)
        return float(number)

    def _holds(self, number: Any) -> bool:
        low, high = self._ends
        is_inside: bool = low <= number <= high
        return is_inside and number != self.above and number != self.below

    @property
    def _ends(self) -> tuple[float, float]:
        lower = [end for end in (self.above, self.low) if end is not None]
        upper = [end for end in (self.below, self.high) if end is not None]
        return max(lower, default=-LARGEST[self.unit]), min(upper, default=LARGEST[self.unit])

    def __str__(self) -> str:
        low, high = self._ends
        start = f"above {low:g}" if self.above is not None else f"from {low:g}"
        joint = "to" if self.above is None and self.below is None else "and"
        end = f"below {high:g}" if self.below is not None else f"{'at most ' if joint == 'and' else ''}{high:g}"
        return f"a number {start} {joint} {end}{_bracketed(self.unit)}"


class Whole:
    """A whole number in a range.

    >>> Whole(1, 10_000)(99999999, "steps")
    Traceback (most recent call last):
    viscera.errors.VisceraError: steps must be a whole number from 1 to 10000, got 99999999
    """

    def __init__(self, low: int, high: int) -> None:
        self.low, self.high = low, high

    def __call__(self, value: Any, what: str) -> int:
        number = _scalar(value)
        if isinstance(number, bool) or not isinstance(number, int) or not self.low <= number <= self.high:
            raise refused(what, self, value)
        return number

    def __str__(self) -> str:
        return f"a whole number from {self.low} to {self.high}"


class Flag:
    """True or false."""

    def __call__(self, value: Any, what: str) -> bool:
        flag = _scalar(value)
        if not isinstance(flag, bool):
            raise refused(what, self, value)
        return flag

    def __str__(self) -> str:
        return "true or false"


class Choice:
    """One of a few words."""

    def __init__(self, known: Collection[str]) -> None:
        self.known = known

    def __call__(self, value: Any, what: str) -> str:
        if not isinstance(value, str) or value not in self.known:
            words = sorted(self.known)
            hint = did_you_mean(value, words) if isinstance(value, str) else f"known: {', '.join(map(repr, words))}"
            raise VisceraError(f"{what} {brief(value)} is unknown; {hint}")
        return value

    def __str__(self) -> str:
        return ", ".join(f'"{word}"' for word in self.known)


class Vector:
    """Three finite numbers (3,), none of which is larger than the largest of the unit."""

    def __init__(self, unit: str) -> None:
        self.unit = unit

    def __call__(self, value: Any, what: str) -> NDArray[np.float64]:
        return vector(value, what, self.unit)

    def __str__(self) -> str:
        return f"three finite numbers{_bracketed(self.unit)}, none above {LARGEST[self.unit]:g} in size"


def vector(value: Any, what: str, unit: str) -> NDArray[np.float64]:
    """Three finite numbers (3,) of a sensible size, as a fresh array."""
    numbers = numbers_of(value)
    if numbers is None or numbers.shape != (3,) or not (np.abs(numbers) <= LARGEST[unit]).all():
        raise refused(what, Vector(unit), value)
    return numbers


def check_nodal(rows: NDArray[np.float64], what: str, unit: str) -> None:
    """Raise `VisceraError` for the first node whose row (3,) in `rows` (n, 3) is not finite or too large for the unit.

    >>> check_nodal(np.array([[0.0, 0.0, 1.0], [0.0, 1e160, 0.0]]), "the velocity of node", "m/s")
    Traceback (most recent call last):
    viscera.errors.VisceraError: the velocity of node 1 must be three finite numbers [m/s], none above 1e+06 in ...
    """
    wrong = np.argwhere(~(np.abs(rows) <= LARGEST[unit]))
    if len(wrong):
        node = wrong[0][0]
        raise refused(f"{what} {node}", Vector(unit), rows[node].tolist())


def numbers_of(value: Any) -> NDArray[np.float64] | None:
    """A new array of numbers, or None if some are not: NumPy would turn booleans, strings and what is under a mask into
    numbers."""
    if hides_no_number(value):
        return None
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        return None
    return np.array(array, dtype=np.float64, order="C") if array.dtype.kind in "iuf" else None


def path_of(value: str | os.PathLike[str], what: str) -> Path:
    """The path of a file or a folder; raises `VisceraError` if the value names none.

    >>> path_of("", "the file of -o")
    Traceback (most recent call last):
    viscera.errors.VisceraError: the file of -o must be named by a text or a path, got ''
    """
    name = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(name, str) or not name or "\0" in name:
        raise refused(what, "named by a text or a path", value)
    try:
        os.stat(name)
    except OSError as error:  # of a name that is taken or free; only one that no file can have is refused here
        if error.errno == errno.ENAMETOOLONG:
            raise VisceraError(
                f"{what}: {brief(name)} is too long for the name of a file; give a shorter one"
            ) from error
    return Path(name)


def refused(what: str, kind: object, value: Any) -> VisceraError:
    """The error for a value that is not what it must be."""
    if hides_masked(value):
        return VisceraError(
            f"{what} must be {kind}, and some of it is masked; leave those values out, or replace them, as by "
            "`values.filled(0.0)`"
        )
    return VisceraError(f"{what} must be {kind}, got {brief(value)}")


def brief(value: Any) -> str:
    """A value as errors show it: on one line, and shortened if it is long."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."


def hides_no_number(value: Any) -> bool:
    """Whether something is a boolean, which NumPy turns into a number beside other numbers, or masked."""
    if type(value) in PLAIN:
        return False
    if isinstance(value, list | tuple):
        return any(map(hides_no_number, value))
    return isinstance(value, bool | np.bool_) or hides_masked(value)


def hides_masked(value: Any) -> bool:
    """Whether something is masked in an array or a list of some: NumPy forgets masks and takes what is under them."""
    if isinstance(value, list | tuple):
        return any(map(hides_masked, value))
    # A plain array is known by its class: `numpy.ma` is only imported where there may be a masked one.
    return isinstance(value, np.ndarray) and type(value) is not np.ndarray and bool(np.ma.is_masked(value))


def refuse_masked(value: Any, what: str, kind: object) -> None:
    """Raise `VisceraError` if something of a value is masked, where masks and texts are taken besides numbers."""
    if hides_masked(value):
        raise refused(what, kind, value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _scalar(value: Any) -> Any:
    """A NumPy scalar or array without dimensions as Python's own."""
    is_scalar = isinstance(value, np.generic | np.ndarray) and value.ndim == 0 and not hides_masked(value)
    return value.item() if is_scalar else value


def _bracketed(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def refuse_twice(given: Sequence[object], where: str) -> None:
    """Raise `VisceraError` if the same thing is named twice: it would act twice, and its report tell a half."""
    for number, each in enumerate(given):
        if any(each is other for other in given[:number]):
            raise VisceraError(f"{where}: {each!r} is named twice and would act twice; name it once")
