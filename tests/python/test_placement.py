"""Where a part's volume lies."""

from __future__ import annotations

import numpy as np
import pytest

from viscera.scans.placement import misplaced


def test_volume_in_other_places_is_measured() -> None:
    """A rod of 120 voxels; its cells, one at each voxel, have too much in one half, and lack as much in the other."""
    inside = np.zeros((120, 5, 5), dtype=bool)
    inside[:, 2, 2] = True
    affine = 0.002 * np.eye(3, 4)
    affine[:, 3] = 0.1, -0.2, 0.3
    middles = np.argwhere(inside) @ affine[:, :3].T + affine[:, 3]
    corners = 1e-5 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    points = (middles[:, None] + corners).reshape(-1, 3)
    cells = np.arange(len(points), dtype=np.uint32).reshape(-1, 4)
    of = np.arange(120)
    for share in (0.0, 0.5, 1.0):
        volumes = 8e-9 * np.where(of < 60, 1.0 + share, 1.0 - share)
        off = misplaced(inside, affine, points, cells, volumes, 0.004)
        # Around the node where the halves meet both cancel: a node is five voxels wide.
        assert off == pytest.approx(share * 60 * 8e-9, rel=0.05, abs=1e-15)
    assert misplaced(inside, affine, points, cells, np.full(120, 4e-9), 0.004) == pytest.approx(0.0, abs=1e-15)
