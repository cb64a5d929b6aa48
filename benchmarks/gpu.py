"""Frames and solutions of `solver="gpu"` beside the processor's, from a thousand cells to a million.

    python benchmarks/gpu.py [SIDE ...]

Cubes of neo-Hookean tissue, Poisson's ratio 0.45, linear cells, six to a brick, SIDE bricks along an edge. Frames:
the upper face moves by a thousandth of the edge in each; the median of their times after the first. Solutions: the
same face moves by a fifth of the edge, to a residual of 1e-9, with all that a solver prepares. "same" is the same
method on the processor, conjugate gradients with block-Jacobi; "best" is what the processor would take: "cg" or, for
large bodies, incomplete Cholesky in frames, and "auto" in solutions. Every row runs in a process of its own, since
the number of threads is set when one starts. A device in software is not measured unless sides are given: its times
say nothing of one in hardware.
"""

from __future__ import annotations

import os
import subprocess
import sys
from statistics import mean, median
from time import perf_counter

import numpy as np
from locking import bricks
from machine import describe

import viscera as vs
from viscera import _core, gpu
from viscera.solver import GPU, Solver

SIDES = (6, 12, 22, 37, 55)
FRAMES, PATIENCE = 20, 8.0  # timed frames, and seconds after which no further one is begun, once there are two
EDGE = 0.1  # [m]
SAME = vs.ConjugateGradients("block_jacobi", max_iterations=GPU.max_iterations)
INCOMPLETE = vs.ConjugateGradients("incomplete_cholesky", max_iterations=GPU.max_iterations)
LARGE = 100_000  # cells from which the processor takes incomplete Cholesky in frames, and "same" solves no statics
RUNS = (("gpu", 0), ("gpu", 1), ("same", 1), ("best", 1), ("best", 0))
"""Solvers and threads of the processor; 0 for all of it."""


def main(sides: tuple[int, ...]) -> None:
    try:
        print(f"device: {gpu.describe()}")
    except vs.VisceraError as error:
        return print(f"not measured: {error}")
    print(describe())
    if _core.gpu()[3] and not sides:
        return print("not measured: the device is software")
    print("\n  cells   nodes  solver  threads   frame [ms]  iterations   solution [s]  iterations")
    for side in sides or SIDES:
        for solver, threads in RUNS:
            environment = os.environ | {"RAYON_NUM_THREADS": str(threads or os.cpu_count())}
            subprocess.run([sys.executable, __file__, "--row", str(side), solver], env=environment, check=True)


def row(side: int, name: str) -> None:
    points, cells = bricks((side, side, side))
    points = EDGE * points
    ends = {"bottom": np.flatnonzero(points[:, 2] == 0), "top": np.flatnonzero(points[:, 2] == points[:, 2].max())}
    mesh = vs.mesh(points, cells, ends)
    organ = vs.Organ(mesh, vs.NeoHookean(young=1e4, poisson=0.45), fixed="bottom", element="P1")
    in_frames, in_statics = solvers(name, len(cells))
    frame, count = frames(organ, in_frames)
    row = f"{len(cells):7}  {len(points):6}  {name:6}  {os.environ['RAYON_NUM_THREADS']:>7}"
    row += f"   {1e3 * frame:10.2f}  {count:10.1f}"
    if in_statics is not None:
        began = perf_counter()
        state = organ.solve(displacement={"top": (0.2 * EDGE, None, 0.0)}, solver=in_statics)
        row += f"   {perf_counter() - began:12.3f}  {state.linear_iterations:10}"
    print(row, flush=True)


def solvers(name: str, n_cells: int) -> tuple[Solver, Solver | None]:
    """Of frames, and of solutions."""
    if name == "gpu":
        return "gpu", "gpu"
    if name == "same":
        return SAME, SAME if n_cells < LARGE else None
    return "cg" if n_cells < LARGE else INCOMPLETE, "auto"


def frames(organ: vs.Organ, solver: Solver) -> tuple[float, float]:
    """Seconds of a frame, and iterations of conjugate gradients in it."""
    stepper = organ.stepper(solver=solver)
    times, counts = [], []
    start = perf_counter()
    for k in range(FRAMES + 1):
        began = perf_counter()
        frame = stepper.frame({"top": (1e-3 * EDGE * (k + 1), None, 0.0)})
        times.append(perf_counter() - began)
        counts.append(frame.iterations)
        if perf_counter() - start > PATIENCE and k > 1:
            break
    return median(times[1:]), mean(counts[1:])


if __name__ == "__main__":
    if sys.argv[1:2] == ["--row"]:
        row(int(sys.argv[2]), sys.argv[3])
    else:
        main(tuple(int(word) for word in sys.argv[1:]))
