"""How well tests determine the parameters of a law: standard deviations, and what they do not tell apart."""

from __future__ import annotations

import numpy as np

from viscera.errors import VisceraError
from viscera.fitting.materialtest import MaterialTest
from viscera.fitting.problem import Problem
from viscera.mesh import Floats

DEPENDENT = 1e-10
"""Smallest singular value over the largest below which derivatives, in units of their norms, are dependent."""
TOLD = 1e-3
"""Part of its summands' size above which a sum of derivatives is not zero in another test."""
SAME = 1e-9
"""Part of the stress up to which two laws have the same curve."""
PART = 1e-3
"""Part of the largest above which a coefficient takes part in a combination."""
OTHER_TESTS = tuple(
    MaterialTest(mode, [0.7, 0.85, 1.15, 1.3], [-2.0, -1.0, 1.0, 2.0], mode) for mode in ("uniaxial", "equibiaxial")
)


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


def confused(problem: Problem, values: Floats, jacobian: Floats) -> list[str]:
    """Coefficients of which the tests determine only a combination, although other tests would tell them apart.

    Coefficients that no test tells apart, such as those of two terms of one exponent, belong to one and the same law.
    """
    n = len(problem.kind.coefficients)
    size = np.maximum(np.linalg.norm(jacobian[:, :n], axis=0), np.finfo(float).tiny)
    _, singular, directions = np.linalg.svd(jacobian[:, :n] / size, full_matrices=False)
    rank = int((singular >= DEPENDENT * singular[0]).sum())
    if rank == n:
        return []
    plain = Problem(problem.kind, OTHER_TESTS, np.ones(len(OTHER_TESTS)), problem.poisson, True)
    elsewhere = plain.derivatives(values)[1][:, :n] / size
    names = set[str]()
    for direction in directions[rank:]:
        summands = elsewhere * direction
        if np.linalg.norm(summands.sum(axis=1)) > TOLD * np.linalg.norm(summands):
            parts = np.flatnonzero(np.abs(direction) > PART * np.abs(direction).max())
            names |= {problem.kind.coefficients[k] for k in parts}
    return [name for name in problem.kind.coefficients if name in names]


def without_sign(problem: Problem, values: Floats) -> list[str]:
    """Exponents of which the tests do not tell the sign, although other tests would.

    In pure and simple shear the stretches are l, 1 and 1 / l, and the stress of a term of Ogden's law,
    `mu (l^(alpha - 1) - l^(-alpha - 1))`, is that of `-mu, -alpha`. Each of the two is a minimum of its own, so that
    derivatives at one do not see the other.
    """
    if not problem.kind.of_products:
        return []
    n = len(problem.kind.coefficients)
    plain = Problem(problem.kind, OTHER_TESTS, np.ones(len(OTHER_TESTS)), problem.poisson, True)
    names = []
    for k, name in enumerate(problem.kind.exponents):
        twin = values * np.where(np.arange(len(values)) == n + k, -1.0, 1.0)  # the product of both keeps its sign
        if _is_alike(problem, values, twin, SAME) and not _is_alike(plain, values, twin, TOLD):
            names.append(name)
    return names


def _is_alike(problem: Problem, values: Floats, others: Floats, part: float) -> bool:
    """Whether two laws have one stress in the tests, up to a part of it."""
    stress = problem.derivatives(values)[0]
    try:
        other = problem.derivatives(others)[0]
    except VisceraError:  # it has no equilibrium there
        return False
    return bool(np.linalg.norm(other - stress) <= part * np.linalg.norm(stress))
