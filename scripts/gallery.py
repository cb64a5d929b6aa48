"""Runs the examples and keeps the picture that each of them makes, for the gallery of the documentation site.

    python scripts/gallery.py [NAME ...]      # into docs/pictures/gallery

An example is a program of at most 80 lines under `examples/`. Its first line of documentation is its title, its picture
is the matplotlib figure that it calls `figure`, and it asserts the number that it is about. One that needs what a
machine may lack ends with `SystemExit`, which says how to get it.
"""

from __future__ import annotations

import os
import runpy
import sys
from pathlib import Path

from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
PICTURES = ROOT / "docs" / "pictures" / "gallery"
WIDTH = 640
"""Of a picture, in pixels."""


def run(example: Path) -> Figure:
    """The picture of one example."""
    os.environ.setdefault("MPLBACKEND", "Agg")
    figure = runpy.run_path(str(example), run_name="__main__").get("figure")
    if not isinstance(figure, Figure):
        raise TypeError(f"{example.name} makes no figure of that name")
    return figure


def main(names: list[str]) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    for example in EXAMPLES:
        if not names or example.stem in names:
            print(f"== {example.name}", flush=True)
            figure = run(example)
            figure.savefig(PICTURES / f"{example.stem}.png", dpi=WIDTH / figure.get_figwidth())


if __name__ == "__main__":
    main(sys.argv[1:])
