"""The numbers of one section of a mesh file, in ASCII or binary, as `gmsh4` and `medit` read them."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.files.text import is_number
from viscera.quantity import brief

INT, REAL = "i4", "f8"
LARGEST = 2.0**62
"""The largest whole number that is taken."""


@dataclass(eq=False)
class Numbers:
    """The numbers of a section, taken in turn: of ASCII all are there already, of binary they are read by their kinds.

    No more is ever taken than is there, whatever a damaged count says.
    """

    section: str
    source: bytes | NDArray[np.float64]
    order: str
    at: int = 0

    def table(self, count: int, *columns: tuple[str, int]) -> list[NDArray[Any]]:
        """Rows with columns of one kind side by side: an array (count, width) for each (kind, width)."""
        if count < 0:
            raise VisceraError(f"damaged: its {self.section} declares a count of {count}")
        if isinstance(self.source, bytes):
            row = np.dtype([(f"c{k}", self.order + kind, (width,)) for k, (kind, width) in enumerate(columns)])
            self._require(count * row.itemsize)
            rows = np.frombuffer(self.source, row, count, self.at)
            self.at += count * row.itemsize
            return [rows[name] for name in row.names or ()]
        width = sum(w for _, w in columns)
        self._require(count * width)
        flat = self.source[self.at : self.at + count * width].reshape(count, width)
        self.at += count * width
        parts = np.split(flat, np.cumsum([w for _, w in columns])[:-1], axis=1)
        return [self._as(kind, part) for (kind, _), part in zip(columns, parts, strict=True)]

    def row(self, kind: str, count: int) -> list[Any]:
        """The next numbers of one kind."""
        (found,) = self.table(count, (kind, 1))
        return list(found[:, 0].tolist())

    def skip(self, kind: str, count: int) -> None:
        """Passes over the next numbers of one kind."""
        self.table(count, (kind, 1))

    @property
    def is_over(self) -> bool:
        """Whether all are taken."""
        return self.at == len(self.source)

    def _as(self, kind: str, part: NDArray[np.float64]) -> NDArray[Any]:
        if kind.startswith("f"):
            return part
        wrong = part[(part != np.round(part)) | ~(np.abs(part) <= LARGEST)]
        if len(wrong):
            raise VisceraError(f"damaged: {wrong[0]} stands in its {self.section} where a whole number is due")
        return part.astype(np.int64)

    def _require(self, size: int) -> None:
        if size > len(self.source) - self.at:
            raise VisceraError(f"cut short: there are fewer numbers in its {self.section} than it declares")


def parsed(section: str, text: str) -> NDArray[np.float64]:
    """The numbers of a section in ASCII. Raises `VisceraError` for a word among them."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # of a word that is no number, before NumPy 2.4
            return np.fromstring(text, sep=" ")
    except (ValueError, DeprecationWarning):
        word = next((word for word in text.split() if not is_number(word)), "")
        raise VisceraError(f"damaged: {brief(word)} stands in its {section} where a number is due") from None
