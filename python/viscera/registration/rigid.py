"""Rigid motions, and the search for the one from which an organ's deformation is followed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera import _core
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices
from viscera.quantity import numbers_of, refused
from viscera.registration.observed import Observed

N_COARSE, N_FINE = 120, 400  # points of the cloud that a start is judged by
COARSE_STEPS, FINE_STEPS = 10, 25
N_KEPT = 8  # starts that are followed further
APART = 0.015  # diagonals between two motions that differ
N_STARTS = 2  # that the fit begins from
N_PLACES = 10  # of the surface, where the middle of the cloud may lie
ALIKE = 1.5  # times as far from the cloud, a pose may still be as good once the organ has deformed
QUARTERS = [
    turn
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
    if np.linalg.det(turn := np.diag(signs)[list(order)]) > 0.0 and np.trace(turn) < 3.0
]  # all rotations but one that take the axes to each other
TURN = np.radians(40.0)  # of the starts away from the given orientation
FAR = 0.1  # of the diagonal from the organ, a point is not its own
TUKEY = 4.685  # residuals beyond so many standard deviations count as outliers; Beaton and Tukey (1974)


@dataclass(frozen=True, eq=False)
class Rigid:
    """x -> rotation x + translation."""

    rotation: Floats
    """(3, 3)"""
    translation: Floats
    """(3,) [m]"""

    def __call__(self, x: Floats) -> Floats:
        return np.asarray(x @ self.rotation.T + self.translation)

    def back(self, y: Floats) -> Floats:
        """The inverse."""
        return np.asarray((y - self.translation) @ self.rotation)

    def turned_back(self, vectors: Floats) -> Floats:
        """Directions (k, 3) of the moved organ in its own axes."""
        return np.asarray(vectors @ self.rotation)

    def turned(self, turn: Floats, shift: Floats, centre: Floats) -> Rigid:
        """This motion after a small one in the organ's axes: x -> x + turn x (x - centre) + shift."""
        small = rotation_of(turn)
        return Rigid(self.rotation @ small, self(centre + shift - small @ centre))


def rigid_of(matrix: ArrayLike) -> Rigid:
    """The rigid motion of a matrix (4, 4); raises `VisceraError` if it is none."""
    given = numbers_of(matrix)
    if given is None or given.shape != (4, 4) or not np.isfinite(given).all():
        raise refused("start", "a matrix (4, 4) of finite numbers", matrix)
    rotation = given[:3, :3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-4 or np.linalg.det(rotation) < 0.0:
        raise VisceraError(f"start is no rigid motion: its 3 x 3 part is not a rotation, {rotation.round(4).tolist()}")
    return Rigid(rotation, given[:3, 3])


def rotation_of(vector: Floats) -> Floats:
    """The rotation (3, 3) about a vector by its length in radians (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle > 0.0 else vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def vector_of(rotation: Floats) -> Floats:
    """The vector (3,) of which this is `rotation_of`, of length from 0 to pi."""
    sine = 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    size, cosine = float(np.linalg.norm(sine)), 0.5 * (float(np.trace(rotation)) - 1.0)
    angle = np.arctan2(size, cosine)
    if cosine > 0.0:
        return np.asarray(sine * (angle / size if size > 1e-12 else 1.0))
    # Towards half a turn the antisymmetric part fades; the symmetric one is cos I + (1 - cos) n n^T.
    axis = 0.5 * (rotation + rotation.T) - cosine * np.eye(3)
    column = axis[:, np.argmax(np.diag(axis))]
    return np.asarray(column * (np.copysign(angle, column @ sine) / np.linalg.norm(column)))


def levers(arm: Floats) -> Floats:
    """The matrices (k, 3, 3) that take a small turn to the motion turn x arm of points (k, 3)."""
    matrices = np.zeros((len(arm), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrices[:, i, j], matrices[:, i, k] = arm[:, k], -arm[:, j]
    return matrices


def aligned(places: Floats, measured: Floats, weights: Floats) -> Rigid:
    """The rigid motion of least weighted squares between pairs of points (Kabsch, Acta Cryst. A 32 (1976) 922)."""
    share = weights / weights.sum()
    a, b = share @ places, share @ measured
    u, _, vt = np.linalg.svd((measured - b).T @ ((places - a) * share[:, None]))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return Rigid(rotation, b - rotation @ a)


def rigid_parts(responses: Floats, x: Floats) -> Floats:
    """Turn about the middle and shift (6, m) of the rigid motions of points (n, 3) nearest to responses (n, 3, m)."""
    basis = _rigid_basis(x)
    return np.asarray(np.linalg.solve(basis.T @ basis, basis.T @ responses.reshape(len(basis), -1)))


def turns_of(steps: Floats, x: Floats, now: Floats) -> Floats:
    """The turns (3, m) of the rotation that aligns points x (n, 3) with where they are `now`, by steps (n, 3, m)."""
    arms = (x - x.mean(axis=0)) @ aligned(x, now, np.ones(len(x))).rotation.T
    moments = np.einsum("nki,nkm->im", levers(arms), steps)
    own = np.einsum("nki,nkj->ij", levers(arms), levers(now - now.mean(axis=0)))
    return np.asarray(np.linalg.solve(own, moments))


def without_rigid(responses: Floats, x: Floats) -> Floats:
    """Responses (n, 3, m) less these rigid motions."""
    return np.asarray(responses - (_rigid_basis(x) @ rigid_parts(responses, x)).reshape(responses.shape))


def _rigid_basis(x: Floats) -> Floats:
    """Small turns about the middle of points (n, 3), and shifts, as columns (3 n, 6)."""
    ones = np.broadcast_to(np.eye(3), (len(x), 3, 3))
    return np.concatenate([levers(x - x.mean(axis=0)), ones], axis=2).reshape(-1, 6)


class Shape:
    """The organ's surface in some shape, to find closest points on; only `triangles` (t, 3) may have been seen."""

    def __init__(self, points: Floats, triangles: Indices) -> None:
        self.points, self.triangles = np.ascontiguousarray(points), triangles
        self._surface = _core.Surface(self.points, triangles)
        self.diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
        x = points[triangles]
        normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        self.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def closest(self, places: Floats) -> tuple[NDArray[np.int64], Indices, Floats, Floats, Floats]:
        """Triangles (k,), their nodes and weights (k, 3), closest points (k, 3), outward normals there (k, 3)."""
        found, weights = self._surface.closest_to_each(places)
        triangle = found.astype(np.int64)
        nodes = self.triangles[triangle]
        closest = np.einsum("ka,kai->ki", weights, self.points[nodes])
        return triangle, nodes, weights, closest, self.normals[triangle]


def tukey(residual: Floats, scale: float | Floats) -> Floats:
    """Weights (k,) from 1 to 0 of the biweight for residuals with this standard deviation."""
    return np.asarray(np.clip(1.0 - (residual / (TUKEY * scale)) ** 2, 0.0, None) ** 2)


def spread(residual: Floats, weights: Floats) -> float:
    """Standard deviation of a normal distribution with outliers, from the weighted median of sizes (k,).

    Where half of the weight (k,) lies on either side of two sizes, the median is their mean.
    """
    sizes = np.abs(residual)
    order = np.argsort(sizes)
    total = np.cumsum(weights[order])
    low, high = (np.searchsorted(total, 0.5 * total[-1], side=side) for side in ("left", "right"))
    return 1.4826 * 0.5 * float(sizes[order[low]] + sizes[order[high]])


def spaced(points: Floats, count: int) -> NDArray[np.int64]:
    """Indices of points far from each other: each next one is the farthest from all before; the first is an end."""
    chosen = [int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen)


def starts(shape: Shape, seen: Observed, given: Rigid | None) -> list[Rigid]:
    """The best few rigid motions, by robust iterated closest points from many starts.

    Where three landmarks or points are there, they say where to start; else the middle of the cloud lies at one of some
    places of the surface, in orientations around the given one.
    """
    if seen.fixes_motion:
        return [aligned(seen.places, seen.measured, seen.pair_noise**-2.0)]
    if given is not None:
        return [_icp(shape, seen, given, N_FINE, FINE_STEPS)[1]]
    middle = np.average(seen.surface, axis=0, weights=seen.weights)
    nodes = np.unique(shape.triangles)
    places = shape.points[nodes[spaced(shape.points[nodes], N_PLACES)]]
    axes = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    tried = []
    for turn in axes * TURN:
        rotation = rotation_of(turn)
        for place in places:
            tried.append(_icp(shape, seen, Rigid(rotation, middle - rotation @ place), N_COARSE, COARSE_STEPS))
    tried = sorted(tried, key=lambda pair: pair[0])[:N_KEPT]
    tried = sorted((_icp(shape, seen, motion, N_FINE, FINE_STEPS) for _, motion in tried), key=lambda pair: pair[0])
    kept: list[Rigid] = []
    for _, motion in tried:
        gaps = [np.linalg.norm(motion(shape.points) - other(shape.points), axis=1).max() for other in kept]
        if min(gaps, default=np.inf) > APART * shape.diagonal:
            kept.append(motion)
    return kept[:N_STARTS]


def turned(shape: Shape, seen: Observed, motion: Rigid) -> list[Rigid]:
    """Other rigid motions that bring the organ about as near to the cloud, the nearest first.

    They are tried from quarter and half turns of the organ about its axes of inertia: what looks alike from several
    sides is mostly turned so.
    """
    middle = shape.points.mean(axis=0)
    axes = np.linalg.eigh(np.cov((shape.points - middle).T))[1]
    near, own = _icp(shape, seen, motion, N_FINE, FINE_STEPS)
    enough = ALIKE * near + seen.noise
    kept, found = [motion, own], []
    for turn in QUARTERS:
        spun = axes @ turn @ axes.T
        begin = Rigid(motion.rotation @ spun, motion(middle - spun @ middle))
        if _icp(shape, seen, begin, N_COARSE, COARSE_STEPS)[0] < 2.0 * enough:
            found.append(_icp(shape, seen, begin, N_FINE, FINE_STEPS))
    for misfit, other in sorted(found, key=lambda pair: pair[0]):
        gaps = [np.linalg.norm(other(shape.points) - each(shape.points), axis=1).max() for each in kept]
        if misfit < enough and min(gaps) > APART * shape.diagonal:
            kept.append(other)
    return kept[2:]


def _icp(shape: Shape, seen: Observed, motion: Rigid, count: int, steps: int) -> tuple[float, Rigid]:
    """Point-to-plane iterations; the robust misfit [m] and the motion."""
    every = max(1, len(seen.surface) // count)
    cloud, share = seen.surface[::every], seen.weights[::every] / seen.weights[::every].mean()
    for _ in range(steps):
        z = motion.back(cloud)
        _, _, _, p, normal = shape.closest(z)
        centre = z.mean(axis=0)
        residual = np.einsum("ki,ki->k", normal, z - p)
        near = tukey(np.linalg.norm(z - p, axis=1), FAR * shape.diagonal)
        weight = share * near * tukey(residual, max(spread(residual, share), 1e-4 * shape.diagonal))
        rows = np.concatenate([np.cross(z - centre, normal), normal], axis=1)
        size = np.repeat([0.5 * shape.diagonal, 1.0], 3)
        scaled = rows / size
        normal_matrix = (scaled * weight[:, None]).T @ scaled + 1e-3 * max(weight.sum(), 1.0) * np.eye(6)
        step = np.linalg.solve(normal_matrix, scaled.T @ (weight * residual)) / size
        motion = motion.turned(step[:3], step[3:], centre)
    z = motion.back(cloud)
    distance = np.linalg.norm(z - shape.closest(z)[3], axis=1)
    return float(np.average(np.minimum(distance, FAR * shape.diagonal), weights=share)), motion
