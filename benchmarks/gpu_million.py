"""A million cells on the device, in chunks, against the processor.

    python benchmarks/gpu_million.py [BRICKS_PER_SIDE]

A cube of neo-Hookean tissue, Poisson's ratio 0.45, held on one side and sheared on the other, solved with multigrid on
both. The device may bind no more than VISCERA_GPU_BINDING bytes at once, by default 64 MiB, so that the tangent and the
responses of the cells are cut into chunks. Fails where the displacements differ by more than 1e-5 of the largest.
"""

from __future__ import annotations

import math
import os
import sys
import time

import numpy as np
from gpu_multigrid import box
from machine import describe

import viscera as vs
from viscera import _core, gpu

BINDING = int(os.environ.setdefault("VISCERA_GPU_BINDING", str(64 << 20)))
RESPONSE = 408  # bytes of a cell's response, see gpu/src/layout.rs
AGREEMENT = 1e-5


def main() -> None:
    side = int(sys.argv[1]) if len(sys.argv) > 1 else 55
    try:
        device = gpu.describe()
    except vs.VisceraError as error:
        raise SystemExit(f"not measured: {error}") from None
    print(describe(1))
    print(f"device: {device}; it may bind {BINDING} bytes at once")
    organ = box((side, side, side), 0.45)
    cells, nodes = len(organ.mesh.cells), len(organ.mesh.points)
    print(f"{cells} cells, {nodes} nodes; at least {math.ceil(RESPONSE * cells / BINDING)} chunks", flush=True)
    load = {"end": (0.0, 0.0, -2.0)}
    found = {}
    for place in ("cpu", "gpu"):
        solver = vs.ConjugateGradients("multigrid", 1e-3, 1000, device=place)
        before, clock = np.array(_core.gpu_traffic()), time.process_time()
        state = found[place] = organ.solve(force=load, solver=solver)
        written, read, dispatches, touched = np.array(_core.gpu_traffic()) - before
        print(
            f"{place}: {state.status} in {state.iterations} Newton iterations, largest displacement "
            f"{largest(state.displacement):.4e} m, {time.process_time() - clock:.0f} s of processor time, tangent "
            f"{state.tangent_on_device or 'on the processor'}, {dispatches} dispatches, {1e-6 * written:.0f} MB "
            f"written, {1e-6 * read:.0f} MB read, {1e-9 * touched:.1f} GB touched by iterations",
            flush=True,
        )
    difference = largest(found["gpu"].displacement - found["cpu"].displacement) / largest(found["cpu"].displacement)
    print(f"the largest difference is {difference:.0e} of the largest displacement")
    if not (difference < AGREEMENT and found["gpu"].is_converged and found["gpu"].tangent_on_device):
        raise SystemExit("the device does not agree with the processor")


def largest(u: np.ndarray) -> float:
    return float(np.linalg.norm(u, axis=1).max())


if __name__ == "__main__":
    main()
