"""Viscera itself, by one of its solvers."""

from __future__ import annotations

from time import process_time
from typing import Any

import viscera as vs
from viscera.bench.peers import Solution
from viscera.bench.problem import Problem
from viscera.law import Law

BUDGET = 3000  # iterations of conjugate gradients


def solve(problem: Problem, option: str, law: Law | None = None) -> Solution:
    """Newton's method with its line search; the load is halved where a step fails."""
    mesh = vs.mesh(problem.points, problem.cells, {"clamped": problem.clamped, "moved": problem.moved})
    solver: Any = vs.ConjugateGradients(option, 1e-4, BUDGET) if option.startswith("incomplete") else option
    began = process_time()
    organ = vs.Organ(mesh, law or vs.NeoHookean(mu=problem.mu, lam=problem.lam), fixed="clamped", element="P1")
    state = organ.solve(
        displacement={"moved": (problem.stretch, 0, 0)},
        solver=solver,
        steps=problem.steps,
        settings={"tolerance": problem.tolerance},
        throw=True,
    )
    return Solution(state.displacement, state.iterations, process_time() - began, vs.__version__)
