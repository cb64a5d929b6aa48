"""Reading small text files that people write: tables with a line of names."""

from __future__ import annotations

import csv
import os

from viscera.errors import VisceraError
from viscera.quantity import path_of


def read_table(path: str | os.PathLike[str]) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The names in the first line of a CSV file, and the cells of each further line with its number.

    Raises `VisceraError` for a file that is not there or no text, and for a line with more or fewer cells than names.

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
            lines = [[cell.strip() for cell in row] for row in csv.reader(file)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise VisceraError(f"{path}: not a table of comma-separated text ({error})") from None
    filled = [(number, row) for number, row in enumerate(lines, start=1) if any(row)]
    if not filled:
        raise VisceraError(f"{path}: the file is empty; it needs a line of names, and lines of numbers")
    (_, names), *rows = filled
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
        raise VisceraError(f"{path}, line {line}: {name} is {cell!r}; give a number") from None
