"""The law nearest to measured curves, and its accuracy: intervals, residual, AIC, stability."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from viscera.curves import MODES
from viscera.errors import VisceraError
from viscera.fitting.accuracy import confused, spread, without_sign
from viscera.fitting.families import family
from viscera.fitting.homogeneous import compressibility_error, drucker_range
from viscera.fitting.materialtest import MaterialTest
from viscera.fitting.optional import scipy
from viscera.fitting.problem import Problem
from viscera.fitting.specimen import SpecimenProblem, SpecimenTest
from viscera.law import Law
from viscera.mesh import Floats
from viscera.naming import told_apart
from viscera.quantity import numbers_of, refused
from viscera.sealed import Sealed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CONFIDENCE = 0.95
LARGEST_COMPRESSIBILITY_ERROR = 0.02
"""Part of the largest stress up to which a law with its bulk modulus follows a fit with det F = 1."""
AT_REST = 1e-9
"""Stretch less 1, or shear, below which every law gives the same stress: none."""


class Undetermined(VisceraError):
    """The tests do not determine the parameters of this law; they may determine those of another."""


@dataclass(frozen=True, eq=False)
class Fit(Sealed):
    """A law fitted to material tests.

    >>> import viscera as vs
    >>> test = vs.MaterialTest("uniaxial", [0.8, 0.9, 1.1, 1.2], [-725, -340, 280, 494], "cylinder")
    >>> found = vs.fit(vs.NeoHookean, [test])
    >>> found.is_stable, found.parameters.keys()
    (True, dict_keys(['mu']))
    """

    law: Law
    """The fitted law, with the Poisson's ratio that the fit was given; see `is_followed_by_law`."""
    parameters: dict[str, float]
    """Coefficients [Pa] and exponents."""
    intervals: dict[str, tuple[float, float] | None]
    """Confidence intervals of 95 % from the linearised problem; none of a parameter at its bound, or if the data say
    nothing. A parameter at its bound widens the others' intervals as if it were free."""
    vanishing: dict[str, str]
    """Each of Ogden's `mu_p` whose `alpha_p` may be zero by its interval, with that exponent, by name: the term is then
    that of the logarithmic strain, and the tests determine `mu_p alpha_p` alone. No exponent is below 0.001 in size."""
    at_bound: tuple[str, ...]
    """Parameters that a bound of the search holds, as docs/measured-laws.md lists them: the best may lie beyond."""
    standard_error: float
    """sqrt(SSE / (n - p)) [Pa], n different points off rest, p parameters; infinite if n = p."""
    sse: float
    """Sum of squared errors at these points [Pa^2]."""
    aic: float
    """Akaike's criterion, n ln(SSE / n) + 2 (p + 1): the lower of two fits to the same data is the better.

    Infinite if n = p: the law then goes through all points, and that says nothing about its worth.
    """
    stable: dict[str, tuple[float, float]]
    """By deformation: the part of the fitted range in which the law is stable after Drucker."""
    tests: tuple[MaterialTest, ...]
    stresses: tuple[Floats, ...]
    """The fitted nominal stress [Pa] at the points of each test: with `incompressible`, that with det F = 1."""
    name: str
    incompressible: bool
    """Whether the homogeneous tests were fitted with det F = 1, in place of the bulk modulus of `law`."""

    @property
    def is_stable(self) -> bool:
        """Whether the law is stable over the whole fitted range."""
        return all(self.stable[mode] == _range(self.tests, mode) for mode in self.stable)

    @property
    def is_ranked(self) -> bool:
        """Whether there are more points than parameters, so that the error and AIC say something.

        >>> import viscera as vs
        >>> vs.fit(vs.NeoHookean, vs.MaterialTest("uniaxial", [1.0, 1.1], [0.0, 280.0])).is_ranked
        False
        """
        return bool(np.isfinite(self.aic))

    @cached_property
    def compressibility_error(self) -> float:
        """Largest stress that `law`, with its own bulk modulus, is off the fitted one, as a part of the largest fitted.

        Over the range of each homogeneous deformation, as far as the law has a state there; zero if the fit itself was
        with the law's bulk modulus.

        >>> import viscera as vs
        >>> test = vs.MaterialTest("uniaxial", [0.8, 0.9, 1.1, 1.2], [-725, -340, 280, 494], "cylinder")
        >>> [round(vs.fit(vs.NeoHookean, test, poisson=nu).compressibility_error, 3) for nu in (0.3, 0.45, 0.499)]
        [0.182, 0.049, 0.001]
        """
        homogeneous = [test for test in self.tests if not isinstance(test, SpecimenTest)]
        if not self.incompressible or not homogeneous:
            return 0.0
        modes = dict.fromkeys(test.mode for test in homogeneous)
        largest = max(float(np.abs(stress).max()) for stress in self.stresses)
        return max(compressibility_error(self.law, mode, *_range(homogeneous, mode)) for mode in modes) / largest

    @property
    def is_followed_by_law(self) -> bool:
        """Whether `law`, with its own bulk modulus, has the fitted stress within 2 % of the largest.

        If not, `errors()`, `standard_error` and `intervals` are those of the incompressible form, not of `law`.

        >>> import viscera as vs
        >>> test = vs.MaterialTest("uniaxial", [0.8, 0.9, 1.1, 1.2], [-725, -340, 280, 494], "cylinder")
        >>> vs.fit(vs.NeoHookean, test, poisson=0.3).is_followed_by_law
        False
        """
        return self.compressibility_error <= LARGEST_COMPRESSIBILITY_ERROR

    def errors(self) -> dict[str, float]:
        """Root-mean-square error of each test by its name [Pa]; tests of one name have their number behind it, from 1.

        >>> import viscera as vs
        >>> test = vs.MaterialTest("uniaxial", [0.8, 0.9, 1.1, 1.2], [-725, -340, 280, 494], "cylinder")
        >>> f"{vs.fit(vs.NeoHookean, [test]).errors()['cylinder']:.0f} Pa"
        '13 Pa'
        """
        names = told_apart([test.name for test in self.tests], range(1, len(self.tests) + 1))
        rows = zip(names, self.tests, self.stresses, strict=True)
        return {name: float(np.sqrt(np.mean((stress - test.stress) ** 2))) for name, test, stress in rows}

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """The measured points and the fitted curve, a panel for each deformation. `path`: write a PNG file there.

        >>> import viscera as vs
        >>> test = vs.MaterialTest("uniaxial", [0.8, 0.9, 1.1, 1.2], [-725, -340, 280, 494], "cylinder")
        >>> figure = vs.fit(vs.NeoHookean, [test]).plot("fit.png")
        """
        from viscera.fitting.plot import draw

        return draw(self, path)

    def __repr__(self) -> str:
        marks = dict.fromkeys(self.at_bound, " (at its bound)")
        values = ", ".join(f"{name}={value:.6g}{marks.get(name, '')}" for name, value in self.parameters.items())
        stable = "stable" if self.is_stable else "NOT stable over the range fitted"
        errors = f"standard error {self.standard_error:.4g} Pa, AIC {self.aic:.1f}"
        ranked = errors if self.is_ranked else "as many parameters as points"
        off = f", law with its bulk modulus up to {self.compressibility_error:.1%} off"
        return f"Fit({self.name}: {values}; {ranked}, {stable}{'' if self.is_followed_by_law else off})"


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
        with it too, instead of with det F = 1. A fit with det F = 1 is no fit of a law of low Poisson's ratio:
        `is_followed_by_law` and `repr` then say so.
    weights: one for each test, of its squared errors (default: all points count the same).

    Errors, AIC and intervals count each different point off rest once: a point at rest, or one that is repeated, says
    nothing about the parameters. Raises `VisceraError` for tests that cannot determine them. Needs scipy
    (`pip install 'viscera[fit]'`).

    >>> stretch = np.linspace(0.6, 1.5, 10)
    >>> measured = MaterialTest("uniaxial", stretch, 500.0 * (stretch - stretch**-2))
    >>> round(fit("NeoHookean", measured).parameters["mu"], 6)
    500.0
    """
    curves = _checked(tests)
    if isinstance(poisson, bool) or not isinstance(poisson, Real) or not -1.0 < poisson < 0.5:
        raise VisceraError(f"Poisson's ratio is {poisson}; it must lie above -1 and below 0.5")
    kind = family(law, terms)
    if incompressible and kind.name == "SaintVenantKirchhoff":
        raise VisceraError(
            "SaintVenantKirchhoff has no incompressible form; fit it with incompressible=False, in the shell with "
            "--compressible"
        )
    if weights is None:
        weights = [1.0] * len(curves)
    counts = numbers_of(weights)
    if counts is None or counts.shape != (len(curves),) or not (np.isfinite(counts) & (counts > 0.0)).all():
        raise refused("weights", f"{len(curves)} positive numbers, one for each test", weights)
    of_specimens = any(isinstance(test, SpecimenTest) for test in curves)
    scipy("optimize")  # told before the work, which takes an error for what the law cannot do
    make = SpecimenProblem if of_specimens else Problem
    problem = make(kind, curves, np.sqrt(counts), poisson, incompressible)
    # Stress is odd in the shear: a shear to the other side says nothing new.
    n, p = len(np.unique(np.abs(_points(curves)[_telling(curves)][:, :2]), axis=0)), len(kind.names)
    if n < p:
        stretches = "1 stretch" if n == 1 else f"{n} stretches"
        raise Undetermined(f"{kind.name} has {p} parameters; points at {stretches} off rest cannot determine them")
    try:
        return _result(problem)
    except Undetermined:
        raise
    except VisceraError as error:  # the input is sound: it is this law that the tests do not suit
        raise Undetermined(str(error)) from error


def _checked(tests: MaterialTest | Sequence[MaterialTest]) -> tuple[MaterialTest, ...]:
    if not isinstance(tests, MaterialTest | Iterable):
        raise refused("the tests", "a MaterialTest, or several", tests)
    curves = (tests,) if isinstance(tests, MaterialTest) else tuple(tests)
    if not curves:
        raise VisceraError("there is no test to fit to")
    for test in curves:
        if not isinstance(test, MaterialTest):
            raise VisceraError(f"a test is a MaterialTest, got {type(test).__name__}")
        if not np.abs(test.stress).max() > 0.0:
            raise VisceraError(f"{test.name}: all stresses are zero; there is nothing to fit")
        if not _telling([test]).any():
            raise VisceraError(f"{test.name}: all points are at rest; there is nothing to fit")
    return curves


def _points(tests: Sequence[MaterialTest]) -> Floats:
    """All points (n, 3): number of the deformation, stretch, stress."""
    modes = list(MODES)
    return np.concatenate(
        [np.column_stack([np.full(test.n_points, modes.index(test.mode)), test.stretch, test.stress]) for test in tests]
    )


def _telling(tests: Sequence[MaterialTest]) -> NDArray[np.bool_]:
    """Which points (n,) say something: those off rest, and of equal ones the first."""
    is_first = np.zeros(sum(test.n_points for test in tests), dtype=bool)
    is_first[np.unique(_points(tests), axis=0, return_index=True)[1]] = True
    off = np.concatenate([np.abs(test.stretch - MODES[test.mode].at_rest) > AT_REST for test in tests])
    return np.asarray(is_first & off)


def _range(tests: Sequence[MaterialTest], mode: str) -> tuple[float, float]:
    rest = MODES[mode].at_rest
    stretches = np.concatenate([test.stretch for test in tests if test.mode == mode])
    return float(min(stretches.min(), rest)), float(max(stretches.max(), rest))


def _result(problem: Problem) -> Fit:
    """The best fit and its statistics."""
    found = problem.best()
    coefficients, exponents = problem.split(found)
    free = problem.free(found)
    is_any = np.abs(coefficients).max() > 0.0 and free[: len(coefficients)].any()
    if not (np.isfinite(coefficients).all() and is_any):
        raise Undetermined(
            f"{problem.kind.name} cannot follow these curves: all coefficients vanish within their bounds"
        )
    values = problem.kind.own(coefficients, exponents)
    try:
        law = problem.law(found)
    except VisceraError as error:  # at the end of a bound that is open
        raise Undetermined(
            f"{problem.kind.name} cannot follow these curves: the best would be none ({error})"
        ) from None
    stress, jacobian = problem.derivatives(found)
    told = _telling(problem.tests)
    n, p = int(told.sum()), len(values)
    residual, weight = (stress - problem.target)[told], problem.weight[told]
    weighted = weight[:, None] * jacobian[told]
    _check_told_apart(problem, found, weighted)
    sse = float((residual**2).sum())
    deviations = spread(problem.kind.in_own(weighted, values), weight * residual, n - p)
    student = scipy("stats").t
    half = np.full(p, np.nan) if deviations is None else deviations * float(student.ppf(0.5 + 0.5 * CONFIDENCE, n - p))
    intervals = {
        name: (float(v - h), float(v + h)) if is_free and np.isfinite(h) else None
        for name, v, h, is_free in zip(problem.kind.names, values, half, free, strict=True)
    }
    vanishing = problem.kind.of_vanishing(intervals)
    modes = dict.fromkeys(test.mode for test in problem.tests)
    splits = np.cumsum([test.n_points for test in problem.tests])[:-1]
    return Fit(
        law=law,
        parameters=dict(zip(problem.kind.names, map(float, values), strict=True)),
        intervals=intervals | dict.fromkeys(vanishing),
        vanishing=vanishing,
        at_bound=tuple(name for name, is_free in zip(problem.kind.names, free, strict=True) if not is_free),
        standard_error=float(np.sqrt(sse / (n - p))) if n > p else float("inf"),
        sse=sse,
        aic=float(n * np.log(max(sse, np.finfo(float).tiny) / n) + 2 * (p + 1)) if n > p else float("inf"),
        stable={mode: drucker_range(law, mode, *_range(problem.tests, mode)) for mode in modes},
        tests=problem.tests,
        stresses=tuple(np.split(stress, splits)),
        name=problem.kind.name,
        incompressible=problem.incompressible,
    )


def _check_told_apart(problem: Problem, values: Floats, jacobian: Floats) -> None:
    alike = confused(problem, values, jacobian)
    if alike:
        raise Undetermined(
            f"these tests do not tell {' and '.join(alike)} of {problem.kind.name} apart; add a test of another kind, "
            "or fit a law with fewer parameters"
        )
    signs = without_sign(problem, values)
    if signs:
        pairs = zip(problem.kind.coefficients, problem.kind.exponents, strict=True)
        twin = ", ".join(f"-{coefficient}, -{exponent}" for coefficient, exponent in pairs if exponent in signs)
        raise Undetermined(
            f"these tests do not tell the sign of {' and '.join(signs)} of {problem.kind.name}: {twin} give the same "
            "curves; add a uniaxial or an equibiaxial test"
        )
