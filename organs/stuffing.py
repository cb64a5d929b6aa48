"""Fills an implicit surface with tetrahedra: isosurface stuffing (Labelle and Shewchuk, 2007), then local improvement.

A body-centred cubic lattice gives the inside near-regular cells of one size. Lattice points close to the surface are
moved onto it, cells that still cross it are clipped, and at last each node in turn looks for a better place (on the
surface for a surface node) until no cell is bad. Every step is deterministic.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Implicit = Callable[[Array], Array]

# Lattice points nearer to the surface than this fraction of an edge are moved onto it: long edges (between equal
# points of the lattice) and short ones (between a corner and a centre), after the paper.
SNAP_LONG, SNAP_SHORT = 0.24999, 0.41189
SWEEPS = 10
# A surface node gives way to the shape only while its cells stay this good (mean ratio); weight of the shape.
GOOD_ENOUGH, CHORD_WEIGHT = 0.6, 6.0
# Edges outside spacing * exp(EVEN_MIDDLE +- EVEN_BAND), 0.61 to 1.49 of the spacing, count against a place.
EVEN_MIDDLE, EVEN_BAND, EVEN_WEIGHT = -0.05, 0.45, 1.0


def lattice(low: Array, high: Array, spacing: float) -> tuple[Array, Indices]:
    """Points and cells of the body-centred cubic lattice: a cell joins two neighbouring centres and a corner edge."""
    n = np.ceil((np.asarray(high) - low) / spacing).astype(int) + 1
    corner = np.arange(np.prod(n)).reshape(n)
    center = corner + corner.size
    grid = np.stack(np.meshgrid(*map(np.arange, n), indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.concatenate([grid, grid + 0.5]) * spacing + low
    cells = []
    for axis in range(3):
        # Roll so that `axis` comes first: the face between centres i and i + 1 along it has its corners at i + 1.
        c, m = np.moveaxis(corner, axis, 0), np.moveaxis(center, axis, 0)
        below, above = m[:-2, :-1, :-1], m[1:-1, :-1, :-1]
        ring = [c[1:-1, :-1, :-1], c[1:-1, 1:, :-1], c[1:-1, 1:, 1:], c[1:-1, :-1, 1:]]
        for start, end in zip(ring, ring[1:] + ring[:1], strict=True):
            cells.append(np.stack([below, above, start, end], axis=-1).reshape(-1, 4))
    return points, np.concatenate(cells)


def root(implicit: Implicit, a: Array, b: Array) -> Array:
    """Where the surface crosses each segment from a (inside) to b (outside), by bisection."""
    inside, outside = a.copy(), b.copy()
    for _ in range(40):
        middle = 0.5 * (inside + outside)
        is_inside = (implicit(middle) < 0.0)[:, None]
        inside, outside = np.where(is_inside, middle, inside), np.where(is_inside, outside, middle)
    return 0.5 * (inside + outside)


def crossing_edges(cells: Indices, sign: NDArray[np.int8]) -> Indices:
    """Edges (k, 2) from a node inside to a node outside."""
    pairs = cells[:, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]].reshape(-1, 2)
    pairs = pairs[sign[pairs[:, 0]] * sign[pairs[:, 1]] < 0]
    return np.unique(np.where((sign[pairs[:, 0]] < 0)[:, None], pairs, pairs[:, ::-1]), axis=0)


def snap(implicit: Implicit, points: Array, cells: Indices, spacing: float) -> tuple[Array, NDArray[np.int8]]:
    """Moves the lattice points close to the surface onto it; also the sign of every point: -1, 0 (on it), 1."""
    sign = np.sign(implicit(points)).astype(np.int8)
    edges = crossing_edges(cells, sign)
    cut = root(implicit, points[edges[:, 0]], points[edges[:, 1]])
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    limit = np.where(length > 0.95 * spacing, SNAP_LONG, SNAP_SHORT) * length
    ends, cuts, limits = edges.T.ravel(), np.tile(cut, (2, 1)), np.tile(limit, 2)
    distance = np.linalg.norm(cuts - points[ends], axis=1)
    moved = points.copy()
    for i in np.argsort(-distance, kind="stable"):  # the nearest cut comes last and wins
        if distance[i] < limits[i]:
            moved[ends[i]], sign[ends[i]] = cuts[i], 0
    return moved, sign


def clip(implicit: Implicit, points: Array, cells: Indices, sign: NDArray[np.int8]) -> tuple[Array, Indices]:
    """Keeps what lies inside: whole cells, and the inner pieces of those that cross the surface."""
    edges = crossing_edges(cells, sign)
    number = {(a, b): len(points) + i for i, (a, b) in enumerate(edges.tolist())}
    points = np.concatenate([points, root(implicit, points[edges[:, 0]], points[edges[:, 1]])])
    signs = sign[cells]
    kept = cells[(signs <= 0).all(axis=1) & (signs < 0).any(axis=1)].tolist()
    for cell in cells[(signs < 0).any(axis=1) & (signs > 0).any(axis=1)].tolist():
        inner, level, outer = ([i for i in cell if sign[i] == s] for s in (-1, 0, 1))
        cut = {(a, b): number[a, b] for a in inner for b in outer}
        if len(inner) == 1:
            kept.append([inner[0], *level, *(cut[inner[0], b] for b in outer)])
        elif len(inner) == 2 and len(outer) == 2:
            (a, b), (c, d) = inner, outer
            kept += split_wedge([a, cut[a, c], cut[a, d]], [b, cut[b, c], cut[b, d]])
        elif len(inner) == 2:
            (a, b), c, apex = inner, outer[0], level[0]
            kept += [[*triangle, apex] for triangle in split_quad([a, b, cut[b, c], cut[a, c]])]
        else:
            kept += split_wedge(inner, [cut[a, outer[0]] for a in inner])
    used, packed = np.unique(np.array(kept), return_inverse=True)
    return points[used], packed.reshape(-1, 4)


def split_quad(ring: list[int]) -> list[list[int]]:
    """Two triangles, along the diagonal through the smallest index: neighbours agree on it."""
    k = ring.index(min(ring))
    a, b, c, d = ring[k:] + ring[:k]
    return [[a, b, c], [a, c, d]]


def split_wedge(bottom: list[int], top: list[int]) -> list[list[int]]:
    """Three tetrahedra of the wedge whose corner `bottom[i]` is joined to `top[i]`; its quads as in `split_quad`."""
    k = int(np.argmin(bottom + top))
    if k >= 3:
        bottom, top, k = top, bottom, k - 3
    a, b, c = bottom[k:] + bottom[:k]
    a1, b1, c1 = top[k:] + top[:k]
    return [[a, a1, b1, c1], *([a, *triangle] for triangle in split_quad([b, c, c1, b1]))]


def quality(x: Array) -> Array:
    """Mean ratio of cells x (..., 4, 3), with the sign of their volume."""
    e = x[..., 1:, :] - x[..., :1, :]
    volume = np.einsum("...i,...i", np.cross(e[..., 0, :], e[..., 1, :]), e[..., 2, :]) / 6.0
    pairs = x[..., [0, 0, 0, 1, 1, 2], :] - x[..., [1, 2, 3, 2, 3, 3], :]
    return 12.0 * np.sign(volume) * np.cbrt(3.0 * np.abs(volume)) ** 2 / (pairs**2).sum(axis=(-1, -2))


def on_surface(implicit: Implicit, x: Array, spacing: float) -> Array:
    """The nearby point of the surface, by Newton steps along the gradient."""
    step = 1e-4 * spacing
    for _ in range(3):
        sides = implicit(x[..., None, :] + step * np.concatenate([np.eye(3), -np.eye(3)]))
        gradient = (sides[..., :3] - sides[..., 3:]) / (2.0 * step)
        x = x - implicit(x)[..., None] * gradient / np.maximum((gradient**2).sum(-1, keepdims=True), 1e-12)
    return x


def chord_error(implicit: Implicit, triangles: Array, spacing: float) -> Array:
    """How far flat triangles (..., t, 3, 3) leave the surface: root mean square over their middles and edges."""
    middles = 0.5 * (triangles + np.roll(triangles, 1, axis=-2))
    samples = np.concatenate([middles, triangles.mean(axis=-2, keepdims=True)], axis=-2)
    return np.sqrt((implicit(samples) ** 2).mean(axis=(-1, -2))) / spacing


def unevenness(x: Array, spacing: float) -> Array:
    """How far the edges of cells x (..., c, 4, 3) leave the band around the spacing: the largest logarithm."""
    pairs = x[..., [0, 0, 0, 1, 1, 2], :] - x[..., [1, 2, 3, 2, 3, 3], :]
    logarithm = 0.5 * np.log((pairs**2).sum(axis=-1) / spacing**2)
    return np.maximum(np.abs(logarithm - EVEN_MIDDLE) - EVEN_BAND, 0.0).max(axis=(-1, -2))


def improve(implicit: Implicit, points: Array, cells: Indices, spacing: float) -> Array:
    """Each node in turn moves to the best of a few places around it.

    Inside, the best place is where the worst cell is best. On the surface it is where the triangles follow the
    surface most closely, which brings edges onto its crests, as long as no cell gets worse than GOOD_ENOUGH.
    """
    triangles = boundary(cells)
    is_surface = np.zeros(len(points), dtype=bool)
    is_surface[triangles] = True
    stars = incident(cells, len(points))
    fans = incident(triangles, len(points))
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    rose = np.array([[0, s, t * golden] for s in (-1, 1) for t in (-1, 1)]) / np.hypot(1.0, golden)
    rose = np.concatenate([np.roll(rose, k, axis=1) for k in range(3)])  # the corners of an icosahedron
    points = points.copy()

    def score(i: int, places: Array) -> Array:
        star = moved_to(places, i, points, cells[stars[i]])
        value = quality(star).min(axis=-1) - EVEN_WEIGHT * unevenness(star, spacing)
        if not is_surface[i]:
            return value
        error = chord_error(implicit, moved_to(places, i, points, triangles[fans[i]]), spacing)
        return np.minimum(value, GOOD_ENOUGH) - CHORD_WEIGHT * error

    for sweep in range(SWEEPS):
        size = 0.2 * spacing * 0.85**sweep
        for i in range(len(points)):
            around = triangles[fans[i]] if is_surface[i] else cells[stars[i]]
            toward = points[np.unique(around)].mean(axis=0) - points[i]
            places = points[i] + np.concatenate([size * rose, [0.25 * toward, 0.5 * toward, toward]])
            if is_surface[i]:
                places = on_surface(implicit, places, spacing)
            scores = score(i, np.concatenate([points[i][None], places]))
            best = int(np.argmax(scores))
            if best > 0:
                points[i] = places[best - 1]
    return points


def moved_to(places: Array, i: int, points: Array, simplices: Indices) -> Array:
    """Corners (p, s, k, 3) of simplices (s, k) with node i at each of the places (p, 3)."""
    return np.where((simplices == i)[None, ..., None], places[:, None, None, :], points[simplices][None])


def boundary(cells: Indices) -> Indices:
    """Triangles (t, 3) that belong to one cell only, outward for positively oriented cells."""
    faces = cells[:, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


def incident(simplices: Indices, n_points: int) -> list[Indices]:
    """Rows of `simplices` that hold each point."""
    order = np.argsort(simplices.ravel(), kind="stable") // simplices.shape[1]
    return np.split(order, np.cumsum(np.bincount(simplices.ravel(), minlength=n_points))[:-1])


def fill(implicit: Implicit, low: Array, high: Array, spacing: float) -> tuple[Array, Indices]:
    """Points and positively oriented cells inside `implicit < 0`, which must lie within the box from low to high."""
    points, cells = lattice(low, high, spacing)
    cells = cells[(implicit(points[cells]) < 0.0).any(axis=1)]
    points, sign = snap(implicit, points, cells, spacing)
    points, cells = clip(implicit, points, cells, sign)
    is_inverted = quality(points[cells]) < 0.0
    cells[is_inverted] = cells[is_inverted][:, [0, 2, 1, 3]]
    return improve(implicit, points, cells, spacing), cells
