"""VTK's files of cells, XML (`.vtu`) and legacy (`.vtk`): all pieces, and no cell fewer than they declare.

meshio keeps the cells of the last of several pieces, takes a legacy file as far as it goes, and leaves out cells of
kinds that it does not know.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import unquote

import meshio
import numpy as np
from meshio.vtu import _vtu
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.files import vtu

PIECE = re.compile(rb"<Piece\b[^>]*>")
N_CELLS = re.compile(rb"\bNumberOfCells\s*=\s*[\"']\s*(\d+)")
CELL_TYPES = re.compile(rb"^CELL_TYPES\s+(\d+)", re.MULTILINE)
GHOSTS = "vtkGhostType"
NOT_OWN = 1 | 32
"""Bits of it: a cell that another piece holds, too, and one that is not to be seen."""


def read(path: Path) -> meshio.Mesh:
    """Points, cells by kind and arrays over both; `info["messages"]` are sentences on what was changed.

    Points of different pieces that lie at one place are one point: programs that cut a mesh into pieces write those
    between two pieces in both. Raises `VisceraError` if there are fewer cells than the file declares, if a piece lacks
    an array that another has, and if a cell names a point that its piece does not have.
    """
    reader, declared = (_read_xml, N_CELLS) if path.suffix.lower() == ".vtu" else (_read_legacy, CELL_TYPES)
    found = reader(path)
    count, held = sum(map(int, declared.findall(path.read_bytes()))), sum(len(block) for block in found.cells)
    if count != held:
        raise VisceraError(
            f"it declares {count} cells, and {held} can be read: it is cut short, or holds cells of kinds that are not "
            "read; write it again, without those"
        )
    return _without_ghosts(found)


def _without_ghosts(found: meshio.Mesh) -> meshio.Mesh:
    """The cells that count once: ParaView gives each piece those of its neighbours around it, and marks them so."""
    if GHOSTS not in found.cell_data:
        return found
    kept = [(values.astype(np.uint8) & NOT_OWN) == 0 for values in found.cell_data.pop(GHOSTS)]
    found.point_data.pop(GHOSTS, None)
    for block, stays in zip(found.cells, kept, strict=True):
        block.data = block.data[stays]
    for arrays in found.cell_data.values():
        arrays[:] = [values[stays] for values, stays in zip(arrays, kept, strict=True)]
    if count := sum(int((~stays).sum()) for stays in kept):
        found.info = {"messages": [*(found.info or {}).get("messages", []), f"dropped {count} ghost cells"]}
    return found


def _read_legacy(path: Path) -> meshio.Mesh:
    found = meshio.vtk.read(str(path))
    for data in (found.point_data, found.cell_data):
        named = {unquote(name): values for name, values in data.items()}
        data.clear()
        data.update(named)
    return found


def _read_xml(path: Path) -> meshio.Mesh:
    data = path.read_bytes()
    vtu.require_stated_sizes(data)
    tags = PIECE.findall(data)
    if len(tags) == 1 and _is_filled(tags[0]):
        return vtu.read(path)
    pieces = _pieces(path)
    return _joined(pieces) if pieces else meshio.Mesh(np.empty((0, 3)), [])


def _is_filled(tag: bytes) -> bool:
    count = N_CELLS.search(tag)
    return count is not None and int(count[1]) > 0


def _pieces(path: Path) -> list[meshio.Mesh]:
    """Each piece that has cells, read by meshio as the only one of its file."""
    try:
        root = ET.parse(path).getroot()
    except ET.ParseError:  # bytes among the XML
        root = _vtu._parse_raw_binary(str(path))
    _put_inline(root)
    grid = root.find("UnstructuredGrid")
    if grid is None:
        raise VisceraError("it holds no UnstructuredGrid")
    pieces = grid.findall("Piece")
    for piece in pieces:
        grid.remove(piece)
    found = []
    with TemporaryDirectory() as folder:
        alone = Path(folder) / "piece.vtu"
        for piece in pieces:
            if int(piece.attrib["NumberOfCells"]):
                grid.append(piece)
                ET.ElementTree(root).write(alone)
                grid.remove(piece)
                found.append(vtu.read(alone))
    return found


def _put_inline(root: ET.Element) -> None:
    """Moves what is appended to a file, in base 64, to the arrays that it belongs to."""
    section = root.find("AppendedData")
    if section is None:
        return
    text = (section.text or "").strip().removeprefix("_")
    arrays = [array for array in root.iter("DataArray") if array.get("format") == "appended"]
    starts = sorted({len(text), *(int(array.attrib["offset"]) for array in arrays)})
    ends = dict(pairwise(starts))
    for array in arrays:
        start = int(array.attrib.pop("offset"))
        array.text = text[start : ends[start]]
        array.set("format", "binary")
    root.remove(section)


def _joined(pieces: list[meshio.Mesh]) -> meshio.Mesh:
    """One mesh of several, whose points are joined where they lie at one place."""
    counts = [len(piece.points) for piece in pieces]
    starts = np.cumsum([0, *counts]).tolist()
    points = np.concatenate([piece.points for piece in pieces])
    first = _first_at_place(points, np.repeat(np.arange(len(pieces)), counts))
    is_kept = first == np.arange(len(first))
    number = (np.cumsum(is_kept) - 1)[first]
    blocks = [
        meshio.CellBlock(block.type, number[start + _own(block.data, len(piece.points), k)])
        for k, (piece, start) in enumerate(zip(pieces, starts, strict=False))
        for block in piece.cells
    ]
    at_points = _same_arrays([piece.point_data for piece in pieces])
    at_cells = _same_arrays([piece.cell_data for piece in pieces])
    n_joined = len(first) - int(is_kept.sum())
    message = f"joined {n_joined} points with those of other pieces of the file at the same places"
    return meshio.Mesh(
        points[is_kept],
        blocks,
        point_data={name: _at_first(np.concatenate(each), first)[is_kept] for name, each in at_points.items()},
        cell_data={name: [values for piece in each for values in piece] for name, each in at_cells.items()},
        info={"messages": [message] if n_joined else []},
    )


def _first_at_place(points: NDArray[Any], owner: NDArray[np.int64]) -> NDArray[np.int64]:
    """For each point (n, 3) the first at its place, where no piece has two: such are the lips of a cut, and not joined.

    owner: the piece of each point (n,).
    """
    # Adding zero makes -0 and 0 the same bytes.
    _, first, place = np.unique(points + 0.0, axis=0, return_index=True, return_inverse=True)
    place = place.reshape(-1)
    held, times = np.unique(np.stack([place, owner]), axis=1, return_counts=True)
    is_cut = np.isin(place, held[0][times > 1])
    return np.where(is_cut, np.arange(len(points)), first[place])


def _own(cells: NDArray[Any], n_points: int, k: int) -> NDArray[Any]:
    """The cells of piece `k`, which name its own points."""
    wrong = cells[(cells < 0) | (cells >= n_points)]
    if len(wrong):
        raise VisceraError(f"piece {k}: a cell names point {wrong[0]}, and the piece has {n_points}")
    return cells


def _same_arrays(data: list[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """The arrays of all pieces by name."""
    names = dict.fromkeys(name for each in data for name in each)
    for name in names:
        lacking = next((k for k, each in enumerate(data) if name not in each), None)
        if lacking is not None:
            raise VisceraError(f"piece {lacking} has no array {name!r}, which other pieces have; write it in all")
    return {name: [each[name] for each in data] for name in names}


def _at_first(values: NDArray[Any], first: NDArray[np.int64]) -> NDArray[Any]:
    """Values at points, at the first of each place the largest of those there if they are whole numbers: a point is in
    a set if one piece says so."""
    if values.dtype.kind not in "iub":
        return values
    largest: NDArray[Any] = values.copy()
    np.maximum.at(largest, first, values)
    return largest
