"""What `solver="gpu"` reaches: solutions and frames on the device, against the processor in double precision.

    python benchmarks/gpu_accuracy.py

Solutions: the largest displacement of a point from that of Cholesky's method, relative to the largest displacement.
Frames: iterations of conjugate gradients with block-Jacobi on both processors in the first frame from each of four
equilibria, the same for both, and the residual that single precision alone leaves. No times: a device in software tells
nothing of one in hardware.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from machine import describe

import viscera as vs
from viscera import gpu
from viscera.solver import GPU

CPU = vs.ConjugateGradients("block_jacobi", max_iterations=GPU.max_iterations)
ORGANS = {
    "beam": (vs.organs.beam, "clamp", "tip", 0.03),
    "artery": (vs.organs.artery, "bottom", "top", -0.003),
    "liver": (vs.organs.liver, "hilum", "tip", 0.01),
}


def main() -> None:
    try:
        device = gpu.describe()
    except vs.VisceraError as error:
        raise SystemExit(f"not measured: {error}") from None
    print(describe(1))
    print(f"device: {device}")
    print("neo-Hookean; solution: |u - u of Cholesky| / |u|; iterations of four frames")
    print("organ    element         Poisson   solution   processor   device   ratio     floor")
    for name, (mesh, fixed, where, way) in ORGANS.items():
        for poisson in (0.3, 0.45, 0.49, 0.499):
            element = "P1" if poisson < 0.48 else "P1 mean volume"
            organ = vs.Organ(mesh(), vs.NeoHookean(young=1e4, poisson=poisson), fixed=fixed, element=element)
            print(f"{name:8} {element:14} {poisson:8.3f}   {row(organ, where, way)}", flush=True)


def row(organ: vs.Organ, where: str, way: float) -> str:
    moved, further = {where: (None, None, -way)}, {where: (0.1 * way, None, -1.1 * way)}
    states = [organ.solve(displacement={where: (None, None, -way * k / 4)}) for k in range(1, 5)]
    exact = states[-1]
    found = organ.solve(displacement=moved, solver="gpu")
    error = largest(found.displacement - exact.displacement) / largest(exact.displacement)
    counts, floor = [], 0.0
    for solver in (CPU, GPU):
        frames = [organ.stepper(moved, start=state, solver=solver).frame(further) for state in states]
        counts.append(sum(frame.iterations for frame in frames))
        floor = max(frame.floor for frame in frames)
    return f"{error:8.0e}   {counts[0]:9}   {counts[1]:6}   {counts[1] / counts[0]:5.2f}   {floor:7.0e}"


def largest(u: Any) -> float:
    return float(np.linalg.norm(u, axis=1).max())


if __name__ == "__main__":
    main()
