"""The law nearest to measured curves, and its accuracy: intervals, residual, AIC, stability."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from viscera.curves import MODES
from viscera.errors import VisceraError
from viscera.fitting.families import Family, family
from viscera.fitting.homogeneous import compressible_stress, drucker_range, incompressible_stress
from viscera.fitting.materialtest import MaterialTest
from viscera.law import Law
from viscera.mesh import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CONFIDENCE = 0.95
N_SEARCHES = 3  # from the best of the starts: the error has local minima in the exponents


@dataclass(frozen=True)
class Fit:
    """A law fitted to material tests.

    >>> import viscera as vs
    >>> test = vs.MaterialTest("uniaxial", [0.8, 0.9, 1.1, 1.2], [-725, -340, 280, 494], "cylinder")
    >>> found = vs.fit(vs.NeoHookean, [test])
    >>> found.is_stable, found.parameters.keys()
    (True, dict_keys(['mu']))
    """

    law: Law
    """The fitted law, with the Poisson's ratio that the fit was given."""
    parameters: dict[str, float]
    """Coefficients [Pa] and exponents."""
    intervals: dict[str, tuple[float, float] | None]
    """Confidence intervals of 95 % from the linearised problem; none if a bound is active or the data say nothing."""
    standard_error: float
    """sqrt(SSE / (n - p)) [Pa], n points, p parameters."""
    sse: float
    """Sum of squared errors [Pa^2]."""
    aic: float
    """Akaike's criterion, n ln(SSE / n) + 2 (p + 1): the lower of two fits to the same data is the better."""
    stable: dict[str, tuple[float, float]]
    """By deformation: the part of the fitted range in which the law is stable after Drucker."""
    tests: tuple[MaterialTest, ...]
    stresses: tuple[Floats, ...]
    """The law's nominal stress [Pa] at the points of each test."""
    name: str

    @property
    def is_stable(self) -> bool:
        """Whether the law is stable over the whole fitted range."""
        return all(self.stable[mode] == _range(self.tests, mode) for mode in self.stable)

    def errors(self) -> dict[str, float]:
        """Root-mean-square error of each test by its name [Pa].

        >>> import viscera as vs
        >>> test = vs.MaterialTest("uniaxial", [0.8, 0.9, 1.1, 1.2], [-725, -340, 280, 494], "cylinder")
        >>> f"{vs.fit(vs.NeoHookean, [test]).errors()['cylinder']:.0f} Pa"
        '13 Pa'
        """
        pairs = zip(self.tests, self.stresses, strict=True)
        return {test.name: float(np.sqrt(np.mean((stress - test.stress) ** 2))) for test, stress in pairs}

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """The measured points and the law's curve, a panel for each deformation. `path`: write a PNG file there.

        >>> import viscera as vs
        >>> test = vs.MaterialTest("uniaxial", [0.8, 0.9, 1.1, 1.2], [-725, -340, 280, 494], "cylinder")
        >>> figure = vs.fit(vs.NeoHookean, [test]).plot("fit.png")
        """
        from viscera.fitting.plot import draw

        return draw(self, path)

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value:.6g}" for name, value in self.parameters.items())
        stable = "stable" if self.is_stable else "NOT stable over the range fitted"
        return f"Fit({self.name}: {values}; standard error {self.standard_error:.4g} Pa, AIC {self.aic:.1f}, {stable})"


def fit(
    law: type[Law] | str,
    tests: MaterialTest | Sequence[MaterialTest],
    *,
    terms: int | None = None,
    poisson: float = 0.499,
    incompressible: bool = True,
    weights: Sequence[float] | None = None,
) -> Fit:
    """The law of a family nearest to all points of the tests, by bounded least squares of the nominal stress.

    law: a class such as `vs.Ogden`, or its name; `terms` of Yeoh's or Ogden's sum.
    poisson: Poisson's ratio at small strain of the law returned; with `incompressible=False` the curves are computed
        with it too, instead of with det F = 1.
    weights: one for each test, of its squared errors (default: all points count the same).

    Raises `VisceraError` for tests that cannot determine the parameters. Needs scipy (`pip install viscera[fit]`).

    >>> stretch = np.linspace(0.6, 1.5, 10)
    >>> measured = MaterialTest("uniaxial", stretch, 500.0 * (stretch - stretch**-2))
    >>> round(fit("NeoHookean", measured).parameters["mu"], 6)
    500.0
    """
    curves = _checked(tests)
    if isinstance(poisson, bool) or not -1.0 < poisson < 0.5:
        raise VisceraError(f"Poisson's ratio is {poisson}; it must lie above -1 and below 0.5")
    kind = family(law, terms)
    if incompressible and kind.name == "SaintVenantKirchhoff":
        raise VisceraError("SaintVenantKirchhoff has no incompressible form; fit it with incompressible=False")
    if weights is None:
        weights = [1.0] * len(curves)
    if len(weights) != len(curves) or not all(np.isfinite(w) and w > 0.0 for w in weights):
        raise VisceraError(f"{len(curves)} tests need as many positive weights, got {list(weights)}")
    problem = _Problem(kind, curves, np.sqrt(np.asarray(weights, dtype=float)), poisson, incompressible)
    n, p = len(problem.target), len(kind.names)
    if n <= p:
        raise VisceraError(f"{kind.name} has {p} parameters; {n} measured points cannot determine them")
    return problem.result(problem.best_exponents())


def _checked(tests: MaterialTest | Sequence[MaterialTest]) -> tuple[MaterialTest, ...]:
    curves = (tests,) if isinstance(tests, MaterialTest) else tuple(tests)
    if not curves:
        raise VisceraError("there is no test to fit to")
    for test in curves:
        if not isinstance(test, MaterialTest):
            raise VisceraError(f"a test is a MaterialTest, got {type(test).__name__}")
        if not np.abs(test.stress).max() > 0.0:
            raise VisceraError(f"{test.name}: all stresses are zero; there is nothing to fit")
    return curves


def _range(tests: Sequence[MaterialTest], mode: str) -> tuple[float, float]:
    rest = MODES[mode].at_rest
    stretches = np.concatenate([test.stretch for test in tests if test.mode == mode])
    return float(min(stretches.min(), rest)), float(max(stretches.max(), rest))


class _Problem:
    """Separable least squares: coefficients solved for, exponents searched."""

    def __init__(
        self, kind: Family, tests: tuple[MaterialTest, ...], weights: Floats, poisson: float, incompressible: bool
    ) -> None:
        self.kind, self.tests, self.poisson = kind, tests, poisson
        self.stress_of = incompressible_stress if incompressible else compressible_stress
        if not incompressible and len(kind.coefficients) > 1:
            raise VisceraError(
                f"{kind.name} with incompressible=False has stresses that are not linear in its coefficients; "
                "fit it incompressible"
            )
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
        if ((found > low) & (found < high)).all():
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

    def result(self, exponents: Floats) -> Fit:
        """The fit and its statistics."""
        from scipy.stats import t

        columns = self.columns(exponents)
        sizes = self.coefficients(columns)
        coefficients = sizes * self.kind.sign(exponents)
        if not (np.isfinite(coefficients).all() and np.abs(coefficients).max() > 0.0):
            raise VisceraError(
                f"{self.kind.name} cannot follow these curves: all coefficients vanish within their bounds"
            )
        values = np.concatenate([coefficients, exponents])
        law = self.kind.make(coefficients, exponents, self.poisson)
        stress = columns @ sizes
        n, p = len(self.target), len(values)
        sse = float(((stress - self.target) ** 2).sum())
        jacobian = np.column_stack([columns * self.kind.sign(exponents), *self._exponent_columns(values)])
        free = self._free(sizes, exponents)
        half = np.full(p, np.nan)
        spread = _spread(self.weight[:, None] * jacobian[:, free], self.weight * (stress - self.target), n - p)
        if spread is not None:
            half[free] = spread * float(t.ppf(0.5 + 0.5 * CONFIDENCE, n - p))
        intervals = {
            name: None if np.isnan(h) else (float(v - h), float(v + h))
            for name, v, h in zip(self.kind.names, values, half, strict=True)
        }
        modes = dict.fromkeys(test.mode for test in self.tests)
        splits = np.cumsum([test.n_points for test in self.tests])[:-1]
        return Fit(
            law=law,
            parameters=dict(zip(self.kind.names, map(float, values), strict=True)),
            intervals=intervals,
            standard_error=float(np.sqrt(sse / (n - p))),
            sse=sse,
            aic=float(n * np.log(max(sse, np.finfo(float).tiny) / n) + 2 * (p + 1)),
            stable={mode: drucker_range(law, mode, *_range(self.tests, mode)) for mode in modes},
            tests=self.tests,
            stresses=tuple(np.split(stress, splits)),
            name=self.kind.name,
        )

    def _exponent_columns(self, values: Floats) -> list[Floats]:
        """Derivatives of the stress in the exponents, by central differences."""
        n = len(self.kind.coefficients)
        columns = []
        for k in range(n, len(values)):
            step = 1e-5 * max(1.0, abs(values[k]))
            sides = []
            for sign in (1.0, -1.0):
                moved = values.copy()
                moved[k] += sign * step
                sides.append(self.stress(self.kind.make(moved[:n], moved[n:], self.poisson)))
            columns.append((sides[0] - sides[1]) / (2.0 * step))
        return columns

    def _free(self, sizes: Floats, exponents: Floats) -> Floats:
        """Which parameters no bound holds."""
        bounds = np.array([*self.kind.coefficient_bounds, *self.kind.exponent_bounds])
        values = np.concatenate([sizes, exponents])
        reach = 1e-9 * np.maximum(np.abs(values), np.abs(values).max(initial=0.0) * 1e-6)
        return np.asarray((values > bounds[:, 0] + reach) & (values < bounds[:, 1] - reach))


def _spread(jacobian: Floats, residual: Floats, freedom: int) -> Floats | None:
    """Standard deviations of the parameters; none if the curves leave a combination of them undetermined."""
    size = np.linalg.norm(jacobian, axis=0)
    if jacobian.shape[1] == 0 or not size.all():
        return None
    scaled = jacobian / size
    singular = np.linalg.svd(scaled, compute_uv=False)
    if singular[-1] < 1e-10 * singular[0]:
        return None
    covariance = np.linalg.inv(scaled.T @ scaled) * float(residual @ residual) / freedom
    return np.asarray(np.sqrt(np.diag(covariance)) / size)
