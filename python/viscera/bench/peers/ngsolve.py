"""NGSolve: a symbolic energy, compiled, and its sparse Cholesky."""

from __future__ import annotations

from importlib.metadata import version
from time import process_time

import netgen.meshing as netgen
import ngsolve as ngs
import numpy as np

from viscera.bench.peers import Solution
from viscera.bench.problem import Problem


def solve(problem: Problem, option: str) -> Solution:
    """Newton's method in full steps."""
    mesh = netgen.Mesh(dim=3)
    points = [mesh.Add(netgen.MeshPoint(netgen.Pnt(*x))) for x in problem.points.tolist()]
    for cell in problem.cells[:, [0, 2, 1, 3]].tolist():
        mesh.Add(netgen.Element3D(1, [points[k] for k in cell]))
    mesh.SetMaterial(1, "tissue")
    began = process_time()
    space = ngs.VectorH1(ngs.Mesh(mesh), order=1)
    n = len(problem.points)
    held = problem.held.T.ravel()  # components one after the other, as the space numbers them
    free = ngs.BitArray(space.ndof)
    for k in range(3 * n):
        free[k] = not held[k]
    u = space.TrialFunction()
    F = ngs.Id(3) + ngs.Grad(u)
    J = ngs.Det(F)
    energy = problem.mu / 2 * (ngs.Trace(F.trans * F) - 3) - problem.mu * ngs.log(J) + problem.lam / 2 * ngs.log(J) ** 2
    form = ngs.BilinearForm(space, symmetric=True)
    form += ngs.Variation(energy.Compile() * ngs.dx(bonus_intorder=-2))
    field = ngs.GridFunction(space)
    x, force, step_vector = field.vec.FV().NumPy(), field.vec.CreateVector(), field.vec.CreateVector()
    iterations = 0
    for step in range(1, problem.steps + 1):
        change = problem.prescribed(step / problem.steps).T.ravel() - x
        change[~held] = 0.0
        for _ in range(30):
            iterations += 1
            form.AssembleLinearization(field.vec)
            form.Apply(field.vec, force)
            step_vector.FV().NumPy()[:] = change
            force += form.mat * step_vector
            field.vec.data += step_vector - form.mat.Inverse(free, inverse=option) * force
            change[:] = 0.0
            form.Apply(field.vec, force)
            residual = force.FV().NumPy()
            if np.linalg.norm(residual[~held]) <= problem.tolerance * np.linalg.norm(residual):
                break
    return Solution(x.reshape(3, n).T.copy(), iterations, process_time() - began, version("ngsolve"))
