"""VTK's files: all of their pieces are read, however their numbers are written, and all cells that they declare."""

from __future__ import annotations

import base64
import lzma
import re
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.errors import VisceraError
from viscera.output import state as statefile

KINDS = {"f": "Float64", "i": "Int64", "u": "UInt8"}
EMPTY: dict[str, Any] = {"points": np.empty((0, 3)), "cells": np.empty((0, 4), dtype=np.int64)}
Write = Callable[[NDArray[Any]], tuple[str, str]]
"""The attributes of an array of numbers, and its text."""


class Ascii:
    """Numbers as text in their arrays."""

    section = b""

    def __call__(self, values: NDArray[Any]) -> tuple[str, str]:
        return 'format="ascii"', " ".join(map(str, values.ravel().tolist()))


class Appended:
    """Numbers after the arrays, as bytes or in base 64."""

    def __init__(self, encoding: str) -> None:
        self.encoding, self.data = encoding, b""

    def __call__(self, values: NDArray[Any]) -> tuple[str, str]:
        start = len(self.data)
        block = np.uint32(values.nbytes).tobytes() + values.tobytes()
        self.data += block if self.encoding == "raw" else base64.b64encode(block)
        return f'format="appended" offset="{start}"', ""

    @property
    def section(self) -> bytes:
        return f'<AppendedData encoding="{self.encoding}">_'.encode() + self.data + b"\n</AppendedData>"


class Compressed(Appended):
    """Blocks of 4 kB in their arrays or as bytes after them, of which the last states less than it holds."""

    def __init__(self, encoding: str, compress: Callable[[bytes], bytes], withheld: int) -> None:
        super().__init__(encoding)
        self.compress, self.withheld = compress, withheld

    def __call__(self, values: NDArray[Any]) -> tuple[str, str]:
        start, data = len(self.data), values.tobytes()
        parts = [data[k : k + 4096] for k in range(0, len(data), 4096)]
        blocks = [self.compress(part) for part in parts]
        numbers = [len(parts), 4096, len(parts[-1]) % 4096 - self.withheld, *map(len, blocks)]
        header, body = np.array(numbers, dtype=np.uint32).tobytes(), b"".join(blocks)
        if self.encoding == "raw":
            self.data += header + body
            return f'format="appended" offset="{start}"', ""
        return 'format="binary"', (base64.b64encode(header) + base64.b64encode(body)).decode()


def array(write: Write, name: str, values: NDArray[Any]) -> str:
    attributes, text = write(values)
    width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 and name != "connectivity" else ""
    return f'<DataArray type="{KINDS[values.dtype.kind]}" Name="{name}"{width} {attributes}>{text}</DataArray>'


def piece(
    write: Write,
    points: NDArray[Any],
    cells: NDArray[Any],
    at_points: dict[str, NDArray[Any]] | None = None,
    at_cells: dict[str, NDArray[Any]] | None = None,
    kind: int = 10,
) -> str:
    cells = cells.astype(np.int64)
    offsets = cells.shape[1] * np.arange(1, len(cells) + 1)
    types = np.full(len(cells), kind, dtype=np.uint8)
    cell_arrays = {"connectivity": cells, "offsets": offsets, "types": types}
    return "".join(
        [
            f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}"><Points>',
            array(write, "Points", points),
            "</Points><Cells>",
            *(array(write, name, values) for name, values in cell_arrays.items()),
            "</Cells><PointData>",
            *(array(write, name, values) for name, values in (at_points or {}).items()),
            "</PointData><CellData>",
            *(array(write, name, values) for name, values in (at_cells or {}).items()),
            "</CellData></Piece>",
        ]
    )


def put(path: Path, pieces: list[str], section: bytes = b"") -> Path:
    head = '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>'
    path.write_bytes((head + "".join(pieces) + "</UnstructuredGrid>").encode() + section + b"</VTKFile>")
    return path


def halves(mesh: vs.Mesh) -> list[dict[str, Any]]:
    """The arguments of two pieces that share the points of a section, with a set of nodes, one of cells and a field."""
    middle = mesh.centroids[:, 0] < 0.5 * mesh.points[:, 0].max()
    found = []
    for side in (middle, ~middle):
        used, cells = np.unique(mesh.cells[side], return_inverse=True)
        at_points = {"set:tip": np.isin(used, mesh.nodes("tip")).astype(np.uint8), "displacement": mesh.points[used]}
        at_cells = {"half": np.full(int(side.sum()), side is middle, dtype=np.uint8)}
        cells = cells.reshape(-1, 4)
        found.append({"points": mesh.points[used], "cells": cells, "at_points": at_points, "at_cells": at_cells})
    return found


def places(mesh: vs.Mesh, nodes: NDArray[Any]) -> list[list[float]]:
    return sorted(mesh.points[nodes].tolist())


@pytest.mark.parametrize("write", [Ascii(), Appended("base64"), Appended("raw")], ids=["ascii", "base64", "raw"])
def test_all_pieces_are_read_and_joined(bar: vs.Mesh, tmp_path: Path, write: Any) -> None:
    pieces = [piece(write, **each) for each in halves(bar)]
    path = put(tmp_path / "halves.vtu", pieces, write.section)
    found = vs.read(path)
    n_doubled = sum(len(each["points"]) for each in halves(bar)) - len(bar.points)
    message = f"joined {n_doubled} points with those of other pieces of the file at the same places"
    assert n_doubled > 0
    assert found.messages == (message,)
    assert found.volume == pytest.approx(bar.volume, rel=1e-12)
    assert places(found, np.arange(len(found.points))) == places(bar, np.arange(len(bar.points)))
    assert len(found.surface) == len(bar.surface)
    assert places(found, found.nodes("tip")) == places(bar, bar.nodes("tip"))
    assert found.centroids[found.cells_in("half"), 0].max() < 0.5 * bar.points[:, 0].max()
    solved, displacement, _ = statefile.read(path)
    assert len(solved.cells) == len(bar.cells)
    np.testing.assert_array_equal(displacement, solved.points)


def test_a_point_is_in_a_set_if_one_of_its_pieces_says_so(bar: vs.Mesh, tmp_path: Path) -> None:
    first, second = halves(bar)
    shared = (second["points"][:, None] == first["points"]).all(axis=2)
    first["at_points"] = {"set:mid": np.zeros(len(first["points"]), dtype=np.uint8)}
    second["at_points"] = {"set:mid": shared.any(axis=1).astype(np.uint8)}
    found = vs.read(put(tmp_path / "a.vtu", [piece(Ascii(), **first), piece(Ascii(), **second)]))
    assert places(found, found.nodes("mid")) == sorted(second["points"][shared.any(axis=1)].tolist())


@pytest.mark.parametrize("at", [0, 1])
def test_an_empty_piece_is_left_out(bar: vs.Mesh, tmp_path: Path, at: int) -> None:
    pieces = [piece(Ascii(), bar.points, bar.cells)]
    pieces.insert(at, piece(Ascii(), **EMPTY))
    found = vs.read(put(tmp_path / "a.vtu", pieces))
    np.testing.assert_array_equal(found.cells, bar.cells)
    assert found.messages == ()


def test_a_file_of_empty_pieces_has_no_tetrahedra(tmp_path: Path) -> None:
    with pytest.raises(VisceraError, match=re.escape("it has no tetrahedra (no cells at all)")):
        vs.read(put(tmp_path / "a.vtu", [piece(Ascii(), **EMPTY)]))


def test_the_lips_of_a_cut_are_not_joined(tmp_path: Path) -> None:
    """Two cells that a cut parts, in one piece, and a third on the other side of the cut's end."""
    lips = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    mirrored = lips * [1, 1, -1]
    cut = piece(Ascii(), np.concatenate([lips, mirrored]), np.array([[0, 1, 2, 3], [4, 5, 6, 7]]))
    beside = piece(Ascii(), lips * [-1, 1, 1], np.array([[0, 1, 2, 3]]))
    found = vs.read(put(tmp_path / "a.vtu", [cut, beside]))
    # Only (0, 0, 1) is one point in the first piece and lies in the second; the rest of the common face is on the cut.
    assert len(found.points) == 11
    assert any("at the place of another" in message for message in found.messages)


def test_ghost_cells_count_once(bar: vs.Mesh, tmp_path: Path) -> None:
    """Of two halves, each has the whole bar, with the cells of the other as ghosts; and no piece has a hidden cell."""
    first = bar.centroids[:, 0] < 0.5 * bar.points[:, 0].max()
    marks = [np.where(side, 0, 1).astype(np.uint8) for side in (first, ~first)]
    pieces = [
        piece(Ascii(), bar.points, bar.cells, at_cells={"vtkGhostType": mark, "half": first.astype(np.uint8)})
        for mark in marks
    ]
    found = vs.read(put(tmp_path / "a.vtu", pieces))
    assert found.volume == pytest.approx(bar.volume, rel=1e-12)
    assert len(found.cells) == len(bar.cells)
    assert len(found.points) == len(bar.points)
    assert found.messages[-1] == f"dropped {len(bar.cells)} ghost cells"
    assert list(found.cell_sets) == ["half"]
    assert len(found.cells_in("half")) == first.sum()
    hidden = np.where(first, 0, 32).astype(np.uint8)
    alone = vs.read(put(tmp_path / "b.vtu", [piece(Ascii(), bar.points, bar.cells, at_cells={"vtkGhostType": hidden})]))
    assert len(alone.cells) == first.sum()


def test_cells_that_are_not_read_are_not_lost(bar: vs.Mesh, tmp_path: Path) -> None:
    voxels = piece(Ascii(), np.eye(8, 3), np.arange(8)[None], kind=11)
    with pytest.raises(VisceraError, match="it declares 193 cells, and 192 can be read: it is cut short, or holds"):
        vs.read(put(tmp_path / "a.vtu", [piece(Ascii(), bar.points, bar.cells), voxels]))


def test_pieces_that_do_not_belong_together_are_refused(bar: vs.Mesh, tmp_path: Path) -> None:
    first, second = halves(bar)
    beyond = second | {"cells": second["cells"] + 1}
    with pytest.raises(VisceraError, match=r"a.vtu: piece 1: a cell names point \d+, and the piece has \d+"):
        vs.read(put(tmp_path / "a.vtu", [piece(Ascii(), **first), piece(Ascii(), **beyond)]))
    with pytest.raises(VisceraError, match=r"a.vtu: piece 1 has no array 'half', which other pieces have; write it in"):
        vs.read(put(tmp_path / "a.vtu", [piece(Ascii(), **each) for each in (first, second | {"at_cells": {}})]))


@pytest.mark.parametrize("encoding", ["base64", "raw"])
@pytest.mark.parametrize("compressor", ["ZLib", "LZMA"])
def test_a_compressed_block_is_inflated_no_further_than_it_states(
    bar: vs.Mesh, tmp_path: Path, encoding: str, compressor: str
) -> None:
    """A block of a few megabytes would take all memory."""
    for withheld in (0, 1):
        write = Compressed(encoding, zlib.compress if compressor == "ZLib" else lzma.compress, withheld)
        alone = piece(write, bar.points, bar.cells)
        path = put(tmp_path / "a.vtu", [alone], write.section if encoding == "raw" else b"")
        named = f'version="0.1" compressor="vtk{compressor}DataCompressor"'.encode()
        path.write_bytes(path.read_bytes().replace(b'version="0.1"', named))
        if withheld:
            with pytest.raises(VisceraError, match=r"a.vtu: damaged: a compressed block holds more than the \d+ bytes"):
                vs.read(path)
        else:
            assert np.array_equal(vs.read(path).cells, bar.cells)


def test_an_array_that_does_not_fit_its_components_is_not_left_out(
    bar: vs.Mesh, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bar.write(tmp_path / "a.vtu")
    data = (tmp_path / "a.vtu").read_bytes()
    name = b'Name="set:root"'
    assert data.count(name) == 1
    (tmp_path / "a.vtu").write_bytes(data.replace(name, name + b' NumberOfComponents="7"'))
    with pytest.raises(
        VisceraError, match="its array 'set:root' holds a number of values that is no multiple of its 7"
    ):
        vs.read(tmp_path / "a.vtu")
    assert capfd.readouterr() == ("", "")
