"""Direct solvers on matrices of one's own, and paper B's element with its pressures kept (benchmarks/mixed.py)."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import viscera as vs
from viscera._core import Factor


@pytest.fixture
def mixed(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(Path(__file__).resolve().parents[2] / "benchmarks")
    return importlib.import_module("mixed")


def test_factors_solve_and_count() -> None:
    """A chain of springs, and the same shifted until it is indefinite."""
    n = 40
    chain = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    starts = np.concatenate([[0], np.cumsum([1] + [2] * (n - 1))]).astype(np.uint32)
    rows = np.array([0] + [r for c in range(1, n) for r in (c - 1, c)], dtype=np.uint32)
    b = np.cos(np.arange(n))
    for shift, kinds in ((0.0, ("cholesky", "ldlt")), (1.3, ("ldlt",))):
        matrix = chain - shift * np.eye(n)
        values = matrix[rows, np.repeat(np.arange(n), np.diff(starts))]
        for kind in kinds:
            factor = Factor(kind, starts, rows)
            factor.factorize(values)
            assert matrix @ factor.solve(b) == pytest.approx(b, abs=1e-10)
            assert factor.negative == (np.linalg.eigvalsh(matrix) < 0).sum()
            assert factor.fill >= len(rows)
    with pytest.raises(ValueError, match="not positive definite"):
        Factor("cholesky", starts, rows).factorize(values)
    with pytest.raises(ValueError, match='"cholesky" or "ldlt", got "qr"'):
        Factor("qr", starts, rows)


def test_pressures_kept_give_the_displacements_of_the_condensed_element(mixed: ModuleType) -> None:
    """The indefinite system has one negative eigenvalue a pressure, and its solution is the product's."""
    lift = {"tip": (None, None, 0.02)}
    case = mixed.case("beam", vs.organs.beam(), "clamp", lift)
    system = mixed.System(case, is_mixed=True)
    factor = Factor("ldlt", *system.pattern)
    system.solve(factor)
    assert factor.negative == len(case.organ.mesh.cells)
    exact = case.organ.solve(displacement=lift, gravity=mixed.GRAVITY, density=mixed.DENSITY, throw=True)
    assert exact.max_displacement > 0.02
    assert system.x[: system.n_u].reshape(-1, 3) == pytest.approx(exact.displacement, abs=1e-9)
