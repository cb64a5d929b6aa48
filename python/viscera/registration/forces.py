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
from viscera.registration.rigid import spaced

if TYPE_CHECKING:
    from viscera.organ import Organ

N_PATCHES = 80
SMOOTH = 1.0 / 6.0  # of the organ's diagonal
ROUGH = 1e-2  # variance of what is not smooth
OVERLAP = 1.5  # radius of a patch over the distance to its neighbours


class Forces:
    """Amplitudes (m,) [N] of forces on an organ: three for each patch, then three for the volume."""

    def __init__(self, organ: Organ, nodes: Indices, count: int = N_PATCHES) -> None:
        self.organ = organ
        points = organ.mesh.points
        centres = points[nodes[spaced(points[nodes], count)]]
        gaps = np.linalg.norm(centres[:, None] - centres, axis=2) + np.diag(np.full(len(centres), np.inf))
        radius = OVERLAP * float(np.median(gaps.min(axis=1)))
        self.patches = [organ.patch(centre, radius) for centre in centres]
        weight = organ._body.gravity(np.array([1.0, 0.0, 0.0]), np.ones(len(organ.mesh.cells)))[:, 0]
        everywhere = np.arange(len(points), dtype=np.uint32)
        self.patches.append(_core.Patch(everywhere, weight / weight.sum()))
        self.centres = centres

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
        columns = []
        for field, force in _core.touch_series(self.organ._body, self.patches, displacement, 1):
            columns.append(np.tensordot(np.linalg.inv(force), field, axes=1))
        return np.ascontiguousarray(np.concatenate(columns).transpose(1, 2, 0))

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
