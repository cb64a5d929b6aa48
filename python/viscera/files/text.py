"""Reading small text files that people write: tables with a line of names."""

from __future__ import annotations

import csv
import io
import math
import os
import re

from viscera.errors import VisceraError
from viscera.quantity import path_of

SEPARATORS = ",;\t"
THOUSANDS = re.compile(r"[-+]?\d{1,3}(,\d{3})+(\.\d*)?")
"""A number with commas between its thousands; one with a single comma may also be a decimal."""

Line = tuple[int, list[str]]
"""A line by its number, with its cells."""


def read_table(path: str | os.PathLike[str]) -> tuple[list[str], list[Line]]:
    """The names in the first line of a CSV file, and the cells of each further line with its number.

    Cells are separated by commas, or by semicolons or tabs where the line of names has no comma. Lines before the names
    that begin with # are left out, unless the last of them has the names itself, and so is a separator at the end of
    lines. Raises `VisceraError` for a file that is not there or no text, for names that only spaces separate, and for a
    line with more or fewer cells than names.

    >>> from pathlib import Path
    >>> _ = Path("tips.csv").write_text("# of a needle\\nname, x\\ntip, 0.5\\n")
    >>> read_table("tips.csv")
    (['name', 'x'], [(3, ['tip', '0.5'])])
    """
    path = path_of(path, "the table")
    if path.is_dir() or not path.exists():
        raise VisceraError(f"{path}: {'is a folder, not a table' if path.is_dir() else 'no such file'}")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            filled = _lines(file.read())
    except (UnicodeDecodeError, csv.Error) as error:
        raise VisceraError(f"{path}: not a table of comma-separated text ({error})") from None
    if not filled:
        raise VisceraError(f"{path}: the file is empty; it needs a line of names, and lines of numbers")
    (_, names), *rows = filled
    if len(names) == 1 and " " in names[0]:
        raise VisceraError(f"{path}: spaces separate {names[0]!r}; separate columns by commas, semicolons or tabs")
    if len(names) > 1 and not names[-1]:
        names = names[:-1]
    rows = [(line, _without_end(row, len(names))) for line, row in rows]
    for line, row in rows:
        if len(row) != len(names):
            raise VisceraError(f"{path}, line {line}: {len(row)} values under {len(names)} names")
    return names, rows


def number(path: str | os.PathLike[str], line: int, name: str, cell: str) -> float:
    """A cell as a finite number. Raises `VisceraError` naming file, line and column.

    >>> number("tips.csv", 2, "x", "0.5")
    0.5
    """
    try:
        value = float(cell)
        remedy = "give a finite number, or leave the line out"
    except ValueError:
        value, remedy = math.nan, _remedy(cell)
    if not math.isfinite(value):
        raise VisceraError(f"{path}, line {line}: {name or 'a column without a name'} is {cell!r}; {remedy}")
    return value


def is_number(cell: str) -> bool:
    """Whether a cell is a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _remedy(cell: str) -> str:
    if "," not in cell:
        return "give a number"
    if THOUSANDS.fullmatch(cell) and ("." in cell or cell.count(",") > 1):
        return "leave out the commas between its thousands"
    return "write its decimal comma as a point"


def _lines(text: str) -> list[Line]:
    """The lines with cells, from that of the names on."""
    lines = text.splitlines(keepends=True)
    first = next((k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), len(lines))
    comment = lines[first - 1].strip() if first > 0 else ""
    filled = _cells(lines[first:], first)
    if filled and comment.startswith("#"):
        names = _cells([comment.lstrip("# ")], first - 1)
        is_of_numbers = any(map(is_number, filled[0][1]))
        if names and is_of_numbers and len(names[0][1]) == len(filled[0][1]) > 1:
            return [*names, *filled]
    return filled


def _cells(lines: list[str], before: int) -> list[Line]:
    """The cells of each line that has some; `before` lines precede the first."""
    text = "".join(lines)
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=_separator(text))
    stripped = ([cell.strip() for cell in row] for row in rows)
    return [(line, row) for line, row in enumerate(stripped, start=before + 1) if any(row)]


def _without_end(row: list[str], n: int) -> list[str]:
    """The cells without an empty one behind n others, as a separator at the end of a line makes it."""
    return row[:-1] if len(row) == n + 1 and not row[-1] else row


def _separator(text: str) -> str:
    """What separates the cells: the first of comma, semicolon and tab in the line of names; a comma if it has none."""
    names = next((line for line in text.splitlines() if line.strip()), "")
    return next((separator for separator in SEPARATORS if separator in names), ",")
