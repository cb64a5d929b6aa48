"""Fields that change, for ParaView: one VTU file per moment and a PVD file that lists them as a time series."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from viscera.errors import VisceraError
from viscera.files.atomic import Name, followed, made_folder, replacing, writable
from viscera.mesh import Floats, Mesh
from viscera.output import state as statefile
from viscera.quantity import path_of

Frame = tuple[float, Mesh, Mapping[str, Floats], Mapping[str, Floats]]
"""A moment, its mesh, its point data by name, and its cell data."""


def in_folder(folder: Name, name: str) -> Path:
    """The path of a file in a folder, which is made if it is missing; the one that it lies in must exist."""
    target = path_of(folder, "the folder")
    if not os.path.isdir(target.parent):
        raise VisceraError(f"{target}: the folder {str(target.parent)!r} does not exist; create it first")
    return made_folder(target) / name


def write_series(path: Path, frames: Sequence[Frame]) -> list[Path]:
    """Write NAME.pvd and beside it NAME_0000.vtu, ...; all their paths. A symbolic link is followed, for all of them.

    Points are at rest [m]; ParaView's filter Warp By Vector deforms them. Each file has the fields of its moment alone,
    and the sets and the world axes of its mesh.
    """
    if path.suffix != ".pvd":
        raise VisceraError(f"{path}: a time series is listed in a .pvd file; name one")
    if not frames:
        raise VisceraError(f"{path}: there is no moment to write")
    writable(path)
    real, files = followed(path), list[Path]()
    for index, (_, mesh, points, cells) in enumerate(frames):
        target = real.with_name(f"{real.stem}_{index:04d}.vtu")
        statefile.write_volume(target, mesh, points, cells)
        files.append(target)
    listing = "".join(
        f'<DataSet timestep="{time!r}" file={quoteattr(file.name)}/>\n'
        for (time, *_), file in zip(frames, files, strict=True)
    )
    with replacing(path) as scratch:
        scratch.write_text(
            f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n{listing}'
            "</Collection>\n</VTKFile>\n",
            encoding="utf-8",
        )
    return [path, *files]
