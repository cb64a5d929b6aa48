"""A jerky random hand on the artery, in quasi-static and dynamic frames by direct and iterative solvers, for minutes.

    python benchmarks/soak.py [SECONDS, 600 by default] [--seed N]

The hand grasps a random place, jumps by up to a tenth of the organ's size a frame, jerks gravity about and lets go at
random; now and then a dead force pulls at the free end for a while, up to many times what the law bears. What must not
happen, and ends the run with status 1: a frame that fails, a displacement that is not finite, a cell inside out, an
organ that does not come back to rest when it is let go, memory that grows. `at bound` are frames with a cell at a bound
of its volume. Conjugate gradients have a budget of 5 ms in quasi-static frames; `late` are frames that took longer.
"""

from __future__ import annotations

import argparse
import os
import sys
from array import array
from pathlib import Path
from time import perf_counter

import numpy as np
from machine import describe

import viscera as vs

RUBBER = vs.MooneyRivlin(1.343e5, 0.335e5, alpha=4.167e6)
SOFTENING = vs.SaintVenantKirchhoff(young=2e5, poisson=0.45)
KINDS = {
    "quasi-static, cholesky": (RUBBER, {"solver": "cholesky"}),
    "quasi-static, cg": (RUBBER, {"solver": "cg", "budget": 0.005}),
    "backward Euler, cholesky": (RUBBER, {"dynamics": "backward_euler", "time_step": 1 / 60}),
    "Newmark, cg": (RUBBER, {"dynamics": "newmark", "time_step": 1 / 60, "damping": (2.0, 0.01), "solver": "cg"}),
    "backward Euler, SVK": (SOFTENING, {"dynamics": "backward_euler", "time_step": 1 / 60, "damping": (2.0, 0.01)}),
}
OVERLOADS = (1.0, 10.0, 100.0)
"""Dead forces [N]: ten bend the artery far, a hundred tear it."""
AT_REST = 0.01
"""Distance from rest, over the organ's size, that is left 300 frames after everything is let go."""


def resident() -> float:
    """Resident memory of this process [MB]; 0 where the system does not tell."""
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6 if statm.exists() else 0.0


def volumes(mesh: vs.Mesh, displacement: np.ndarray) -> np.ndarray:
    """Deformed volume of every cell, times six."""
    a, b, c, d = (mesh.points + displacement)[mesh.cells].swapaxes(0, 1)
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)


def soak(name: str, seconds: float, seed: int) -> list[str]:
    """Frames for some seconds; what went wrong, in words."""
    rng, mesh = np.random.default_rng(seed), vs.organs.artery()
    law, settings = KINDS[name]
    organ = vs.Organ(mesh, law, fixed="top", element="P1")
    reach = 0.1 * mesh.diagonal
    stepper, places = organ.stepper(density=1060, **settings), organ.touchable(radius=reach)
    rest = organ.solve(gravity=(0, 0, -9.81), density=1060, throw=True).displacement
    hand, faults, pull, pulls = None, [], (0.0, 0.0, 0.0), 0
    frames = cut = bound = unstable = late = 0
    times = array("d")
    worst, gravity = 0.0, np.array([0.0, 0.0, -9.81])
    began, memory = perf_counter(), [resident()]
    while perf_counter() - began < seconds and not faults:
        if hand is None:
            hand = stepper.grasp(organ.patch(mesh.points[rng.choice(places)], reach))
        elif rng.random() < 0.02:
            hand.release()
            hand = None
        else:
            hand.move(rng.normal(size=3) * mesh.diagonal * rng.choice([0.002, 0.01, 0.05]))
            if np.linalg.norm(hand.displacement) > 0.4 * mesh.diagonal:
                hand.displacement = hand.displacement * 0.5  # a hand stays within reach
        if rng.random() < 0.01:
            turned = rng.normal(size=3)
            gravity = 9.81 * turned / np.linalg.norm(turned)
        if pulls == 0 and rng.random() < 0.003:
            direction = rng.normal(size=3)
            pull, pulls = rng.choice(OVERLOADS) * direction / np.linalg.norm(direction), int(rng.integers(5, 60))
        force = {"bottom": pull} if pulls > 0 else None
        pulls = max(pulls - 1, 0)
        frames += 1
        try:
            frame = stepper.frame(gravity=gravity, force=force)
        except vs.VisceraError as error:
            faults.append(f"frame {frames} failed: {error}")
            break
        cut += frame.taken < 1.0
        bound += frame.cells_at_bound > 0
        unstable += frame.is_unstable
        late += not frame.within_budget
        times.append(1e3 * frame.seconds)
        worst = max(worst, frame.residual)
        if not (np.isfinite(frame.displacement).all() and np.isfinite(frame.residual)):
            faults.append(f"frame {frames} is not finite")
        elif volumes(mesh, frame.displacement).min() <= 0.0:
            faults.append(f"frame {frames} has a cell inside out")
        if frames % 500 == 0:
            memory.append(resident())
    if hand is not None:
        hand.release()
    for _ in range(0 if faults else 300):
        frame = stepper.frame(gravity=(0, 0, -9.81))
    if not faults and not (frame.residual < 1e-3 and frame.taken == 1.0):
        faults.append(f"let go, it did not come to rest: residual {frame.residual:.1e}, taken {frame.taken}")
    away = np.abs(frame.displacement - rest).max() / mesh.diagonal
    if not faults and away > AT_REST:
        faults.append(f"let go, it came to rest {100 * away:.0f} % of its size from where it began")
    half = len(memory) // 2
    growth = max(memory[half:]) - max(memory[: half + 1]) if half > 1 else 0.0
    if growth > 20.0:
        faults.append(f"memory grew by {growth:.0f} MB in the second half")
    print(
        f"{name:26s}{frames:9d}{cut:8d}{bound:10d}{unstable:10d}{np.median(times):9.2f}{np.quantile(times, 0.99):8.2f}"
        f"{max(times):8.2f}{late:7d}{worst:12.1e}{frame.residual:12.1e}{growth:12.1f}"
        f"  {'; '.join(faults) or 'none'}"
    )
    return faults


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("seconds", nargs="?", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(describe())
    print(f"{'':63s}ms: p50     99 %   worst")
    print(
        f"{'kind':26s}{'frames':>9s}{'cut':>8s}{'at bound':>10s}{'unstable':>10s}{'':25s}{'late':>7s}"
        f"{'worst res.':>12s}{'at the end':>12s}{'growth [MB]':>12s}  faults"
    )
    wrong = [soak(name, options.seconds / len(KINDS), options.seed) for name in KINDS]
    sys.exit(1 if any(wrong) else 0)
