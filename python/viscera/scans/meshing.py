"""Tetrahedra from labels on a grid, or from the surface of an organ; the work is done in the compiled mesher.

The labels' indicators are smoothed by a Gaussian, each with a bias that keeps the label's volume; the cells of a
body-centred lattice, graded between labels with edges of different lengths, are cut along the surfaces between them
(isosurface stuffing, Labelle and Shewchuk 2007); then nodes move on these surfaces until the worst dihedral angles are
good.
"""

from __future__ import annotations

import os
import re
import string
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera import _core
from viscera.errors import VisceraError, did_you_mean
from viscera.files import surface as surfacefile
from viscera.files.mesh import METRES, metres_per_unit
from viscera.mesh import Floats, Indices, Mesh, mesh
from viscera.progress import shown
from viscera.quantity import Number, brief
from viscera.scans.placement import misplaced
from viscera.select import BOUND, length

Progress = Callable[[int, int, str], None]
Edges = float | str | Mapping[str, float | str]
"""A mean edge [m] or words such as "8 mm"; or one for each part by name."""
Numbers = NDArray[np.integer[Any]]
SURFACES = (".stl", ".obj", ".ply")
VOXELS_PER_EDGE = 4
"""Voxels along an edge, in the grid that separates the inside of a surface from the outside."""
TURNED = "turned the surface round: its triangles looked inward"
MOST_VOXELS = 2e8
MOST_CELLS = 5e7
MIDDLE_EDGE = 0.911
"""Mean edge of the lattice in units of its spacing; the volume of a cell is a twelfth of the spacing cubed."""
AT_BORDER = 1e-3
"""How far a node on a flat end may lie from the image's border [voxels]."""
OFF = 0.02
"""Share of its volume by which a part may be off before a message says so."""
MISPLACED = 0.07
"""Share of its volume that a part may have in other places than its voxels before a message says so."""
MOST_OFF = 0.5
"""A part that is off by more is refused: cells this coarse do not show it."""
DIRECTIONS = {
    "RAS": (("right", "left"), ("anterior", "posterior"), ("superior", "inferior")),
    "LPS": (("left", "right"), ("posterior", "anterior"), ("superior", "inferior")),
    "": (("+x", "-x"), ("+y", "-y"), ("+z", "-z")),
}
"""The patient's directions that the world axes point to, and those that they point from."""


@dataclass(frozen=True)
class Region:
    """A part of a mesh: its name and its labels."""

    name: str
    numbers: tuple[int, ...]


def mesh_regions(
    values: NDArray[np.uint16],
    affine: Floats,
    regions: Sequence[Region],
    edge: Edges,
    *,
    axes: str = "",
    volumes: list[float] | None = None,
    progress: Progress | None = None,
) -> Mesh:
    """Conforming tetrahedra of regions of a label map (i, j, k), with the volumes [m^3] of their voxels or those given;
    see `Scan.mesh`."""
    names = [region.name for region in regions]
    sizes = edge_lengths(edge, names)
    order = np.zeros(65536, dtype=np.uint16)
    for region in regions:
        order[list(region.numbers)] = region.numbers[0]
    voxel = abs(float(np.linalg.det(affine[:, :3])))
    own = order[values]
    cells = 0.0
    for region, size in zip(regions, sizes, strict=True):
        volume = voxel * np.count_nonzero(own == region.numbers[0])
        _check_edge(region.name, volume, size)
        cells += 12.0 * volume * (MIDDLE_EDGE / size) ** 3
    if cells > MOST_CELLS:
        raise VisceraError(f"an edge of {1e3 * min(sizes):g} mm would make {cells:.2g} cells; give a longer one")
    labels = [region.numbers[0] for region in regions]
    tell = None if progress is None else lambda done, total: progress(done, total, "meshing")
    named = list(zip(labels, names, strict=True))
    made = _core.mesh_labels(own, affine, named, volumes=volumes, edges=sizes, on_progress=tell)
    cell_sets = {region.name: np.flatnonzero(made["owner"] == k) for k, region in enumerate(regions)}
    sets = {"cut": made["cut"]} if len(made["cut"]) else {}
    found = mesh(made["points"], made["cells"], sets, cell_sets)
    told = [*_cut_ends(made, own.shape, affine, axes, names), *_lost_pieces(made, names)]
    told += _shorter_edges(made["edges"], sizes, names)
    told += _volumes_off(found, made, "voxels" if volumes is None else "surface")
    told += _misplaced(found, own, affine, labels, made["edges"])
    messages = (*found.messages, *told)
    return replace(found, axes=axes, messages=messages)


def edge_lengths(edge: Edges, parts: Sequence[str]) -> list[float]:
    """The mean edge of each part [m]; raises `VisceraError` unless every part has one, and nothing else.

    >>> edge_lengths({"vein": "3 mm", "liver": 0.008}, ["liver", "vein"]), edge_lengths("5 mm", ["a", "b"])
    ([0.008, 0.003], [0.005, 0.005])
    """
    if not isinstance(edge, Mapping):
        return [_edge(edge, "edge")] * len(parts)
    if unknown := [name for name in edge if name not in parts]:
        raise VisceraError(f"edge {unknown[0]!r} is of no part; {did_you_mean(unknown[0], parts)}")
    if missing := [name for name in parts if name not in edge]:
        raise VisceraError(f"edge has no length for {missing[0]!r}; give one for every part")
    return [_edge(edge[name], f"edge of {name!r}") for name in parts]


@shown
def mesh_surface(
    surface: str | os.PathLike[str] | tuple[Any, Any],
    *,
    edge: float | str,
    units: str | float = "m",
    name: str = "organ",
    progress: Progress | None = None,
) -> Mesh:
    """Tetrahedra inside a nearly closed surface: a file (STL, OBJ, PLY), or points (n, 3) and triangles (t, 3).

    A point is inside if the generalised winding number exceeds a half (Jacobson, Kavan and Sorkine-Hornung 2013),
    evaluated on a grid of four voxels per edge. Holes are closed and overlapping parts joined, and `messages` says so.
    A sound surface keeps its volume; details finer than a voxel are rounded.
    edge: as in `Scan.mesh`; units: of the file or of the points. Raises `VisceraError` if nothing is inside.

    >>> import viscera as vs
    >>> beam = vs.organs.beam()
    >>> vs.mesh_surface((beam.points, beam.surface), edge=0.1).messages
    ()
    """
    size = _edge(edge, "edge")
    points, triangles, axes = _surface(surface, units)
    points, triangles, notes, messages = _mended(points, triangles)
    step = size / VOXELS_PER_EDGE
    low, high = points.min(axis=0), points.max(axis=0)
    shape = [int(n) for n in np.ceil((high - low) / step) + 8]
    if np.prod(shape, dtype=float) > MOST_VOXELS:
        raise VisceraError(
            f"an edge of {1e3 * size:g} mm is too short for a surface of {1e3 * np.linalg.norm(high - low):.4g} mm: "
            "the grid would have more than 2e8 voxels; give a longer one, or check the units"
        )
    affine = np.column_stack([step * np.eye(3), low - 3.5 * step])
    tell = None if progress is None else lambda done, total: progress(done, total, "winding numbers")
    winding = _core.winding_numbers(points, triangles, shape, affine, on_progress=tell)
    inside = np.abs(winding) > 0.5
    if not inside.any():
        _check_edge(name, abs(_enclosed(points, triangles)), size)
        raise VisceraError("nothing is inside the surface: its holes are too large, or it is flat")
    twice = np.count_nonzero(np.abs(winding) > 1.5) * step**3
    if twice > 0:
        messages.append(f"parts of the surface overlap in {1e6 * twice:.3g} ml; they are joined")
    if (turned := np.count_nonzero(winding < -0.5) * step**3) > 0:
        messages.append(f"the triangles around {1e6 * turned:.3g} ml look inward; that is inside as well")
    exact = None if messages else [_enclosed(points, triangles)]
    region = Region(name, (1,))
    found = mesh_regions(inside.astype(np.uint16), affine, [region], size, axes=axes, volumes=exact, progress=progress)
    return replace(found, messages=(*notes, *messages, *found.messages))


def read_surface(path: Path, units: str | float) -> tuple[Floats, Indices]:
    """Points (n, 3) [m] and triangles (t, 3) of a file, with equal points joined and triangles turned outward."""
    points, triangles, _ = _surface(path, units)
    points, triangles, _, _ = _mended(points, triangles)
    return points, triangles


def edge_means(points: Floats, cells: Indices) -> Floats:
    """The mean length of each cell's edges (m,) [m]."""
    pairs = points[cells[:, [0, 0, 0, 1, 1, 2]]] - points[cells[:, [1, 2, 3, 2, 3, 3]]]
    return np.asarray(np.linalg.norm(pairs, axis=2).mean(axis=1))


def least_angles(points: Floats, cells: Indices) -> Floats:
    """The smallest dihedral angle of each cell (m,) [degrees]."""
    x = points[cells]
    least = np.full(len(cells), np.inf)
    for i, j, left, right in ((0, 1, 2, 3), (0, 2, 1, 3), (0, 3, 1, 2), (1, 2, 0, 3), (1, 3, 0, 2), (2, 3, 0, 1)):
        edge = x[:, j] - x[:, i]
        n, m = (np.cross(edge, x[:, corner] - x[:, i]) for corner in (left, right))
        sine, cosine = np.linalg.norm(np.cross(n, m), axis=1), np.einsum("ij,ij->i", n, m)
        least = np.minimum(least, np.degrees(np.arctan2(sine, cosine)))
    return least


def _edge(value: Any, what: str) -> float:
    """An edge [m], in whose words a percentage would have nothing to refer to."""
    if isinstance(value, str):
        words = value.strip()
        if "%" in words:
            raise VisceraError(f"{what}: a percentage of what? write {brief(value)} with its unit, such as '8 mm'")
        unit = words[len(words.rstrip(string.ascii_letters)) :]
        if not re.fullmatch(BOUND, words) or unit not in METRES:
            raise VisceraError(f"{what} {brief(value)} is not a length; write it as '8 mm' (in {', '.join(METRES)})")
    return Number("m", above=0)(length(value, 0.0, what), what)


def _check_edge(name: str, volume: float, edge: float) -> None:
    across = (6.0 * volume / np.pi) ** (1.0 / 3.0)
    if edge > across:
        raise VisceraError(
            f"the edge, {1e3 * edge:.4g} mm, is longer than {name!r}, which is {1e3 * across:.3g} mm across "
            "(the diameter of a ball of its volume); give a shorter one"
        )


def _cut_ends(made: dict[str, Any], shape: Sequence[int], affine: Floats, axes: str, names: Sequence[str]) -> list[str]:
    """The ends of the image at which parts of the mesh are flat."""
    is_cut = np.zeros(len(made["points"]), dtype=bool)
    is_cut[made["cut"]] = True
    index = (made["points"] - affine[:, 3]) @ np.linalg.inv(affine[:, :3]).T
    messages = []
    for place, name in enumerate(names):
        cells = made["cells"][made["owner"] == place]
        ends = []
        for k, side in ((k, side) for k in range(3) for side in (0, -1)):
            border = -0.5 if side == 0 else shape[k] - 0.5
            is_flat = is_cut & (np.abs(index[:, k] - border) < AT_BORDER)
            if (is_flat[cells].sum(axis=1) >= 3).any():
                ends.append(_end(affine, axes, k, side))
        if ends:
            messages.append(
                f"the image's edge cuts {name!r} at its {_listed(ends)} end, which is flat there: set 'cut'"
            )
    return messages


def _lost_pieces(made: dict[str, Any], names: Sequence[str]) -> list[str]:
    """The separate pieces of voxels that the mesh does not hold."""

    def told(kind: str, reason: str, remedy: str = "") -> list[str]:
        if not (count := made[f"n_{kind}"]):
            return []
        volumes = zip(1e6 * np.asarray(made[kind]), names, strict=True)
        lost = ", ".join(f"{float(f'{ml:.2g}'):g} ml of {name!r}" for ml, name in volumes if ml)
        pieces = "a separate piece" if count == 1 else f"{count} separate pieces"
        return [f"dropped {pieces} {reason}: {lost}{remedy}"]

    return [
        *told("dropped", "with less than 5 % of its label"),
        *told("missed", "for which the edge is too long", "; give a shorter edge where that matters"),
    ]


def _volumes_off(found: Mesh, made: dict[str, Any], whose: str) -> list[str]:
    """The parts whose volume is not that of their voxels, or of the surface, less what was dropped."""
    messages = []
    kept = made["volumes"] - made["dropped"] - made["missed"]
    for (name, cells), wanted in zip(found.cell_sets.items(), kept, strict=True):
        volume = float(found.facts["cell_volumes"][cells].sum())
        off = volume / wanted - 1.0
        both = f"its mesh has {1e6 * volume:.3g} ml, its {whose} {1e6 * wanted:.3g} ml"
        if abs(off) > MOST_OFF:
            raise VisceraError(f"the edge is too long for {name!r}: {both}; give a shorter one")
        if abs(off) > OFF:
            than = f"{100 * abs(off):.2g} % too {'large' if off > 0.0 else 'small'}"
            messages.append(f"{name!r} is {than} ({both}): give a shorter edge where that matters")
    return messages


def _misplaced(found: Mesh, own: NDArray[np.uint16], affine: Floats, labels: Sequence[int], edges: Floats) -> list[str]:
    """The parts of which much volume is in other places than that of their voxels."""
    messages = []
    for (name, cells), label, edge in zip(found.cell_sets.items(), labels, edges, strict=True):
        volumes = found.facts["cell_volumes"][cells]
        volume = float(volumes.sum())
        off = misplaced(own == label, affine, found.points, found.cells[cells], volumes, float(edge))
        if off > MISPLACED * volume:
            messages.append(
                f"{name!r} is too thick in some places and too thin in others: {1e6 * off:.2g} of its "
                f"{1e6 * volume:.3g} ml are not where its voxels are; give a shorter edge where that matters, or finer "
                "voxels"
            )
    return messages


def _shorter_edges(edges: Floats, asked: Sequence[float], names: Sequence[str]) -> list[str]:
    """What the lattice made of the lengths asked for, where that is less."""
    told = [
        f"{1e3 * edge:.3g} mm in {name!r}"
        for edge, size, name in zip(edges, asked, names, strict=True)
        if edge < 0.999 * size
    ]
    return [f"lengths double from cube to cube, so edges are {_listed(told)}"] if told else []


def _listed(words: list[str]) -> str:
    """Words with commas, and `and` before the last.

    >>> _listed(["left", "right", "inferior"]), _listed(["superior"])
    ('left, right and inferior', 'superior')
    """
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _end(affine: Floats, axes: str, k: int, side: int) -> str:
    """The patient's direction in which voxels begin (side 0) or end along index axis k."""
    step = affine[:, k] * (1 if side else -1)
    world = int(np.abs(step).argmax())
    names = DIRECTIONS.get(axes, DIRECTIONS[""])
    return names[world][int(step[world] < 0.0)]


def _surface(surface: Any, units: str | float) -> tuple[Floats, Indices, str]:
    """Points [m], triangles and world axes of a surface."""
    factor = metres_per_unit(units)
    if isinstance(surface, str | os.PathLike):
        (points, triangles, axes), place = _read_surface(Path(surface)), f"{surface}: "
    else:
        (points, triangles), axes, place = _pair(surface), "", ""
    if points.ndim != 2 or points.shape[1] != 3:
        raise VisceraError(f"a surface needs points (n, 3), not {points.shape}")
    if len(wrong := np.flatnonzero(~np.isfinite(points).all(axis=1))):
        raise VisceraError(f"point {wrong[0]} of the surface is {points[wrong[0]].tolist()}; it must be finite")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.size == 0:
        raise VisceraError(f"a surface needs triangles (t, 3), not {triangles.shape}")
    if triangles.min() < 0 or triangles.max() >= len(points):
        raise VisceraError(f"{place}a triangle names a point that is not one of {len(points)}")
    return factor * points, triangles.astype(np.uint32), axes


def _pair(surface: Any) -> tuple[Floats, NDArray[Any]]:
    """Points and triangles as numbers, of whatever shape."""
    try:
        points, triangles = surface
    except (TypeError, ValueError):
        raise VisceraError("a surface is a file's path, or a pair: points (n, 3) and triangles (t, 3)") from None
    try:
        points, triangles = np.asarray(points, dtype=np.float64), np.asarray(triangles)
        is_whole = triangles.size == 0 or np.array_equal(triangles, np.rint(triangles))
    except (TypeError, ValueError):
        is_whole = False
    if not is_whole or triangles.dtype.kind not in "iuf":
        raise VisceraError("a surface needs points (n, 3) of numbers and triangles (t, 3) of whole numbers")
    return points, triangles


def _read_surface(path: Path) -> tuple[Floats, NDArray[np.int64], str]:
    """Points and triangles of a file, and the world axes that 3D Slicer states in it."""
    if path.is_dir() or not path.exists():
        raise VisceraError(f"{path}: {'is a folder, not a surface' if path.is_dir() else 'no such file'}")
    if path.suffix.lower() not in SURFACES:
        raise VisceraError(f"{path}: unknown surface format; the formats are {', '.join(SURFACES)}")
    points, triangles, axes = surfacefile.read(path)
    if not len(triangles):
        raise VisceraError(f"{path}: it has no triangles")
    return points, triangles, axes


def _mended(points: Floats, triangles: Indices) -> tuple[Floats, Indices, list[str], list[str]]:
    """The surface with equal points joined, unused ones left out and triangles turned outward; what was turned; and a
    list of faults that leave its volume unknown."""
    notes, faults = [], []
    used, number = np.unique(triangles, return_inverse=True)
    places, place = np.unique(points[used], axis=0, return_inverse=True)
    triangles = place.reshape(-1)[number.reshape(triangles.shape)].astype(np.uint32)
    is_odd, is_one_sided = _odd_triangles(triangles)
    if odd := np.count_nonzero(is_odd):
        triangles[is_odd] = triangles[is_odd, ::-1]
        notes.append(f"turned {odd} of {len(triangles)} triangles that faced another way than those around them")
    if is_one_sided:
        faults.append("the triangles of the surface cannot all face one way; its volume is that of the grid's voxels")
    if _enclosed(places, triangles) < 0.0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
        notes.append(TURNED)
    _, count, _ = _edges(triangles)
    if open_edges := np.count_nonzero(count == 1):
        faults.append(f"the surface is open at {open_edges} edges; its holes are closed by the winding number")
    if crowded := np.count_nonzero(count > 2):
        faults.append(f"more than two triangles meet at {crowded} edges of the surface")
    return places, triangles, notes, faults


def _edges(triangles: Indices) -> tuple[Numbers, Numbers, Numbers]:
    """The triangles' directed edges (e, 3), sorted so that those with the same ends follow each other: lower end, upper
    end, twice the triangle plus one if the edge runs down. How many there are of each, and the first of them."""
    ends = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    which = 2 * np.repeat(np.arange(len(triangles)), 3) + (ends[:, 0] > ends[:, 1])
    table = np.column_stack([ends.min(axis=1), ends.max(axis=1), which])[ends[:, 0] != ends[:, 1]]
    table = table[np.lexsort((table[:, 1], table[:, 0]))]
    starts = np.flatnonzero(np.diff(table[:, :2], axis=0, prepend=-1).any(axis=1))
    return table, np.diff(starts, append=len(table)), starts


def _odd_triangles(triangles: Indices) -> tuple[NDArray[np.bool_], bool]:
    """The triangles that face another way than most of those that edges join them with, and whether some of these
    cannot face one way, as on a Moebius strip: they stay."""
    table, count, starts = _edges(triangles)
    pairs = table[starts[count == 2][:, None] + [0, 1], 2]
    is_against = (pairs[:, 0] - pairs[:, 1]) % 2 == 0
    if not is_against.any():
        return np.zeros(len(triangles), dtype=bool), False
    # Each triangle twice, as it is and turned (2 t, 2 t + 1): joined are those that face one way. What can face one way
    # then falls into two parts, and a triangle's two copies have different ones.
    t, u = (pairs // 2).T
    copies = np.concatenate([2 * t, 2 * t + 1]), np.concatenate([2 * u + is_against, 2 * u + ~is_against])
    part = _parts(2 * len(triangles), *copies).reshape(-1, 2)
    is_one_sided = part[:, 0] == part[:, 1]
    lower = part.min(axis=1)
    is_turned = part[:, 0] > part[:, 1]
    turned, size = (np.bincount(lower, weights=w, minlength=2 * len(lower)) for w in (is_turned, np.ones(len(lower))))
    is_odd = is_turned != (2 * turned > size)[lower]
    return is_odd & ~is_one_sided, bool(is_one_sided.any())


def _parts(n: int, a: Numbers, b: Numbers) -> Numbers:
    """For each of n nodes the lowest one that the edges (a, b) join it with."""
    part = np.arange(n)
    while True:
        lower = np.minimum(part[a], part[b])
        joined = part.copy()
        for ends in (a, b):
            np.minimum.at(joined, part[ends], lower)
        while not np.array_equal(further := joined[joined], joined):
            joined = further
        if np.array_equal(joined, part):
            return part
        part = joined


def _enclosed(points: Floats, triangles: Indices) -> float:
    """Signed volume [m^3] that triangles enclose, by the divergence theorem about their middle."""
    a, b, c = (points[triangles[:, k]] - points.mean(axis=0) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
