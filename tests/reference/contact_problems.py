"""Rigid tools on the built-in liver as CalculiX solves them too: tools, their ways and the law as plain data, SI units.

The tissue is Mooney-Rivlin's with c2 = 0 and kappa/2 (J - 1)^2, in linear cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import viscera as vs

Floats = NDArray[np.float64]

YOUNG, POISSON = 5e3, 0.45
C1 = YOUNG / (4 * (1 + POISSON))
KAPPA = YOUNG / (3 * (1 - 2 * POISSON))
CLEARANCE = 1e-4
"""Between tool and organ at the start [m]."""


@dataclass(frozen=True)
class Problem:
    """A sphere, or a capsule along y, that goes down onto the organ and then along x."""

    radius: float
    length: float
    friction: float
    down: float
    along: float
    increments: tuple[int, int]
    """Down and along."""

    def shape(self) -> vs.Sphere | vs.Capsule:
        return vs.Capsule(self.radius, self.length) if self.length else vs.Sphere(self.radius)

    def rotation(self) -> tuple[float, float, float]:
        return (-np.pi / 2, 0.0, 0.0) if self.length else (0.0, 0.0, 0.0)

    def start(self, mesh: vs.Mesh) -> Floats:
        """Where the middle of the tool starts: over the highest point of the organ."""
        x = mesh.points
        start = x[x[:, 2].argmax()].copy()
        beside = np.maximum(np.abs(x[:, 1] - start[1]) - self.length / 2, 0.0)
        across = np.hypot(beside, x[:, 0] - start[0])
        near = across < self.radius
        start[2] = (x[near, 2] + np.sqrt(self.radius**2 - across[near] ** 2)).max() + CLEARANCE
        return np.asarray(start)


PROBLEMS = {
    "indentation": Problem(radius=0.02, length=0.0, friction=0.0, down=0.02, along=0.0, increments=(10, 0)),
    "drag": Problem(radius=0.01, length=0.04, friction=0.3, down=0.008, along=0.02, increments=(4, 20)),
}


def law() -> vs.MooneyRivlin:
    return vs.MooneyRivlin(C1, 0.0, KAPPA, volumetric="J-1")


def organ(mesh: vs.Mesh) -> vs.Organ:
    return vs.Organ(mesh, law(), fixed="hilum", element="P1")


def forces(problem: Problem, mesh: vs.Mesh) -> Floats:
    """Our force (n, 3) [N] of the tool on the organ after every increment, in settled frames."""
    stepper = organ(mesh).stepper(iterations=60, settled=1e-6, solver="cg")
    tool = stepper.tool(problem.shape(), problem.start(mesh), problem.rotation(), friction=problem.friction)
    found = []
    steps = ((0.0, 0.0, -problem.down), problem.increments[0]), ((problem.along, 0.0, 0.0), problem.increments[1])
    for way, n in steps:
        for _ in range(n):
            tool.move(np.array(way) / n)
            frame = stepper.frame()
            if not frame.is_settled:
                raise SystemExit(f"a frame has not settled: {frame}")
            found.append(frame.force(tool))
    return np.array(found)
