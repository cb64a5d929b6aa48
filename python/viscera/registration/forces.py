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
from viscera.registration.rigid import aligned, levers, spaced, turns_of

if TYPE_CHECKING:
    from viscera.organ import Organ

N_PATCHES = 80
SMOOTH = 1.0 / 6.0  # of the organ's diagonal
ROUGH = 1e-2  # variance of what is not smooth
ITERATIONS = 4  # of Newton's method at most
RESIDUAL = 1e-3  # forces left, over all forces, near enough to an equilibrium
HOPELESS = 10.0  # growth of it after which Newton's method ends
NEAR = 1e-3  # root-mean-square distance from where the organ is held, in diagonals
OVERLAP = 1.5  # radius of a patch over the distance to its neighbours


class Forces:
    """Amplitudes (m,) [N] of forces on an organ: three for each patch, then three for the volume."""

    def __init__(self, organ: Organ, nodes: Indices, count: int = N_PATCHES) -> None:
        self.organ, self.loaded = organ, nodes
        self.compliance = _core.Compliance(organ._body)
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

    def responses(self, displacement: Floats, more: Floats | None = None) -> Floats:
        """Displacements (n, 3, m) [m/N] per unit amplitude about an equilibrium: columns of the inverse tangent.

        more (k, n, 3) [N]: further nodal forces, whose displacements [m] are the last columns.
        """
        loads = self.units if more is None else np.concatenate([self.units, more])
        return np.ascontiguousarray(self.compliance.responses(displacement, loads).transpose(1, 2, 0))

    def left(self, displacement: Floats, amplitudes: Floats) -> Floats:
        """Nodal forces (n, 3) [N] that the organ does not balance."""
        left = self.nodal(amplitudes) - self.organ._body.internal_force(displacement)
        left[self.organ.fixed] = 0.0
        return np.asarray(left)

    def following(self, responses: Floats, amplitudes: Floats, turns: Floats) -> Floats:
        """The same if forces turn with the organ: a' = a + da + turn x a, where turns (3, m) are those of responses.

        A dead force that presses an organ towards its fixed nodes makes it fall over; this one does not. The first
        columns are those of the amplitudes.
        """
        crossed = np.concatenate(levers(amplitudes.reshape(-1, 3)))
        count = len(crossed)
        return np.asarray(
            responses
            + (responses[:, :, :count] @ crossed) @ np.linalg.solve(np.eye(3) - turns[:, :count] @ crossed, turns)
        )

    def equilibrium(
        self,
        amplitudes: Floats,
        start: Floats,
        before: Floats,
        goal: Floats,
        steer: Floats,
        count: int = ITERATIONS,
        enough: float = RESIDUAL,
    ) -> tuple[Floats, Floats, float]:
        """Displacement (n, 3) under forces that turn with the organ, amplitudes then, forces left over all forces.

        Newton's method from `start`; the amplitudes are given for the organ in the displacement `before`. Every
        iteration adds as much of the amplitudes `steer` (m, k) as brings the organ nearest to the displacement `goal`:
        a unit of one costs what a distance of `NEAR` diagonals does. Of all iterations, the one that leaves least.
        """
        points = self.organ.mesh.points
        ones = np.ones(len(points))
        first = aligned(points, points + before, ones).rotation
        u, best = start, (start, amplitudes, np.inf)
        for iteration in range(count + 1):
            if not np.isfinite(self.organ._body.energy(u)):
                break
            turn = aligned(points, points + u, ones).rotation @ first.T
            turned = (amplitudes.reshape(-1, 3) @ turn.T).ravel()
            force, left = self.nodal(turned), self.left(u, turned)
            size = float(np.linalg.norm(left)) / (float(np.linalg.norm(force)) + 1e-300)
            best = min(best, (u, turned, size), key=lambda state: state[2])
            if iteration == count or size < enough or size > HOPELESS * best[2]:
                break
            columns = [self.nodal((column.reshape(-1, 3) @ turn.T).ravel()) for column in steer.T]
            step, more = self._newton(u, [left, *columns], force, goal)
            u, amplitudes = u + step, amplitudes + steer @ more
        return best

    def _newton(self, u: Floats, loads: list[Floats], force: Floats, goal: Floats) -> tuple[Floats, Floats]:
        """The step (n, 3) under the first load and so much (k,) of the others as leads nearest to the goal."""
        x = self.organ.mesh.points + u
        crossed = [np.cross(axis, force) for axis in np.eye(3)]
        found = self.compliance.responses(u, np.stack(loads + crossed)).transpose(1, 2, 0)
        turns, own = turns_of(found, self.organ.mesh.points, x), len(loads)
        moved = found[:, :, :own] + found[:, :, own:] @ np.linalg.solve(np.eye(3) - turns[:, own:], turns[:, :own])
        flat = moved.reshape(-1, own) / (np.sqrt(len(x)) * NEAR * self.organ.mesh.diagonal)
        rest = (goal - u).ravel() / (np.sqrt(len(x)) * NEAR * self.organ.mesh.diagonal) - flat[:, 0]
        more = np.linalg.solve(flat[:, 1:].T @ flat[:, 1:] + np.eye(own - 1), flat[:, 1:].T @ rest)
        return np.asarray(moved[:, :, 0] + moved[:, :, 1:] @ more), more

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
