"""Frames in real time on one core, as ratios to the limits this project sets itself: a hand that wanders.

Each case is one organ of linear cells, a law and a solver: 300 frames, five runs. Every run takes the same steps, so
the time of a frame, of the whole Python call, is the least of its five: medians of processor and wall time, and of
processor time the 99th percentile. The ratio is that of the median processor time to the limit: up to 1 keeps it.
`residual` is the median of what the frames left behind the moving hand, `worst` the largest. The meshes of SOFA's liver
are read from the folder VISCERA_SHARED, and their cases left out, in words, where it is missing.
"""

import os

os.environ.setdefault("RAYON_NUM_THREADS", "1")

from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from machine import describe

import viscera as vs

FRAMES, RUNS = 300, 5
MESHES = Path(os.environ.get("VISCERA_SHARED", "../shared")) / "meshes"


def sofa_liver(name: str) -> vs.Mesh | None:
    """SOFA's liver, 0.035 m to its unit of length, where it is at hand."""
    path = MESHES / name
    return vs.read(path, units=0.035) if path.exists() else None


def places(mesh: vs.Mesh) -> tuple[object, object]:
    """What is held and what is grasped: by name, or a tenth of the nodes at each end of the longest axis."""
    for held, grasped in (("top", "bottom"), ("hilum", "tip")):
        if held in mesh.sets:
            return held, grasped
    along = mesh.points[:, np.argmax(np.ptp(mesh.points, axis=0))]
    low, high = np.quantile(along, [0.1, 0.99])
    return tuple(np.flatnonzero(along <= low).tolist()), tuple(np.flatnonzero(along >= high).tolist())


def run(mesh: vs.Mesh, law: vs.laws.Law, solver: str | vs.ConjugateGradients) -> np.ndarray:
    """Processor and wall time [ms], iterations and residual of each frame, (FRAMES, 4)."""
    held, grasped = places(mesh)
    stepper = vs.Organ(mesh, law, fixed=held, element="P1").stepper({grasped: (0, 0, 0)}, solver=solver)
    rows = []
    for k in range(FRAMES):
        hand = 0.03 * mesh.diagonal * np.array([np.sin(0.05 * k), 1 - np.cos(0.03 * k), np.sin(0.02 * k)])
        began, worked = perf_counter(), process_time()
        frame = stepper.frame({grasped: hand})
        busy, wall = process_time() - worked, perf_counter() - began
        rows.append((1e3 * busy, 1e3 * wall, frame.iterations, frame.residual))
    return np.array(rows)


def frames(mesh: vs.Mesh, law: vs.laws.Law, solver: str | vs.ConjugateGradients) -> tuple[float, ...]:
    """Median and 99th percentile of processor time, median wall time [ms], iterations, residuals: median, worst."""
    runs = np.array([run(mesh, law, solver) for _ in range(RUNS)])
    busy, wall = runs[..., 0].min(axis=0), runs[..., 1].min(axis=0)
    iterations, residuals = runs[0, :, 2], runs[0, :, 3]
    late = np.quantile(busy, 0.99)
    middle = np.median(residuals)
    return tuple(map(float, (np.median(busy), late, np.median(wall), iterations.mean(), middle, residuals.max())))


neo_hookean = vs.NeoHookean(young=0.17e6, poisson=0.48)
mooney_rivlin = vs.MooneyRivlin(1.343e5, 0.335e5, alpha=4.167e6)
cg = {name: vs.ConjugateGradients(name) for name in ("block_jacobi", "incomplete_cholesky", "lagged_cholesky")}
small, large = sofa_liver("liver_sofa_1441.vtu"), sofa_liver("liver_sofa_4497.vtu")
cases = [("artery", vs.organs.artery(), mooney_rivlin, "cholesky", 0.7)]
cases += [("artery", vs.organs.artery(), mooney_rivlin, solver, None) for solver in cg.values()]
for name, mesh, limits in (("liver, small", small, (5.0, 2.0)), ("liver, large", large, (None, 1000 / 60))):
    if mesh is None:
        print(f"SOFA's {name} is not in {MESHES}: left out")
        continue
    cases.append((name, mesh, neo_hookean, "cholesky", limits[0]))
    cases += [(name, mesh, neo_hookean, solver, limits[1]) for solver in cg.values()]

print(describe())
print(f"{FRAMES} frames, each the least of {RUNS} runs")
print(
    "organ          cells  law           solver                busy [ms]    99 %     wall  iterations  limit  ratio"
    "  residual   worst"
)
for name, mesh, law, solver, limit in cases:
    busy, late, wall, iterations, residual, worst = frames(mesh, law, solver)
    label = solver if isinstance(solver, str) else solver.preconditioner
    ratio = "     -      -" if limit is None else f"{limit:6.1f}{busy / limit:7.2f}"
    print(
        f"{name:13s}{len(mesh.cells):7d}  {type(law).__name__:12s}  {label:20s}{busy:11.2f}{late:8.2f}{wall:9.2f}"
        f"{iterations:12.1f} {ratio}{residual:10.0e}{worst:8.0e}"
    )
