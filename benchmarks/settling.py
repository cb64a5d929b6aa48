"""How far the force of a frame is off before it has settled: the artery dragged sideways, 60 frames a second.

A contact patch is dragged along the artery and back, up to 10 mm, at three speeds, one to three Newton iterations a
frame, and then with as many as it takes to settle. Frames set out from where the last motion leads, and for comparison,
marked *, from the last state. Each frame's force is held against that of the full solution with
the hand in the same place. The second table has all frames by the residual that they left.
"""

import os

os.environ.setdefault("RAYON_NUM_THREADS", "1")

from itertools import pairwise

import numpy as np
from machine import describe

import viscera as vs

FRAMES, RATE, REACH = 60, 60, 0.010
SPEEDS = (0.017, 0.044, 0.087)
DECADES = (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 0.0)

organ = vs.Organ(vs.organs.artery(), vs.MooneyRivlin(1.343e5, 0.335e5, alpha=4.167e6), fixed="top", element="P1")
places = organ.touchable(radius=0.1 * organ.mesh.diagonal)
middle = organ.mesh.points[places] - organ.mesh.points.mean(axis=0)
patch = organ.patch(organ.mesh.points[places[np.argmax(middle[:, 0])]], 0.1 * organ.mesh.diagonal)
SIDEWAYS = np.array([0.0, 1.0, 0.0])


def path(speed: float) -> np.ndarray:
    """Where the hand is in every frame (k, 3) [m]: back and forth."""
    gone = speed / RATE * np.arange(1, FRAMES + 1)
    return np.abs((gone + REACH) % (4 * REACH) - 2 * REACH)[:, None] * SIDEWAYS - REACH * SIDEWAYS


def exact(hands: np.ndarray) -> np.ndarray:
    """Forces of full solutions (k, 3) [N], each from the one before."""
    forces, state = [], None
    for hand in hands:
        state = organ.solve(displacement={patch: hand}, start=state, throw=True)
        forces.append(state.reaction(patch))
    return np.array(forces)


print(describe())
print(f"{FRAMES} frames; force: |F - F_full| / |F_full|")
print("mm/s  iterations    force: median      90 %     worst    residual: median   settled  steps")
left, off = [], []
for speed in SPEEDS:
    hands = path(speed)
    truth = exact(hands)
    for iterations, extrapolate in ((1, False), (1, True), (2, True), (3, True), (20, False), (20, True)):
        stepper = organ.stepper({patch: (0, 0, 0)}, iterations=iterations, extrapolate=extrapolate)
        frames = [stepper.frame({patch: hand}) for hand in hands]
        forces = np.array([frame.reaction(patch) for frame in frames])
        wrong = np.linalg.norm(forces - truth, axis=1) / np.linalg.norm(truth, axis=1)
        residual = np.array([frame.residual for frame in frames])
        left.append(residual)
        off.append(wrong)
        settled = np.mean([frame.is_settled for frame in frames])
        steps = np.mean([frame.steps for frame in frames])
        name = (str(iterations) if iterations < 20 else "settled") + ("" if extrapolate else "*")
        print(
            f"{1e3 * speed:4.0f}  {name:>10s}  {100 * np.median(wrong):12.3g} %{100 * np.quantile(wrong, 0.9):8.3g} %"
            f"{100 * wrong.max():8.3g} %{np.median(residual):20.0e}{100 * settled:8.0f} %{steps:7.1f}"
        )
print("\nresidual            frames    force: median     worst")
residuals, errors = np.concatenate(left), np.concatenate(off)
for high, low in pairwise(DECADES):
    inside = (residuals <= high) & (residuals > low)
    if inside.any():
        wrong = errors[inside]
        print(f"{low:7.0e} to {high:5.0e}{inside.sum():9d}{100 * np.median(wrong):15.2g} %{100 * wrong.max():8.2g} %")
