"""The faults of a mesh, in sentences. Nothing is repaired here, and nothing refused."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera import _core
from viscera.errors import VisceraError
from viscera.files import mesh as meshfile
from viscera.files.mesh import RawMesh
from viscera.quantity import LARGEST, path_of

if TYPE_CHECKING:
    from viscera.mesh import Floats, Indices, Mesh

# An organ outside this range of bounding-box diagonals [m] was most likely read in the wrong unit.
PLAUSIBLE_DIAGONAL = (1e-3, 2.0)

SAME_PLACE = 1e-9
"""Distance, in sizes of the mesh, below which two points count as one: the rounding of files."""
DEEP = 1e-6
"""Least barycentric coordinate of a place inside a cell, against rounding."""
MIDDLE = np.array([0.43, 0.29, 0.19, 0.09])
"""Barycentric coordinates of a place in a cell. No two sums of them are equal: between even grids, however one is moved
over the other, such places are on no face, as corners and centroids are."""
NEAR = 1e-3
"""Part of the way from a corner of a cell to there that is within the cell, so that what only touches a part is not in
it."""
KINDS = {"c": "complex numbers", "b": "booleans", "U": "texts", "S": "bytes"}
"""Words for what stands in place of numbers, by NumPy's letter."""


def inspect(path: str | Path, *, units: str | float = "m") -> dict[str, Any]:
    """The sanity report of a mesh file, good or bad; see `report`."""
    return report(meshfile.read(path_of(path, "the mesh file"), units))


def report(raw: RawMesh | Mesh) -> dict[str, Any]:
    """Facts and problems of a mesh, without repairing or refusing anything.

    n_points, n_cells, bounding_box [[3], [3]] [m], volume [m^3], volume_ml, quality {min, mean} (mean ratio, 1 =
    regular tetrahedron), problems (sentences), axes ("RAS", "LPS" or None), sets {name: number of nodes}, cell_sets
    {name: number of cells},
    parts (cells are of one part when they share a face), messages. Numbers that a broken mesh does not have are None.
    """
    result: dict[str, Any] = {
        "n_points": len(raw.points),
        "n_cells": len(raw.cells),
        "bounding_box": None,
        "volume": None,
        "volume_ml": None,
        "quality": None,
        "parts": None,
        "axes": raw.axes or None,
        "sets": {name: len(nodes) for name, nodes in raw.sets.items()},
        "cell_sets": {name: len(cells) for name, cells in raw.cell_sets.items()},
        "messages": list(raw.messages),
    }
    try:
        points, cells = arrays(raw)
    except VisceraError as error:
        return result | {"problems": [str(error)]}
    facts = _core.inspect(points, cells)
    volume = float(np.abs(facts["cell_volumes"]).sum())
    return result | {
        "bounding_box": [points.min(axis=0).tolist(), points.max(axis=0).tolist()],
        "volume": volume,
        "volume_ml": 1e6 * volume,
        "quality": {"min": float(facts["quality"].min()), "mean": float(facts["quality"].mean())},
        "parts": int(facts["n_parts"]),
        "problems": problems_of(points, cells, facts),
    }


def problems_of(points: Floats, cells: Indices, facts: dict[str, Any]) -> list[str]:
    problems = faults(facts)
    if len(facts["inverted"]) and not len(facts["overlapping"]):
        problems.append(f"{listed('cell', facts['inverted'])} inverted; reading the mesh turns them round")
    if len(facts["loose_points"]):
        problems.append(f"{listed('point', facts['loose_points'])} in no cell; reading a file drops them")
    if facts["n_parts"] > 1:
        sizes = np.sort(np.bincount(facts["part"]))[::-1]
        problems.append(
            f"the mesh has {facts['n_parts']} separate parts (of {', '.join(map(str, sizes[:5]))}"
            f"{', ...' if len(sizes) > 5 else ''} cells); each needs its own fixed nodes"
        )
    return problems + doubts(points, cells, facts) + implausible(points)


def faults(facts: dict[str, Any]) -> list[str]:
    """Faults that no reader can repair."""
    found = []
    if len(facts["degenerate"]):
        found.append(f"{listed('cell', facts['degenerate'])} of zero volume; remove or remesh them")
    if len(facts["duplicate"]):
        found.append(f"{listed('cell', facts['duplicate'])} on the same four points as an earlier cell; remove them")
    if len(over := facts["overlapping"]):
        volumes = np.abs(facts["cell_volumes"])
        found.append(
            f"{listed('cell', over)} pushed through neighbouring cells: the volumes of all cells add up to "
            f"{1e6 * volumes.sum():.6g} ml, {2e6 * volumes[over].sum():.3g} ml more than the surface encloses; move "
            "their points back, or remesh"
        )
    if len(facts["crowded"]):
        found.append(f"{listed('cell', facts['crowded'])} on a face that two other cells share already; remove them")
    if len(hanging := facts["hanging"]):
        found.append(
            f"{listed('point', hanging[:, 0])} hanging on a face of another cell (the first on one of cell "
            f"{hanging[0, 1]}) without being a corner of it: the two sides would separate there; remesh"
        )
    return found


def doubts(points: Floats, cells: Indices, facts: dict[str, Any]) -> list[str]:
    """What may be meant, but seldom is: a mesh is read all the same."""
    return hinges(facts) + doubled(points) + overlaps(points, cells, facts)


def doubled(points: Floats) -> list[str]:
    """Where one point lies on another: the lips of a cut, or what was never joined."""
    size = float(np.ptp(points, axis=0).max())
    place = np.round((points - points.min(axis=0)) / (SAME_PLACE * size)) if size > 0.0 else points
    order = np.lexsort(place.T)
    again = order[1:][(place[order[1:]] == place[order[:-1]]).all(axis=1)]
    if not len(again):
        return []
    return [
        f"{listed('point', np.sort(again))} at the place of another: the cells on the two sides are not joined there; "
        "merge the points, unless it is a cut"
    ]


def overlaps(points: Floats, cells: Indices, facts: dict[str, Any]) -> list[str]:
    """Cells of a part with a place next to a corner, or in the middle, inside another part."""
    if facts["n_parts"] < 2 or len(facts["degenerate"]):
        return []
    owner, corners, is_inside = facts["part"], points[cells], np.zeros(len(cells), dtype=bool)
    weights = np.vstack([(1.0 - NEAR) * np.eye(4) + NEAR * MIDDLE, MIDDLE])
    order = np.argsort(owner, kind="stable")
    starts = np.searchsorted(owner[order], np.arange(facts["n_parts"]))
    low = np.minimum.reduceat(corners.min(axis=1)[order], starts)
    high = np.maximum.reduceat(corners.max(axis=1)[order], starts)
    for part, (lowest, highest) in enumerate(zip(low, high, strict=True)):
        is_near = (low < highest).all(axis=1) & (high > lowest).all(axis=1)
        is_near[part] = False
        if is_near.any():
            own = np.flatnonzero(owner == part)
            places = (weights @ corners[own]).reshape(-1, 3)
            found, at = _core.Locator(points, cells[is_near[owner]]).find(places)
            is_deep = (found >= 0) & (at.min(axis=1) > DEEP)
            is_inside[own] = is_deep.reshape(-1, len(weights)).any(axis=1)
    if not is_inside.any():
        return []
    inside = np.flatnonzero(is_inside).astype(np.uint32)
    return [f"{listed('cell', inside)} inside another part: parts overlap; move them apart, or join them"]


def hinges(facts: dict[str, Any]) -> list[str]:
    """Where parts share points but no face."""
    if (count := len(at := facts["pinches"])) == 0:
        return []
    where = f"point {at[0]}" if count == 1 else f"{count} points (first: {', '.join(map(str, at[:5]))})"
    return [f"parts meet at {where} only, without a common face: they turn there as on a hinge"]


def implausible(points: Floats) -> list[str]:
    """Size and place that tell of another unit."""
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    away = float(np.abs(points).max())
    low, high = PLAUSIBLE_DIAGONAL
    found = []
    if not low <= diagonal <= high:
        found.append(f"the bounding box has a diagonal of {diagonal:.3g} m, implausible for an organ; check `units`")
    if away > LARGEST["m"]:
        found.append(f"a coordinate is {away:.4g} m in size, implausible for an organ; check `units`, or move the mesh")
    return found


def listed(noun: str, indices: Indices) -> str:
    """`cell 7 is`, or `12 cells (first: 7, 9, 11, 12, 30) are`."""
    if len(indices) == 1:
        return f"{noun} {indices[0]} is"
    return f"{len(indices)} {noun}s (first: {', '.join(map(str, indices[:5]))}) are"


def arrays(raw: RawMesh | Mesh) -> tuple[Floats, Indices]:
    """Points and cells in the form of the core (a copy), or a sentence that says why they are not valid."""
    kind = raw.points.dtype.kind
    if kind not in "iuf":  # NumPy would drop imaginary parts, and read texts and booleans as numbers
        raise VisceraError(f"points must be real numbers (n, 3), not {KINDS.get(kind, 'objects')} {raw.points.shape}")
    points = np.array(raw.points, dtype=np.float64, order="C")
    cells = raw.cells
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise VisceraError(f"points must have the shape (n, 3) with n > 0, not {points.shape}")
    if cells.ndim != 2 or cells.shape[1] != 4 or len(cells) == 0:
        raise VisceraError(f"cells must have the shape (m, 4) with m > 0, not {cells.shape}")
    if not np.issubdtype(cells.dtype, np.integer):
        raise VisceraError(f"cells must hold integers, not {cells.dtype}")
    bad_points = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad_points):
        first = bad_points[0]
        more = f" ({len(bad_points)} such points)" if len(bad_points) > 1 else ""
        raise VisceraError(f"point {first} has a coordinate that is not finite: {points[first].tolist()}{more}")
    bad_cells = np.flatnonzero(((cells < 0) | (cells >= len(points))).any(axis=1))
    if len(bad_cells):
        first = bad_cells[0]
        more = f" ({len(bad_cells)} such cells)" if len(bad_cells) > 1 else ""
        raise VisceraError(f"cell {first} {cells[first].tolist()} names a point that is not one of {len(points)}{more}")
    return points, np.array(cells, dtype=np.uint32, order="C")
