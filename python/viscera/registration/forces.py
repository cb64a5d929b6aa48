"""Forces that may act on an organ, and its equilibrium responses to them.

A few dozen overlapping patches cover the part of the surface where forces may act; each carries a force of unknown
direction and size, spread smoothly. One more force acts on the volume, as a change of gravity would. The organ is held
at its fixed nodes, whose reactions are whatever they need to be; a motion of the support as a whole is part of the
rigid motion. All responses come from one factorised tangent.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from viscera import _core
from viscera.mesh import Floats, Indices
from viscera.registration.rigid import aligned, levers, rigid_parts, spaced

if TYPE_CHECKING:
    from viscera.organ import Organ

N_PATCHES = 80
SMOOTH = 1.0 / 6.0  # of the organ's diagonal
ROUGH = 1e-2  # variance of what is not smooth
ITERATIONS = 8  # of Newton's method at most
RESIDUAL = 1e-7  # of an equilibrium, over the norm of the forces
GROWTH, SHORTEST = 1.5, 0.2  # of the residual from which a step is halved; least part of it
OVERLAP = 1.5  # radius of a patch over the distance to its neighbours


class Forces:
    """Amplitudes (m,) [N] of forces on an organ: three for each patch, then three for the volume."""

    def __init__(self, organ: Organ, nodes: Indices, count: int = N_PATCHES) -> None:
        self.organ, self.loaded = organ, nodes
        points = organ.mesh.points
        centres = points[nodes[spaced(points[nodes], count)]]
        gaps = np.linalg.norm(centres[:, None] - centres, axis=2) + np.diag(np.full(len(centres), np.inf))
        radius = OVERLAP * float(np.median(gaps.min(axis=1)))
        self.patches = [organ.patch(centre, radius) for centre in centres]
        weight = organ._body.gravity(np.array([1.0, 0.0, 0.0]), np.ones(len(organ.mesh.cells)))[:, 0]
        everywhere = np.arange(len(points), dtype=np.uint32)
        self.patches.append(_core.Patch(everywhere, weight / weight.sum()))
        self.centres = centres
        self.units = np.stack([self.nodal(unit) for unit in np.eye(len(self))])
        """Nodal forces (m, n, 3) of unit amplitudes."""

    def __len__(self) -> int:
        return 3 * len(self.patches)

    def nodal(self, amplitudes: Floats) -> Floats:
        """Nodal forces (n, 3) [N]."""
        total = np.zeros_like(self.organ.mesh.points)
        for patch, force in zip(self.patches, amplitudes.reshape(-1, 3), strict=True):
            np.add.at(total, patch.nodes, patch.weights[:, None] * force)
        total[self.organ.fixed] = 0.0
        return total

    def responses(self, displacement: Floats) -> Floats:
        """Displacements (n, 3, m) [m/N] per unit amplitude about an equilibrium: columns of the inverse tangent."""
        return np.ascontiguousarray(self.organ._body.linear_responses(displacement, self.units).transpose(1, 2, 0))

    def following(self, responses: Floats, amplitudes: Floats, turns: Floats) -> Floats:
        """The same if forces turn with the organ: a' = a + da + turn x a, where turns (3, m) are those of responses.

        A dead force that presses an organ towards its fixed nodes makes it fall over; this one does not.
        """
        crossed = np.concatenate(levers(amplitudes.reshape(-1, 3)))
        return np.asarray(responses + (responses @ crossed) @ np.linalg.solve(np.eye(3) - turns @ crossed, turns))

    def equilibrium(self, amplitudes: Floats, start: Floats, before: Floats) -> tuple[Floats, Floats, bool]:
        """Displacement (n, 3) under forces that turn with the organ, amplitudes in the end, and whether it was found.

        Newton's method from `start`; the amplitudes are given for the organ in the displacement `before`.
        """
        points, body = self.organ.mesh.points, self.organ._body
        u, least, step, reach = start, np.inf, np.zeros_like(start), 1.0
        ones = np.ones(len(points))
        first = aligned(points, points + before, ones).rotation
        for _ in range(ITERATIONS):
            turned = amplitudes.reshape(-1, 3) @ (aligned(points, points + u, ones).rotation @ first.T).T
            force = self.nodal(turned.ravel())
            left = force - body.internal_force(u) if np.isfinite(body.energy(u)) else np.full_like(u, np.inf)
            left[self.organ.fixed] = 0.0
            size = float(np.linalg.norm(left))
            if not size < GROWTH * least:
                reach *= 0.5
                if reach < SHORTEST:
                    return u, turned.ravel(), False
                u = u - reach * step
                continue
            if size < RESIDUAL * float(np.linalg.norm(force)) + 1e-300:
                return u, turned.ravel(), True
            least, reach = size, 1.0
            loads = [left, *(np.cross(axis, force) for axis in np.eye(3))]
            found = self._solved(u, loads)
            turns = rigid_parts(found, points + u)[:3]
            step = found[:, :, 0] + found[:, :, 1:] @ np.linalg.solve(np.eye(3) - turns[:, 1:], turns[:, 0])
            u = u + step
        return u, turned.ravel(), False

    def _solved(self, displacement: Floats, loads: list[Floats]) -> Floats:
        """Responses (n, 3, k) to small nodal forces about a state."""
        return np.asarray(self.organ._body.linear_responses(displacement, np.stack(loads)).transpose(1, 2, 0))

    def metrics(self, responses: Floats) -> list[Floats]:
        """The priors P of the forces on the boundary and of that on the volume, for a root-mean-square motion of 1 m.

        Forces on patches are normal variables whose correlation falls as a Gaussian over `SMOOTH`.
        """
        gap = np.linalg.norm(self.centres[:, None] - self.centres, axis=2)
        correlation = np.exp(-0.5 * (gap / (SMOOTH * self.organ.mesh.diagonal)) ** 2) + ROUGH * np.eye(len(gap))
        metrics, begin = [], 0
        for covariance in (np.kron(correlation, np.eye(3)), np.eye(3)):
            part = responses[:, :, begin : begin + len(covariance)]
            mean_square = float(np.einsum("nim,mk,nik->", part, covariance, part, optimize=True)) / len(part)
            metrics.append(np.asarray(np.linalg.inv(covariance) * mean_square, dtype=np.float64))
            begin += len(covariance)
        return metrics
