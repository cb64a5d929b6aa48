"""The artery: a bent thick-walled tube with a side branch, after paper B (401 nodes, 1,101 tetrahedra there).

Axes: x and y across, z along the vessel, which runs from z = 0 to z = HEIGHT; metres. A triangulated middle surface is
thickened to both sides, so there is one prism through the wall, and each prism is cut in three tetrahedra. The rings
at z = 0, HEIGHT/2 and HEIGHT are plane circles: the supports of paper B's tests.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

HEIGHT, RADIUS, WALL = 0.040, 0.003, 0.001  # the middle surface; outer diameter 7 mm
BEND = 0.004  # how far the axis swings out and back, twice tangent to z on the way [m]
AROUND, ROWS = 12, 12  # nodes of a ring; rows of quadrilaterals along the vessel
HOLE_ROWS, HOLE_SEGMENTS = (7, 9), (-2, 2)  # the branch leaves here: rows, segments around the angle 0
BRANCH_ROWS, BRANCH_RADIUS, BRANCH_LENGTH = 4, 0.0020, 0.009
BRANCH_DIRECTION = np.array([np.sin(np.radians(75)), 0.0, np.cos(np.radians(75))])
SMOOTHINGS = 3


def axis(z: Array) -> tuple[Array, Array]:
    """Centre line and its unit tangent at height z; the tangent is vertical at both ends and half-way."""
    phase = 2.0 * np.pi * z / HEIGHT
    center = np.stack([-0.5 * BEND * (1.0 - np.cos(phase)), 0.0 * z, z], axis=-1)
    tangent = np.stack([-0.5 * BEND * 2.0 * np.pi / HEIGHT * np.sin(phase), 0.0 * z, 1.0 + 0.0 * z], axis=-1)
    return center, tangent / np.linalg.norm(tangent, axis=-1, keepdims=True)


def trunk() -> tuple[Array, Array]:
    """Middle surface of the vessel as rings (ROWS + 1, AROUND, 3), and its outward normals."""
    center, tangent = axis(np.linspace(0.0, HEIGHT, ROWS + 1))
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    side = np.array([0.0, 1.0, 0.0])
    normals = np.cos(angle)[:, None] * np.cross(side, tangent)[:, None] + np.sin(angle)[:, None] * side
    return center[:, None] + RADIUS * normals, normals


def grid_triangles(rows: Indices) -> Indices:
    """Two triangles per quadrilateral between neighbouring closed rings (r, n); -1 marks what is cut out."""
    a, b = rows[:-1], rows[1:]
    a1, b1 = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    even = (np.add.outer(np.arange(a.shape[0]), np.arange(a.shape[1])) % 2 == 0)[..., None]
    first = np.where(even, np.stack([a, a1, b1], -1), np.stack([a, a1, b], -1))
    second = np.where(even, np.stack([a, b1, b], -1), np.stack([a1, b1, b], -1))
    return np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])


def hole() -> list[tuple[int, int]]:
    """Rim of the hole as (row, segment), counter-clockwise seen from outside, starting at the top right corner."""
    (low, high), (left, right) = HOLE_ROWS, HOLE_SEGMENTS
    top = [(high, s) for s in range(right, left, -1)]
    bottom = [(low, s) for s in range(left, right)]
    return top + [(r, left) for r in range(high, low, -1)] + bottom + [(r, right) for r in range(low, high)]


def vertex_normals(points: Array, triangles: Indices) -> Array:
    """Unit normals, the mean of the triangles weighted by their angle at the vertex."""
    normals = np.zeros_like(points)
    x = points[triangles]
    face = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    for i in range(3):
        u, v = x[:, (i + 1) % 3] - x[:, i], x[:, (i + 2) % 3] - x[:, i]
        cosine = (u * v).sum(1) / (np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1))
        np.add.at(normals, triangles[:, i], np.arccos(np.clip(cosine, -1.0, 1.0))[:, None] * face)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0.0, length, 1.0)  # points cut out with the hole have no triangle


def smooth(points: Array, triangles: Indices, is_free: NDArray[np.bool_]) -> Array:
    """Moves the free points to the mean of their neighbours, a few times over: rounds the crotch of the branch."""
    edges = np.unique(np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=0)
    edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    n_neighbours = np.bincount(edges[:, 0], minlength=len(points))[:, None]
    for _ in range(SMOOTHINGS):
        total = np.zeros_like(points)
        np.add.at(total, edges[:, 0], points[edges[:, 1]])
        points = np.where(is_free[:, None], total / np.maximum(n_neighbours, 1), points)
    return points


def branch(rim: Array) -> tuple[Array, Array]:
    """Rings (BRANCH_ROWS, n, 3) from the rim of the hole to the circle at the branch's end, and that end's normals."""
    root = rim.mean(axis=0)
    across = np.cross([0.0, 1.0, 0.0], BRANCH_DIRECTION)  # with y, the plane of the end
    flat = rim - root
    angle = np.arctan2(flat @ -across, flat[:, 1])
    start = angle[0]
    angle = start + np.sign(np.unwrap(angle)[-1] - start) * 2.0 * np.pi * np.arange(len(rim)) / len(rim)
    normals = np.cos(angle)[:, None] * np.array([0.0, 1.0, 0.0]) - np.sin(angle)[:, None] * across
    rings = []
    for step in range(1, BRANCH_ROWS + 1):
        s = step / BRANCH_ROWS
        circle = root + s * BRANCH_LENGTH * BRANCH_DIRECTION + BRANCH_RADIUS * normals
        carried = rim + s * BRANCH_LENGTH * BRANCH_DIRECTION
        rings.append((1.0 - s) ** 2 * carried + (1.0 - (1.0 - s) ** 2) * circle)
    return np.array(rings), normals


def middle_surface() -> tuple[Array, Indices, Array, dict[str, Indices]]:
    """Points, triangles, unit normals and the rings by name."""
    rings, ring_normals = trunk()
    number = np.arange(rings[..., 0].size).reshape(rings.shape[:2])
    rim = np.array([number[r, s] for r, s in hole()])
    branch_rings, end_normals = branch(rings.reshape(-1, 3)[rim])
    branch_number = number.size + np.arange(branch_rings[..., 0].size).reshape(branch_rings.shape[:2])

    (low, high), (left, right) = HOLE_ROWS, HOLE_SEGMENTS
    inside = [number[r, s] for r in range(low + 1, high) for s in range(left + 1, right)]
    wall = grid_triangles(number)
    wall = wall[~np.isin(wall, np.append(rim, inside)).all(axis=1)]
    triangles = np.concatenate([wall, grid_triangles(np.vstack([rim[None], branch_number]))])

    points = np.concatenate([rings.reshape(-1, 3), branch_rings.reshape(-1, 3)])
    is_free = np.zeros(len(points), dtype=bool)
    is_free[np.append(rim, branch_number[:-1])] = True
    points = smooth(points, triangles, is_free)
    normals = vertex_normals(points, triangles)
    is_round = ~np.isin(number, rim)  # here the normals are known exactly, and keep the rings plane
    normals[number[is_round]] = ring_normals[is_round]
    normals[branch_number[-1]] = end_normals

    kept, triangles = np.unique(triangles, return_inverse=True)
    ends = {"bottom": number[0], "middle": number[ROWS // 2], "top": number[-1], "branch": branch_number[-1]}
    named = {name: np.flatnonzero(np.isin(kept, ring)) for name, ring in ends.items()}
    return points[kept], triangles.reshape(-1, 3), normals[kept], named


def artery() -> tuple[Array, Indices, dict[str, Indices]]:
    """Points [m], cells and node sets: the rings `bottom`, `middle`, `top`, the `lumen`, and `branch`, the end of
    the side branch.
    """
    middle, triangles, normals, rings = middle_surface()
    n = len(middle)
    points = np.concatenate([middle - 0.5 * WALL * normals, middle + 0.5 * WALL * normals])
    # Three tetrahedra per prism between i and i + n; ascending order makes neighbours agree on their diagonals.
    a, b, c = np.sort(triangles, axis=1).T
    corners = ([a, b, c, c + n], [a, b, b + n, c + n], [a, a + n, b + n, c + n])
    cells = np.concatenate([np.stack(cell, axis=-1) for cell in corners])
    is_inverted = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0.0
    cells[is_inverted] = cells[is_inverted][:, [0, 2, 1, 3]]
    sets = {name: np.concatenate([ring, ring + n]) for name, ring in rings.items()}
    return points, cells, {**sets, "lumen": np.arange(n)}
