"""FElupe: its compressible neo-Hookean solid and its own Newton method, with SuperLU or PARDISO."""

from __future__ import annotations

from time import process_time
from typing import Any

import felupe as fem
import numpy as np

from viscera.bench.peers import Solution
from viscera.bench.problem import Problem


def solve(problem: Problem, option: str) -> Solution:
    """`felupe.newtonrhapson`, load step after load step."""
    mesh = fem.Mesh(problem.points, problem.cells.astype(int), "tetra")
    began = process_time()
    field = fem.FieldContainer([fem.Field(fem.RegionTetra(mesh), dim=3)])
    body = fem.SolidBody(fem.NeoHookeCompressible(mu=problem.mu, lmbda=problem.lam), field)
    iterations = 0
    for step in range(1, problem.steps + 1):
        target = problem.prescribed(step / problem.steps)
        bounds = {
            f"{side} {axis}": fem.Boundary(
                field[0],
                mask=_mask(len(problem.points), nodes),
                skip=[k != axis for k in range(3)],
                value=target[nodes[0], axis],
            )
            for side, nodes in (("clamped", problem.clamped), ("moved", problem.moved))
            for axis in range(3)
        }
        dof0, dof1 = fem.dof.partition(field, bounds)
        loads = fem.dof.apply(field, bounds, dof0)
        found = fem.newtonrhapson(
            items=[body],
            x0=field,
            dof0=dof0,
            dof1=dof1,
            ext0=loads,
            tol=problem.tolerance,
            solver=_solver(option),
            verbose=0,
        )
        iterations += found.iterations
    return Solution(field[0].values, iterations, process_time() - began, fem.__version__)


def _mask(count: int, nodes: Any) -> Any:
    mask = np.zeros(count, dtype=bool)
    mask[nodes] = True
    return mask


def _solver(option: str) -> Any:
    if option == "pardiso":
        from pypardiso import spsolve

        return spsolve
    from scipy.sparse.linalg import spsolve as superlu

    return superlu
