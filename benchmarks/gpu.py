"""Frames and solutions of `solver="gpu"` beside the processor's, from a thousand cells to a million.

    python benchmarks/gpu.py [SIDE ...]

Cubes of neo-Hookean tissue, Poisson's ratio 0.45, linear cells, six to a brick, SIDE bricks along an edge. Frames: the
upper face moves by a thousandth of the edge in each; the median of their times after the first. Solutions: the same
face moves by a fifth of the edge, to a residual of 1e-9, with all that a solver prepares. "same" is the same method on
the processor, block-Jacobi conjugate gradients; "auto" the solver that the processor would take. Every row runs in a
process of its own, since the number of threads is set when one starts. Numbers of a device in software say nothing of
one in hardware; the output says which it is.
"""

from __future__ import annotations

import os
import subprocess
import sys
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from locking import bricks
from machine import describe

import viscera as vs
from viscera import gpu
from viscera.solver import GPU

SIDES = (6, 12, 22, 37, 55)
FRAMES, PATIENCE = 20, 20.0  # timed frames, and seconds after which no further one is begun
EDGE = 0.1  # [m]
SOLVERS: dict[str, Any] = {
    "gpu": "gpu",
    "same": vs.ConjugateGradients("block_jacobi", max_iterations=GPU.max_iterations),
    "best": "cg",
}
RUNS = (("gpu", 1), ("same", 1), ("auto", 1), ("gpu", 0), ("same", 0), ("auto", 0))
"""Solvers and threads of the processor; 0 for all of it."""


def main(sides: tuple[int, ...]) -> None:
    try:
        print(f"device: {gpu.describe()}")
    except vs.VisceraError as error:
        raise SystemExit(f"not measured: {error}") from None
    print(describe())
    print("\n  cells   nodes  solver  threads   frame [ms]  iterations   solution [s]  Newton  iterations  difference")
    for side in sides:
        for solver, threads in RUNS if (os.cpu_count() or 1) > 1 else RUNS[:3]:
            environment = os.environ | {"RAYON_NUM_THREADS": str(threads or os.cpu_count())}
            subprocess.run([sys.executable, __file__, "--row", str(side), solver], env=environment, check=True)


def row(side: int, name: str) -> None:
    points, cells = bricks((side, side, side))
    points = EDGE * points
    ends = {"bottom": np.flatnonzero(points[:, 2] == 0), "top": np.flatnonzero(points[:, 2] == points[:, 2].max())}
    mesh = vs.mesh(points, cells, ends)
    organ = vs.Organ(mesh, vs.NeoHookean(young=1e4, poisson=0.45), fixed="bottom", element="P1")
    frame, count = frames(organ, SOLVERS[name])
    began = perf_counter()
    state = organ.solve(displacement={"top": (0.2 * EDGE, None, 0.0)}, solver=SOLVERS[name])
    solution = perf_counter() - began
    threads = os.environ["RAYON_NUM_THREADS"]
    print(
        f"{len(cells):7}  {len(points):6}  {name:6}  {threads:>7}   {1e3 * frame:10.3f}  {count:10.1f}   {solution:12.3f}  "
        f"{state.iterations:6}  {state.linear_iterations:10}  {state.residuals[-1][-1]:10.0e}",
        flush=True,
    )


def frames(organ: vs.Organ, solver: Any) -> tuple[float, float]:
    """Seconds of a frame, and iterations of conjugate gradients in it."""
    stepper = organ.stepper(solver=solver)
    times, counts = [], []
    start = perf_counter()
    for k in range(FRAMES + 1):
        began = perf_counter()
        frame = stepper.frame({"top": (1e-3 * EDGE * (k + 1), None, 0.0)})
        times.append(perf_counter() - began)
        counts.append(frame.iterations or 0)
        if perf_counter() - start > PATIENCE and k > 1:
            break
    return median(times[1:]), float(np.mean(counts[1:]))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--row"]:
        row(int(sys.argv[2]), sys.argv[3])
    else:
        main(tuple(int(word) for word in sys.argv[1:]) or SIDES)
