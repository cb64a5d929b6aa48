"""The body that every code solves: a cube of tissue, drawn out by a quarter."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from viscera.mesh import Floats

SIDE = 0.1  # [m]
YOUNG, POISSON = 1e4, 0.45
STRETCH = 0.25
STEPS = 4


@dataclass(frozen=True, eq=False)
class Problem:
    """A cube, clamped at x = 0; its opposite side moves by `stretch` [m] along x in `steps` equal load steps.

    Neo-Hookean, `mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2`; linear tetrahedra, one point of integration. Every code
    stops by its own criterion of convergence at `tolerance`.
    """

    points: Floats
    """Corners (n, 3) [m]."""
    cells: NDArray[np.int64]
    """Tetrahedra (m, 4) of positive volume."""
    mu: float = YOUNG / (2 * (1 + POISSON))
    lam: float = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    stretch: float = STRETCH * SIDE
    steps: int = STEPS
    tolerance: float = 1e-8

    @property
    def clamped(self) -> NDArray[np.intp]:
        """Nodes of the side at x = 0."""
        return np.flatnonzero(self.points[:, 0] == 0.0)

    @property
    def moved(self) -> NDArray[np.intp]:
        """Nodes of the side that moves."""
        return np.flatnonzero(self.points[:, 0] > SIDE * (1 - 1e-9))

    @property
    def held(self) -> NDArray[np.bool_]:
        """Whether a component of a node (n, 3) is prescribed."""
        mask = np.zeros(self.points.shape, dtype=bool)
        mask[self.clamped] = mask[self.moved] = True
        return mask

    def prescribed(self, share: float) -> Floats:
        """Displacement (n, 3) [m] of the prescribed components at a share of the load, zero elsewhere."""
        u = np.zeros(self.points.shape)
        u[self.moved, 0] = share * self.stretch
        return u


def cube(cells: int) -> Problem:
    """A cube of about so many cells: bricks, each cut into six tetrahedra around its diagonal."""
    n = max(1, round((cells / 6) ** (1 / 3)))
    corners = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3)
    points = np.stack(np.meshgrid(*[np.arange(n + 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
    stride = np.array([(n + 1) ** 2, n + 1, 1])
    walks = np.cumsum([[0, *stride[list(axes)]] for axes in permutations(range(3))], axis=1)
    tets = ((corners @ stride)[:, None, None] + walks).reshape(-1, 4)
    points = SIDE * points / n
    edges = points[tets[:, 1:]] - points[tets[:, :1]]
    turned = np.linalg.det(edges) < 0.0
    tets[turned] = tets[turned][:, [0, 2, 1, 3]]
    return Problem(points, tets.astype(np.int64))
