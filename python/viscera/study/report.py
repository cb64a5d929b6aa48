"""A study's report: one HTML page, and beside it each figure as PNG and each table as CSV."""

from __future__ import annotations

import csv
import html
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from viscera.files.atomic import replacing

Cell = str | int | float

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem;
       color: #22262e; background: #fff; }
figure { margin: 2rem 0; } img { max-width: 100%; } figcaption { color: #555; font-size: 0.9em; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 0.2rem 0.8rem; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
"""


class Report:
    """Collects headings, paragraphs, figures and tables in the order they are given; `write` ends it.

    title: of the page; folder: made where it is missing.
    """

    def __init__(self, title: str, folder: str | Path) -> None:
        self.title = title
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self._parts: list[str] = []

    def heading(self, text: str) -> None:
        """A section."""
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def text(self, text: str) -> None:
        """A paragraph."""
        self._parts.append(f"<p>{html.escape(text)}</p>")

    def figure(self, name: str, figure: Figure, caption: str) -> None:
        """A figure, kept as NAME.png."""
        with replacing(self.folder / f"{name}.png") as scratch:
            figure.savefig(scratch, format="png", dpi=150)
        words = html.escape(caption)
        self._parts.append(f'<figure><img src="{name}.png" alt="{words}"><figcaption>{words}</figcaption></figure>')

    def table(self, name: str, header: Sequence[str], rows: Sequence[Sequence[Cell]], caption: str) -> None:
        """A table, kept with all its digits as NAME.csv."""
        with replacing(self.folder / f"{name}.csv") as scratch, scratch.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([header, *rows])
        head = "".join(f"<th>{html.escape(word)}</th>" for word in header)
        body = "".join(f"<tr>{''.join(f'<td>{html.escape(_shown(c))}</td>' for c in row)}</tr>" for row in rows)
        self._parts.append(
            f"<figure><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
            f'<figcaption>{html.escape(caption)} (<a href="{name}.csv">CSV</a>)</figcaption></figure>'
        )

    def write(self) -> Path:
        """The page, and where it is."""
        path = self.folder / "index.html"
        title = html.escape(self.title)
        page = (
            f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title><style>{STYLE}</style>'
            f"<h1>{title}</h1>{''.join(self._parts)}</html>\n"
        )
        with replacing(path) as scratch:
            scratch.write_text(page, encoding="utf-8")
        return path


def _shown(cell: Cell) -> str:
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)
