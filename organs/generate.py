"""Writes the built-in organs of `viscera.organs`. From the repository root, with the package installed:

    python organs/generate.py

The shapes are formulas of our own (beam.py, artery.py, liver.py); no measured geometry enters. The same files come
out on every run.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from artery import artery
from beam import beam
from liver import liver

import viscera as vs

FOLDER = Path(__file__).parent.parent / "python" / "viscera" / "organs"


def main() -> None:
    shapes: dict[str, Callable] = {"beam": beam, "artery": artery, "liver": liver}
    for name, shape in shapes.items():
        points, cells, sets = shape()
        organ = vs.mesh(np.round(points, 7), cells, sets)  # tenths of a micrometre, so that the file packs well
        organ.write(FOLDER / f"{name}.vtu")
        print(f"{name}: {len(organ.points)} points, {len(organ.cells)} cells, {1e6 * organ.volume:.4g} ml")


if __name__ == "__main__":
    main()
