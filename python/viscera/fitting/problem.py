"""The least-squares problem of a fit: coefficients solved for, exponents searched."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.fitting.condensed import Condensed, condensed, whole
from viscera.fitting.families import Family
from viscera.fitting.homogeneous import compressible_stress, incompressible_stress
from viscera.fitting.materialtest import MaterialTest
from viscera.fitting.optional import scipy
from viscera.law import Law
from viscera.mesh import Floats

EXPONENT_STEP = 1e-5
FAILED = 1e3
"""Residual of a trial whose stress no number holds, or which has no equilibrium."""
N_SEARCHES = 3  # from the best of the starts: the error has local minima in the exponents


class Problem:
    """Separable least squares. Values: the coefficients within their bounds, then the exponents."""

    def __init__(
        self, kind: Family, tests: tuple[MaterialTest, ...], weights: Floats, poisson: float, incompressible: bool
    ) -> None:
        self.kind, self.tests, self.poisson, self.incompressible = kind, tests, poisson, incompressible
        self.stress_of = incompressible_stress if incompressible else compressible_stress
        if not incompressible and len(kind.coefficients) > 1:
            raise VisceraError(
                f"{kind.name} has stresses that are not linear in its coefficients unless det F = 1; fit it without "
                "incompressible=False, in the shell without --compressible"
            )
        self.roots = weights
        self.weight = np.concatenate([np.full(test.n_points, w) for test, w in zip(tests, weights, strict=True)])
        self.target = np.concatenate([test.stress for test in tests])
        self.scale = float(np.abs(self.target).max())

    @cached_property
    def _condensed(self) -> list[Condensed]:
        shorten = condensed if self.kind.exponents else whole  # one solution of all points needs nothing shorter
        return [shorten(test, float(root)) for test, root in zip(self.tests, self.roots, strict=True)]

    @cached_property
    def _weighted_target(self) -> Floats:
        return np.concatenate([curve.target for curve in self._condensed])

    def stress(self, law: Law) -> Floats:
        """The law's stress at all points of all tests."""
        return np.concatenate([self.stress_of(law, test) for test in self.tests])

    def _weighted_stress(self, law: Law) -> Floats:
        """The law's stress as it enters the squared error."""
        return np.concatenate([curve.weighted(self.stress_of(law, curve.test)) for curve in self._condensed])

    def columns(self, exponents: Floats) -> Floats:
        """Stress (points, coefficients) of unit coefficients."""
        return self._columns(exponents, self.stress)

    def _columns(self, exponents: Floats, stress_of: Callable[[Law], Floats]) -> Floats:
        columns, base = [], np.empty(0)
        for law, taken in self.kind.basis(exponents, self.poisson):
            stress = stress_of(law)
            if taken is None:
                base = stress
            columns.append(stress if taken is None else stress - base)
        return np.column_stack(columns)

    def coefficients(self, exponents: Floats) -> Floats:
        """The best coefficients within their bounds."""
        return self._coefficients(self._columns(exponents, self._weighted_stress))

    def _coefficients(self, weighted: Floats) -> Floats:
        """The same from the columns as they enter the squared error."""
        with np.errstate(over="ignore"):
            size = np.maximum(np.linalg.norm(weighted, axis=0), np.finfo(float).tiny)
        if not np.isfinite(size).all():
            raise VisceraError(f"{self.kind.name} has stresses beyond all numbers on these curves; fit a shorter range")
        A = weighted / size
        low, high = np.array(self.kind.coefficient_bounds).T
        found = np.linalg.lstsq(A, self._weighted_target, rcond=None)[0] / size
        if ((found > low) & (found < high)).all() or (self.kind.admits is not None and self.kind.admits(found)):
            return np.asarray(found)
        bounded = scipy("optimize").lsq_linear(
            A, self._weighted_target, (low * size, high * size), method="bvls", tol=1e-14
        )
        return np.asarray(bounded.x / size)

    def residual(self, exponents: Floats) -> Floats:
        """Weighted error [largest stress] with the best coefficients; a large one where the law has no stress."""
        weighted = self._columns(exponents, self._weighted_stress)
        try:
            error = weighted @ self._coefficients(weighted) - self._weighted_target
        except VisceraError:
            return np.full(len(weighted), FAILED)
        return np.asarray(error / self.scale)

    def best_exponents(self) -> Floats:
        """The exponents with the least error, searched from every start."""
        if not self.kind.exponents:
            return np.empty(0)
        low, high = np.array(self.kind.exponent_bounds).T
        starts = sorted(self.kind.starts, key=lambda start: float(np.square(self.residual(np.array(start))).sum()))
        settings = {
            "bounds": (low, high),
            "xtol": 1e-12,
            "ftol": 1e-12,
            "gtol": 1e-14,
            "jac": "3-point",
            "x_scale": "jac",
            "max_nfev": 200,
        }
        runs = [scipy("optimize").least_squares(self.residual, start, **settings) for start in starts[:N_SEARCHES]]
        return np.asarray(min(runs, key=lambda run: run.cost).x)

    def best(self) -> Floats:
        """The values with the least error."""
        exponents = self.kind.settled(self.best_exponents())
        return np.concatenate([self.coefficients(exponents), exponents])

    def split(self, values: Floats) -> tuple[Floats, Floats]:
        """Coefficients, and exponents."""
        n = len(self.kind.coefficients)
        return values[:n], values[n:]

    def law(self, values: Floats) -> Law:
        """The law of these values."""
        return self.kind.make(*self.split(values), self.poisson)

    def derivatives(self, values: Floats) -> tuple[Floats, Floats]:
        """Stress (points,), and its derivatives (points, parameters) in coefficients and exponents."""
        coefficients, exponents = self.split(values)
        columns = self.columns(exponents)
        return columns @ coefficients, np.column_stack([columns, *self._exponent_columns(values)])

    def free(self, values: Floats) -> NDArray[np.bool_]:
        """Which parameters no bound holds."""
        low, high = np.array([*self.kind.coefficient_bounds, *self.kind.exponent_bounds]).T
        reach = 1e-9 * np.maximum(np.abs(values), np.abs(values).max(initial=0.0) * 1e-6)
        return np.asarray((np.abs(values - low) > reach) & (np.abs(values - high) > reach))

    def _exponent_columns(self, values: Floats) -> list[Floats]:
        """Derivatives of the stress in the exponents, by central differences."""
        columns = []
        for plus, minus, step in self.exponent_pairs(values):
            columns.append((self.stress(plus) - self.stress(minus)) / step)
        return columns

    def exponent_pairs(self, values: Floats) -> Iterator[tuple[Law, Law, float]]:
        """For each exponent two laws on either side, and how far they are apart."""
        coefficients, exponents = self.split(values)
        for k in range(len(exponents)):
            step = EXPONENT_STEP * max(1.0, abs(exponents[k]))
            sides = (exponents + sign * step * np.eye(len(exponents))[k] for sign in (1.0, -1.0))
            plus, minus = (self.kind.make(coefficients, side, self.poisson) for side in sides)
            yield plus, minus, 2.0 * step
