"""Two round bodies pressed on each other without friction: force against Hertz's, 4 and 8 cells to a contact radius.

    python benchmarks/hertz_pair.py [CELLS ...] [--write]

Hertz (1881): F = 4/3 E* sqrt(R*) d^(3/2) at the approach d, with 1/R* = 1/R_1 + 1/R_2 and 1/E* = (1 - nu_1^2)/E_1 +
(1 - nu_2^2)/E_2; contact radius a = sqrt(R* d), here a/R* = 0.05. Quarters of two blocks of 100 a x 100 a x 100 a
with round tops, graded away from the contact. The meshes do not match: the upper one has three cells where the lower
has four. In the second half the upper body is ten times as stiff.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import hertz
import numpy as np
from machine import describe

import viscera as vs

A, YOUNG, POISSON = hertz.A, 1e4, 0.3
DEPTH = A**2  # R* = 1
RADIUS = 2.0


def body(cells: int, side: float) -> vs.Mesh:
    """A quarter of a block with a round top at the origin, above (side 1) or below it (-1)."""
    mesh = hertz.block(cells)
    r = np.hypot(mesh.points[:, 0], mesh.points[:, 1])
    near = np.minimum(r, 0.5 * RADIUS)
    sphere = np.sqrt(RADIUS**2 - near**2)
    drop = RADIUS - sphere + near / sphere * (r - near)
    z = mesh.points[:, 2]
    height = -z.min()
    points = np.column_stack([mesh.points[:, :2], -side * (z * (1.0 - drop / height) - drop)])
    return vs.mesh(points, mesh.cells, mesh.sets)


def press(cells: int, ratio: float) -> tuple[vs.Scene, vs.State]:
    """The lower body's floor held, the upper's moved down by the approach."""
    lower = vs.Organ(body(cells, -1.0), vs.NeoHookean(young=YOUNG, poisson=POISSON), fixed="floor", element="P1")
    law = vs.NeoHookean(young=ratio * YOUNG, poisson=POISSON)
    weak = vs.ElasticSupport("floor", stiffness=1e-6)
    upper = vs.Organ(body(3 * cells // 4, 1.0), law, supports=[weak], element="P1")
    pair = vs.ContactPair("lower", "upper", reach=4 * A)
    scene = vs.Scene({"lower": lower, "upper": upper}, contacts=[pair])
    held = {f"{name}/{side}": move for name in scene.organs for side, move in planes().items()}
    moved = {**held, "upper/floor": (0.0, 0.0, -DEPTH)}
    solver = "cg" if len(scene.mesh.points) > 40_000 else "cholesky"
    return scene, scene.solve(displacement=moved, solver=solver, settings={"tolerance": 1e-7}, throw=True)


def planes() -> dict[str, tuple[float | None, ...]]:
    """The planes of symmetry."""
    return {"x": (0, None, None), "y": (None, 0, None)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cells", nargs="*", type=int, default=[4, 8])
    parser.add_argument("--write", action="store_true", help="keep it in benchmarks/results")
    arguments = parser.parse_args()
    lines = [
        describe(),
        "",
        "upper/lower   cells/a   points   force/Hertz   area/Hertz   gap/depth   iterations   seconds",
    ]
    print("\n".join(lines), flush=True)
    for ratio in (1.0, 10.0):
        for cells in arguments.cells:
            scene, state = press(cells, ratio)
            contact = state.contact(scene.contacts[0])
            modulus = YOUNG / (1 - POISSON**2) / (1 + 1 / ratio)
            force = 4 / 3 * modulus * DEPTH**1.5
            lines.append(
                f"{ratio:<14g}{cells:<10d}{len(scene.mesh.points):<9d}{-4 * contact.force[2] / force:<14.4f}"
                f"{4 * contact.area / (np.pi * A**2):<13.4f}{contact.gap / DEPTH:<12.1e}{state.iterations:<13d}"
                f"{state.seconds:.1f}"
            )
            print(lines[-1], flush=True)
    if arguments.write:
        path = Path(__file__).parent / "results" / "hertz_pair.txt"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
