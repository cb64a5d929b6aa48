"""What each element costs: assembly of a Newton iteration per cell, a frame in real time; ratios to P1.

One thread; neo-Hookean, nu = 0.48; assembly (force, tangent and all that goes with them) as the best of some solves,
which leaves out what else the machine does; frames of a hand that wanders, median. It does not show accuracy:
docs/elements.md does.
"""

import os

os.environ["RAYON_NUM_THREADS"] = "1"

from time import perf_counter

import numpy as np
from machine import describe

import viscera as vs
from viscera.supported import ELEMENTS

SOLVES, FRAMES = 5, 60


def assembly(organ: vs.Organ) -> float:
    """Seconds of the assembly of one iteration."""
    states = [organ.solve(gravity=(0, 0, -9.81), density=1060, throw=True) for _ in range(SOLVES)]
    return min(state.timings["assembly"] / (state.iterations + len(state.residuals)) for state in states)


def frame(organ: vs.Organ, grasped: str) -> float:
    """Seconds of a frame, median."""
    stepper, times = organ.stepper({grasped: (0, 0, 0)}), []
    for k in range(FRAMES):
        hand = 0.03 * organ.mesh.diagonal * np.array([np.sin(0.05 * k), 1 - np.cos(0.03 * k), np.sin(0.02 * k)])
        began = perf_counter()
        stepper.frame({grasped: hand})
        times.append(perf_counter() - began)
    return float(np.median(times))


print(describe())
print("organ   element           nodes   cells   assembly per cell, in a solve          frame")
for name, held, grasped in (("artery", "top", "bottom"), ("liver", "hilum", "tip")):
    mesh, first = getattr(vs.organs, name)(), None
    for element in ELEMENTS:
        organ = vs.Organ(mesh, vs.NeoHookean(young=0.17e6, poisson=0.48), fixed=held, element=element)
        times = np.array([assembly(organ), frame(organ, grasped)])
        first = times if first is None else first
        cell, (cell_ratio, frame_ratio) = 1e6 * times[0] / len(mesh.cells), times / first
        print(
            f"{name:8s}{element:15s}{len(organ.mesh.points):8d}{len(mesh.cells):8d}"
            f"{cell:13.3f} us  ({cell_ratio:4.1f} x){1e3 * times[1]:13.2f} ms  ({frame_ratio:4.1f} x)"
        )
