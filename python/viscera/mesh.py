"""A tetrahedral mesh with named node sets: made from arrays or files, checked once, immutable afterwards.

The files themselves are read and written by `meshfile`; topology and quality come from the compiled core.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera import _core
from viscera.display import Pictured
from viscera.errors import VisceraError
from viscera.files import mesh as meshfile
from viscera.files.mesh import RawMesh
from viscera.inspection import arrays, doubts, faults, implausible, listed
from viscera.members import indices_of, listed_in, members, part_of_set, sets_within, united, words_of
from viscera.quantity import Number, hides_no_number, path_of, refuse_masked, refused
from viscera.select import Lengths, length
from viscera.select import point as point_of

if TYPE_CHECKING:
    import os

    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
Indices = NDArray[np.uint32]
Where = str | ArrayLike | Callable[[Floats], ArrayLike]
"""A set's name, conditions such as "x < 10%" or "within 8 mm of (100, 50, 80) mm", indices, or a predicate on places
(k, 3) -> bool (k,): see `viscera.select`. A list of names and conditions is all their places together."""

log = logging.getLogger("viscera")
said = logging.getLogger("viscera.mesh")  # what a mesh keeps among its messages, too


@dataclass(frozen=True, eq=False)
class Mesh(Pictured):
    """Straight tetrahedra, positively oriented. Made by `mesh` and `read`, which check it; arrays are read-only.

    A mesh is linear; `quadratic` gives it the midpoints of its edges as further points.

    >>> import viscera as vs
    >>> corner = vs.mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]], sets={"floor": [0, 1, 2]})
    >>> round(corner.volume, 6), corner.nodes("floor").tolist(), corner.nodes(lambda x: x[:, 2] > 0.5).tolist()
    (0.166667, [0, 1, 2], [3])
    """

    points: Floats
    """Rest positions (n, 3) [m]."""
    cells: Indices
    """Node indices (m, 4); `(x1 - x0) x (x2 - x0) . (x3 - x0) > 0` in every cell."""
    sets: Mapping[str, Indices] = field(default_factory=dict)
    """Named node sets, ascending indices."""
    messages: tuple[str, ...] = ()
    """What was repaired, dropped or doubtful when the mesh was read."""
    edges: Indices = field(default_factory=lambda: np.empty((0, 2), dtype=np.uint32))
    """Ends (k, 2) of the edges whose midpoints are the last k points; none in a linear mesh."""
    cell_sets: Mapping[str, Indices] = field(default_factory=dict)
    """Named sets of cells, ascending indices, such as a tumour."""
    axes: str = ""
    """World axes of the scan that the mesh comes from, "RAS" or "LPS"; empty if unknown."""
    is_unloaded: bool = False
    """Whether it is without the loads of its scan, or under others: its points then lie elsewhere than in the scan."""

    def __post_init__(self) -> None:
        """Check the arrays as `mesh` does, unless they are read-only: those of a checked mesh are."""
        if not (_is_ours(self.points, np.float64) and _is_ours(self.cells, np.uint32)):
            checked = mesh(self.points, self.cells, self.sets, self.cell_sets)
            for name in ("points", "cells", "sets", "messages", "cell_sets"):
                object.__setattr__(self, name, getattr(checked, name))

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle and copy: a checked mesh is not checked again."""
        arrays = (self.points, self.cells, self.sets, self.messages, self.edges, self.cell_sets)
        return _again, (*arrays, self.axes, self.is_unloaded)

    @cached_property
    def surface(self) -> Indices:
        """Boundary triangles (t, 3), oriented outward. A face of a quadratic cell is four, with the middle one last."""
        boundary = _core.quadratic_surface if len(self.edges) else _core.surface
        return _read_only(boundary(self.points, self.cells))

    @cached_property
    def surface_nodes(self) -> Indices:
        """Nodes of the boundary, ascending."""
        return _read_only(np.unique(self.surface))

    @cached_property
    def volume(self) -> float:
        """Volume [m^3]."""
        return float(self.facts["volume"])

    @cached_property
    def facts(self) -> dict[str, Any]:
        """What the core finds in the mesh: `cell_volumes` (m,) [m^3], `quality` (m,), `body` (n,), `part` (m,), ..."""
        found = _core.inspect(self.points, self.cells)
        return {name: _read_only(fact) if isinstance(fact, np.ndarray) else fact for name, fact in found.items()}

    @cached_property
    def centroids(self) -> Floats:
        """Centroids of the cells (m, 3) [m]."""
        return _read_only(self.points[self.cells].mean(axis=1))

    @property
    def n_corners(self) -> int:
        """Number of points that are corners of cells: all of a linear mesh."""
        return len(self.points) - len(self.edges)

    @property
    def bounding_box(self) -> Floats:
        """Lowest and highest coordinates (2, 3) [m]."""
        return _box_of(self.points)

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box [m], the size that touch depths are compared with."""
        low, high = self.bounding_box
        return float(np.linalg.norm(high - low))

    def nodes(self, where: Where) -> Indices:
        """The nodes of a place, ascending.

        where: a set's name; conditions, as `viscera.select` reads them; node indices; a predicate on points
            (n, 3) -> bool (n,); or a list of names and conditions, which is all their places together. "tip/x > 50%" is
            the part of a set, with percentages of its own bounding box.
        Raises `VisceraError` for an unknown name (with the most similar known one), an index that is no node of the
        mesh, and a set without nodes. In a quadratic mesh, corners given by index or by a condition also select the
        midpoint of every edge whose ends are both among them.

        >>> import viscera as vs
        >>> len(vs.organs.beam().nodes("x < 1% and z > 12 cm"))
        10
        >>> len(vs.organs.beam().nodes("clamp and within 6 cm of (0%, 50%, 50%)"))
        5
        >>> len(vs.organs.beam().nodes(["clamp", "x > 99%"]))
        50
        """
        if (words := words_of(where)) is not None:
            return united([self.nodes(each) for each in words])
        if part := part_of_set(where, self.sets):
            return self._nodes_within(*part)
        where = listed_in(where, self.sets)
        places = self.points[: self.n_corners] if isinstance(where, str) else self.points
        found = members(where, self.sets, places, self.bounding_box, "node", len(self.points))
        is_chosen = callable(where) or (isinstance(where, str) and where in self.sets)
        names_corners_alone = not is_chosen and found[-1] < self.n_corners
        return _with_midpoints(found, self.edges, self.n_corners) if names_corners_alone else found

    def cells_in(self, where: Where) -> Indices:
        """The cells of a place, ascending, as in `nodes`: a cell set's name, a condition, indices or a predicate.

        Conditions and predicates look at the centroids (m, 3). Raises `VisceraError` as `nodes` does.

        >>> import viscera as vs
        >>> len(vs.organs.beam().cells_in("x < 50%"))
        960
        """
        if (words := words_of(where, "cell")) is not None:
            return united([self.cells_in(each) for each in words])
        if part := part_of_set(where, self.cell_sets):
            return self._cells_within(*part)
        where = listed_in(where, self.cell_sets)
        return members(where, self.cell_sets, self.centroids, self.bounding_box, "cell")

    def _nodes_within(self, name: str, words: str) -> Indices:
        """The nodes of a set that words select, as if the set were a mesh of its own."""
        inside = self.nodes(name)
        corners = inside[inside < self.n_corners]
        own = sets_within(name, self.sets, corners)
        chosen = listed_in(words, own)
        places = self.points[corners if isinstance(chosen, str) else inside]
        found = inside[members(chosen, own, places, _box_of(self.points[inside]), "node")]
        return _with_midpoints(found, self.edges, self.n_corners) if found[-1] < self.n_corners else found

    def _cells_within(self, name: str, words: str) -> Indices:
        """The cells of a set that words select, as if the set were a mesh of its own."""
        inside = self.cells_in(name)
        own = sets_within(name, self.cell_sets, inside)
        box = _box_of(self.points[self.cells[inside].ravel()])
        return np.asarray(inside[members(listed_in(words, own), own, self.centroids[inside], box, "cell")])

    def per_cell(self, value: float, elsewhere: Mapping[Any, float]) -> Floats:
        """One value per cell (m,) for a law's parameter: `value`, except in the places of `{where: value}`.

        Places are as in `cells_in`; if two overlap, the later one counts.

        >>> import viscera as vs
        >>> liver = vs.organs.liver()
        >>> young = liver.per_cell(3e3, {lambda x: np.linalg.norm(x - [0.02, 0.0, 0.0], axis=1) < 0.02: 30e3})
        >>> vs.NeoHookean(young=young, poisson=0.45)
        NeoHookean(mu=1034.48..10344.8, lam=9310.34..93103.4)
        """
        values = np.full(len(self.cells), Number()(value, "the value per cell"))
        for where, other in elsewhere.items():
            values[self.cells_in(where)] = Number()(other, "the value per cell of a part")
        return values

    def near(self, point: Lengths, radius: float | str) -> Indices:
        """Surface nodes within `radius` [m] of a point (3,) [m]; both may be given in words.

        >>> import viscera as vs
        >>> vs.organs.beam().near("(100%, 50%, 100%)", "6 cm").tolist()
        [489, 509, 513, 514, 519]
        """
        center = point_of(point, self, "centre")
        radius = length(radius, self.diagonal, "radius")
        distance = np.linalg.norm(self.points[self.surface_nodes] - center, axis=1)
        if not (distance <= radius).any():
            raise VisceraError(
                f"no surface node lies within {radius:g} m of {center.tolist()}; "
                f"the nearest is {distance.min():.3g} m away"
            )
        near: Indices = self.surface_nodes[distance <= radius]
        return near

    def with_sets(self, **sets: Where) -> Mesh:
        """The same mesh with more node sets, each a name, indices or a predicate as in `nodes`.

        >>> import viscera as vs
        >>> mesh = vs.organs.beam().with_sets(edge="x > 99% and z > 99%")
        >>> mesh.sets["edge"].tolist()
        [504, 509, 514, 519, 524]
        """
        added = {name: _read_only(self.nodes(where)) for name, where in sets.items()}
        return replace(self, sets={**self.sets, **added})

    def with_cell_sets(self, **sets: Where) -> Mesh:
        """The same mesh with more sets of cells, each a name, indices or a predicate as in `cells_in`.

        >>> import viscera as vs
        >>> mesh = vs.organs.beam().with_cell_sets(nodule="within 10 cm of (50%, 50%, 50%)")
        >>> len(mesh.cell_sets["nodule"])
        228
        """
        added = {name: _read_only(self.cells_in(where)) for name, where in sets.items()}
        return replace(self, cell_sets={**self.cell_sets, **added})

    def quadratic(self) -> Mesh:
        """The mesh with the midpoints of its edges: the nodes of quadratic cells, corners first.

        A set gains the midpoint of every edge whose ends are both in it.

        >>> import viscera as vs
        >>> len(vs.organs.beam().quadratic().points)
        3321
        """
        if len(self.edges):
            return self
        edges, _ = _core.quadratic(len(self.points), self.cells)
        points = np.concatenate([self.points, 0.5 * (self.points[edges[:, 0]] + self.points[edges[:, 1]])])
        wider = {name: _read_only(_with_midpoints(nodes, edges, len(self.points))) for name, nodes in self.sets.items()}
        return replace(self, points=_read_only(points), sets=wider, edges=_read_only(edges))

    def linear(self) -> Mesh:
        """The mesh without midpoints.

        >>> import viscera as vs
        >>> mesh = vs.organs.beam()
        >>> len(mesh.quadratic().linear().points) == len(mesh.points)
        True
        """
        if not len(self.edges):
            return self
        corners = self.points[: self.n_corners]
        sets = {name: nodes[nodes < len(corners)] for name, nodes in self.sets.items()}
        kept = {name: nodes for name, nodes in sets.items() if len(nodes)}
        return replace(self, points=corners, sets=kept, edges=self.edges[:0])

    def write(self, path: str | Path) -> None:
        """Writes the mesh in metres; the ending chooses the format: `.vtu`, `.vtk`, `.msh`, `.mesh`, `.inp`, `.feb`.

        Node and cell sets are written too, except in `.mesh` and `.meshb`, which cannot hold them: the log says so.
        `.vtu` also holds the world axes, but not if the mesh `is_unloaded`. Midpoints are not written. Raises
        `VisceraError` if the format cannot say a set's name, as `.inp` none with a comma, or cannot hold cell sets that
        overlap (`.msh`).

        >>> import viscera as vs
        >>> vs.organs.beam().write("beam.vtu")
        >>> vs.read("beam.vtu")
        Mesh: 525 points, 1920 cells, 4e+04 ml, clamp (25), tip (25), top (105)
        """
        mesh = self.linear()
        target, axes = path_of(path, "the file to write"), "" if mesh.is_unloaded else mesh.axes
        meshfile.write(target, mesh.points, mesh.cells, mesh.sets, mesh.cell_sets, axes)

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """Draw the mesh, with its cell sets as wireframes. `path`: write a PNG file there.

        >>> import viscera as vs
        >>> figure = vs.organs.beam().plot("beam.png")
        """
        from viscera.output.picture import draw_rest

        parts = {name: _core.surface(self.points, self.cells[cells]) for name, cells in self.cell_sets.items()}
        return draw_rest(self.points, self.surface, fixed=np.empty(0, dtype=np.uint32), parts=parts, path=path)

    def __repr__(self) -> str:
        sets = ", ".join(f"{name} ({len(nodes)})" for name, nodes in self.sets.items()) or "no node sets"
        return f"Mesh: {len(self.points)} points, {len(self.cells)} cells, {1e6 * self.volume:.4g} ml, {sets}"


def mesh(
    points: ArrayLike,
    cells: ArrayLike,
    sets: Mapping[str, ArrayLike] | None = None,
    cell_sets: Mapping[str, ArrayLike] | None = None,
) -> Mesh:
    """A mesh from arrays: points (n, 3) [m], cells (m, 4) node indices from 0, sets of nodes and of cells by name.

    Inverted cells are turned, with a message. Raises `VisceraError`, which names the first faulty points or cells, for
    coordinates that are not finite, indices out of range, cells of zero volume or given twice, cells that overlap their
    neighbours, points that lie on a face without being a corner of it, and points without a cell.

    >>> import viscera as vs
    >>> corner = vs.mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]], sets={"floor": [0, 1, 2]})
    >>> corner
    Mesh: 4 points, 1 cells, 1.667e+05 ml, floor (3)
    """
    named, parts = _named_arrays(sets, "set"), _named_arrays(cell_sets, "cell set")
    corners = _array(cells, "cells", "rows of four node indices (m, 4)")
    return _checked(RawMesh(_array(points, "points", "rows of three numbers (n, 3)"), corners, named, parts))


def known(points: Floats, cells: Indices, sets: dict[str, Indices], cell_sets: dict[str, Indices]) -> Mesh:
    """As `mesh`, of one that a model was made with: what may be doubted of it was told then."""
    return _checked(RawMesh(points, cells, sets, cell_sets), is_new=False)


def read(path: str | Path, *, units: str | float = "m") -> Mesh:
    """Reads a mesh file: VTU, legacy VTK, Gmsh (1, 2.2, 4.1), Medit, Abaqus, FEBio.

    `units` of the file: "m", "cm", "mm", "um", "inch", or metres per unit; a mesh of a scan, written by `write` to
    `.vtu`, states that it is in metres, and no other units are taken. Node sets come from point sets and integer
    point arrays (VTU, VTK; `set:NAME` or NAME), physical groups (Gmsh), NSET and SURFACE (Abaqus), NodeSet and Surface
    (FEBio); cell sets from integer cell arrays, groups of tetrahedra, ELSET and Elements. Points of no cell are left
    out, and points of several pieces of a VTU file that lie at one place joined, with a message; otherwise as `mesh`.

    >>> import viscera as vs
    >>> vs.organs.beam().write("beam.msh")
    >>> vs.read("beam.msh", units="m")
    Mesh: 525 points, 1920 cells, 4e+04 ml, clamp (25), tip (25), top (105)
    """
    raw = meshfile.read(path_of(path, "the mesh file"), units)
    try:
        found = _checked(_without_loose_points(raw))
    except VisceraError as error:
        raise VisceraError(f"{path}: {error}") from None
    for problem in implausible(found.points):
        log.warning("%s: %s", path, problem)
    return found


def _checked(raw: RawMesh, *, is_new: bool = True) -> Mesh:
    points, cells = arrays(raw)
    facts = _core.inspect(points, cells)
    found = faults(facts)
    if len(facts["loose_points"]):
        found.append(f"{listed('point', facts['loose_points'])} in no cell; remove them")
    if found:
        raise VisceraError("; ".join(found))
    messages = list(raw.messages)
    if len(inverted := facts["inverted"]):
        cells[inverted] = cells[inverted][:, [0, 2, 1, 3]]
        messages.append(f"turned round {len(inverted)} of {len(cells)} cells that were inverted")
        said.info(messages[-1])
    for doubt in doubts(points, cells, facts) if is_new else ():
        messages.append(doubt)
        said.warning(doubt)
    sets = {name: _read_only(indices_of(nodes, len(points), f"set {name!r}")) for name, nodes in raw.sets.items()}
    parts = {
        name: _read_only(indices_of(chosen, len(cells), f"cell set {name!r}", "cell"))
        for name, chosen in raw.cell_sets.items()
    }
    return Mesh(_read_only(points), _read_only(cells), sets, tuple(messages), cell_sets=parts, axes=raw.axes)


def _array(value: ArrayLike, what: str, kind: str) -> NDArray[Any]:
    """An array as NumPy makes it of a value, whose numbers `inspection.arrays` checks."""
    if hides_no_number(value):
        raise refused(what, kind, value)
    try:
        return np.asarray(value)
    except (TypeError, ValueError, OverflowError):  # rows of different lengths
        raise refused(what, kind, value) from None


def _named_arrays(given: Mapping[str, ArrayLike] | None, noun: str) -> dict[str, NDArray[Any]]:
    """Sets by name, whose members `indices_of` checks."""
    if not isinstance(given, Mapping | None):
        raise refused(f"{noun}s", f"a mapping from the name of each {noun} to its members", given)
    found = {}
    for name, chosen in (given or {}).items():
        if not isinstance(name, str) or not name:
            raise refused(f"the name of a {noun}", "a text that is not empty", name)
        refuse_masked(chosen, f"{noun} {name!r}", "a list of indices, or a mask")
        try:
            found[name] = np.asarray(chosen)
        except (TypeError, ValueError, OverflowError):
            raise refused(f"{noun} {name!r}", "a list of indices, or a mask", chosen) from None
    return found


def _without_loose_points(raw: RawMesh) -> RawMesh:
    is_used = np.zeros(len(raw.points), dtype=bool)
    is_valid = (raw.cells >= 0) & (raw.cells < len(raw.points))
    is_used[raw.cells[is_valid]] = True
    if is_used.all() or not is_valid.all():
        return raw
    number = np.cumsum(is_used) - 1
    kept = {name: nodes[is_used[nodes]] for name, nodes in raw.sets.items()}
    sets = {name: number[nodes] for name, nodes in kept.items() if len(nodes)}
    message = f"dropped {np.count_nonzero(~is_used)} of {len(is_used)} points that belong to no cell"
    said.warning(message)  # in a format without an end mark, all that shows of a file cut short
    return RawMesh(raw.points[is_used], number[raw.cells], sets, raw.cell_sets, (*raw.messages, message), raw.axes)


def _box_of(points: Floats) -> Floats:
    """Lowest and highest coordinates (2, 3) of points (k, 3)."""
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _with_midpoints(nodes: Indices, edges: Indices, n_corners: int) -> Indices:
    """The nodes, and the midpoint of every edge (k, 2) whose ends are both among them."""
    inside = np.isin(edges, nodes).all(axis=1)
    midpoints = n_corners + np.flatnonzero(inside)
    return np.union1d(nodes, midpoints).astype(np.uint32)


def _again(points: Floats, cells: Indices, sets: Any, messages: Any, edges: Indices, parts: Any, *scan: Any) -> Mesh:
    """A mesh from the arrays of one, which pickle has made writable."""
    sets, parts = ({name: _read_only(members) for name, members in each.items()} for each in (sets, parts))
    return Mesh(_read_only(points), _read_only(cells), sets, messages, _read_only(edges), parts, *scan)


def _is_ours(array: Any, kind: type) -> bool:
    return isinstance(array, np.ndarray) and array.dtype == kind and not array.flags.writeable


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array = array.view()
    array.flags.writeable = False
    return array
