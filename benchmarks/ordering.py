"""Analysis of the direct solver beside MKL PARDISO's: time before the first number, and entries of the factor.

    python benchmarks/ordering.py

The tangents of organs and blocks, by their pattern alone; one thread, the least of some runs. PARDISO orders by METIS
unless told otherwise, so its fill is what that dissection is worth. It needs the package pypardiso, and its columns are
left out, in words, without it. Ratios are ours over PARDISO's.
"""

from __future__ import annotations

import os

os.environ.setdefault("RAYON_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")

from collections.abc import Callable
from time import perf_counter

import numpy as np
from machine import describe
from numpy.typing import NDArray
from scipy import sparse

import viscera as vs
from viscera._core import Factor
from viscera.bench.problem import cube
from viscera.mesh import Floats

RUNS = 3
CUBES = (6_000, 48_000, 162_000)
ANALYSIS, ENTRIES = 11, 18
"""PARDISO's phase, and which of its parameters is the number of entries of the factor."""

Cells = NDArray[np.integer]
Measure = Callable[[sparse.csc_array], tuple[float, int]]
"""Time of the analysis [s] and entries of the factor."""


def main() -> None:
    """Print one line per body."""
    print(describe())
    measured = pardiso()
    if measured is None:
        print("without PARDISO: pip install pypardiso")
    print(f"{'body':24} {'nodes':>7} {'time [ms]':>10} {'entries':>10}     PARDISO: time      entries     ratios")
    for name, (points, cells) in bodies().items():
        matrix = stiffness(len(points), cells)
        seconds, entries = ours(matrix)
        line = f"{name:24} {len(points):7d} {1e3 * seconds:10.1f} {entries:10d}"
        if measured is not None:
            theirs, fill = measured(matrix)
            line += f" {1e3 * theirs:17.1f} {fill:12d}  {seconds / theirs:5.2f} {entries / fill:5.2f}"
        print(line, flush=True)


def bodies() -> dict[str, tuple[Floats, Cells]]:
    """Points and cells of organs, and of cubes of so many cells."""
    organs = {"artery": vs.organs.artery(), "beam": vs.organs.beam(), "liver": vs.organs.liver()}
    cubes = {f"cube, {cells} cells": cube(cells) for cells in CUBES}
    return {name: (body.points, body.cells) for name, body in (organs | cubes).items()}


def stiffness(n_nodes: int, cells: Cells) -> sparse.csc_array:
    """A positive definite matrix with the entries of a tangent of linear cells."""
    rows, columns = (np.repeat(cells, 4, axis=1), np.tile(cells, 4))
    ones = np.ones(rows.size)
    near = sparse.coo_array((ones, (rows.ravel(), columns.ravel())), shape=(n_nodes, n_nodes)).tocsr()
    near.data[:] = -0.1
    whole = sparse.kron(near, np.ones((3, 3)), format="csr")
    return sparse.csc_array(whole + sparse.diags_array(abs(whole).sum(axis=1)))


def ours(matrix: sparse.csc_array) -> tuple[float, int]:
    """Time [s] and entries of the factor."""
    upper = sparse.triu(matrix, format="csc")
    upper.sort_indices()
    start, row = upper.indptr.astype(np.uint32), upper.indices.astype(np.uint32)
    times = []
    for _ in range(RUNS):
        began = perf_counter()
        factor = Factor("cholesky", start, row)
        times.append(perf_counter() - began)
    return min(times), factor.fill


def pardiso() -> Measure | None:
    """The same of PARDISO; None where it is not installed."""
    try:
        from pypardiso import PyPardisoSolver
    except ImportError:
        return None

    def measure(matrix: sparse.csc_array) -> tuple[float, int]:
        upper, times = sparse.triu(matrix, format="csr"), []
        for _ in range(RUNS + 1):  # the first loads the library
            solver = PyPardisoSolver(mtype=2, phase=ANALYSIS)
            began = perf_counter()
            solver._call_pardiso(upper, np.zeros(matrix.shape[0]))
            times.append(perf_counter() - began)
            entries = int(solver.get_iparm(ENTRIES))
            solver.free_memory(everything=True)
        return min(times[1:]), entries

    return measure


if __name__ == "__main__":
    main()
