"""Organs side by side as one mesh with one law, and what belongs to each of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from viscera import law as laws
from viscera.boundary.loads import faces_within
from viscera.boundary.ties import NONE, Ties
from viscera.errors import VisceraError, did_you_mean
from viscera.members import sets_within
from viscera.mesh import Floats, Indices, Mesh
from viscera.organ import Organ
from viscera.quantity import brief

if TYPE_CHECKING:
    from viscera.boundary.bond import Bond, Pieces
    from viscera.contact.pair import ContactPair


def numbers_of(meshes: Mapping[str, Mesh]) -> dict[str, NDArray[np.int64]]:
    """Of the mesh of each organ: the nodes of the scene that are its own. All midpoints come after all corners."""
    corners = np.cumsum([0, *(mesh.n_corners for mesh in meshes.values())])
    edges = corners[-1] + np.cumsum([0, *(len(mesh.edges) for mesh in meshes.values())])
    starts = zip(meshes.items(), corners[:-1], edges[:-1], strict=True)
    return {
        name: np.concatenate([first + np.arange(mesh.n_corners), middle + np.arange(len(mesh.edges))]).astype(np.int64)
        for (name, mesh), first, middle in starts
    }


def joined_mesh(organs: Mapping[str, Organ]) -> Mesh:
    """The linear meshes side by side. They are checked already, and may lie on each other."""
    points, cells = [], []
    sets, cell_sets = dict[str, Indices](), dict[str, Indices]()
    first = n_cells = 0
    for name, organ in organs.items():
        mesh = organ.mesh.linear()
        points.append(mesh.points)
        cells.append(mesh.cells + np.uint32(first))
        sets[name] = np.arange(first, first + len(mesh.points), dtype=np.uint32)
        sets |= {f"{name}/{own}": sets[name][nodes] for own, nodes in mesh.sets.items()}
        cell_sets[name] = np.arange(n_cells, n_cells + len(mesh.cells), dtype=np.uint32)
        cell_sets |= {f"{name}/{own}": cell_sets[name][chosen] for own, chosen in mesh.cell_sets.items()}
        first, n_cells = first + len(mesh.points), n_cells + len(mesh.cells)
    all_points, all_cells = np.concatenate(points), np.concatenate(cells).astype(np.uint32)
    all_points.flags.writeable = all_cells.flags.writeable = False
    axes = {organ.mesh.axes for organ in organs.values()}
    common = axes.pop() if len(axes) == 1 else ""
    is_unloaded = any(organ.mesh.is_unloaded for organ in organs.values())
    return Mesh(all_points, all_cells, sets, cell_sets=cell_sets, axes=common, is_unloaded=is_unloaded)


def parted_mesh(mesh: Mesh) -> dict[str, Mesh]:
    """The meshes of the organs, by name, that `joined_mesh` has put side by side; empty if it has not made this one."""
    whole = mesh.linear()
    names = [name for name in whole.sets if "/" not in name and name in whole.cell_sets]
    names.sort(key=lambda name: int(whole.sets[name][0]))
    nodes = [np.zeros(0, dtype=np.uint32), *(whole.sets[name] for name in names)]
    if not np.array_equal(np.concatenate(nodes), np.arange(len(whole.points))):
        return {}
    parts = {}
    for name in names:
        first, count = whole.sets[name][0], len(whole.sets[name])
        cells = whole.cells[whole.cell_sets[name]]
        if cells.min() < first or cells.max() >= first + count:
            return {}
        sets = sets_within(name, whole.sets, whole.sets[name])
        cell_sets = sets_within(name, whole.cell_sets, whole.cell_sets[name])
        part = replace(
            whole, points=whole.points[first : first + count], cells=cells - first, sets=sets, cell_sets=cell_sets
        )
        parts[name] = part.quadratic() if len(mesh.edges) else part
    return parts


def require_organ(name: str, organs: Collection[str]) -> None:
    """Raise `VisceraError` unless an organ has this name."""
    if name not in organs:
        raise VisceraError(f"no organ of the scene is called {brief(name)}; {did_you_mean(str(name), organs)}")


def sides_of(
    pair: Bond | ContactPair, meshes: Mapping[str, Mesh], numbers: Mapping[str, NDArray[np.int64]]
) -> list[Indices]:
    """The faces (f, 3) or (f, 6) of each side, by the nodes of the joined mesh.

    numbers: of each organ, as `numbers_of` tells them. Raises `VisceraError` for a place without a face.
    """
    sides = []
    for name, where in pair.sides:
        require_organ(name, meshes)
        mesh = meshes[name]
        faces = faces_within(mesh, mesh.surface_nodes if where is None else mesh.nodes(where))
        if not len(faces):
            raise VisceraError(f"{pair!r}: the place of {name!r} holds no triangle of its surface; take a larger one")
        sides.append(numbers[name][faces].astype(np.uint32))
    return sides


def diagonal_of(pair: Bond | ContactPair, meshes: Mapping[str, Mesh]) -> float:
    """The diagonal of the smaller organ of a pair [m]."""
    return min(meshes[name].diagonal for name, _ in pair.sides)


def pieces_of(bond: Bond, mesh: Mesh, meshes: Mapping[str, Mesh], numbers: Mapping[str, NDArray[np.int64]]) -> Pieces:
    """What a bond holds together on the joined mesh."""
    sides = sides_of(bond, meshes, numbers)
    return bond._pieces(mesh, sides, bond._reach(diagonal_of(bond, meshes)))


def part_of(organ: Organ, name: str) -> tuple[Organ, NDArray[np.int64]]:
    """One of the organs that `joined_mesh` has put side by side, and its nodes (k,) in the whole.

    Its supports are the samples that lie on it alone, which those of bonds do not. Raises `VisceraError` for an organ
    that is not of several, and for a name that none of them has.
    """
    parts = parted_mesh(organ.mesh)
    if not parts:
        raise VisceraError(f"{name!r} names a part of a scene, and this is no scene but one organ")
    require_organ(name, parts)
    nodes = numbers_of(parts)[name]
    law = law_of(organ.law, organ.mesh.cell_sets[name].astype(np.int64))
    ties = _ties_within(organ._ties, nodes)
    fixed = np.flatnonzero(np.isin(nodes, organ.fixed))
    return Organ(parts[name], law, fixed, element=organ.element, supports=[ties] if len(ties) else []), nodes


def joined_law(organs: Mapping[str, Organ]) -> laws.Law:
    """One law with parameters per cell for all organs of one law; laws of several kinds side by side."""
    rows: dict[str, Floats] = {}
    total = sum(len(organ.mesh.cells) for organ in organs.values())
    of_cell, first = np.empty(total, dtype=np.int64), 0
    for organ in organs.values():
        count = len(organ.mesh.cells)
        several = organ.law if isinstance(organ.law, laws.Several) else None
        parts = several.laws if several else (organ.law,)
        owner = several.of_cell if several else np.zeros(count, dtype=np.int64)
        for k, part in enumerate(parts):
            own = np.flatnonzero(owner == k)
            if not len(own):
                continue
            kind = rows.setdefault(part.name, np.tile(part.parameters[:1], (total, 1)))
            kind[first + own] = part.parameters[own] if len(part.parameters) > 1 else part.parameters
            of_cell[first + own] = list(rows).index(part.name)
        first += count
    whole = [laws.from_core(name, each[:1] if (each == each[0]).all() else each) for name, each in rows.items()]
    return whole[0] if len(whole) == 1 else laws.Several.of_cells(tuple(whole), of_cell)


def law_of(law: laws.Law, cells: NDArray[np.int64]) -> laws.Law:
    """Of some of the cells of a joined mesh, in their order."""
    if isinstance(law, laws.Several):
        first, *others = np.unique(law.of_cell[cells])
        if not others:
            return law_of(law.laws[first], cells)
        return laws.Several.of_cells(tuple(law_of(part, cells) for part in law.laws), law.of_cell[cells])
    return law if len(law.parameters) == 1 else laws.from_core(law.name, law.parameters[cells])


def renumbered(ties: Ties, numbers: Indices | NDArray[np.int64]) -> Ties:
    links = tuple(
        replace(link, ends=tuple((int(numbers[node]), weight) for node, weight in link.ends)) for link in ties.links
    )
    return Ties(ties.start, numbers[ties.nodes].astype(np.uint32), ties.weights, ties.stiffness, links)


def _ties_within(ties: Ties, nodes: NDArray[np.int64]) -> Ties:
    """The samples all of whose nodes are among these (k,), ascending, and numbered by them."""
    if not len(ties):
        return NONE
    is_own = np.isin(ties.nodes, nodes)
    is_whole = np.logical_and.reduceat(is_own, ties.start[:-1].astype(np.int64))
    kept = np.repeat(is_whole, ties.counts)
    start = np.concatenate([[0], np.cumsum(ties.counts[is_whole])]).astype(np.uint32)
    own = np.searchsorted(nodes, ties.nodes[kept]).astype(np.uint32)
    return Ties(start, own, ties.weights[kept], ties.stiffness[is_whole])
