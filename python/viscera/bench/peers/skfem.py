"""scikit-fem: forms written with NumPy, and SuperLU or PARDISO."""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np
import skfem
from skfem.helpers import ddot, grad

from viscera.bench.peers import Solution
from viscera.bench.problem import Problem
from viscera.mesh import Floats


def solve(problem: Problem, option: str) -> Solution:
    """Newton's method in full steps."""
    mesh = skfem.MeshTet(problem.points.T.copy(), problem.cells.T.copy())
    began = process_time()
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()), intorder=1)
    dofs = basis.nodal_dofs.T  # (n, 3)
    held = dofs[problem.held]
    u, iterations = basis.zeros(), 0
    for step in range(1, problem.steps + 1):
        change = basis.zeros()
        change[dofs] = problem.prescribed(step / problem.steps)
        change[held] -= u[held]
        for _ in range(30):
            iterations += 1
            stiffness, force = _system(basis, u, problem)
            system = skfem.condense(stiffness, -force, x=change, D=held)
            du = skfem.solve(*system, solver=_solver(option))
            u, change = u + du, basis.zeros()
            force = _force(basis, u, problem)
            free = np.delete(force, held)
            if np.linalg.norm(free) <= problem.tolerance * np.linalg.norm(force):
                break
    return Solution(np.asarray(u[dofs]), iterations, process_time() - began, skfem.__version__)


def _system(basis: Any, u: Floats, problem: Problem) -> tuple[Any, Floats]:
    return _stiffness.assemble(basis, **_state(basis, u, problem)), _force(basis, u, problem)


def _force(basis: Any, u: Floats, problem: Problem) -> Floats:
    return np.asarray(_internal.assemble(basis, **_state(basis, u, problem)))


def _state(basis: Any, u: Floats, problem: Problem) -> dict[str, Any]:
    """First Piola-Kirchhoff stress, and what its derivative needs, at the points of integration."""
    gradient = basis.interpolate(u).grad
    F = np.moveaxis(gradient, (0, 1), (-2, -1)) + np.eye(3)
    inverse = np.swapaxes(np.linalg.inv(F), -2, -1)
    log_j = np.log(np.linalg.det(F))[..., None, None]
    stress = problem.mu * (F - inverse) + problem.lam * log_j * inverse
    fields = {"stress": stress, "inverse": inverse, "minus": problem.mu - problem.lam * log_j * np.ones((3, 3))}
    moved = {name: np.moveaxis(value, (-2, -1), (0, 1)) for name, value in fields.items()}
    return {**moved, "mu": problem.mu, "lam": problem.lam}


@skfem.LinearForm  # type: ignore[untyped-decorator]
def _internal(v: Any, w: Any) -> Any:
    return ddot(w.stress, grad(v))


@skfem.BilinearForm  # type: ignore[untyped-decorator]
def _stiffness(u: Any, v: Any, w: Any) -> Any:
    """dP = mu dF + (mu - lam ln J) F^-T dF^T F^-T + lam (F^-T : dF) F^-T."""
    dF, inverse = grad(u), w.inverse
    turned = np.einsum("ij...,jl...->il...", np.einsum("ij...,kj...->ik...", inverse, dF), inverse)
    stress = w.mu * dF + w.minus * turned + w.lam * ddot(inverse, dF) * inverse
    return ddot(stress, grad(v))


def _solver(option: str) -> Any:
    if option == "pardiso":
        from pypardiso import spsolve

        return lambda matrix, b, **_: spsolve(matrix.tocsr(), b)
    return skfem.solver_direct_scipy()
