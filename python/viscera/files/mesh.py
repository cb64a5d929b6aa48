"""Reading and writing mesh files: meshio writes them, and `vtk`, `gmsh`, `medit` and `abaqus` read those of one format
each; `febio` does both. The meshes are not checked here; `mesh` does that.

Node sets are found where each format keeps them; sets without a name in the file are called after where they were
found, as `physical:2:7` (Gmsh group 7 of dimension 2) or `ref:2:7` (Medit), and left out where they hold every point.
The nodes of a set of cells are a node set too, unless one of nodes or faces has that name.
"""

from __future__ import annotations

import importlib
import logging
import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError, did_you_mean, refuse_case_file
from viscera.files import febio, gmsh_names
from viscera.files.atomic import replacing, writable
from viscera.quantity import Number, brief, path_of

if TYPE_CHECKING:
    import meshio

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "inch": 0.0254}
MESHIO_MODULES = {
    ".vtu": "vtu",
    ".vtk": "vtk",
    ".msh": "gmsh",
    ".mesh": "medit",
    ".meshb": "medit",
    ".inp": "abaqus",
}
FORMATS = (*MESHIO_MODULES, ".feb")
said = logging.getLogger("viscera.mesh")  # a command says it by itself
SET_PREFIX = "set:"
EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
"""Local ends of the edges whose midpoints are nodes 4 to 9 of a ten-node tetrahedron."""
STRAIGHT = 1e-3
"""How far a midpoint may be off the middle of its edge, in edge lengths: the rounding of single precision."""
WITHOUT_SETS = (".mesh", ".meshb")
"""Formats into which no sets are written."""
UNSAID = {".inp": ',="', ".msh": '"\\'}
"""Letters that end a name in these formats."""
VTK_SAFE = "".join(letter for letter in map(chr, range(33, 127)) if letter not in '"%')
"""Letters that stand for themselves in a legacy VTK file; VTK writes the others as in a URL, and reads them so."""
# An integer array with more values than this numbers things; it does not name sets.
MAX_SETS_PER_ARRAY = 64


@dataclass(frozen=True, eq=False)
class RawMesh:
    """The contents of a file, unchecked: points (n, 3) [m], cells (m, 4), sets of nodes and of cells by name."""

    points: NDArray[Any]
    cells: NDArray[Any]
    sets: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    cell_sets: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    messages: tuple[str, ...] = ()
    axes: str = ""
    """World axes, "RAS" or "LPS", if the file states them."""


def read(path: Path, units: str | float = "m") -> RawMesh:
    """Reads a file unchecked, in metres. Raises `VisceraError` if it is missing, of no known format or damaged."""
    scale = metres_per_unit(units)
    refuse_case_file(path, "a mesh")
    if path.is_dir() or not path.exists():
        raise VisceraError(f"{path}: {'is a folder, not a mesh file' if path.is_dir() else 'no such file'}")
    ending = _known_ending(path)
    try:
        found = (*febio.read(path.read_bytes()), ()) if ending == ".feb" else _read_grid(path, ending)
        points, blocks, sets, cell_sets, messages = found
        axes = stated_axes(path) if ending == ".vtu" else ""
        if axes and scale != 1.0:
            raise VisceraError(
                f'it states its unit, metres, and the units are {brief(units)}: leave them out, or say "m"'
            )
        for message in messages:
            said.warning(message)
        return _without_midpoints(RawMesh(scale * points, _tetrahedra(blocks), sets, cell_sets, messages, axes))
    except VisceraError as error:
        raise VisceraError(f"{path}: {error}") from None
    except (Exception, SystemExit) as error:  # the readers of meshio raise whatever their parser meets
        reason = f"{type(error).__name__}: {error}".rstrip(": ").splitlines()[0]
        raise VisceraError(f"{path}: not a readable {ending} file, or cut short ({reason})") from error


def checked(path: str | os.PathLike[str], names: Iterable[str] = ()) -> Path:
    """The path. It is an error if its format or its folder cannot take a mesh whose sets have these names; call this
    before long work."""
    _refuse_names(_known_ending(path_of(path, "the file to write")), names)
    return writable(path)


def _refuse_names(ending: str, names: Iterable[str]) -> None:
    """Raises `VisceraError` for a name that would not be read again as it is."""
    spelt: dict[str, str] = {}
    for name in names:
        other = spelt.setdefault(name.upper(), name)
        if ending == ".inp" and other != name:
            raise VisceraError(
                f"the names {brief(other)} and {brief(name)} of sets differ in capitals alone, which .inp does not "
                "keep apart; rename one"
            )
        if ending not in WITHOUT_SETS and any("\ud800" <= letter <= "\udfff" for letter in name):
            raise VisceraError(
                f"the name {brief(name)} of a set holds half of a letter, which no file can say; rename the set"
            )
        unsaid = next((letter for letter in name if letter in UNSAID.get(ending, "") or ord(letter) < 32), None)
        if unsaid is not None and ending not in WITHOUT_SETS:
            raise VisceraError(
                f"the name {brief(name)} of a set holds {unsaid!r}, which {ending} cannot say; rename the set"
            )
        if ending == ".inp" and name != name.strip():
            raise VisceraError(
                f"the name {brief(name)} of a set begins or ends in a space, which .inp loses; rename the set"
            )


def write(
    path: Path,
    points: NDArray[np.float64],
    cells: NDArray[np.uint32],
    sets: Mapping[str, Any],
    cell_sets: Mapping[str, Any],
    axes: str = "",
) -> None:
    """Writes points, cells and the sets of both in the format of the file's ending; world axes in `.vtu`.

    A format without sets is said in the log.
    """
    ending = _known_ending(path)
    _refuse_names(ending, [*sets, *cell_sets])
    if ending == ".feb":
        with replacing(path) as scratch:
            scratch.write_bytes(febio.write(points, cells, sets, cell_sets))
        return
    import meshio

    grid = meshio.Mesh(points, [("tetra", cells.astype(np.int64))])
    names: gmsh_names.Names = {}
    if ending in (".vtu", ".vtk"):
        add_masks(grid, ending, sets, cell_sets)
    elif ending == ".inp":
        grid.point_sets = {name: np.asarray(nodes, dtype=np.int64) for name, nodes in sets.items()}
        grid.cell_sets = {name: [np.asarray(chosen, dtype=np.int64)] for name, chosen in cell_sets.items()}
    elif ending == ".msh":
        names = _add_groups(grid, path, sets, cell_sets)
    options: dict[str, Any] = {
        ".msh": {"fmt_version": "2.2", "binary": False},
        ".vtk": {"fmt_version": "4.2"},
    }
    module = importlib.import_module(f"meshio.{MESHIO_MODULES[ending]}")
    with replacing(path) as scratch:
        module.write(str(scratch), grid, **options.get(ending, {}))
        if names:
            gmsh_names.add(scratch, names)
        if axes and ending == ".vtu":
            state_axes(scratch, axes)
    for lost in lacking(path, sets, cell_sets, ""):
        said.warning("%s: %s cannot hold %s; .vtu does", path, ending, lost)


def add_masks(grid: meshio.Mesh, ending: str, sets: Mapping[str, Any], cell_sets: Mapping[str, Any]) -> None:
    """Puts sets of nodes and of cells into a grid of one block of cells as fields of 0 and 1, which `read` knows.

    Raises `VisceraError` for names that the format of the ending cannot say.
    """
    _refuse_names(ending, [*sets, *cell_sets])
    # A name such as "x < 10%" would go into XML as it is, and meshio refuses its spaces in legacy files.
    ways: dict[str, Callable[[str], str]] = {".vtu": escape, ".vtk": partial(quote, safe=VTK_SAFE)}
    written = ways.get(ending, str)
    for name, nodes in sets.items():
        grid.point_data[written(SET_PREFIX + name)] = _mask(nodes, len(grid.points))
    for name, chosen in cell_sets.items():
        grid.cell_data[written(SET_PREFIX + name)] = [_mask(chosen, len(grid.cells[0]))]


def _add_groups(
    grid: meshio.Mesh, path: Path, sets: Mapping[str, Any], cell_sets: Mapping[str, Any]
) -> gmsh_names.Names:
    """Puts sets into a grid as physical groups of Gmsh, a node set as one of dimension 0; their names."""
    import meshio

    vertices = [np.asarray(nodes, dtype=np.int64)[:, None] for nodes in sets.values()]
    grid.cells += [meshio.CellBlock("vertex", nodes) for nodes in vertices]
    groups = [np.full(len(block), tag, dtype=np.int32) for tag, block in enumerate(grid.cells)]
    first = len(sets) + 1
    for tag, (name, chosen) in enumerate(cell_sets.items(), start=first):
        if groups[0][chosen].any():
            raise VisceraError(f"{path}: cells are in {name!r} and in another set, which .msh cannot say; use .vtu")
        groups[0][chosen] = tag
    grid.cell_data |= {"gmsh:physical": groups, "gmsh:geometrical": groups}
    names = {(0, tag): name for tag, name in enumerate(sets, start=1)}
    return names | {(3, tag): name for tag, name in enumerate(cell_sets, start=first)}


def lacking(path: Path, sets: Mapping[str, Any], cell_sets: Mapping[str, Any], axes: str) -> list[str]:
    """What of a mesh the format of a file cannot hold, in words."""
    ending = _known_ending(path)
    lacks = []
    if ending in WITHOUT_SETS and (sets or cell_sets):
        lacks.append("sets and parts")
    if ending != ".vtu" and axes:
        lacks.append(f"the axes {axes}")
    return lacks


def state_axes(path: Path, axes: str, more: str = "") -> None:
    """Puts the world axes, and what more there is to say of them, into a comment, which every reader ignores; not
    every reader ignores a text in field data."""
    head, tag, rest = path.read_bytes().partition(b"<UnstructuredGrid>")
    path.write_bytes(head + f"<!-- axes: {axes}, metres{more} -->\n".encode() + tag + rest)


def stated_axes(path: Path) -> str:
    """The world axes that a `.vtu` file states; empty if it states none."""
    with path.open("rb") as file:
        stated = re.search(rb"<!-- axes: (RAS|LPS)\b", file.read(2000))
    return stated[1].decode() if stated else ""


def metres_per_unit(units: str | float) -> float:
    """The factor from a unit's name, or the factor itself, to metres."""
    if isinstance(units, str):
        if units not in METRES:
            raise VisceraError(f"unknown unit {brief(units)}; {did_you_mean(units, METRES)}, or give metres per unit")
        return METRES[units]
    return Number("m", above=0)(units, "units, if they are metres per unit,")


def _known_ending(path: Path) -> str:
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise VisceraError(f"{path}: unknown mesh format {ending!r}; the formats are {', '.join(FORMATS)}")
    return ending


Arrays = dict[str, NDArray[Any]]


READERS = {".vtu": "vtk", ".vtk": "vtk", ".msh": "gmsh", ".mesh": "medit", ".meshb": "medit", ".inp": "abaqus"}
"""Modules here that read a format into a mesh of meshio."""


def _read_grid(path: Path, ending: str) -> tuple[NDArray[Any], Arrays, Arrays, Arrays, tuple[str, ...]]:
    """Points, node indices of the cells by kind, node sets, cell sets, and what the reader has to say."""
    found = importlib.import_module(f"viscera.files.{READERS[ending]}").read(path)
    kinds = dict.fromkeys(block.type for block in found.cells)
    blocks = {kind: np.concatenate([block.data for block in found.cells if block.type == kind]) for kind in kinds}
    sets = {name: np.unique(nodes) for name, nodes in found.point_sets.items() if len(nodes)}
    sets |= _sets_of_point_arrays(found)
    groups = _sets_of_cell_groups(found)
    sets |= {name: nodes for name, nodes in groups.items() if name not in sets}
    messages = tuple((found.info or {}).get("messages", ()))
    return np.asarray(found.points, dtype=np.float64), blocks, sets, _cell_sets(found), messages


def _tetrahedra(blocks: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
    """The tetrahedra, of 4 or 10 nodes. Surfaces, edges and vertices are ignored; other solid cells are refused."""
    blocks = {kind: cells for kind, cells in blocks.items() if len(cells)}
    flat = ("vertex", "line", "triangle", "quad", "polygon")
    found = [kind for kind in blocks if kind in ("tetra", "tetra10")]
    solids = [kind for kind in blocks if kind not in found and not kind.startswith(flat)]
    if solids:
        kind = solids[0]
        raise VisceraError(f"it holds {len(blocks[kind])} {kind} cells; only tetrahedra are read, remesh it")
    if not found:
        held = ", ".join(f"{len(cells)} {kind}" for kind, cells in blocks.items()) or "no cells at all"
        raise VisceraError(f"it has no tetrahedra ({held})")
    if len(found) == 2:
        raise VisceraError("it mixes tetrahedra of 4 and of 10 nodes; remesh it with one kind")
    return blocks[found[0]]


def _without_midpoints(raw: RawMesh) -> RawMesh:
    """Ten-node tetrahedra with straight edges as four-node ones; curved cells are refused."""
    points, cells = raw.points, raw.cells
    if cells.ndim != 2 or cells.shape[1] != 10:
        return raw
    if cells.min() < 0 or cells.max() >= len(points):
        raise VisceraError(f"a cell names a point that is not one of {len(points)}")
    for k, (a, b) in enumerate(EDGES, start=4):
        ends, middle = (points[cells[:, a]], points[cells[:, b]]), points[cells[:, k]]
        bend = np.linalg.norm(middle - 0.5 * (ends[0] + ends[1]), axis=1)
        bent = np.flatnonzero(~(bend <= STRAIGHT * np.linalg.norm(ends[1] - ends[0], axis=1)))
        if len(bent):
            share = bend[bent[0]] / np.linalg.norm(ends[1] - ends[0], axis=1)[bent[0]]
            raise VisceraError(
                f"cell {bent[0]} is curved: the midpoint of an edge is {share:.2g} edge lengths off its middle; only "
                "straight cells are read, remesh it with linear ones"
            )
    is_kept = np.ones(len(points), dtype=bool)
    is_kept[cells[:, 4:]] = False
    lost = _lost_midpoints(raw)
    for loss in lost:
        said.warning(loss)
    is_kept[cells[:, :4]] = True
    number = np.cumsum(is_kept) - 1
    sets = {name: number[nodes[is_kept[nodes]]] for name, nodes in raw.sets.items()}
    message = "left out the midpoints of ten-node cells; the element P2 puts them back"
    kept = {name: nodes for name, nodes in sets.items() if len(nodes)}
    messages = (*raw.messages, message, *lost)
    return RawMesh(points[is_kept], number[cells[:, :4]], kept, raw.cell_sets, messages, raw.axes)


def _lost_midpoints(raw: RawMesh) -> list[str]:
    """The node sets of ten-node cells that hold midpoints without both ends of their edges, in words.

    Other midpoints come back with the element P2: a set has those between its nodes.
    """
    ends = np.full((len(raw.points), 2), -1)
    for k, edge in enumerate(EDGES, start=4):
        ends[raw.cells[:, k]] = raw.cells[:, edge]
    ends[raw.cells[:, :4]] = -1
    lost = []
    for name, nodes in raw.sets.items():
        middles = nodes[ends[nodes, 0] >= 0]
        is_alone = ~np.isin(ends[middles], nodes).all(axis=1)
        if len(middles) and len(middles) == len(nodes):
            lost.append(f"the node set {brief(name)} is left out: all its nodes are midpoints of edges")
        elif is_alone.any():
            lost.append(
                f"the node set {brief(name)} has lost {is_alone.sum()} of its {len(nodes)} nodes: midpoints of edges "
                "whose ends it does not hold"
            )
    return lost


def _sets_of_point_arrays(found: meshio.Mesh) -> Arrays:
    sets: Arrays = {}
    for name, values in found.point_data.items():
        sets |= _sets_of_array("ref:0" if name == "medit:ref" else name, values)
    return _informative(sets, len(found.points), _given(found.point_data))


def _given(arrays: Iterable[str]) -> list[str]:
    """The names of sets that `write` has made arrays of."""
    return [name.removeprefix(SET_PREFIX) for name in arrays if name.startswith(SET_PREFIX)]


def _sets_of_array(name: str, values: NDArray[Any]) -> Arrays:
    """An integer array over points or cells: a mask names one set, a few labels name one set each (`ARRAY:LABEL`)."""
    if values.ndim > 1 and values.shape[1:] == (1,):
        values = values[:, 0]
    if name.startswith(SET_PREFIX):  # Gmsh's fields are floats
        values = values.astype(np.uint8)
    if values.ndim != 1 or values.dtype.kind not in "iub":
        return {}
    is_mask = not name.startswith("ref:")  # what numbers a reference 1 is none
    name = name.removeprefix(SET_PREFIX)
    labels = np.unique(values)
    labels = labels[labels != 0]
    if labels.tolist() == [1] and is_mask:
        return {name: np.flatnonzero(values)}
    if len(labels) > MAX_SETS_PER_ARRAY:
        return {}
    return {f"{name}:{label}": np.flatnonzero(values == label) for label in labels.tolist()}


def _informative(sets: Arrays, count: int, given: Collection[str]) -> Arrays:
    """The sets, without those that contain everything and have no name of their own, as those given have."""
    return {n: members for n, members in sets.items() if ":" not in n or n in given or len(members) < count}


def _cell_sets(found: meshio.Mesh) -> Arrays:
    """Sets of tetrahedra: integer cell arrays, Medit's references, named groups of cells."""
    solid = [k for k, block in enumerate(found.cells) if block.type in ("tetra", "tetra10")]
    sets: Arrays = {}
    for key, arrays in found.cell_data.items():
        values = np.concatenate([np.asarray(arrays[k]) for k in solid]) if solid else np.empty(0)
        if key == "medit:ref":
            labels = np.unique(values[values != 0]).tolist()
            sets |= {f"ref:3:{label}": np.flatnonzero(values == label) for label in labels}
        else:
            sets |= _sets_of_array(key, values)
    starts = np.cumsum([0, *(len(found.cells[k]) for k in solid)])
    for name, per_block in found.cell_sets.items():
        chosen = [(start, per_block[k]) for start, k in zip(starts, solid, strict=False)]
        members = [start + np.asarray(c, dtype=np.int64) for start, c in chosen if c is not None and len(c)]
        if members:
            sets[name] = np.concatenate(members)
    return _informative(sets, int(starts[-1]), [*found.cell_sets, *_given(found.cell_data)])


def _sets_of_cell_groups(found: meshio.Mesh) -> Arrays:
    """Nodes of named and numbered groups of cells of any dimension, Medit's references among them."""
    members: dict[str, list[NDArray[Any]]] = {}
    for block, refs in zip(found.cells, found.cell_data.get("medit:ref", []), strict=False):
        for ref in np.unique(refs[refs != 0]).tolist():
            members.setdefault(f"ref:{block.dim}:{ref}", []).append(block.data[refs == ref].ravel())
    for name, per_block in found.cell_sets.items():
        held = [(block, np.asarray(c)) for block, c in zip(found.cells, per_block, strict=False) if c is not None]
        nodes = [block.data[chosen.astype(np.int64)].ravel() for block, chosen in held if len(chosen)]
        if nodes:
            members.setdefault(name, []).extend(nodes)
    sets = {name: np.unique(np.concatenate(nodes)) for name, nodes in members.items()}
    named = [name for name in found.cell_sets if not gmsh_names.is_number(name)]
    return _informative(sets, len(found.points), named)


def _mask(members: NDArray[Any], count: int) -> NDArray[np.uint8]:
    mask = np.zeros(count, dtype=np.uint8)
    mask[members] = 1
    return mask
