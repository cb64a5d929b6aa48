"""Reading what was measured of an organ: a cloud of points on its surface, and landmarks with names."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from viscera.errors import VisceraError
from viscera.files import surface as surfacefile
from viscera.files.mesh import metres_per_unit
from viscera.files.text import number, read_table
from viscera.mesh import Floats
from viscera.quantity import path_of

CLOUDS = (".csv", ".ply", ".obj", ".stl")
"""Formats of a cloud."""
AXES = ("x", "y", "z")


def read_cloud(path: str | os.PathLike[str], units: str | float = "m") -> Floats:
    """Points (k, 3) [m] of a cloud: a CSV file with columns x, y, z, or the points of a PLY, OBJ or STL file.

    units: of the file, "mm" for instance, or metres per unit. Points that several triangles share count once; so do
    equal rows of a CSV file in a registration, which has a result for each. Raises `VisceraError` for a file that
    cannot be read, an unknown format, and a cloud without points.

    >>> from pathlib import Path
    >>> _ = Path("seen.csv").write_text("x, y, z\\n10, 0, 5\\n11, 0, 5\\n")
    >>> read_cloud("seen.csv", "mm").tolist()
    [[0.01, 0.0, 0.005], [0.011, 0.0, 0.005]]
    """
    path, factor = path_of(path, "the cloud"), metres_per_unit(units)
    if path.is_dir() or not path.exists():
        raise VisceraError(f"{path}: {'is a folder, not a cloud of points' if path.is_dir() else 'no such file'}")
    ending = path.suffix.lower()
    if ending not in CLOUDS:
        raise VisceraError(f"{path}: unknown format of a cloud; the formats are {', '.join(CLOUDS)}")
    points = _positions(path)[1] if ending == ".csv" else np.unique(surfacefile.read(path)[0], axis=0)
    if not len(points):
        raise VisceraError(f"{path}: it has no points")
    if not np.isfinite(points).all():
        place = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise VisceraError(f"{path}: point {place} is {points[place].tolist()}; it must be finite")
    return np.asarray(factor * points)


def read_landmarks(path: str | os.PathLike[str], units: str | float = "m") -> dict[str, Floats]:
    """Landmarks `{name: (3,)}` [m] of a CSV file with columns name, x, y, z; each name is a node set of the mesh.

    Raises `VisceraError` for a file that cannot be read, missing columns, and names that stand twice.

    >>> from pathlib import Path
    >>> _ = Path("marks.csv").write_text("name, x, y, z\\ntip, 0.1, 0.2, 0.3\\n")
    >>> read_landmarks("marks.csv")["tip"].tolist()
    [0.1, 0.2, 0.3]
    """
    names, places = _positions(path_of(path, "the file of landmarks"), "name")
    twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if twice is not None:
        raise VisceraError(f"{path}: the landmark {twice!r} stands twice")
    return dict(zip(names, metres_per_unit(units) * places, strict=True))


def _positions(path: Path, *others: str) -> tuple[list[str], Floats]:
    """The cells of another column, if one is asked for, and the positions (k, 3) of a table."""
    names, rows = read_table(path)
    needed = (*others, *AXES)
    missing = [name for name in needed if name not in names]
    if missing:
        raise VisceraError(
            f"{path}: no column {missing[0]!r}; it has {', '.join(names)}, and needs {', '.join(needed)}"
        )
    where = [names.index(axis) for axis in AXES]
    places = [[number(path, line, names[k], row[k]) for k in where] for line, row in rows]
    words = [row[names.index(name)] for _, row in rows for name in others]
    return words, np.array(places, dtype=float).reshape(-1, 3)
