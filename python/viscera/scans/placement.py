"""Where a part's volume lies: that of its voxels, and that of its cells.

A mesh may have the volume of a part and yet hold it in other places: a vein as thin as a voxel may become a thread
with thick ends. Hat functions on a grid some edges wide, which add up to one everywhere, weigh both around each node of
the grid. What is too much around some nodes, and lacking around others, lies in a wrong place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viscera.mesh import Floats, Indices

EDGES, VOXELS = 2.5, 4.0
"""Distance between nodes: in edges, and in the largest sides of voxels; the larger of both."""
CHUNK = 1 << 16
"""Places that are weighed in one go, so that their numbers stay in the cache."""


def misplaced(
    inside: NDArray[np.bool_], affine: Floats, points: Floats, cells: Indices, volumes: Floats, edge: float
) -> float:
    """Volume [m^3] that cells (m, 4) with volumes (m,) [m^3] and a mean edge [m] have too much in some places, and lack
    in others.

    `sum_i max(0, r_i)` or `sum_i max(0, -r_i)`, the smaller one, where `r_i` is the volume of the voxels `inside`
    (i, j, k) less that of the cells, weighted by the hat function of node i. affine (3, 4): from voxel indices to
    places [m].
    """
    sides = np.linalg.norm(affine[:, :3], axis=0)
    stride = max(EDGES * edge, VOXELS * sides.max()) / sides
    shape = np.ceil((np.array(inside.shape) + 1) / stride).astype(int) + 2
    voxels = np.argwhere(inside)
    held = _around(voxels, np.full(len(voxels), abs(np.linalg.det(affine[:, :3]))), stride, shape)
    middles = points[cells[:, 0]].copy()
    for k in (1, 2, 3):
        middles += points[cells[:, k]]
    index = (0.25 * middles - affine[:, 3]) @ np.linalg.inv(affine[:, :3]).T
    off = held - _around(index, volumes, stride, shape)  # nodes lie far enough apart for a cell to count at its middle
    return float(min(np.maximum(off, 0.0).sum(), np.maximum(-off, 0.0).sum()))


def _around(index: NDArray[np.number], weights: Floats, stride: Floats, shape: NDArray[np.int64]) -> Floats:
    """What lies at indices (n, 3) of the image, around each node; a node lies one stride outside the image."""
    sums = np.zeros(int(np.prod(shape)))
    for some in range(0, len(index), CHUNK):
        place = np.clip(index[some : some + CHUNK] / stride + 1.0, 0.0, shape - 1.001)
        first = place.astype(int)
        parts = (1.0 - (place - first)).T, (place - first).T
        nodes = first @ np.array([shape[1] * shape[2], shape[2], 1])
        for i, j, k in np.ndindex(2, 2, 2):
            share = weights[some : some + CHUNK] * parts[i][0] * parts[j][1] * parts[k][2]
            sums += np.bincount(nodes + (i * shape[1] + j) * shape[2] + k, share, len(sums))
    return sums
