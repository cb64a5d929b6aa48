"""What a full solution takes in memory and time, solver by solver: the liver of quadratic cells under its own weight.

One thread; every solution in a process of its own. Memory is the peak of that process over what it held with mesh and
element ready, wall time that of `solve`; ratios are to the factor in every iteration. The equilibria are the same: the
last column is the largest difference to the first.
"""

import json
import os
import resource
import subprocess
import sys
from time import perf_counter

os.environ["RAYON_NUM_THREADS"] = "1"

import numpy as np
from machine import describe

import viscera as vs

SOLVERS = {
    "cholesky": "cholesky",
    "lagged_cholesky": vs.ConjugateGradients("lagged_cholesky", 1e-4, 2000),
    "incomplete_cholesky": vs.ConjugateGradients("incomplete_cholesky", 1e-4, 2000),
    "block_jacobi": vs.ConjugateGradients("block_jacobi", 1e-4, 2000),
    "block_jacobi, matrix-free": vs.ConjugateGradients("block_jacobi", 1e-4, 2000, matrix_free=True),
}


def peak() -> float:
    """Largest memory that this process has held [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def solution(solver: str) -> None:
    """Prints memory [MB], time [s] and some displacements."""
    law = vs.NeoHookean(young=0.05e6, poisson=0.45)
    organ = vs.Organ(vs.organs.liver(), law, fixed="hilum", element="P2")
    before, began = peak(), perf_counter()
    state = organ.solve(gravity=(0, 0, -9.81), density=1060, solver=SOLVERS[solver], throw=True)
    seconds = perf_counter() - began
    print(json.dumps([peak() - before, seconds, state.displacement[::50].tolist(), state.displacement.size]))


if len(sys.argv) == 2:
    solution(sys.argv[1])
    sys.exit()
print(describe())
first = None
for solver in SOLVERS:
    run = subprocess.run([sys.executable, __file__, solver], check=True, capture_output=True, text=True)
    memory, seconds, places, unknowns = json.loads(run.stdout)
    if first is None:
        first = memory, seconds, np.array(places)
        print(f"{unknowns} unknowns                memory [MB]  ratio   time [s]  ratio  difference")
    gap = np.abs(np.array(places) - first[2]).max() / np.abs(first[2]).max()
    print(f"{solver:28s}{memory:13.0f}{memory / first[0]:7.2f}{seconds:11.2f}{seconds / first[1]:7.1f}{gap:12.0e}")
