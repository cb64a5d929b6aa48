"""A random tool against a soft cube, driven through a coupling that bounds its force, for many frames with inertia.

    python benchmarks/contact_soak.py [FRAMES, 100000 by default] [--seed N] [--write]

Backward Euler, frames of 10 ms. A target wanders through and around the cube; a spring of bounded force draws a sphere,
a capsule or a box with friction after it. What must not happen, and ends the run with status 1: a depth of more than
0.1 % of the diagonal at a node or a sample, a cell inside out, a value that is not finite, an energy (of motion, strain
and layer, with what friction took) above that of the start and the work of the tool by more than 1e-6 of the work
exchanged.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from pathlib import Path

import numpy as np
from machine import describe

import viscera as vs

SIDE, PULL, DRAG = 0.1, 2.0, 4000.0
"""Of the cube [m]; largest force of the coupling [N]; force over the step of the tool in a frame [N/m]."""
SHAPES = {"sphere": vs.Sphere(0.02), "capsule": vs.Capsule(0.012, 0.04), "box": vs.Box(0.05, rounding=0.015)}
LARGEST_DEPTH, LARGEST_GAIN = 1e-3, 1e-6


def cube(n: int) -> vs.Mesh:
    """A cube of n^3 cubes, six cells each."""
    line = np.linspace(0.0, SIDE, n + 1)
    points = np.array([(x, y, z) for z in line for y in line for x in line])
    corner = np.array([i + (n + 1) * (j + (n + 1) * k) for k, j, i in itertools.product(range(n), repeat=3)])
    parts = []
    for order in itertools.permutations((1, n + 1, (n + 1) ** 2)):
        parts.append(np.stack([corner, *(corner + sum(order[: k + 1]) for k in range(3))], axis=1))
    return vs.mesh(points, np.vstack(parts), {"base": np.flatnonzero(points[:, 2] == 0.0)})


class Soak:
    """One tool and one cube; the energy balance from frame to frame."""

    def __init__(self, shape: str, seed: int, friction: float = 0.3) -> None:
        self.random = np.random.default_rng(seed)
        self.organ = vs.Organ(cube(4), vs.NeoHookean(young=10e3, poisson=0.4), fixed="base")
        self.stepper = self.organ.stepper(
            dynamics="backward_euler", time_step=0.01, density=1000, iterations=40, settled=1e-9
        )
        self.tool = self.stepper.tool(SHAPES[shape], (0.05, 0.05, SIDE + 0.035), friction=friction)
        self.target = self.tool.position.copy()
        self.force = np.zeros(3)
        self.work = self.exchanged = self.dissipated = 0.0
        self.deepest = self.gain = 0.0
        self.unsettled = self.touched = 0

    def frame(self) -> None:
        goal = self.random.uniform((-0.02, -0.02, 0.07), (0.12, 0.12, 0.15))
        self.target += 0.05 * (goal - self.target) + self.random.normal(0.0, 0.002, 3)
        pull = DRAG * (self.target - self.tool.position)
        pull *= min(1.0, PULL / max(np.linalg.norm(pull), 1e-12))
        step = (pull - self.force) / DRAG
        self.tool.move(step)
        frame = self.stepper.frame()
        told = frame.contact(self.tool)
        self.force = told.force
        self.work += float(told.force @ step)
        self.exchanged += abs(float(told.force @ step))
        self.dissipated += told.dissipation
        energy = frame.energy + frame.kinetic_energy + told.energy + self.dissipated
        if self.exchanged > 0.0:
            self.gain = max(self.gain, (energy - self.work) / self.exchanged)
        self.deepest = min(self.deepest, told.gap / self.organ.mesh.diagonal)
        self.unsettled += not frame.is_settled
        self.touched += told.touching > 0
        if not (np.isfinite(frame.displacement).all() and np.isfinite(energy)):
            raise SystemExit("a value is not finite")

    def wrong(self) -> list[str]:
        """What must not be."""
        found = []
        if -self.deepest > LARGEST_DEPTH:
            found.append(f"the tool was {-100 * self.deepest:.3f} % of the diagonal deep")
        if self.gain > LARGEST_GAIN:
            found.append(f"the energy was above its balance by {self.gain:.1e} of the work exchanged")
        return found

    def row(self, name: str, frames: int) -> str:
        counts = f"{name:<10}{frames:<9d}{self.touched:<10d}{self.unsettled:<12d}"
        energies = f"{self.gain:<12.1e}{self.exchanged:<14.3e}{self.dissipated:.3e}"
        return f"{counts}{-100 * self.deepest:<12.4f}{energies}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("frames", nargs="?", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", action="store_true", help="keep it in benchmarks/results")
    arguments = parser.parse_args()
    heads = "tool      frames   touching  unsettled   depth [%]   gain        exchanged [J] dissipated [J]"
    lines, wrong = [describe(), "", heads], []
    print("\n".join(lines), flush=True)
    each = arguments.frames // len(SHAPES)
    for shape in SHAPES:
        soak = Soak(shape, arguments.seed)
        for _ in range(each):
            soak.frame()
        lines.append(soak.row(shape, each))
        wrong += [f"{shape}: {line}" for line in soak.wrong()]
        print(lines[-1], flush=True)
    lines += wrong
    print("\n".join(wrong))
    if arguments.write:
        path = Path(__file__).parent / "results" / "contact_soak.txt"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
