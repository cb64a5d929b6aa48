"""The least-squares problem of a fit: coefficients solved for, exponents searched."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.fitting.families import Family
from viscera.fitting.homogeneous import compressible_stress, incompressible_stress
from viscera.fitting.materialtest import MaterialTest
from viscera.law import Law
from viscera.mesh import Floats

EXPONENT_STEP = 1e-5
N_SEARCHES = 3  # from the best of the starts: the error has local minima in the exponents


class Problem:
    """Separable least squares. Values: sizes of the coefficients within their bounds, then exponents."""

    def __init__(
        self, kind: Family, tests: tuple[MaterialTest, ...], weights: Floats, poisson: float, incompressible: bool
    ) -> None:
        self.kind, self.tests, self.poisson, self.incompressible = kind, tests, poisson, incompressible
        self.stress_of = incompressible_stress if incompressible else compressible_stress
        if not incompressible and len(kind.coefficients) > 1:
            raise VisceraError(
                f"{kind.name} with incompressible=False has stresses that are not linear in its coefficients; "
                "fit it incompressible"
            )
        self.roots = weights
        self.weight = np.concatenate([np.full(test.n_points, w) for test, w in zip(tests, weights, strict=True)])
        self.target = np.concatenate([test.stress for test in tests])
        self.scale = float(np.abs(self.target).max())

    def stress(self, law: Law) -> Floats:
        """The law's stress at all points of all tests."""
        return np.concatenate([self.stress_of(law, test) for test in self.tests])

    def columns(self, exponents: Floats) -> Floats:
        """Stress (points, coefficients) of unit coefficients, of the sign that these exponents ask for."""
        columns, base = [], np.empty(0)
        for law, taken in self.kind.basis(exponents, self.poisson):
            stress = self.stress(law)
            if taken is None:
                base = stress
            columns.append(stress if taken is None else stress - base)
        return np.column_stack(columns)

    def coefficients(self, columns: Floats) -> Floats:
        """The best coefficients within their bounds, by size."""
        from scipy.optimize import lsq_linear

        size = np.maximum(np.linalg.norm(self.weight[:, None] * columns, axis=0), np.finfo(float).tiny)
        A = self.weight[:, None] * columns / size
        low, high = np.array(self.kind.coefficient_bounds).T
        found = np.linalg.lstsq(A, self.weight * self.target, rcond=None)[0] / size
        if ((found > low) & (found < high)).all() or self.kind.admits(found):
            return np.asarray(found)
        bounded = lsq_linear(A, self.weight * self.target, (low * size, high * size), method="bvls", tol=1e-14)
        return np.asarray(bounded.x / size)

    def residual(self, exponents: Floats) -> Floats:
        """Weighted error [largest stress] with the best coefficients."""
        if np.abs(exponents).min(initial=1.0) < 1e-3:  # a power of zero has no stress
            exponents = np.where(np.abs(exponents) < 1e-3, 1e-3, exponents)
        columns = self.columns(exponents)
        error = columns @ self.coefficients(columns) - self.target
        return np.asarray(self.weight * error / self.scale)

    def best_exponents(self) -> Floats:
        """The exponents with the least error, searched from every start."""
        from scipy.optimize import least_squares

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
        runs = [least_squares(self.residual, start, **settings) for start in starts[:N_SEARCHES]]
        return np.asarray(min(runs, key=lambda run: run.cost).x)

    def best(self) -> Floats:
        """The values with the least error."""
        exponents = self.best_exponents()
        return np.concatenate([self.coefficients(self.columns(exponents)), exponents])

    def split(self, values: Floats) -> tuple[Floats, Floats]:
        """Coefficients with their signs, and exponents."""
        n = len(self.kind.coefficients)
        return values[:n] * self.kind.sign(values[n:]), values[n:]

    def law(self, values: Floats) -> Law:
        """The law of these values."""
        return self.kind.make(*self.split(values), self.poisson)

    def derivatives(self, values: Floats) -> tuple[Floats, Floats]:
        """Stress (points,), and its derivatives (points, parameters) in coefficients and exponents."""
        n = len(self.kind.coefficients)
        columns = self.columns(values[n:])
        signed = columns * self.kind.sign(values[n:])
        return columns @ values[:n], np.column_stack([signed, *self._exponent_columns(values)])

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
        n = len(self.kind.coefficients)
        coefficients, exponents = self.split(values)
        for k in range(len(values) - n):
            step = EXPONENT_STEP * max(1.0, abs(exponents[k]))
            sides = (exponents + sign * step * np.eye(len(exponents))[k] for sign in (1.0, -1.0))
            plus, minus = (self.kind.make(coefficients, side, self.poisson) for side in sides)
            yield plus, minus, 2.0 * step
