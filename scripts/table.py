"""Prints a CSV table as aligned text, for the pages that quote recorded results.

    python scripts/table.py FILE.csv [COLUMN ...]

Numbers are shown to three digits; where columns are named, those alone are shown.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path


def aligned(path: Path, columns: list[str]) -> str:
    """The table in columns as wide as their widest cell, the first to the left and the others to the right."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    names = columns or list(rows[0])
    cells = [names, *([_shown(row[name]) for name in names] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = []
    for row in cells:
        first, *rest = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        lines.append("  ".join([first.strip().ljust(widths[0]), *rest]).rstrip())
    return "\n".join(lines)


def _shown(cell: str) -> str:
    try:
        return cell if cell.isdigit() else f"{float(cell):.3g}"
    except ValueError:
        return cell


if __name__ == "__main__":
    print(aligned(Path(sys.argv[1]), sys.argv[2:]))
