"""What is left between the points and the organ: a scatter of each point, and what neighbouring points have in common.

Noise differs from point to point. A shape that does not fit leaves whole neighbourhoods on one side of the surface,
however well forces have brought it near: the products of residuals of neighbours then have a mean,

    s^2 = sum_c sum_{i != j in c} w_i w_j r_i r_j / sum_c sum_{i != j in c} w_i w_j,

over cubes c of feet of the points on the organ. Noise alone leaves it at zero, so the noise need not be told to find s.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import erfc, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from viscera.mesh import Floats
from viscera.registration.equations import CUBE, WRONG
from viscera.registration.rigid import spread

MISFIT = 1.5
"""Largest `misfit` of a good fit. It is about 1 where noise and model are as was said, and scatters where points are
few; a bound nearer to 1 would blame good fits."""
SYSTEMATIC, CURVED = 2.0, 0.1
"""Largest systematic residual of a good fit: so many times the model's error and, added in squares, this part of the
noise, since a curved surface seems to lie farther out where points are noisy. `benchmarks/registration.py` prints what
right and wrong clouds leave."""
CERTAIN = 2.0
"""Standard deviations of s^2 by noise alone that it must be beyond that."""
FAR = 3.0
"""Residuals over their spread beyond which they may be of something else."""
NEIGHBOURS = 10.0
"""Of a point in its cube, on average at least, if cubes no wider than that hold so many."""
WIDEST = 0.2
"""In diagonals."""


UNLIKELY = 0.01
"""Probability that noise alone puts one of all landmarks and points so far off that it is taken for wrong."""


@dataclass(frozen=True)
class Left:
    """What a fit leaves."""

    misfit: float
    """Spread of the residuals over what noise and the model's error explain."""
    systematic: float
    """s [m]."""
    is_poor: bool
    """Whether one of them is beyond its bound."""


def left(residual: Floats, feet: Floats, weights: Floats, noise: float, size: float) -> Left:
    """What is left of residuals (k,) [m] at feet (k, 3) on an organ of this size [m].

    noise [m]: standard deviation of a point of weight 1; that of others is noise / sqrt(weight).
    """
    explained = np.hypot(noise / np.sqrt(weights), WRONG * size)
    misfit = spread(residual / explained, weights)
    scatter = spread(residual * np.sqrt(weights), weights)
    near = np.abs(residual) * np.sqrt(weights) < FAR * scatter
    square, deviation = _in_common(residual[near], feet[near], weights[near], scatter, size)
    bound = np.hypot(SYSTEMATIC * WRONG * size, CURVED * noise)
    is_systematic = square > bound**2 + CERTAIN * deviation
    return Left(misfit, float(np.sqrt(max(square, 0.0))), misfit > MISFIT or bool(is_systematic))


def is_beyond_noise(gaps: Floats, noise: Floats, size: float) -> NDArray[np.bool_]:
    """Which landmarks and points (l,) lie farther from where they were measured than their noise leaves them.

        P(r_i) < UNLIKELY / l,    r_i = g_i / s_i,    s_i^2 = noise_i^2 + (WRONG size)^2,

    where P(r) = erfc(r / sqrt 2) + sqrt(2 / pi) r exp(-r^2 / 2) is the probability that a place with a normal error of
    deviation 1 along each axis is farther off than r: 3.4 for one landmark, 4.6 for a hundred. The fit gives way to
    what is wrong, so the gap is smaller than the error: where nothing else observes the organ nearby, none is left.
    gaps g (l,) [m]; noise (l,) [m]: standard deviation of each along an axis; size of the organ [m].
    """
    ratio = gaps / np.hypot(noise, WRONG * size)
    beyond = np.array([erfc(r / sqrt(2.0)) for r in ratio]) + sqrt(2.0 / pi) * ratio * np.exp(-0.5 * ratio**2)
    return np.asarray(beyond * len(gaps) < UNLIKELY)


def _in_common(residual: Floats, feet: Floats, weights: Floats, scatter: float, size: float) -> tuple[float, float]:
    """s^2 [m^2], and its standard deviation by noise alone."""
    edge = CUBE * size
    while True:
        cube = np.unique(np.floor(feet / edge).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
        sums = [np.bincount(cube, values) for values in (weights, weights**2, weights * residual)]
        pairs = float((sums[0] ** 2 - sums[1]).sum())
        if pairs >= NEIGHBOURS * weights.sum() or edge > WIDEST * size:
            break
        edge *= 2.0
    if pairs <= 0.0:
        return 0.0, 0.0
    products = float((sums[2] ** 2).sum() - np.square(weights * residual).sum())
    return products / pairs, scatter**2 * float(np.sqrt(2.0 / pairs))
