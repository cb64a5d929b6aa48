"""What `solver="gpu"` reaches: solutions and frames on the device, against the processor in double precision.

    python benchmarks/gpu_accuracy.py

Solutions: the largest displacement of a point from that of Cholesky's method, relative to the largest displacement.
Frames: iterations of conjugate gradients with block-Jacobi on both processors in the first frame from each of four
equilibria, the same for both, and the residual that single precision alone leaves. Traffic: bytes written to the device
and read from it and kernels dispatched in the fifth frame of a moving hand, where the device forms the tangent, and
where it takes that of the processor, which Ogden's law makes it do. No times: a device in software tells nothing of one
in hardware.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from machine import describe

import viscera as vs
from viscera import _core, gpu
from viscera.solver import GPU

CPU = vs.ConjugateGradients("block_jacobi", max_iterations=GPU.max_iterations)
ORGANS = {
    "beam": (vs.organs.beam, "clamp", "tip", 0.03, (0.3, 0.45, 0.49, 0.499)),
    "artery": (vs.organs.artery, "bottom", "top", -0.003, (0.45,)),
    "liver": (vs.organs.liver, "hilum", "tip", 0.01, (0.45, 0.49)),
}
"""Mesh, what is fixed, what is moved how far [m], Poisson's ratios: few for the larger organs, which take long."""
ELEMENTS = ("P1", "P1 mean volume")


def main() -> None:
    try:
        device = gpu.describe()
    except vs.VisceraError as error:
        return print(f"not measured: {error}")
    print(describe(1))
    print(f"device: {device}")
    print("\nneo-Hookean; solution: |u - u of Cholesky| / |u|; iterations of four frames")
    print("organ    element         Poisson   solution   processor   device   ratio     floor   tangent")
    for name, (mesh, fixed, where, depth, ratios) in ORGANS.items():
        for poisson in ratios:
            element = ELEMENTS[0] if poisson < 0.48 else ELEMENTS[1]
            organ = vs.Organ(mesh(), vs.NeoHookean(young=1e4, poisson=poisson), fixed=fixed, element=element)
            print(f"{name:8} {element:14} {poisson:8.3f}   {row(organ, where, depth)}", flush=True)
    print("\nwhat one frame moves, at Poisson's ratio 0.45")
    print("organ    nodes   cells   element         tangent    iterations   written/node   read/node   dispatches")
    for name, (mesh, fixed, where, depth, _) in ORGANS.items():
        for element in ELEMENTS:
            for law in (vs.NeoHookean(young=1e4, poisson=0.45), vs.Ogden(mu=3.45e3, alpha=2.0, kappa=3.33e4)):
                organ = vs.Organ(mesh(), law, fixed=fixed, element=element)
                body = f"{len(organ.mesh.points):5}   {len(organ.mesh.cells):5}"
                print(f"{name:8} {body}   {element:14}  {traffic(organ, where, depth)}", flush=True)


def row(organ: vs.Organ, where: str, depth: float) -> str:
    moved, further = {where: (None, None, -depth)}, {where: (0.1 * depth, None, -1.1 * depth)}
    states = [organ.solve(displacement={where: (None, None, -depth * k / 4)}) for k in range(1, 5)]
    exact = states[-1]
    found = organ.solve(displacement=moved, solver="gpu")
    error = largest(found.displacement - exact.displacement) / largest(exact.displacement)
    counts, floor = [], 0.0
    for solver in (CPU, GPU):
        frames = [organ.stepper(moved, start=state, solver=solver).frame(further) for state in states]
        counts.append(sum(frame.iterations for frame in frames))
        floor = max(frame.floor for frame in frames)
    ratio = counts[1] / counts[0]
    return (
        f"{error:8.0e}   {counts[0]:9}   {counts[1]:6}   {ratio:5.2f}   {floor:7.0e}   {frames[-1].tangent_on_device}"
    )


def traffic(organ: vs.Organ, where: str, depth: float) -> str:
    stepper = organ.stepper(solver="gpu")
    for k in range(1, 6):
        before = np.array(_core.gpu_traffic())
        frame = stepper.frame({where: (None, None, -0.02 * depth * k)})
    written, read, dispatches = np.array(_core.gpu_traffic()) - before
    n = len(organ.mesh.points)
    counts = f"{frame.iterations:10}   {written / n:12.0f}   {read / n:9.0f}   {dispatches:10}"
    return f"{frame.tangent_on_device or 'none':8}   {counts}"


def largest(u: Any) -> float:
    return float(np.linalg.norm(u, axis=1).max())


if __name__ == "__main__":
    main()
