"""What an entry of a case file may be: kinds of values, keys, and tables of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from viscera.errors import VisceraError, did_you_mean
from viscera.files.mesh import METRES
from viscera.members import words_of
from viscera.quantity import Check, Choice, Number, Whole, brief, refused
from viscera.select import FREE, METRIC, PLACE, length, point


class Text:
    """A text that is not empty."""

    def __call__(self, value: Any, what: str) -> None:
        if not isinstance(value, str) or not value:
            raise refused(what, self, value)

    def __str__(self) -> str:
        return "words in quotes"


class Units:
    """The unit of a mesh file."""

    def __call__(self, value: Any, what: str) -> None:
        if isinstance(value, str):
            Choice(METRES)(value, what)
        else:
            self.factor(value, f'{what}, a word such as "mm" or metres per unit,')

    factor = Number("m", above=0)

    def __str__(self) -> str:
        return f"{Choice(METRES)}; or metres per unit, {self.factor}"


@dataclass(frozen=True)
class Place:
    """Nodes or cells."""

    noun: str

    def __call__(self, value: Any, what: str) -> None:
        is_list = isinstance(value, list) and value != []
        if not (is_list or (isinstance(value, str) and value)):
            raise refused(what, self, value)
        if words_of(value, self.noun) is not None:
            if not all(value):
                raise refused(what, self, value)
            return
        for index in value if is_list else []:
            Whole(0, 2**32 - 1)(index, f"a {self.noun} of {what}")

    def __str__(self) -> str:
        return (
            f'a {self.noun} set\'s name, conditions such as "x < 10%", a list of such words for all these places '
            f"together, or a list of {self.noun} indices"
        )


class Length:
    """A length of a contact."""

    def __call__(self, value: Any, what: str) -> None:
        length(value, 1.0, what, self.metres)

    metres = Number("m", above=0)

    def __str__(self) -> str:
        return f'{self.metres}; or words such as "12 mm", or "10%" of the diagonal of the bounding box'


UNIT = SimpleNamespace(bounding_box=np.array([[0.0] * 3, [1.0] * 3]), diagonal=1.0)
"""Stands in for the mesh, which has not been read yet."""


class Point:
    """A point of the mesh."""

    def __call__(self, value: Any, what: str) -> None:
        point(value, UNIT, what)

    def __str__(self) -> str:
        return f'three lengths, each {PLACE} or words such as "12 mm" and "10%"; or "(100, 50, 80) mm"'


class Components:
    """A displacement, some of whose components may be free."""

    def __call__(self, value: Any, what: str) -> None:
        parts = [part for part in value if part != FREE] if isinstance(value, list) and len(value) == 3 else []
        if not parts or any(isinstance(part, bool | list | dict) for part in parts):
            raise refused(what, self, value)
        for part in parts:
            if isinstance(part, str) and not any(letter.isdigit() for letter in part):
                raise refused(what, self, value)
            length(part, 1.0, what)

    def __str__(self) -> str:
        return f'three lengths, each {METRIC} or words such as "-12 mm", or "{FREE}" for one or two of them'


@dataclass(frozen=True)
class PerCell:
    """A number; in Python also one per cell as an array, which law and loads check against the mesh."""

    number: Number

    def __call__(self, value: Any, what: str) -> None:
        if not isinstance(value, np.ndarray):
            self.number(value, what)

    def __str__(self) -> str:
        return str(self.number)


@dataclass(frozen=True)
class Key:
    """One entry of a table."""

    value: Check
    means: str
    default: str = ""
    """What applies if the key is left out."""
    is_required: bool = False


@dataclass(frozen=True)
class Table:
    """A table with known keys."""

    name: str
    means: str
    keys: Mapping[str, Key]

    def __call__(self, words: Any, what: str) -> None:
        for name, value in known(words, self.keys, self.name):
            self.keys[name].value(value, f"{name}{of_table(self.name)}")
        for name, key in self.keys.items():
            if key.is_required and name not in words:
                raise VisceraError(f"the key {name!r} is missing{of_table(self.name)}")

    def __str__(self) -> str:
        return f"a table, `[{self.name}]`"


@dataclass(frozen=True)
class Places:
    """A table of places, each with its load."""

    name: str
    load: Check

    def __call__(self, words: Any, what: str) -> None:
        kind = self.name.rpartition(".")[2]
        for place, value in known(words, words, self.name):
            load = replace(self.load, name=f"{self.name}.{place}") if isinstance(self.load, Table) else self.load
            load(value, f"{kind} of {place!r}")

    def __str__(self) -> str:
        return f"for each place {self.load}"


def known(words: Any, keys: Collection[str], table: str) -> Iterator[tuple[str, Any]]:
    """The entries of a table. A key that is not among `keys` is an error."""
    if not isinstance(words, Mapping):
        raise VisceraError(f"{table!r} is a table, written as [{table}], got {brief(words)}")
    for name, value in words.items():
        if name not in keys:
            raise VisceraError(f"unknown key {brief(name)}{of_table(table)}; {did_you_mean(str(name), keys)}")
        yield name, value


def of_table(table: str) -> str:
    """Where a key stands, in errors; nowhere in the table of the file itself."""
    return f" in [{table}]" if table else ""
