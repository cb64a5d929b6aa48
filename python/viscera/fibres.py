"""Fibre directions: two families of unit vectors, the same everywhere or one pair per cell."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from viscera.errors import VisceraError
from viscera.mesh import Floats, Mesh
from viscera.quantity import Number, numbers_of, refused, vector
from viscera.select import Lengths, point


def helical_fibres(
    mesh: Mesh, angle: float, axis: ArrayLike = (0.0, 0.0, 1.0), through: Lengths = (0.0, 0.0, 0.0)
) -> Floats:
    """Two families (2, m, 3) that wind round an axis at +angle and -angle [degrees] from the circumference.

    axis: direction (3,) of the vessel; through: a point (3,) [m] of its centre line, also in words. Each cell takes the
    circumference at its centroid; raises `VisceraError` for an axis of no length or a centroid on it.

    >>> import viscera as vs
    >>> vs.helical_fibres(vs.organs.artery(), 40.0).shape
    (2, 1104, 3)
    """
    angle = Number()(angle, "the angle of helical fibres")
    along = vector(axis, "the axis of helical fibres", "")
    if not along.any():
        raise VisceraError("the axis of helical fibres has no length; give a direction such as (0, 0, 1)")
    along /= np.linalg.norm(along / np.abs(along).max()) * np.abs(along).max()
    around = np.cross(along, mesh.centroids - point(through, mesh, "the point that the axis goes through"))
    radius = np.linalg.norm(around, axis=1, keepdims=True)
    if not (radius > 1e-9 * mesh.diagonal).all():
        raise VisceraError(f"the centroid of cell {int(radius.argmin())} lies on the axis of the helical fibres")
    around /= radius
    turn = np.radians(angle)
    return np.stack([np.cos(turn) * around + sign * np.sin(turn) * along for sign in (1.0, -1.0)])


def directions(fibres: ArrayLike) -> Iterator[tuple[int, str, Floats]]:
    """The components of two families of unit directions, by family and axis."""
    given = numbers_of(fibres)
    if given is None:
        raise refused("fibres", "two directions (2, 3), or (2, m, 3) over cells", fibres)
    if given.ndim not in {2, 3} or given.shape[0] != 2 or given.shape[-1] != 3:
        raise VisceraError(f"fibres are two directions (2, 3), or (2, m, 3) over cells, got shape {given.shape}")
    rows = given.reshape(2, -1, 3)
    lengths = np.linalg.norm(rows, axis=-1)
    for family, cell in np.argwhere(~((lengths > 0.0) & np.isfinite(lengths))):
        raise VisceraError(f"fibre {family + 1} of cell {cell} is {rows[family, cell].tolist()}; it needs a direction")
    for family, unit in enumerate(rows / lengths[..., None]):
        yield from ((family, axis, unit[:, k]) for k, axis in enumerate("xyz"))
