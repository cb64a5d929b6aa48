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
import json
from dataclasses import asdict, dataclass
from time import process_time

import numpy as np
from machine import ROOT, describe

import viscera as vs

RADIUS, RATIO, YOUNG = 1.0, 0.05, 1e4
A = RATIO * RADIUS
DEPTH = A**2 / RADIUS
GROWTH, LAYER = 1.4, 30.0


def graded(cells: int, near: float, far: float) -> np.ndarray:
    """Coordinates from 0: `cells` to a contact radius as far as `near` radii, then ever longer ones as far as `far`."""
    line = list(np.arange(np.ceil(near * cells) + 1) * A / cells)
    edge = len(line)
    while line[-1] < far * A:
        line.append(line[-1] + GROWTH * (line[-1] - line[-2]))
    line = np.array(line)
    line[edge:] = line[edge - 1] + (line[edge:] - line[edge - 1]) * (far * A - line[edge - 1]) / (
        line[-1] - line[edge - 1]
    )
    return line


def block(cells: int) -> vs.Mesh:
    """A quarter of the block, its top at z = 0."""
    along, down = graded(cells, 1.2, 50), graded(cells, 0.8, 100)
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


@dataclass(frozen=True)
class Row:
    """A sphere at the depth: our force over Hertz's, and what else must hold."""

    poisson: float
    cells: int
    layer: float
    points: int
    force: float
    is_tensile: bool
    back: float
    gap: float
    iterations: int
    seconds: float


def pressed(poisson: float, cells: int, layer: float) -> Row:
    """The sphere at the depth, and the force there after it has been half as deep again."""
    organ = vs.Organ(block(cells), vs.NeoHookean(young=YOUNG, poisson=poisson), fixed="floor")
    held = {"x": (0, None, None), "y": (None, 0, None)}

    def go(start: float, end: float, state: vs.State | None) -> tuple[vs.State, vs.Tool]:
        tool = vs.Tool(vs.Sphere(RADIUS), (0, 0, RADIUS - start), displacement=(0, 0, start - end), stiffness=layer)
        settings = {"tolerance": 1e-6}
        return organ.solve(
            displacement=held, contact=[tool], start=state, solver="cg", settings=settings, throw=True
        ), tool

    began = process_time()
    state, tool = go(0.0, DEPTH, None)
    seconds = process_time() - began
    deeper, _ = go(DEPTH, 1.5 * DEPTH, state)
    back, same = go(1.5 * DEPTH, DEPTH, deeper)
    contact = state.contact(tool)
    hertz = 4 / 3 * YOUNG / (1 - poisson**2) * np.sqrt(RADIUS) * DEPTH**1.5
    return Row(
        poisson,
        cells,
        layer,
        len(organ.mesh.points),
        float(-4 * contact.force[2] / hertz),
        bool(contact.pressures.min() < 0),
        float(back.force(same)[2] / state.force(tool)[2] - 1.0),
        contact.gap / DEPTH,
        state.iterations,
        seconds,
    )


def kept(poisson: float, cells: int, layer: float) -> Row:
    """A row; those of an earlier run are read."""
    path = ROOT / "out" / "hertz.jsonl"
    path.parent.mkdir(exist_ok=True)
    known = [Row(**json.loads(line)) for line in path.read_text().splitlines()] if path.exists() else []
    for row in known:
        if (row.poisson, row.cells, row.layer) == (poisson, cells, layer):
            return row
    row = pressed(poisson, cells, layer)
    with path.open("a") as file:
        file.write(json.dumps(asdict(row)) + "\n")
    return row


def line(row: Row) -> str:
    told = f"{row.poisson:<7}{row.cells:<10d}{row.points:<9d}{row.force:<14.4f}"
    told += f"{'yes' if row.is_tensile else 'never':<10}{row.back:<12.1e}{row.gap:<12.1e}"
    told += f"{row.iterations:<13d}{row.seconds:.0f}"
    return told + (f"   layer {row.layer:g}" if row.layer != LAYER else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cells", nargs="*", type=int, default=[4, 8, 16])
    parser.add_argument("--poisson", nargs="*", type=float, default=[0.3, 0.499])
    parser.add_argument("--write", action="store_true", help="keep it in benchmarks/results")
    arguments = parser.parse_args()
    heads = "nu     cells/a   points   force/Hertz   tensile   back        gap/depth   iterations   seconds"
    lines = [describe(), "", heads]
    print("\n".join(lines), flush=True)
    for poisson, cells in itertools.product(arguments.poisson, arguments.cells):
        for layer in (LAYER, 4 * LAYER) if cells == min(arguments.cells) else (LAYER,):
            lines.append(line(kept(poisson, cells, layer)))
            print(lines[-1], flush=True)
    if arguments.write:
        path = ROOT / "benchmarks" / "results" / "hertz.txt"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
