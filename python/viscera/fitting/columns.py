"""The columns of a table that a machine or a person wrote: numbers are asked only of those that are used."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from viscera.errors import VisceraError
from viscera.files.text import Line, is_number, number, read_table
from viscera.mesh import Floats

UNIT = re.compile(r"[^\W\d_]{0,3}(/[^\W\d_]{1,2}(\^?2|²)?)?|[-%]")
"""What stands under a name in a line of units."""
MOST_LINES = 100_000
"""Lines of a curve. The time of a fit grows with them, and what they say of a law hardly does."""


class Columns(Mapping[str, Floats]):
    """Columns by name, in the order of the file. Those nobody asks for may hold dates, remarks or nothing."""

    def __init__(self, path: Path, names: list[str], lines: list[Line]) -> None:
        self._path = path
        self._lines = lines
        self._position = {name: k for k, name in enumerate(names)}

    def __getitem__(self, name: str) -> Floats:
        """Its numbers (k,). Raises `VisceraError` for a cell that is none or not finite, with its line."""
        k = self._position[name]
        return np.array([number(self._path, line, name, cells[k]) for line, cells in self._lines])

    def __iter__(self) -> Iterator[str]:
        return iter(self._position)

    def __len__(self) -> int:
        return len(self._position)


def read_columns(path: str | os.PathLike[str]) -> Columns:
    """The columns of a CSV file by the names in its first line; a line of units below becomes part of them.

    Raises `VisceraError` for names that are twice there, and for fewer than two lines of numbers or more than
    `MOST_LINES`.
    """
    names, lines = read_table(path)
    if lines and not any(map(is_number, lines[0][1])):
        units = [cell.strip("()[] ") for cell in lines[0][1]]
        if all(map(UNIT.fullmatch, units)):
            names = [f"{name} ({unit})" if unit else name for name, unit in zip(names, units, strict=True)]
            lines = lines[1:]
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise VisceraError(f"{path}: two columns are called {twice!r}; leave one")
    if len(lines) < 2:
        raise VisceraError(f"{path}: a curve needs a line of names and at least two lines of numbers")
    if len(lines) > MOST_LINES:
        share = -(-len(lines) // MOST_LINES)
        raise VisceraError(
            f"{path}: a curve of {len(lines)} lines, and a fit takes {MOST_LINES} at most; thin it out, one line of "
            f"{share} is enough"
        )
    return Columns(Path(path), names, lines)
