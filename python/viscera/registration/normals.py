"""Normals of a measured cloud by itself, which say on which face of the organ a point lies.

At a rim the closest point of the organ may lie on the face beside the one that was seen: noise decides. Its normal
would say where the organ ends, which points on one face do not know: that they stop there may be the camera's doing. So
a point tells where the organ lies as far as the face of its closest point faces as the cloud does around it.
"""

from __future__ import annotations

import numpy as np

from viscera.mesh import Floats

NEIGHBOURS = 12
"""Points, itself included, through which a plane is laid."""
MOST, BATCH = 2000, 256
"""Points with a normal of their own, at most, and points compared with them at once."""
FLAT = 0.25
"""Variance of them across the plane over the smaller one along it, at most; otherwise the cloud has no normal there."""
NONE, FULL = 0.3, 0.6
"""Cosines of the angle between both normals up to which a point does not count, and from which it counts in full. At a
rim the plane through the points of both faces is turned by some 45 degrees against each."""


def normals_of(points: Floats) -> Floats:
    """Normals (k, 3) of the cloud (k, 3) at its points, either way round; zero where no plane fits its neighbours.

    Of a cloud of more than `MOST` points so many, drawn at random, have a normal of their own; each of the others has
    that of the nearest of these.
    """
    if len(points) <= MOST:
        return _own_normals(points)
    points = points - points.mean(axis=0)
    drawn = points[np.random.default_rng(0).permutation(len(points))[:MOST]]
    normals, squares = _own_normals(drawn), np.square(drawn).sum(axis=1)
    batches = np.split(points, range(BATCH, len(points), BATCH))
    nearest = [(squares - 2.0 * batch @ drawn.T).argmin(axis=1) for batch in batches]
    return np.asarray(normals[np.concatenate(nearest)])


def _own_normals(points: Floats) -> Floats:
    normals = np.zeros_like(points)
    if len(points) < NEIGHBOURS:
        return normals
    for k, point in enumerate(points):
        gaps = np.square(points - point).sum(axis=1)
        near = points[np.argpartition(gaps, NEIGHBOURS - 1)[:NEIGHBOURS]]
        arms = near - near.mean(axis=0)
        variances, axes = np.linalg.eigh(arms.T @ arms)
        if variances[0] < FLAT * variances[1]:
            normals[k] = axes[:, 0]
    return normals


def agreement(faces: Floats, cloud: Floats) -> Floats:
    """Weights (k,) from 0 to 1 of points by the normals (k, 3) of their faces and of the cloud; 1 where it has none."""
    cosine = np.abs(np.einsum("ki,ki->k", faces, cloud))
    return np.where(cloud.any(axis=1), np.clip((cosine - NONE) / (FULL - NONE), 0.0, 1.0), 1.0)
