"""The off-line stage with the right-hand sides of the series on the device, beside the processor's.

    python benchmarks/gpu_reduce.py [SIDE ...]

Cubes of neo-Hookean tissue, Poisson's ratio 0.45, six cells to a brick, SIDE bricks along an edge; a corner of the
upper face is touchable. The series of order 4 are solved and compressed; the check of the model, which is the
processor's in both cases, is not counted. "difference" is the largest between forces of the two models, relative to
the force. Every cube runs in a process of its own. A device in software is not measured unless sides are given: its
times say nothing of one in hardware.
"""

from __future__ import annotations

import subprocess
import sys
from time import perf_counter, process_time

import numpy as np
from locking import bricks
from machine import describe

import viscera as vs
from viscera import _core, gpu

SIDES = (6, 12, 22)
EDGE = 0.1  # [m]
DEPTH = 0.01
ELEMENTS = ("P1", "P1 mean volume")
SOLVERS = ("cholesky", "gpu")


def main(sides: tuple[int, ...]) -> None:
    try:
        print(f"device: {gpu.describe()}")
    except vs.VisceraError as error:
        return print(f"not measured: {error}")
    print(describe())
    if _core.gpu()[3] and not sides:
        return print("not measured: the device is software")
    print("\n  cells   nodes  element         positions  solver    wall [s]  processor [s]  difference")
    for side in sides or SIDES:
        for element in ELEMENTS:
            subprocess.run([sys.executable, __file__, "--row", str(side), element], check=True)


def row(side: int, element: str) -> None:
    points, cells = bricks((side, side, side))
    points = EDGE * points
    top = points[:, 2] == points[:, 2].max()
    near = top & (points[:, :2].max(axis=1) < 0.4 * EDGE)
    mesh = vs.mesh(points, cells, {"bottom": np.flatnonzero(points[:, 2] == 0), "corner": np.flatnonzero(near)})
    organ = vs.Organ(mesh, vs.NeoHookean(young=1e4, poisson=0.45), fixed="bottom", element=element)
    forces = []
    for solver in SOLVERS:
        clocks: list[tuple[float, float]] = []

        def solved(done: int, total: int, stage: str, clocks: list[tuple[float, float]] = clocks) -> None:
            if stage == "solve":
                clocks[1:] = [(perf_counter(), process_time())]

        clocks.append((perf_counter(), process_time()))
        touch = organ.reduce("corner", radius=0.012, depth=DEPTH, order=4, solver=solver, progress=solved)
        wall, processor = (after - before for before, after in zip(*clocks, strict=True))
        place = points[near].mean(axis=0)
        directions = np.vstack([np.eye(3), -np.eye(3)])
        forces.append(np.array([touch(touch.locate(place), 0.8 * DEPTH * d).force for d in directions]))
        off = np.linalg.norm(forces[-1] - forces[0], axis=1) / np.linalg.norm(forces[0], axis=1)
        print(
            f"{len(cells):7} {len(points):7}  {element:14}  {near.sum():9}  {solver:8} {wall:9.2f}  {processor:13.2f}"
            f"  {off.max():10.0e}",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--row"]:
        row(int(sys.argv[2]), sys.argv[3])
    else:
        main(tuple(map(int, sys.argv[1:])))
