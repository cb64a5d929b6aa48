"""Nonlinear least squares within bounds, by damped Gauss-Newton steps that are linear least squares within them.

A step `s` from `x` minimises `|J s + r|^2 + damping |D s|^2`, `low <= x + s <= high`, with the norms of the columns of
`J` in `D`, so that units play no part (Marquardt, J. SIAM 11 (1963) 431). It puts a value on its bound exactly: methods
that stay inside end beside it, and short of the minimum of the others.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from viscera.fitting.optional import scipy
from viscera.mesh import Floats

N_TRIALS = 60
DAMPING = 1e-4
NO_GAIN = 1e-12
"""Part of the squared error that a step must promise: a smaller one moves no value by 1e-5 of its interval."""
NO_ERROR = 1e-20
"""Squared error that is none: residuals are parts of the largest stress, which an equilibrium gives to 1e-10."""

Residual = Callable[[Floats], tuple[Floats, Floats]]
"""Values (p,) to the errors (n,) and their derivatives (n, p)."""


def least(residual: Residual, start: Floats, low: Floats, high: Floats) -> Floats:
    """The values (p,) of a minimum of the squared error within bounds, descended to from a start.

    The damping follows the gain of a step over the promised one (Madsen, Nielsen and Tingleff, *Methods for Non-Linear
    Least Squares Problems*, 2004): factors of ten would zigzag along a curved valley.
    """
    values = np.clip(start, low, high)
    error, derivatives = residual(values)
    damping, factor = DAMPING, 2.0
    for _ in range(N_TRIALS):
        squared = float(error @ error)
        trial = np.clip(values + _step(error, derivatives, damping, low - values, high - values), low, high)
        promised = squared - float(np.square(error + derivatives @ (trial - values)).sum())
        if promised <= max(NO_GAIN * squared, NO_ERROR):
            break
        tried = residual(trial)
        gain = (squared - float(tried[0] @ tried[0])) / promised
        if gain > 0.0:
            values, (error, derivatives) = trial, tried
            damping, factor = damping * max(0.1, 1.0 - (2.0 * gain - 1.0) ** 3), 2.0
        else:
            damping, factor = damping * factor, 2.0 * factor
    return values


def _step(error: Floats, derivatives: Floats, damping: float, low: Floats, high: Floats) -> Floats:
    """The step (p,) within bounds that is best by the derivatives, and damped."""
    size = np.maximum(np.linalg.norm(derivatives, axis=0), np.finfo(float).tiny)
    A = np.vstack([derivatives / size, np.sqrt(damping) * np.eye(len(size))])
    b = np.concatenate([-error, np.zeros(len(size))])
    found = scipy("optimize").lsq_linear(A, b, (low * size, high * size), method="bvls", tol=1e-14)
    return np.asarray(found.x / size)
