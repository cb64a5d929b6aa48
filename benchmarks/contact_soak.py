"""A random tool against a soft cube, driven through a coupling that bounds its force, for many frames with inertia.

    python benchmarks/contact_soak.py [FRAMES, 100000 by default] [--seed N] [--shapes NAME ...] [--write]

Backward Euler, frames of 10 ms. A target wanders through and around the cube; a spring of bounded force draws a sphere,
a capsule or a box with friction after it. What must not happen, and ends the run with status 1: a depth of more than
0.1 % of the diagonal at a node or a sample, a cell inside out, a value that is not finite, an energy (of motion, strain
and layer, with what friction took) above that of the start and the work of the tool by more than 1e-6 of the work
exchanged. The shapes share the frames. An interrupted study goes on with the next shape: what it found is kept in
out/contact_soak.jsonl, to be deleted for a new one.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from dataclasses import asdict, dataclass

import numpy as np
from machine import ROOT, describe

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


@dataclass
class Tally:
    """What happened to one shape."""

    shape: str
    frames: int = 0
    touched: int = 0
    unsettled: int = 0
    deepest: float = 0.0
    """Over the diagonal of the cube."""
    smallest: float = 1.0
    """Volume of a cell over that at rest; at zero it turns inside out."""
    gain: float = 0.0
    """Of energy over its balance, over the work exchanged."""
    work: float = 0.0
    exchanged: float = 0.0
    dissipated: float = 0.0
    """Energies [J]."""

    def wrong(self) -> list[str]:
        """What must not be."""
        found = []
        if self.deepest > LARGEST_DEPTH:
            found.append(f"the {self.shape} was {100 * self.deepest:.3f} % of the diagonal deep")
        if self.smallest <= 0.0:
            found.append(f"{self.shape}: a cell was inside out")
        if self.gain > LARGEST_GAIN:
            found.append(f"{self.shape}: energy above its balance by {self.gain:.1e} of the work exchanged")
        return found

    def __str__(self) -> str:
        counts = f"{self.shape:<10}{self.frames:<9d}{self.touched:<10d}{self.unsettled:<12d}"
        state = f"{100 * self.deepest:<12.4f}{self.smallest:<13.3f}"
        return f"{counts}{state}{self.gain:<12.1e}{self.exchanged:<14.3e}{self.dissipated:.3e}"


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
        self.tally = Tally(shape)
        self.at_rest = self.volumes(np.zeros_like(self.organ.mesh.points))

    def volumes(self, displacement: np.ndarray) -> np.ndarray:
        """Six times the volumes of the cells [m^3], negative where inside out."""
        corners = (self.organ.mesh.points + displacement)[self.organ.mesh.cells]
        return np.linalg.det(corners[:, 1:] - corners[:, :1])

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
        tally, work = self.tally, float(told.force @ step)
        tally.work += work
        tally.exchanged += abs(work)
        tally.dissipated += told.dissipation
        energy = frame.energy + frame.kinetic_energy + told.energy + tally.dissipated
        if tally.exchanged > 0.0:
            tally.gain = max(tally.gain, (energy - tally.work) / tally.exchanged)
        tally.deepest = max(tally.deepest, -told.gap / self.organ.mesh.diagonal)
        tally.smallest = min(tally.smallest, float((self.volumes(frame.displacement) / self.at_rest).min()))
        tally.frames += 1
        tally.unsettled += not frame.is_settled
        tally.touched += told.touching > 0
        if not (np.isfinite(frame.displacement).all() and np.isfinite(energy)):
            raise SystemExit("a value is not finite")


def soaked(shape: str, frames: int, seed: int) -> Tally:
    """After so many frames; what an earlier run found is read."""
    path = ROOT / "out" / "contact_soak.jsonl"
    path.parent.mkdir(exist_ok=True)
    for line in path.read_text().splitlines() if path.exists() else []:
        known = json.loads(line)
        if known["seed"] == seed and (known["tally"]["shape"], known["tally"]["frames"]) == (shape, frames):
            return Tally(**known["tally"])
    soak = Soak(shape, seed)
    for _ in range(frames):
        soak.frame()
    with path.open("a") as file:
        file.write(json.dumps({"seed": seed, "tally": asdict(soak.tally)}) + "\n")
    return soak.tally


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("frames", nargs="?", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--shapes", nargs="*", choices=SHAPES, default=list(SHAPES))
    parser.add_argument("--write", action="store_true", help="keep it in benchmarks/results")
    arguments = parser.parse_args()
    heads = "tool      frames   touching  unsettled   depth [%]   smallest J   gain        exchanged [J] dissipated [J]"
    lines, wrong = [describe(), "", heads], []
    print("\n".join(lines), flush=True)
    for shape in arguments.shapes:
        tally = soaked(shape, arguments.frames // len(SHAPES), arguments.seed)
        lines.append(str(tally))
        wrong += tally.wrong()
        print(lines[-1], flush=True)
    lines += wrong
    print("\n".join(wrong))
    if arguments.write:
        path = ROOT / "benchmarks" / "results" / "contact_soak.txt"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
