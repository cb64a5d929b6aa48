"""Analysis of the direct solver beside MKL PARDISO's and METIS: its time, and what the order of elimination is worth.

    python benchmarks/ordering.py

The tangents of organs and cubes of linear cells, by their pattern alone; processor time of one thread, the least of
some runs. An order is judged by the entries of the factor that it leaves, without the zeros that a solver stores beside
them. METIS orders the graph of nodes; PARDISO's time is that of its analysis, which begins with METIS. They need the
packages pymetis and pypardiso, and are left out, in words, without them. Ratios are ours over theirs.
"""

from __future__ import annotations

import os

os.environ.setdefault("RAYON_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")

from collections.abc import Callable
from time import process_time

import numpy as np
from machine import describe
from numpy.typing import NDArray
from scipy import sparse
from timing import least

import viscera as vs
from viscera._core import Factor
from viscera.bench.problem import cube
from viscera.mesh import Floats

RUNS = 3
CUBES = (6_000, 48_000, 93_000)
ANALYSIS = 11
"""PARDISO's phase."""

Cells = NDArray[np.integer]
Graph = sparse.csr_array
"""Which nodes share a cell."""


def main() -> None:
    """Print one line per body."""
    print(describe())
    pardiso, metis = time_of_pardiso(), order_of_metis()
    for name, code in (("pypardiso", pardiso), ("pymetis", metis)):
        if code is None:
            print(f"left out: pip install {name}")
    print("body                  nodes  time [ms]  PARDISO  ratio    entries      METIS  ratio")
    for name, (points, cells) in bodies().items():
        graph = neighbours(len(points), cells)
        seconds, order = ours(graph)
        of_pardiso = np.nan if pardiso is None else pardiso(graph)
        entries = entries_of_factor(graph, order)
        of_metis = np.nan if metis is None else entries_of_factor(graph, metis(graph))
        print(
            f"{name:20} {len(points):6d} {1e3 * seconds:10.1f} {1e3 * of_pardiso:8.1f} {seconds / of_pardiso:6.2f}"
            f" {entries:10d} {of_metis:10.0f} {entries / of_metis:6.2f}",
            flush=True,
        )


def bodies() -> dict[str, tuple[Floats, Cells]]:
    """Points and cells of organs, and of cubes of so many cells."""
    organs = {"artery": vs.organs.artery(), "beam": vs.organs.beam(), "liver": vs.organs.liver()}
    cubes = {f"cube, {cells} cells": cube(cells) for cells in CUBES}
    return {name: (body.points, body.cells) for name, body in (organs | cubes).items()}


def neighbours(n_nodes: int, cells: Cells) -> Graph:
    """Nodes of a common cell, each node with itself."""
    rows, columns = np.repeat(cells, 4, axis=1).ravel(), np.tile(cells, 4).ravel()
    graph = sparse.coo_array((np.ones(rows.size), (rows, columns)), shape=(n_nodes, n_nodes)).tocsr()
    graph.data[:] = 1.0
    return graph


def tangent(graph: Graph) -> sparse.csr_array:
    """A positive definite matrix with three rows a node."""
    whole = sparse.csr_array(sparse.kron(-0.1 * graph, np.ones((3, 3))))
    return sparse.csr_array(whole + sparse.diags_array(abs(whole).sum(axis=1)))


def ours(graph: Graph) -> tuple[float, NDArray[np.integer]]:
    """Time of the analysis [s], and the nodes in the order of elimination."""
    upper = sparse.triu(tangent(graph), format="csc")
    upper.sort_indices()
    start, row = upper.indptr.astype(np.uint32), upper.indices.astype(np.uint32)
    order = Factor("cholesky", start, row).order
    assert np.array_equal(order[0::3] + 1, order[1::3]), "the rows of a node are eliminated one after the other"
    return least(lambda: Factor("cholesky", start, row), RUNS, process_time), order[::3] // 3


def time_of_pardiso() -> Callable[[Graph], float] | None:
    """What measures PARDISO's analysis [s]; None where it is not installed."""
    try:
        from pypardiso import PyPardisoSolver
    except ImportError:
        return None

    def measure(graph: Graph) -> float:
        upper = sparse.triu(tangent(graph), format="csr")
        nothing = np.zeros(upper.shape[0])

        def analyze() -> None:
            solver = PyPardisoSolver(mtype=2, phase=ANALYSIS)
            solver._call_pardiso(upper, nothing)
            solver.free_memory(everything=True)

        analyze()  # loads the library
        return least(analyze, RUNS, process_time)

    return measure


def order_of_metis() -> Callable[[Graph], NDArray[np.integer]] | None:
    """METIS's nested dissection; None where it is not installed."""
    try:
        from pymetis import nested_dissection
    except ImportError:
        return None

    def order(graph: Graph) -> NDArray[np.integer]:
        near = (graph.indices[a:b] for a, b in zip(graph.indptr[:-1], graph.indptr[1:], strict=True))
        lists = [[int(other) for other in row if other != node] for node, row in enumerate(near)]
        return np.array(nested_dissection(adjacency=lists)[0])

    return order


def entries_of_factor(graph: Graph, order: NDArray[np.integer]) -> int:
    """Entries below and on the diagonal, three rows a node: by the patterns that columns pass on to their parents."""
    n = len(order)
    position = np.empty(n, dtype=np.int64)
    position[order] = np.arange(n)
    below = [set[int]() for _ in range(n)]
    for k, node in enumerate(order):
        steps = position[graph.indices[graph.indptr[node] : graph.indptr[node + 1]]]
        below[k].update(steps[steps > k].tolist())
    blocks = 0
    for k in range(n):
        column, below[k] = below[k], set()
        blocks += len(column)
        if column:
            parent = min(column)
            below[parent] |= column - {parent}
    return 9 * blocks + 6 * n


if __name__ == "__main__":
    main()
