"""What multigrid saves on the device: iterations, dispatches and bytes of one frame, beside block-Jacobi.

    python benchmarks/gpu_multigrid.py

The second frame of a block, or of an organ, under a growing force: one linear system, to two tolerances. The tangent is
formed on the device; the hierarchy is the one of the first frame. Bytes are those that the iterations read and write, a
vector that neighbours share counted once. The least times are bytes over bandwidth and an overhead for each dispatch,
both as in docs/gpu.md. They are bounds: nothing here was measured on a graphics processor.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from locking import bricks
from machine import describe

import viscera as vs
from viscera import _core, gpu

SHEETS = {"Iris Xe": (68e9, 10e-6), "M2": (100e9, 10e-6), "RTX 4070": (504e9, 5e-6)}
"""Bandwidth [bytes/s] and overhead of a dispatch [s], those of gpu/examples/plan.rs."""

TOLERANCES = (1e-3, 1e-6)
PRECONDITIONERS = ("block_jacobi", "multigrid")


def main() -> None:
    try:
        device = gpu.describe()
    except vs.VisceraError as error:
        raise SystemExit(f"not measured: {error}") from None
    print(describe(1))
    print(f"device: {device}")
    print("\none frame; least times of its iterations [ms]")
    heads = "   ".join(f"{name:>8}" for name in SHEETS)
    print(f"body            cells   tolerance   preconditioner   iterations   dispatches        MB   {heads}")
    for name, organ, where, force in bodies():
        for tolerance in TOLERANCES:
            for preconditioner in PRECONDITIONERS:
                solver = vs.ConjugateGradients(preconditioner, tolerance, 20_000, device="gpu")
                start = f"{name:12} {len(organ.mesh.cells):8}   {tolerance:9.0e}   {preconditioner:14}"
                print(f"{start}   {row(organ, solver, where, force)}", flush=True)


def bodies() -> Iterator[tuple[str, vs.Organ, str, float]]:
    """Name, organ, where a force pulls down, and the force [N]: strains of some percent."""
    for n in (8, 16, 26):
        yield "block", box((n, n, n), 0.45), "end", 4.0
    yield "bar", box((80, 8, 8), 0.45), "end", 0.01
    yield "bar, 0.49", box((80, 8, 8), 0.49), "end", 0.01
    for poisson in (0.45, 0.49):
        law = vs.NeoHookean(young=1e4, poisson=poisson)
        yield f"liver, {poisson}", vs.Organ(vs.organs.liver(), law, fixed="hilum"), "tip", 0.2


def box(counts: tuple[int, int, int], poisson: float) -> vs.Organ:
    """Bricks of six cells, 0.1 m high, held at one end."""
    unit, cells = bricks(counts)
    points = unit * (0.1 / counts[2] * np.array(counts))
    sets = {"wall": np.flatnonzero(unit[:, 0] == 0.0), "end": np.flatnonzero(unit[:, 0] == 1.0)}
    return vs.Organ(vs.mesh(points, cells, sets), vs.NeoHookean(young=1e4, poisson=poisson), fixed="wall")


def row(organ: vs.Organ, solver: vs.ConjugateGradients, where: str, force: float) -> str:
    stepper = organ.stepper(solver=solver)
    stepper.frame(force={where: (0.0, 0.0, -0.5 * force)})
    before = np.array(_core.gpu_traffic())
    frame = stepper.frame(force={where: (0.0, 0.0, -force)})
    _, _, dispatches, touched = np.array(_core.gpu_traffic()) - before
    counts = f"{frame.iterations:10}   {dispatches:10}   {1e-6 * touched:7.1f}"
    least = "   ".join(f"{1e3 * (touched / band + dispatches * each):8.2f}" for band, each in SHEETS.values())
    return f"{counts}   {least}" + ("" if frame.is_solved and frame.tangent_on_device == "formed" else "   not solved")


if __name__ == "__main__":
    main()
