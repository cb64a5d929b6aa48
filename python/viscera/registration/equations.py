"""What was measured, as equations for a rigid motion, the amplitudes of forces, and smooth errors of the model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from viscera.mesh import Floats, Indices
from viscera.registration.forces import Forces
from viscera.registration.normals import agreement, normals_of
from viscera.registration.observed import Observed
from viscera.registration.rigid import TUKEY, Rigid, Shape, levers, spaced, spread, tukey

if TYPE_CHECKING:
    from viscera.organ import Organ

CUBE = 0.025
"""Edge of the cubes in each of which the points of the cloud are averaged; this and other lengths in diagonals."""
WRONG, SMOOTH = 1e-3, 0.1
"""Standard deviation along the normal of what law, mesh and forces get wrong, and the distance over which it varies."""
N_WRONG = 60
"""Places that carry it."""
ANY_TURN, ANY_SHIFT = 1.0, 1.0
"""Standard deviations of a turn [rad] and of a shift of the organ that nobody has seen: points on one flat face leave
the organ free to slide along it, and the equations without a solution."""
REACH = 0.05
"""Largest motion of a node in an iteration."""
STILL = 1e-3
"""Largest motion of a node in the last iteration with one tangent."""
SETTLED = 3e-3
"""Change of a node's place at which a tangent is good enough."""
FARTHEST = 0.05
"""Such a change says that a tangent was of no use; the equilibrium before it is kept."""
TRUST = 0.1
"""Largest motion of a node with one tangent."""
DOUBT, SURE, CALMER = 50.0, 4.0, 4.0
"""Factors on the variance of the noise with the first tangent, at last, and from one tangent to the next."""


@dataclass(eq=False)
class Iterate:
    """Where a fit is."""

    motion: Rigid
    amplitudes: Floats
    displacement: Floats
    expected: Floats
    covariance: Floats = field(default_factory=lambda: np.empty((0, 0)))
    responses: Floats = field(default_factory=lambda: np.empty((0, 3, 0)))
    prior: Floats = field(default_factory=lambda: np.empty((0, 0)))
    change: float = np.inf
    """Largest distance of a node [m] between the equilibrium and what the tangent had said."""
    cost: float = np.inf
    trust: float = np.inf
    """Largest motion of a node [m] for which a tangent is believed."""
    is_cut: bool = False
    """Whether the last step was shortened to it."""
    left: float = np.inf
    """Largest motion of a node [m] that the last step would have been longer by."""
    is_lost: bool = False
    """Whether no equilibrium was found near what a step said."""
    length: float = np.inf
    """Root-mean-square motion of the surface in the last step, over its standard deviation."""
    doubt: float = DOUBT
    """Factor on the variance of the noise."""
    iterations: int = 0

    def step_to(self, displacement: Floats, amplitudes: Floats, back: Rigid) -> None:
        """An equilibrium in place of what the tangent had said; `back` takes the former to the latter."""
        self.motion = Rigid(self.motion.rotation @ back.rotation, self.motion(back.translation))
        self.displacement, self.amplitudes = displacement, amplitudes

    def believe(self, part: float, farthest: float, size: float) -> None:
        """Choose how far the next step may go, after `part` of one that moved a node by `farthest` [m]."""
        is_right = part == 1.0 and self.change < 0.25 * farthest
        trust = 2.0 * self.trust if is_right else max(part * farthest, SETTLED * size)
        self.trust = min(TRUST * size, trust)


class Equations:
    """What does not change from one iterate to the next."""

    def __init__(self, organ: Organ, seen: Observed, visible: Indices, forces: Forces) -> None:
        self.organ, self.seen, self.visible, self.forces = organ, seen, visible, forces
        self.size = organ.mesh.diagonal
        self.cloud, self.weights = averaged(seen.surface, seen.weights, CUBE * self.size)
        self.facing = normals_of(self.cloud)
        self.sample = organ.mesh.surface_nodes[:: max(1, len(organ.mesh.surface_nodes) // 100)]
        self.centre = organ.mesh.points.mean(axis=0)
        self.wrong = self._wrong()
        self.groups = (slice(0, len(forces) - 3), slice(len(forces) - 3, len(forces)))

    @property
    def n_known(self) -> int:
        """Unknowns of rigid motion and forces, before those of the model's errors."""
        return 6 + len(self.forces)

    def _wrong(self) -> Floats:
        """How smooth unit errors of the model (q,) move the cloud (k, q) [m] along normals, by Nystroem's method."""
        if not len(self.cloud):
            return np.empty((0, 0))
        places = self.cloud[spaced(self.cloud, N_WRONG)]
        kernel, own = (
            np.exp(-0.5 * (np.linalg.norm(x[:, None] - places, axis=2) / (SMOOTH * self.size)) ** 2)
            for x in (self.cloud, places)
        )
        values, vectors = np.linalg.eigh(own + 1e-6 * np.eye(len(own)))
        return np.asarray(WRONG * self.size * kernel @ (vectors / np.sqrt(values)))

    def at(
        self, at: Iterate, responses: Floats, scale: float, *, is_faced: bool = False
    ) -> tuple[Floats, Floats, Floats, float]:
        """Rows (k, p) of turn, shift, amplitudes and errors, residuals (k,) [m], weights (k,) [1/m^2], scatter [m].

        is_faced: of the cloud only what lies on faces that face as it does (normals.py) counts.
        """
        flat = responses.reshape(-1, responses.shape[2])
        rows, residuals, weights, scatter = [], [], [], self.seen.noise
        if len(self.cloud):
            shape = Shape(self.organ.mesh.points + at.displacement, self.visible)
            z = at.motion.back(self.cloud)
            _, corners, shares, p, normal = shape.closest(z)
            residual = np.einsum("ki,ki->k", normal, z - p)
            own = agreement(normal, at.motion.turned_back(self.facing)) if is_faced else 1.0
            beside = np.maximum(np.linalg.norm(z - p, axis=1) - 3.0 * scale, 0.0)
            scatter = spread(residual, self.weights)
            moved = _along(flat, corners, shares, normal)
            rows.append(np.concatenate([np.cross(z - self.centre, normal), normal, moved, self.wrong], axis=1))
            residuals.append(residual)
            weights.append(
                self.weights * own * tukey(residual, scale) * tukey(beside, scale) / (at.doubt * self.seen.noise**2)
            )
        if self.seen.members:
            x = self.means(self.organ.mesh.points + at.displacement)
            z = at.motion.back(self.seen.measured)
            lever = levers(z - self.centre)
            moved = self.means(responses)
            ones = np.broadcast_to(np.eye(3), lever.shape)
            pairs = np.concatenate([lever, ones, moved], axis=2).reshape(-1, self.n_known)
            rows.append(np.pad(pairs, ((0, 0), (0, self.wrong.shape[1]))))
            residuals.append((z - x).ravel())
            weights.append(np.repeat(self.seen.pair_noise**-2.0, 3))
        return np.concatenate(rows), np.concatenate(residuals), np.concatenate(weights), scatter

    def held(self, turns: Floats, turn: Floats, deviation: float) -> tuple[Floats, Floats, Floats]:
        """Rows, residuals and weights that hold the organ's turn [rad] against its fixed nodes near zero.

        turns (3, m): by unit amplitudes; turn (3,): what it is now.
        """
        rows = np.pad(turns, ((0, 0), (6, self.wrong.shape[1])))
        return rows, -turn, np.full(3, deviation**-2.0)

    def prior(self, metrics: list[Floats], sizes: Floats) -> Floats:
        """Of all unknowns (p, p): wide on the rigid motion; forces of these sizes; unit errors of the model."""
        prior = np.eye(self.n_known + self.wrong.shape[1])
        prior[:6, :6] = np.diag(np.repeat([ANY_TURN, ANY_SHIFT * self.size], 3) ** -2.0)
        for group, metric, size in zip(self.groups, metrics, sizes, strict=True):
            where = slice(6 + group.start, 6 + group.stop)
            prior[where, where] = metric / size**2
        return prior

    def unknowns(self, at: Iterate) -> Floats:
        """What the unknowns (p,) are: rigid motion and errors count from where they are."""
        return np.concatenate([np.zeros(6), at.amplitudes, np.zeros(self.wrong.shape[1])])

    def motions(self, responses: Floats, x: Floats) -> Floats:
        """Rows (3 k, p): how all unknowns move some nodes of the surface together."""
        lever = levers(x[self.sample] - self.centre)
        ones = np.broadcast_to(np.eye(3), lever.shape)
        rows = np.concatenate([lever, ones, responses[self.sample]], axis=2).reshape(-1, self.n_known)
        return np.pad(rows, ((0, 0), (0, self.wrong.shape[1])))

    def advance(self, at: Iterate, step: Floats, motions: Floats) -> float:
        """Take a step (p,), shortened to `REACH`; the largest motion of a node [m] before that."""
        largest = float(np.linalg.norm((motions @ step).reshape(-1, 3), axis=1).max())
        step = step * min(1.0, REACH * self.size / max(largest, 1e-12))
        at.motion = at.motion.turned(step[:3], step[3:6], self.centre)
        at.amplitudes = at.amplitudes + step[6 : self.n_known]
        at.iterations += 1
        return largest

    def narrowed(self, scale: float, scatter: float) -> float:
        """Standard deviation [m] by which the next iteration tells outliers."""
        return max(min(scale, 2.0 * scatter), 1.2 * self.seen.noise)

    def missed(self, weight: Floats, doubt: float) -> float:
        """The cost of what was left out as an outlier: as if at the biweight's end, so that starts can be compared."""
        count = len(self.cloud)
        full = self.weights / (doubt * self.seen.noise**2)
        return float((full - weight[:count]).sum() * (TUKEY * 2.0 * self.seen.noise) ** 2) if count else 0.0

    def means(self, field: Floats) -> Floats:
        """A field (n, 3, ...) at landmarks and points (l, 3, ...)."""
        return np.stack([np.tensordot(weights, field[nodes], axes=1) for nodes, weights in self.seen.members])


def averaged(points: Floats, weights: Floats, edge: float) -> tuple[Floats, Floats]:
    """Weighted means (k, 3) of the points in each cube of this edge [m] that holds some, and their weights (k,)."""
    _, cube = np.unique(np.floor(points / edge).astype(np.int64), axis=0, return_inverse=True)
    cube = cube.ravel()
    total = np.bincount(cube, weights)
    means = np.column_stack([np.bincount(cube, weights * points[:, i]) for i in range(3)])
    kept = total > 0.0
    return np.asarray(means[kept] / total[kept, None]), np.asarray(total[kept], dtype=np.float64)


def _along(flat: Floats, nodes: Indices, shares: Floats, normal: Floats) -> Floats:
    """Responses (k, m) of points in triangles along the normals there."""
    columns = np.zeros((len(nodes), flat.shape[1]))
    for corner in range(3):
        for axis in range(3):
            columns += (shares[:, corner] * normal[:, axis])[:, None] * flat[3 * nodes[:, corner] + axis]
    return columns
