"""What may have happened to an organ: one thing that moved most of it, beside small smooth forces everywhere.

A cause is a force of one or three unknown amplitudes b: a pressure on a disk of the surface, a pull on a part of it, or
a force in the volume. Without a cause, the amplitudes a of all forces have the prior a . P a. With it they are a + D b,
where b is normal with a standard deviation s. With the Hessian H of data and prior, and the most probable a without a
cause, all that it changes follows from

    h = D . (P - P H^-1 P) D,  g = D . P a,  b = (h + 1/s^2)^-1 g,  log evidence = (g . b - log det(1 + s^2 h)) / 2,

so that hundreds of causes are weighed against each other at once. What is believed is the mean over all of them, with
the evidence as weight (Bayesian model averaging: MacKay, Neural Computation 4 (1992) 415; Hoeting et al., Statistical
Science 14 (1999) 382), and so is the covariance. A choice of the best one would jump from one iteration to the next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viscera.mesh import Floats, Indices
from viscera.registration.forces import Forces
from viscera.registration.rigid import spaced

N_PLACES = 100
"""Middles of disks."""
RADII = (0.14, 0.19, 0.25, 0.32)
"""Of disks; this and other lengths in diagonals."""
PULLED = (0.06, 0.14)
"""Standard deviation of the Gaussian by which a pull is spread."""
SIZES = (0.02, 0.05)
"""Root-mean-square displacement, rigid motion apart, that a cause is expected to cause."""
SMALL = (0.005, 0.01, 0.02)
"""The same of the smooth forces, and of that in the volume, where it is not the cause."""
SMALL_VOLUME = 0.003
RIDGE = 1e-2
"""Of the fit of a pressure by the forces on patches."""
NEGLIGIBLE = 1e-4
"""Weight of a cause that is left out."""


class Causes:
    """Forces that may have been the one that moved the organ most."""

    def __init__(self, forces: Forces, nodes: Indices) -> None:
        self.forces, self.nodes, self.mesh = forces, nodes, forces.organ.mesh
        points = self.mesh.points
        centres = points[nodes[spaced(points[nodes], N_PLACES)]]
        self.gaps = np.linalg.norm(points[nodes] - centres[:, None], axis=2) / self.mesh.diagonal
        count = len(forces.centres)
        shares = np.zeros((len(points), count))
        for column, patch in enumerate(forces.patches[:count]):
            shares[patch.nodes, column] = patch.weights
        gram = shares[nodes].T @ shares[nodes]
        self.onto = np.linalg.solve(gram + RIDGE * np.trace(gram) / count * np.eye(count), shares[nodes].T)

    def at(self, x: Floats, responses: Floats) -> list[Floats]:
        """Amplitudes (m, c, k) of c causes each, for a root-mean-square displacement of 1 m: pressed, pulled, volume.

        x (n, 3): the organ as it is, along whose normals pressures act; responses (n, 3, m), rigid motions apart.
        """
        flat = responses.reshape(-1, responses.shape[2])
        gram = flat.T @ flat / len(responses)
        kinds = [self._pressed(x), self._pulled(), np.eye(len(gram))[:, None, -3:]]
        for k, kind in enumerate(kinds):
            columns = kind.reshape(len(gram), -1)
            square = np.einsum("mc,mc->c", columns, gram @ columns).reshape(kind.shape[1:]).mean(axis=1)
            kinds[k] = kind / np.sqrt(np.maximum(square, 1e-300))[None, :, None]
        return kinds

    def _pressed(self, x: Floats) -> Floats:
        """Pressures on all of the surface within a radius, and on what of it faces as its middle does."""
        corners = x[self.mesh.surface]
        areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 6.0
        push = np.zeros_like(x)
        np.add.at(push, self.mesh.surface, -areas[:, None])
        push = push[self.nodes]
        unit = push / np.linalg.norm(push, axis=1, keepdims=True)
        facing = unit[self.gaps.argmin(axis=1)] @ unit.T > 0.0
        near = [self.gaps < radius for radius in RADII]
        disks = np.concatenate([*near, *(disk & facing for disk in near)]).astype(float)
        weighted = (disks[:, :, None] * push).transpose(1, 0, 2).reshape(len(push), -1)
        amplitudes = (self.onto @ weighted).reshape(-1, len(disks), 3).transpose(0, 2, 1).reshape(-1, len(disks))
        return np.pad(amplitudes, ((0, 3), (0, 0)))[:, :, None]

    def _pulled(self) -> Floats:
        centres = self.forces.centres / self.mesh.diagonal
        gap = np.linalg.norm(centres - centres[:, None], axis=2)
        spread = np.concatenate([np.exp(-0.5 * (gap / width) ** 2) for width in PULLED])
        pulls = np.einsum("cp,ij->picj", spread, np.eye(3)).reshape(-1, len(spread), 3)
        return np.pad(pulls, ((0, 3), (0, 0), (0, 0)))


@dataclass(eq=False)
class _Weighed:
    """Causes of one kind and size, beside small forces of one size."""

    log: Floats
    """Logarithms (c,) of their evidence."""
    mean: Floats
    """Of all unknowns (p,), without a cause."""
    inverse: Floats
    """Their covariance (p, p)."""
    moved: Floats
    """P D (m, c, k)."""
    amplitudes: Floats
    """b (c, k)."""
    covariances: Floats
    """Of b (c, k, k)."""


class Weighing:
    """All causes in all sizes, each kind and size as probable as another, to be weighed beside small forces."""

    def __init__(self, priors: list[Floats], kinds: list[Floats], sizes: list[float]) -> None:
        """priors (p, p): of all unknowns, in which the forces are those from 6 on, for sizes of the small forces."""
        self.priors, self.kinds, self.sizes = priors, kinds, sizes
        self.forces = slice(6, 6 + len(kinds[0]))
        own = [prior[self.forces, self.forces] for prior in priors]
        self.logs = [_log_determinant(prior) for prior in own]
        self.moved = [[np.tensordot(prior, kind, axes=1) for kind in kinds] for prior in own]
        """P D (m, c, k) by prior and kind."""

    def believed(self, data: Floats, right: Floats) -> tuple[Floats, Floats, float]:
        """Mean (p,) and covariance (p, p) of all unknowns, over causes and over sizes of small forces; log evidence.

        data (p, p), right (p,): the normal equations.
        """
        weighed = [part for prior in range(len(self.priors)) for part in self._beside(prior, data, right)]
        largest = max(float(part.log.max()) for part in weighed)
        total = sum(float(np.exp(part.log - largest).sum()) for part in weighed)
        means, covariance = [], np.zeros_like(data)
        weights = []
        for part in weighed:
            weight = np.exp(part.log - largest) / total
            kept = np.flatnonzero(weight > NEGLIGIBLE)
            if not len(kept):
                continue
            weight = weight[kept]
            turned = np.tensordot(part.inverse[:, self.forces], part.moved[:, kept], axes=1)
            means.append(part.mean[:, None] + np.einsum("pck,ck->pc", turned, part.amplitudes[kept]))
            weights.append(weight)
            factors = np.einsum("pci,cij->pcj", turned, np.linalg.cholesky(part.covariances[kept]))
            factors = (factors * np.sqrt(weight)[:, None]).reshape(len(data), -1)
            covariance += weight.sum() * part.inverse + factors @ factors.T
        every, weight = np.concatenate(means, axis=1), np.concatenate(weights)
        weight = weight / weight.sum()
        mean = every @ weight
        apart = (every - mean[:, None]) * np.sqrt(weight)
        return mean, covariance + apart @ apart.T, largest + float(np.log(total))

    def _beside(self, prior: int, data: Floats, right: Floats) -> list[_Weighed]:
        """With one prior: no cause, then all kinds of causes in all sizes."""
        hessian = data + self.priors[prior]
        scale = 1.0 / np.sqrt(np.diag(hessian))
        scaled = hessian * scale[:, None] * scale
        inverse = scale[:, None] * np.linalg.inv(scaled) * scale
        mean, own = inverse @ right, inverse[self.forces, self.forces]
        log = 0.5 * (right @ mean + self.logs[prior] - _log_determinant(scaled)) + np.log(scale).sum()
        none = np.zeros((len(own), 1, 1))
        found = [_Weighed(np.array([log]), mean, inverse, none, np.zeros((1, 1)), np.full((1, 1, 1), 1e-300))]
        for kind, moved in zip(self.kinds, self.moved[prior], strict=True):
            _, c, k = kind.shape
            # D . (P - P H^-1 P) D
            h = np.einsum("mci,mcj->cij", moved, kind - np.tensordot(own, moved, axes=1))
            g = np.tensordot(mean[self.forces], moved, axes=1)
            for size in self.sizes:
                covariances = np.linalg.inv(h + np.eye(k) / size**2)
                b = np.einsum("cij,cj->ci", covariances, g)
                gain = 0.5 * ((g * b).sum(axis=1) - np.linalg.slogdet(np.eye(k) + size**2 * h)[1])
                weight = log + gain - np.log(c * len(self.sizes))
                found.append(_Weighed(weight, mean, inverse, moved, b, covariances))
        return found


def _log_determinant(matrix: Floats) -> float:
    """Of a symmetric positive definite matrix."""
    return 2.0 * float(np.log(np.diag(np.linalg.cholesky(matrix))).sum())
