"""Paper B's element with its pressures kept, by LDL^T, against the same with its pressures condensed, by Cholesky.

The perturbed Lagrangian `psi(F) + p g(J) - p^2 / (2 alpha)`, g = J^2 - 1, of linear tetrahedra with one pressure p each
has the tangent `[K_u, B^T; B, -V / alpha]`. A pressure meets no other, so `K = K_u + alpha B^T V^-1 B` is their exact
elimination. Both are assembled here in NumPy, and only the solvers timed: the least of some runs on the last tangent.
Load steps and rule of convergence are the same, without a line search; Mooney-Rivlin with paper B's c1 and c2.
"""

from __future__ import annotations

import os

os.environ.setdefault("RAYON_NUM_THREADS", "1")

from dataclasses import dataclass

import numpy as np
from machine import describe
from numpy.typing import NDArray
from timing import least

import viscera as vs
from viscera._core import Factor
from viscera.mesh import Floats
from viscera.study.artery import ACROSS, ALONG, ALPHA, C1, C2

Ints = NDArray[np.intp]

RUNS, STEPS, TOLERANCE, PATIENCE = 9, 10, 1e-9, 40
DENSITY, GRAVITY = 1060.0, (0.0, 0.0, -9.81)
PERMUTATION = np.array([[[(i - j) * (j - k) * (k - i) / 2 for k in range(3)] for j in range(3)] for i in range(3)])


@dataclass(frozen=True)
class Case:
    """An organ, its weight (3 n,) [N], the degrees of freedom that are prescribed, and their displacement [m]."""

    name: str
    organ: vs.Organ
    weight: Floats
    moved: Ints
    values: Floats


def case(name: str, mesh: vs.Mesh, fixed: str, drives: dict[str, tuple[float | None, ...]]) -> Case:
    """Sets of nodes driven by so much in x, y and z [m], where not None."""
    organ = vs.Organ(mesh, vs.MooneyRivlin(C1, C2, alpha=ALPHA), fixed=fixed, element="P1")
    target = {3 * int(node) + i: 0.0 for node in organ.fixed for i in range(3)}
    for place, motion in drives.items():
        target |= {3 * int(node) + i: by for node in mesh.nodes(place) for i, by in enumerate(motion) if by is not None}
    weight = organ._body.gravity(np.array(GRAVITY), np.array([DENSITY])).ravel()
    return Case(name, organ, weight, np.array(list(target)), np.array(list(target.values())))


class System:
    """Element matrices and residuals of one of the two systems, and their sparse sum."""

    def __init__(self, case: Case, is_mixed: bool) -> None:
        mesh = case.organ.mesh
        corners = mesh.points[mesh.cells]
        edges = corners[:, 1:] - corners[:, :1]
        slopes = np.linalg.inv(edges).transpose(0, 2, 1)
        self.case, self.is_mixed, self.volume = case, is_mixed, np.linalg.det(edges) / 6
        self.slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
        self.n_u, m = mesh.points.size, len(mesh.cells)
        self.dofs = (3 * mesh.cells[:, :, None].astype(np.intp) + np.arange(3)).reshape(m, 12)
        if is_mixed:
            self.dofs = np.column_stack([self.dofs, self.n_u + np.arange(m)])
        self.x = np.zeros(self.n_u + is_mixed * m)
        self.free = np.setdiff1d(np.arange(len(self.x)), case.moved)
        row_of = np.full(len(self.x), -1)
        row_of[self.free] = np.arange(len(self.free))
        rows, columns = (
            np.broadcast_to(row_of[self.dofs][at], (*self.dofs.shape, self.dofs.shape[1])).ravel()
            for at in (np.s_[:, :, None], np.s_[:, None, :])
        )
        self.upper = (rows >= 0) & (rows <= columns)
        keys, self.entry = np.unique(columns[self.upper] * len(self.free) + rows[self.upper], return_inverse=True)
        starts = np.searchsorted(keys, len(self.free) * np.arange(len(self.free) + 1))
        self.pattern = starts.astype(np.uint32), (keys % len(self.free)).astype(np.uint32)

    def elements(self) -> tuple[Floats, Floats]:
        """Residuals (m, k) and tangents (m, k, k) of the cells at the state x."""
        law, V, G = self.case.organ.law, self.volume, self.slopes
        nodal = self.x[self.dofs[:, :12]].reshape(-1, 4, 3)
        F = np.eye(3) + np.einsum("mai,maj->mij", nodal, G)
        P, A = law.stress(F), law.tangent(F)
        if not self.is_mixed:
            return self._force(P), self._stiffness(A)
        J, p = np.linalg.det(F), self.x[self.dofs[:, 12]]
        cofactor = J[:, None, None] * np.linalg.inv(F).transpose(0, 2, 1)
        curvature = np.einsum("ikm,jln,pmn->pijkl", PERMUTATION, PERMUTATION, F)
        g, slope, bend = J**2 - 1, 2 * J, 2.0
        excess = p - ALPHA * g  # over the pressure that the law, being condensed, has already
        product = np.einsum("mij,mkl->mijkl", cofactor, cofactor)
        P = P + (excess * slope)[:, None, None] * cofactor
        A = A + (excess * bend - ALPHA * slope**2)[:, None, None, None, None] * product
        A = A + (excess * slope)[:, None, None, None, None] * curvature
        K = np.zeros((len(V), 13, 13))
        K[:, :12, :12] = self._stiffness(A)
        K[:, :12, 12] = K[:, 12, :12] = slope[:, None] * self._force(cofactor)
        K[:, 12, 12] = -V / ALPHA
        return np.column_stack([self._force(P), V * (g - p / ALPHA)]), K

    def _force(self, P: Floats) -> Floats:
        return np.asarray(np.einsum("m,mij,maj->mai", self.volume, P, self.slopes).reshape(-1, 12))

    def _stiffness(self, A: Floats) -> Floats:
        G = self.slopes
        return np.asarray(np.einsum("m,maj,mijkl,mbl->maibk", self.volume, G, A, G, optimize=True).reshape(-1, 12, 12))

    def linear(self, share: float) -> tuple[Floats, Floats, Floats]:
        """Values of the matrix, right-hand side, and what is to go of the prescribed way, at a share of the load."""
        r, K = self.elements()
        way = np.zeros(len(self.x))
        way[self.case.moved] = share * self.case.values - self.x[self.case.moved]
        rhs = np.zeros(len(self.x))
        rhs[: self.n_u] = share * self.case.weight
        np.subtract.at(rhs, self.dofs, r + np.einsum("mij,mj->mi", K, way[self.dofs]))
        return np.bincount(self.entry, K.ravel()[self.upper]), rhs[self.free], way

    def solve(self, factor: Factor) -> int:
        """Newton's method to the full load; the number of iterations."""
        iterations = 0
        for step in range(1, STEPS + 1):
            for _ in range(PATIENCE):
                values, rhs, way = self.linear(step / STEPS)
                factor.factorize(values)
                way[self.free] = factor.solve(rhs)
                self.x += way
                iterations += 1
                if np.linalg.norm(way[: self.n_u]) <= TOLERANCE * np.linalg.norm(self.x[: self.n_u]):
                    break
            else:
                raise SystemExit(f"{self.case.name}: no equilibrium in {PATIENCE} iterations at step {step}")
        return iterations


def solved(case: Case, kind: str, is_mixed: bool) -> Floats:
    """A line of the table; the displacement (3 n,)."""
    system = System(case, is_mixed)
    factor = Factor(kind, *system.pattern)
    iterations = system.solve(factor)
    values, rhs, _ = system.linear(1.0)
    work = (
        lambda: Factor(kind, *system.pattern),
        lambda: factor.factorize(values),
        lambda: factor.solve(rhs),
    )
    times = [1e3 * least(part, RUNS) for part in work]
    print(
        f"{case.name:8s}{kind:10s}{len(system.free):9d}{len(values):10d}{factor.fill:10d}{factor.negative:10d}"
        + "".join(f"{time:10.2f}" for time in times)
        + f"{iterations:12d}"
    )
    return system.x[: system.n_u]


def report(case: Case) -> None:
    """Both systems of a case, and how far their displacements are apart."""
    condensed, mixed = solved(case, "cholesky", False), solved(case, "ldlt", True)
    apart = np.abs(mixed - condensed).max() / np.abs(condensed).max()
    print(f"{'':8s}largest difference of a displacement, relative: {apart:.0e}")


if __name__ == "__main__":
    beam, artery, liver = vs.organs.beam(), vs.organs.artery(), vs.organs.liver()
    print(f"{describe()}\nms, least of {RUNS} runs")
    print("case    solver     unknowns   entries      fill  negative  analysis    factor     solve  iterations")
    report(case("beam", beam, "clamp", {"tip": (None, None, 0.2 * beam.diagonal)}))
    report(case("artery", artery, "top", {"middle": (ACROSS, None, None), "bottom": (None, None, -ALONG)}))
    report(case("liver", liver, "hilum", {"tip": (None, None, 0.1 * liver.diagonal)}))
