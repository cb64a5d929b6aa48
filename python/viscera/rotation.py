"""Rotations: matrices of rotation vectors, and the mean rotation of a set of points."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from viscera.mesh import Floats
from viscera.quantity import numbers_of, refused

UNTURNED = np.eye(3)


def rotation_matrix(rotation: ArrayLike | None, what: str = "the rotation of a tool") -> Floats:
    """A rotation matrix (3, 3) of one, or of a rotation vector (3,) [rad] by Rodrigues' formula."""
    if rotation is None:
        return np.array(UNTURNED)
    given = numbers_of(rotation)
    if given is None or given.shape not in {(3,), (3, 3)} or not np.isfinite(given).all():
        raise refused(what, "a matrix (3, 3) or a rotation vector (3,) [rad], finite", rotation)
    if given.shape == (3, 3):
        if np.abs(given @ given.T - UNTURNED).max() > 1e-6 or np.linalg.det(given) < 0.0:
            raise refused(what, "an orthogonal matrix of determinant 1", rotation)
        return np.asarray(given)
    angle = float(np.linalg.norm(given))
    if angle == 0.0:
        return np.array(UNTURNED)
    x, y, z = given / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(UNTURNED + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def mean_rotation(weights: Floats, arms: Floats, places: Floats) -> Floats:
    """The rotation (3, 3) that takes arms (k, 3) nearest to places (k, 3), both about their weighted mean.

    It minimises `sum_i w_i |R r_i - x_i|^2` (Kabsch 1976) and is the polar factor of `sum_i w_i x_i r_i^T`.

    >>> arms = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])
    >>> mean_rotation(np.ones(3), arms, arms[:, [1, 0, 2]] * (-1, 1, 1)).round(6).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    left, _, right = np.linalg.svd((weights[:, None] * places).T @ arms)
    left[:, 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))
    return np.asarray(left @ right)


def angle_between(one: Floats, other: Floats) -> float:
    """The angle [rad] of the rotation that takes one orientation (3, 3) to the other."""
    return float(np.arccos(np.clip(0.5 * (np.trace(one.T @ other) - 1.0), -1.0, 1.0)))


def spread(weights: Floats, arms: Floats) -> float:
    """How far points are from lying on a line: the second principal extent over the first, 0 on a line."""
    extents = np.linalg.svd(np.sqrt(weights)[:, None] * arms, compute_uv=False)
    return float(extents[1] / extents[0]) if len(arms) > 1 and extents[0] > 0.0 else 0.0
