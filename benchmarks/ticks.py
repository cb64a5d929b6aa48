"""Ticks of two fingers that move on the liver, by the series of single touches alone, on one thread.

    python benchmarks/ticks.py [--write]

The organ and the pairs are those of benchmarks/fingers.py: 16 pairs of places that the model has not seen, whose
fingers wander at 0.1 m/s within 5 % of the diagonal, 400 ticks each. With a budget a search that takes longer stops,
says "out of time" and goes on in the next tick. The model is made first and kept in out/, since that takes minutes.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from itertools import islice

import numpy as np
from fingers import TICKS, hand, pairs
from machine import ROOT, describe

import viscera as vs
from viscera.reduced.galerkin import HyperReducedModel

MODEL = ROOT / "out" / "anterior.viscera"
PAIRS = 16
BUDGETS = (None, 0.8e-3, 0.5e-3)  # [s]


def reduced() -> None:
    """Makes the model, on all processors."""
    if not MODEL.exists():
        MODEL.parent.mkdir(exist_ok=True)
        law = vs.NeoHookean(young=0.17e6, poisson=0.48)
        vs.Organ(vs.organs.liver(), law, fixed="hilum", element="P1").reduce("anterior").save(MODEL)


def moved(touch: vs.Touch, grasps: list[HyperReducedModel], budget: float | None) -> tuple[np.ndarray, float]:
    """Milliseconds of every tick, and the share of ticks that were out of time."""
    random, seconds, late = np.random.default_rng(5), [], 0
    for grasp in grasps:
        for at in islice(hand(touch, random), TICKS):
            held = grasp.solve(at, from_last=True, stiffness=False, budget=budget)
            seconds.append(held.seconds)
            late += held.status == "out of time"
    return 1e3 * np.array(seconds), late / len(seconds)


def measured() -> list[str]:
    """The table."""
    touch = vs.load(MODEL)
    fingers = touch.galerkin()
    grasps = [fingers.grasp(points) for points, _, _ in pairs(touch, PAIRS, seed=1)]
    modes, cells = (f"{np.median([getattr(grasp, what) for grasp in grasps]):.0f}" for what in ("modes", "cells"))
    lines = [
        describe(),
        f"two fingers on the liver, forces: {modes} modes on {cells} of {len(touch.mesh.cells)} cells (medians); ms",
        "budget       p50      p99   99.9 %    worst   within 1 ms   out of time",
    ]
    for budget in BUDGETS:
        times, late = moved(touch, grasps, budget)
        p50, p99, most, worst = np.quantile(times, [0.5, 0.99, 0.999, 1.0])
        name = f"{1e3 * budget:.1f} ms" if budget else "none"
        within = 100 * np.mean(times <= 1.0)
        lines.append(f"{name:7s} {p50:8.3f} {p99:8.3f} {most:8.3f} {worst:8.3f} {within:11.2f} % {100 * late:11.2f} %")
    return lines


def main() -> None:
    """Measures in a process that has one thread."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true", help="keep it in benchmarks/results")
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.alone:
        print("\n".join(measured()))
        return
    reduced()
    alone = {**os.environ, "RAYON_NUM_THREADS": "1"}
    command = [sys.executable, __file__, "--alone"]
    found = subprocess.run(command, env=alone, stdout=subprocess.PIPE, text=True, check=True).stdout
    print(found, end="")
    if arguments.write:
        (ROOT / "benchmarks" / "results" / "ticks.txt").write_text(found, encoding="utf-8")


if __name__ == "__main__":
    main()
