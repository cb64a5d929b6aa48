"""A rigid sphere pressed into a block without friction: force against Hertz's, with 4 to 16 cells to a contact radius.

    python benchmarks/hertz.py [CELLS ...] [--write]

Hertz (1881): F = 4/3 E/(1 - nu^2) sqrt(R) d^(3/2) at the depth d, contact radius a = sqrt(R d); here a/R = 0.05. A
quarter of a block of 100 a x 100 a x 100 a, graded away from the contact, its floor held; "P1" at nu = 0.3, "P1 mean
volume" at nu = 0.499. `back` is the force at the same depth come back to from one and a half times as deep, less 1;
`layer` repeats the coarsest mesh with a layer four times as stiff between sphere and block.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path

import numpy as np
from machine import describe

import viscera as vs

RADIUS, RATIO, YOUNG = 1.0, 0.05, 1e4
A = RATIO * RADIUS
DEPTH = A**2 / RADIUS
GROWTH = 1.3


def graded(cells: int, far: float) -> np.ndarray:
    """Coordinates from 0: `cells` to a contact radius as far as 1.2 radii, then ever longer ones as far as `far`."""
    line = list(np.arange(np.ceil(1.2 * cells) + 1) * A / cells)
    while line[-1] < far:
        line.append(line[-1] + GROWTH * (line[-1] - line[-2]))
    line = np.array(line)
    inner = line <= 1.2 * A + 1e-9
    line[~inner] = line[inner][-1] + (line[~inner] - line[inner][-1]) * (far - line[inner][-1]) / (
        line[-1] - line[inner][-1]
    )
    return line


def block(cells: int) -> vs.Mesh:
    """A quarter of the block, its top at z = 0."""
    along, down = graded(cells, 50 * A), graded(cells, 100 * A)
    n, m = len(along), len(down)
    points = np.array([(x, y, -z) for z in down for y in along for x in along])
    grid = itertools.product(range(m - 1), range(n - 1), range(n - 1))
    corner = np.array([i + n * (j + n * k) for k, j, i in grid])
    parts = []
    for order in itertools.permutations((1, n, n * n)):
        parts.append(np.stack([corner, *(corner + sum(order[: k + 1]) for k in range(3))], axis=1))
    x, y, z = points.T
    sets = {"x": np.flatnonzero(x == 0), "y": np.flatnonzero(y == 0), "floor": np.flatnonzero(z < -99.9 * A)}
    sets["x"] = np.setdiff1d(sets["x"], sets["floor"])
    sets["y"] = np.setdiff1d(sets["y"], sets["floor"])
    return vs.mesh(points, np.vstack(parts), sets)


def press(organ: vs.Organ, stiffness: float = 30.0) -> tuple[vs.State, vs.Tool, float]:
    """The sphere at the depth, and the force there after it has been half as deep again."""
    held = {"x": (0, None, None), "y": (None, 0, None)}

    def go(start: float, end: float, state: vs.State | None) -> tuple[vs.State, vs.Tool]:
        tool = vs.Tool(vs.Sphere(RADIUS), (0, 0, RADIUS - start), displacement=(0, 0, start - end), stiffness=stiffness)
        solver = "cg" if len(organ.mesh.points) > 40_000 else "cholesky"
        settings = {"tolerance": 1e-7}
        return organ.solve(
            displacement=held, contact=[tool], start=state, solver=solver, settings=settings, throw=True
        ), tool

    state, tool = go(0.0, DEPTH, None)
    deeper, _ = go(DEPTH, 1.5 * DEPTH, state)
    back, same = go(1.5 * DEPTH, DEPTH, deeper)
    return state, tool, float(back.force(same)[2] / state.force(tool)[2] - 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cells", nargs="*", type=int, default=[4, 8, 16])
    parser.add_argument("--write", action="store_true", help="keep it in benchmarks/results")
    arguments = parser.parse_args()
    lines = [
        describe(),
        "",
        "nu     cells/a   points   force/Hertz   tensile   back        gap/depth   iterations   seconds",
    ]
    print("\n".join(lines), flush=True)
    for poisson, cells in itertools.product((0.3, 0.499), arguments.cells):
        organ = vs.Organ(block(cells), vs.NeoHookean(young=YOUNG, poisson=poisson), fixed="floor")
        for stiffness in (30.0, 120.0) if cells == arguments.cells[0] else (30.0,):
            state, tool, back = press(organ, stiffness)
            contact = state.contact(tool)
            hertz = 4 / 3 * YOUNG / (1 - poisson**2) * np.sqrt(RADIUS) * DEPTH**1.5
            lines.append(
                f"{poisson:<7}{cells:<10d}{len(organ.mesh.points):<9d}{-4 * contact.force[2] / hertz:<14.4f}"
                f"{'yes' if contact.pressures.min() < 0 else 'never':<10}{back:<12.1e}{contact.gap / DEPTH:<12.1e}"
                f"{state.iterations:<13d}{state.seconds:.1f}" + (f"   layer {stiffness:g}" if stiffness != 30.0 else "")
            )
            print(lines[-1], flush=True)
    if arguments.write:
        path = Path(__file__).parent / "results" / "hertz.txt"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
