"""Multigrid against pyamg on the same matrices, and against the other solvers over whole solutions.

    python benchmarks/multigrid.py [--solutions | --sizes]

The matrices are those of linear elasticity on bricks of six tetrahedra, clamped at one end: cubes and a bar ten times
as long as thick, linear cells with a volume each ("P1") or one for a brick ("mean", which is how the element that does
not lock couples its cells). pyamg has the same rigid-body modes, one block Gauss-Seidel sweep forward before the coarse
correction and one backward after it, no threshold, and as many nodes on the coarsest level; it is no dependency of this
project (pip install pyamg). With --solutions: bars of neo-Hookean tissue bent by Newton's method, "P1 mean volume".
With --sizes: cubes of up to a million cells stretched by a quarter, and how time and memory grow with them; every
solution in a process of its own, rows kept in out/solvers.jsonl as they finish (benchmarks/solvers.py).

Processor time of one thread; set RAYON_NUM_THREADS=1.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import solvers
from locking import bricks
from machine import ROOT, describe

import viscera as vs

try:
    import pyamg
except ImportError:
    pyamg = None

COARSEST = 64  # nodes, as in crates/linear/src/multigrid
SHAPES = {"cube": ((10, 10, 10), (1, 1, 1)), "cube 8x": ((20, 20, 20), (1, 1, 1)), "bar": ((100, 10, 10), (10, 1, 1))}

CASES = ((False, 0.3), (False, 0.45), (False, 0.49), (True, 0.45), (True, 0.49), (True, 0.499))


def stiffness(points: Any, cells: Any, poisson: float, in_brick: bool) -> Any:
    """Matrix of linear elasticity, Young's modulus 1, in blocks of 3 x 3; cells share their volume `in_brick`."""
    mu, bulk = 0.5 / (1 + poisson), 1 / (3 * (1 - 2 * poisson))
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    volumes = np.abs(np.linalg.det(edges)) / 6
    slopes = np.swapaxes(np.linalg.inv(edges), 1, 2)
    slopes = np.concatenate([-slopes.sum(1, keepdims=True), slopes], 1)
    dots = np.einsum("mai,mbi->mab", slopes, slopes)[..., None, None] * np.eye(3)
    products = np.einsum("mai,mbk->mabik", slopes, slopes)
    local = mu * (dots + np.swapaxes(products, 3, 4) - 2 / 3 * products) * volumes[:, None, None, None, None]
    dofs = 3 * cells[:, :, None] + np.arange(3)
    rows = np.broadcast_to(dofs[:, :, None, :, None], local.shape).ravel()
    columns = np.broadcast_to(dofs[:, None, :, None, :], local.shape).ravel()
    matrix = sp.coo_matrix((local.ravel(), (rows, columns)), (3 * len(points),) * 2).tocsr()
    cluster = np.arange(len(cells)) // (6 if in_brick else 1)
    change = (slopes * volumes[:, None, None]).ravel(), (np.repeat(cluster, 12), dofs.ravel())
    change = sp.coo_matrix(change, (cluster.max() + 1, 3 * len(points))).tocsr()
    matrix = (matrix + change.T @ sp.diags(bulk / np.bincount(cluster, volumes)) @ change).tocsr()
    return ((matrix + matrix.T) / 2).tobsr((3, 3))


def ours(points: Any, matrix: Any, held: Any, load: Any) -> list[dict[str, Any]]:
    """Iterations and seconds of each preconditioner, from the example of the crate."""
    matrix.sort_indices()
    rows = np.repeat(np.arange(len(points)), np.diff(matrix.indptr))
    kept = matrix.indices <= rows  # the lower triangle by rows is the upper one by columns
    pairs = np.column_stack([matrix.indices[kept], rows[kept]])
    values = np.swapaxes(matrix.data[kept], 1, 2)
    numbers = [[len(points), len(pairs)], points, pairs, values, held, load]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "matrix"
        np.concatenate([np.ravel(part).astype("<f8") for part in numbers]).tofile(path)
        command = ["cargo", "run", "--release", "--quiet", "-p", "viscera-linear", "--example", "multigrid", "--", path]
        printed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    lines = [line.split() for line in printed.splitlines()]
    return [{word: float(line[line.index(word) + 1]) for word in ("iterations", "factor", "solve")} for line in lines]


def peer(points: Any, matrix: Any, held: Any, load: Any) -> dict[str, float]:
    """The same of pyamg."""
    free = ~held.ravel()
    x, y, z = (points - points.mean(0)).T
    one, none = np.ones(len(points)), np.zeros(len(points))
    modes = [[one, none, none], [none, one, none], [none, none, one], [none, -z, y], [z, none, -x], [-y, x, none]]
    modes = np.array([np.column_stack(mode).ravel() for mode in modes]).T
    start = time.process_time()
    levels = pyamg.smoothed_aggregation_solver(
        matrix.tocsr()[free][:, free].tobsr((3, 3)),
        B=modes[free],
        strength=("symmetric", {"theta": 0.0}),
        smooth=("jacobi", {"omega": 4 / 3}),
        presmoother=("block_gauss_seidel", {"sweep": "forward"}),
        postsmoother=("block_gauss_seidel", {"sweep": "backward"}),
        improve_candidates=None,
        max_coarse=COARSEST,
    )
    made = time.process_time()
    residuals: list[float] = []
    levels.solve(load.ravel()[free], tol=1e-8, accel="cg", residuals=residuals, maxiter=5000)
    return {"iterations": len(residuals) - 1, "factor": made - start, "solve": time.process_time() - made}


def matrices() -> None:
    """One line for each matrix."""
    print("solved to 1e-8: iterations / seconds of factor and solution")
    print("body      volumes  Poisson   nodes       multigrid           pyamg  ratio    incomplete Cholesky")
    for name, (counts, size) in SHAPES.items():
        for in_brick, poisson in (
            (False, 0.3),
            (False, 0.45),
            (False, 0.49),
            (True, 0.45),
            (True, 0.49),
            (True, 0.499),
        ):
            points, cells = bricks(counts)
            points = points * size
            matrix = stiffness(points, cells, poisson, in_brick)
            held = np.repeat(points[:, :1] == 0, 3, axis=1)
            load = np.where(held, 0, np.random.default_rng(0).standard_normal(held.shape))
            runs = ours(points, matrix, held, load)
            other = peer(points, matrix, held, load) if pyamg else None
            told = [f"{run['iterations']:6.0f} /{run['factor'] + run['solve']:7.2f}" for run in runs]
            theirs = f"{other['iterations']:6d} /{other['factor'] + other['solve']:7.2f}" if other else "-"
            ratio = f"{runs[0]['iterations'] / other['iterations']:7.2f}" if other else "      -"
            volumes = "mean" if in_brick else "P1"
            print(f"{name:9s} {volumes:8s}{poisson:7.3f}{len(points):8d}  {told[0]}{theirs:>16s}{ratio}{told[1]:>23s}")


def solutions() -> None:
    """Bars bent by a load on their end until it has sunk by about a third of their length."""
    choices: dict[str, str | vs.ConjugateGradients] = {
        "cholesky": "cholesky",
        "multigrid": "multigrid",
        "auto": "auto",
        "incomplete_cholesky": vs.ConjugateGradients("incomplete_cholesky", 1e-8, 20_000),
    }
    print("bars bent by Newton's method, residual 1e-9")
    print("  cells  Poisson  solver                 Newton  iterations  seconds  ratio  difference")
    for counts, poisson in (((40, 4, 4), 0.49), ((100, 10, 10), 0.45), ((100, 10, 10), 0.49)):
        points, cells = bricks(counts)
        points = points * (0.1, 0.01, 0.01)
        ends = {"clamp": np.flatnonzero(points[:, 0] == 0), "tip": np.flatnonzero(points[:, 0] == 0.1)}
        law = vs.NeoHookean(young=1e4, poisson=poisson)
        organ = vs.Organ(vs.mesh(points, cells, ends), law, fixed="clamp", element="P1 mean volume")
        exact, seconds = None, 1.0
        for name, solver in choices.items():
            start = time.process_time()
            state = organ.solve(force={"tip": (0, 0, -0.01)}, solver=solver, throw=True)
            spent = time.process_time() - start
            if exact is None:
                exact, seconds = state.displacement, spent
            gap = np.abs(state.displacement - exact).max() / np.abs(exact).max()
            told = f"{state.iterations:6d}{state.linear_iterations:12d}{spent:9.2f}{spent / seconds:7.2f}{gap:12.0e}"
            print(f"{len(cells):7d}{poisson:9.2f}  {name:22s}{told}")


def sizes() -> None:
    """Whole solutions of cubes, linear cells, Poisson's ratio 0.45, to a residual of 1e-9; exponents fitted."""
    print("cubes stretched by a quarter, P1, Poisson's ratio 0.45, residual 1e-9")
    print("solver          cells  Newton  iterations  seconds  memory [MB]")
    for solver in ("multigrid", "auto"):
        table = []
        for cells in (63_888, 132_720, 303_918, 998_250):
            case = solvers.Case("cube", cells, "P1", 0.45)
            solvers.measure([case], [solver], 600.0)
            row = solvers.kept()[(*case, solver)]
            if row["seconds"] is None:
                print(f"{solver:10s}{cells:11d}  {row['fault']}")
                continue
            table.append([cells, row["seconds"], row["megabytes"]])
            told = f"{row['newton']:8d}{row['iterations']:12d}{row['seconds']:9.2f}{row['megabytes']:13.0f}"
            print(f"{solver:10s}{cells:11d}{told}  {row['solver']}", flush=True)
        cells, seconds, memory = np.log(table).T
        print(
            f"exponent of time {np.polyfit(cells, seconds, 1)[0]:.2f}, of memory {np.polyfit(cells, memory, 1)[0]:.2f}"
        )


if __name__ == "__main__":
    print(describe())
    if "--solutions" in sys.argv:
        solutions()
    elif "--sizes" in sys.argv:
        sizes()
    else:
        if pyamg is None:
            print("pyamg is not there to compare with; pip install pyamg")
        matrices()
