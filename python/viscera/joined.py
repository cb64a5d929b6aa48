"""Organs side by side as one mesh with one law, and what belongs to each of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from viscera import law as laws
from viscera.mesh import Floats, Indices, Mesh
from viscera.organ import Organ
from viscera.ties import Ties


def numbers_of(organs: Mapping[str, Organ]) -> dict[str, NDArray[np.int64]]:
    """Of each organ: the nodes of the scene that are its own. The midpoints of all organs come after all corners."""
    corners = np.cumsum([0, *(organ.mesh.n_corners for organ in organs.values())])
    edges = corners[-1] + np.cumsum([0, *(len(organ.mesh.edges) for organ in organs.values())])
    starts = zip(organs.items(), corners[:-1], edges[:-1], strict=True)
    return {
        name: np.concatenate(
            [first + np.arange(organ.mesh.n_corners), middle + np.arange(len(organ.mesh.edges))]
        ).astype(np.int64)
        for (name, organ), first, middle in starts
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
    return Mesh(all_points, all_cells, sets, cell_sets=cell_sets, axes=axes.pop() if len(axes) == 1 else "")


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
