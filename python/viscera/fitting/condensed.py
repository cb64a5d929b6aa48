"""A long curve condensed to few stretches, with the same sum of squared errors for every law.

Along a curve the stress of a law is a smooth function of the logarithm of the stretch (of the shear, in simple shear):
at all n points it is `L s`, where `s` are its values at K Chebyshev points and `L` (n, K) interpolates between them by
a polynomial of degree K - 1, to rounding. With `W [L, y] = Q R`, y the measured stress, the sum of squared errors is
`|R (s, -1)|^2`: K + 1 rows in place of n. Trefethen, Approximation Theory and Approximation Practice, SIAM (2013).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from viscera.curves import MODES
from viscera.fitting.materialtest import MaterialTest
from viscera.mesh import Floats

N_KEPT = 64
"""Stretches of a condensed curve: enough for a power of -30 of stretches from 1/5 to 5."""
SHORT = 256
"""Points up to which a curve stays as it is."""
ROWS = 8192
"""Points that are added to the triangle `R` at a time."""


@dataclass(frozen=True, eq=False)
class Condensed:
    """A curve whose squared error is `|weights s - target|^2`, if s (K,) is the stress at the stretches of `test`."""

    test: MaterialTest
    """Its stress is not that of the curve."""
    weights: Floats
    """(rows, K); or (K,), those of its own points, where it is as it was."""
    target: Floats
    """(rows,) [Pa]."""

    def weighted(self, stress: Floats) -> Floats:
        """`weights s` (rows,) of a stress (K,) at the stretches of `test`."""
        return np.asarray(self.weights * stress if self.weights.ndim == 1 else self.weights @ stress)


def whole(test: MaterialTest, weight: float) -> Condensed:
    """A curve as it is; the error [Pa] of each of its points counts `weight` times."""
    return Condensed(test, np.full(test.n_points, weight), weight * test.stress)


def condensed(test: MaterialTest, weight: float) -> Condensed:
    """The same at few stretches, if it is long."""
    if test.n_points <= SHORT:
        return whole(test, weight)
    kept = np.unique(test.stretch)
    if len(kept) <= SHORT:
        to_points: Callable[[Floats], Floats] = lambda part: (part[:, None] == kept).astype(float)  # noqa: E731
    else:
        kept, to_points = _interpolation(test)
    triangle = np.empty((0, len(kept) + 1))
    for start in range(0, test.n_points, ROWS):
        part = slice(start, start + ROWS)
        rows = weight * np.column_stack([to_points(test.stretch[part]), test.stress[part]])
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, rows]), mode="r"))
    curve = MaterialTest(test.mode, kept, np.zeros_like(kept), test.name)
    return Condensed(curve, triangle[:, :-1], triangle[:, -1])


def _interpolation(test: MaterialTest) -> tuple[Floats, Callable[[Floats], Floats]]:
    """Chebyshev points (K,) over the range of a curve, and the matrix (k, K) from values there to others."""
    is_shear = MODES[test.mode].at_rest == 0.0
    low, high = (float(end) if is_shear else float(np.log(end)) for end in (test.stretch.min(), test.stretch.max()))
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    points = chebyshev.chebpts2(N_KEPT)
    from_values = np.linalg.inv(chebyshev.chebvander(points, N_KEPT - 1))

    def to_points(stretch: Floats) -> Floats:
        x = ((stretch if is_shear else np.log(stretch)) - middle) / half
        return np.asarray(chebyshev.chebvander(np.clip(x, -1.0, 1.0), N_KEPT - 1) @ from_values)

    kept = middle + half * points
    return kept if is_shear else np.clip(np.exp(kept), test.stretch.min(), test.stretch.max()), to_points
