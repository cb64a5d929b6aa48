"""How well tests determine the parameters of a law: standard deviations."""

from __future__ import annotations

import numpy as np

from viscera.mesh import Floats

DEPENDENT = 1e-10
"""Smallest singular value over the largest below which derivatives, in units of their norms, are dependent."""


def spread(jacobian: Floats, residual: Floats, freedom: int) -> Floats | None:
    """Standard deviations of the parameters; none without freedom, or if a combination of them is undetermined.

    The roots of the diagonal of `(J^T J)^-1 r.r / freedom`, with the columns of parameters at a bound: the truth may
    lie off the bound, and what the others would then be is part of their uncertainty.
    """
    size = np.linalg.norm(jacobian, axis=0)
    if freedom == 0 or not size.all():
        return None
    _, singular, directions = np.linalg.svd(jacobian / size, full_matrices=False)
    if singular[-1] < DEPENDENT * singular[0]:
        return None
    deviation = np.sqrt(float(residual @ residual) / freedom)
    return np.asarray(deviation * np.linalg.norm(directions / singular[:, None], axis=0) / size)
