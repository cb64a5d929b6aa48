"""What a full solution takes in memory and time, solver by solver: an organ of quadratic cells under its own weight.

One thread; every solution in a process of its own. Memory is the peak of that process over what it held with mesh and
element ready, wall time that of `solve`; ratios are to the factor in every iteration. The equilibria are the same: the
last column is the largest difference to the first. SOFA's larger liver is read from the folder VISCERA_SHARED, and left
out, in words, where it is missing.
"""

import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from time import perf_counter

os.environ["RAYON_NUM_THREADS"] = "1"

import numpy as np
from machine import describe

import viscera as vs

LARGE = Path(os.environ.get("VISCERA_SHARED", "../shared")) / "meshes" / "liver_sofa_4497.vtu"
SOLVERS = {
    "cholesky": "cholesky",
    "lagged_cholesky": vs.ConjugateGradients("lagged_cholesky", 1e-4, 2000),
    "incomplete_cholesky": vs.ConjugateGradients("incomplete_cholesky", 1e-4, 2000),
    "block_jacobi": vs.ConjugateGradients("block_jacobi", 1e-4, 2000),
    "block_jacobi, matrix-free": vs.ConjugateGradients("block_jacobi", 1e-4, 2000, matrix_free=True),
}


def mesh_of(name: str) -> vs.Mesh:
    """The built-in liver, or SOFA's."""
    return vs.organs.liver() if name == "liver" else vs.read(LARGE, units=0.035)


def held(mesh: vs.Mesh) -> object:
    """The hilum, or a tenth of the nodes at the low end of the longest axis."""
    if "hilum" in mesh.sets:
        return "hilum"
    along = mesh.points[:, np.argmax(np.ptp(mesh.points, axis=0))]
    return tuple(np.flatnonzero(along <= np.quantile(along, 0.1)).tolist())


def peak() -> float:
    """Largest memory that this process has held [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def solution(name: str, solver: str) -> None:
    """Prints cells, unknowns, memory [MB], time [s], Newton's iterations and some displacements."""
    mesh = mesh_of(name)
    organ = vs.Organ(mesh, vs.NeoHookean(young=0.05e6, poisson=0.45), fixed=held(mesh), element="P2")
    before, began = peak(), perf_counter()
    state = organ.solve(gravity=(0, 0, -9.81), density=1060, solver=SOLVERS[solver], throw=True)
    seconds = perf_counter() - began
    row = [len(mesh.cells), state.displacement.size, peak() - before, seconds, state.iterations]
    print(json.dumps([*row, state.displacement[:: len(state.displacement) // 500].tolist()]))


if len(sys.argv) == 3:
    solution(*sys.argv[1:])
    sys.exit()
print(describe() + ", 1 thread")
print("organ         cells  unknowns  solver                        memory [MB]  ratio   time [s]  ratio  difference")
for name in ("liver", "liver, SOFA") if LARGE.exists() else ("liver",):
    first = None
    for solver in SOLVERS:
        run = subprocess.run([sys.executable, __file__, name, solver], check=True, capture_output=True, text=True)
        cells, unknowns, memory, seconds, _, places = json.loads(run.stdout)
        first = first or (memory, seconds, np.array(places))
        gap = np.abs(np.array(places) - first[2]).max() / np.abs(first[2]).max()
        print(
            f"{name:12s}{cells:7d}{unknowns:10d}  {solver:28s}{memory:13.0f}{memory / first[0]:7.2f}"
            f"{seconds:11.2f}{seconds / first[1]:7.1f}{gap:12.0e}"
        )
if not LARGE.exists():
    print(f"SOFA's larger liver is not in {LARGE.parent}: left out")
