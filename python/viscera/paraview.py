"""Fields that change, for ParaView: one VTU file per moment and a PVD file that lists them as a time series."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from viscera import statefile
from viscera.atomic import replacing
from viscera.errors import VisceraError
from viscera.mesh import Floats, Mesh

Frame = tuple[float, Mapping[str, Floats]] | tuple[float, Mapping[str, Floats], Mapping[str, Floats]]
"""A moment, its point data by name, and its cell data."""


def write_series(path: Path, mesh: Mesh, frames: Sequence[Frame]) -> list[Path]:
    """Write NAME.pvd and beside it NAME_0000.vtu, ..., the folder being made where it is missing; all their paths.

    Points are at rest [m]; ParaView's filter Warp By Vector deforms them.
    """
    import meshio

    if path.suffix != ".pvd":
        raise VisceraError(f"{path}: a time series is listed in a .pvd file; name one")
    if not frames:
        raise VisceraError(f"{path}: there is no moment to write")
    path.parent.mkdir(parents=True, exist_ok=True)
    files = []
    for index, (_, data, *cells) in enumerate(frames):
        target = path.with_name(f"{path.stem}_{index:04d}.vtu")
        with replacing(target) as scratch:
            meshio.vtu.write(scratch, statefile.volume(mesh, data, cells[0] if cells else {}))
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
