"""Frames of the built-in organs in real time: one Newton iteration each, direct solver, a hand that wanders.

Wall time of the core and of the Python call around it, median and 99 %. It does not show inertia, contact or
iterative solvers.
"""

from time import perf_counter

import numpy as np
from machine import describe

import viscera as vs

FRAMES = 300

print(describe())
print(f"ms a frame, {FRAMES} frames")
print("organ    nodes   cells  law                  median    99 %   worst residual")
cases = (
    ("artery", "top", "bottom", vs.MooneyRivlin(1.343e5, 0.335e5, alpha=4.167e6)),
    ("artery", "top", "bottom", vs.NeoHookean(young=1e6, poisson=0.45)),
    ("liver", "hilum", "tip", vs.NeoHookean(young=0.17e6, poisson=0.48)),
)
for name, held, grasped, law in cases:
    mesh = getattr(vs.organs, name)()
    stepper = vs.Organ(mesh, law, fixed=held).stepper({grasped: (0, 0, 0)})
    times, residuals = [], []
    for k in range(FRAMES):
        hand = 0.03 * mesh.diagonal * np.array([np.sin(0.05 * k), 1 - np.cos(0.03 * k), np.sin(0.02 * k)])
        began = perf_counter()
        frame = stepper.frame({grasped: hand})
        times.append(1e3 * (perf_counter() - began))
        residuals.append(frame.residual)
    print(
        f"{name:7s}{len(mesh.points):7d}{len(mesh.cells):8d}  {type(law).__name__:18s}"
        f"{np.median(times):9.2f}{np.percentile(times, 99):8.2f}{max(residuals[1:]):17.1e}"
    )
