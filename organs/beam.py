"""The beam: the slender block of textbooks, 1 x 0.2 x 0.2 m, x along it; metres."""

import numpy as np
from numpy.typing import NDArray

SIZE = np.array([1.0, 0.2, 0.2])
N_HEXAHEDRA = (20, 4, 4)
# Kuhn's subdivision: six tetrahedra around the diagonal 0-7 of the hexahedron whose corner a + 2 b + 4 c is (a, b, c).
KUHN = np.array([[0, 1, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 3, 2, 7], [0, 6, 4, 7], [0, 5, 1, 7]])


def beam() -> tuple[NDArray[np.float64], NDArray[np.int64], dict[str, NDArray[np.int64]]]:
    """Points [m], cells and node sets `clamp` (x = 0), `tip` (x = 1), `top` (z = 0.2)."""
    lattice = np.stack(np.meshgrid(*(np.arange(n + 1) for n in N_HEXAHEDRA), indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(lattice)).reshape([n + 1 for n in N_HEXAHEDRA])
    nx, ny, nz = N_HEXAHEDRA
    corners = [number[a : nx + a, b : ny + b, c : nz + c].ravel() for c in (0, 1) for b in (0, 1) for a in (0, 1)]
    cells = np.stack(corners, axis=-1)[:, KUHN].reshape(-1, 4)
    sets = {
        "clamp": np.flatnonzero(lattice[:, 0] == 0),
        "tip": np.flatnonzero(lattice[:, 0] == nx),
        "top": np.flatnonzero(lattice[:, 2] == nz),
    }
    return lattice / N_HEXAHEDRA * SIZE, cells, sets
