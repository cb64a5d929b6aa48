"""Reading small text files that people write: tables with a line of names."""

from __future__ import annotations

import csv
import io
import os

from viscera.errors import VisceraError
from viscera.quantity import path_of

SEPARATORS = ",;\t"


def read_table(path: str | os.PathLike[str]) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The names in the first line of a CSV file, and the cells of each further line with its number.

    Cells are separated by commas, or by semicolons or tabs where the line of names has no comma. Raises `VisceraError`
    for a file that is not there or no text, for names that only spaces separate, and for a line with more or fewer
    cells than names.

    >>> from pathlib import Path
    >>> _ = Path("tips.csv").write_text("name, x\\ntip, 0.5\\n")
    >>> read_table("tips.csv")
    (['name', 'x'], [(2, ['tip', '0.5'])])
    """
    path = path_of(path, "the table")
    if path.is_dir() or not path.exists():
        raise VisceraError(f"{path}: {'is a folder, not a table' if path.is_dir() else 'no such file'}")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            text = file.read()
        rows_of = csv.reader(io.StringIO(text, newline=""), delimiter=_separator(text))
        lines = [[cell.strip() for cell in row] for row in rows_of]
    except (UnicodeDecodeError, csv.Error) as error:
        raise VisceraError(f"{path}: not a table of comma-separated text ({error})") from None
    filled = [(number, row) for number, row in enumerate(lines, start=1) if any(row)]
    if not filled:
        raise VisceraError(f"{path}: the file is empty; it needs a line of names, and lines of numbers")
    (_, names), *rows = filled
    if len(names) == 1 and " " in names[0]:
        raise VisceraError(f"{path}: spaces separate {names[0]!r}; separate columns by commas, semicolons or tabs")
    for line, row in rows:
        if len(row) != len(names):
            raise VisceraError(f"{path}, line {line}: {len(row)} values under {len(names)} names")
    return names, rows


def number(path: str | os.PathLike[str], line: int, name: str, cell: str) -> float:
    """A cell as a number. Raises `VisceraError` naming file, line and column.

    >>> number("tips.csv", 2, "x", "0.5")
    0.5
    """
    try:
        return float(cell)
    except ValueError:
        wanted = "write its decimal comma as a point" if "," in cell else "give a number"
        raise VisceraError(f"{path}, line {line}: {name} is {cell!r}; {wanted}") from None


def _separator(text: str) -> str:
    """What separates the cells: the first of comma, semicolon and tab in the line of names; a comma if it has none."""
    names = next((line for line in text.splitlines() if line.strip()), "")
    return next((separator for separator in SEPARATORS if separator in names), ",")
