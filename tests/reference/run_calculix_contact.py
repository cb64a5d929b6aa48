"""Presses rigid tools into the liver with CalculiX (`ccx` on the path); writes data/contact.npz and the decks.

    python tests/reference/run_calculix_contact.py [PROBLEM ...]

CalculiX has no smooth rigid surfaces: the tool is a shell of wedges, finely meshed, all of whose nodes are moved.
Contact is surface to surface with a linear penalty. data/contact.npz holds `PROBLEM/MESH/FACTOR/FINER` (n, 4): the
time, 1 for each step, and the force of the tool on the organ [N] after every increment of ours, with a penalty FACTOR
times PENALTY and FINER increments of CalculiX in each; data/contact/ the decks of the first of each mesh, packed.

Its friction and normals lag behind a tool that slides: on the coarse mesh the mean force of the drag is 7 % larger with
increments of 1 mm than with a quarter of that.
"""

from __future__ import annotations

import itertools
import lzma
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from contact_problems import C1, KAPPA, PROBLEMS, Floats, Problem
from run_calculix import FACES, number

import viscera as vs

DATA = Path(__file__).parent / "data" / "contact.npz"
DECKS = Path(__file__).parent / "data" / "contact"
PENALTY = 4e7
"""Pressure over depth [Pa/m]: about that of our layer."""
CASES = [
    ("indentation", "liver", 1, 1),
    ("drag", "coarse", 1, 4),
    ("drag", "coarse", 1, 1),
    ("drag", "coarse", 1, 8),
    ("drag", "coarse", 4, 4),
    ("drag", "liver", 1, 4),
    ("drag", "fine", 1, 4),
]
"""Problem, mesh, factor of the penalty, and increments in each of ours. The last two take CalculiX half an hour."""
EDGES = {"coarse": 0.0155, "fine": 0.008}
"""Of the other meshes [m]."""
WIDE = 0.005
"""How far from the held nodes of the organ those of another mesh are held, at least [m]."""
AROUND = 72
"""Sides of a circle around the tool."""


def meshed(edge: float) -> vs.Mesh:
    """The liver in cells of another edge, held where it is held."""
    liver = vs.organs.liver()
    mesh = vs.mesh_surface((liver.points, liver.surface), edge=edge)
    hilum = liver.points[liver.nodes("hilum")]
    near = [i for i, x in enumerate(mesh.points) if np.linalg.norm(hilum - x, axis=1).min() < max(edge / 2, WIDE)]
    return vs.mesh(mesh.points, mesh.cells, {"hilum": near})


def parts(mesh: vs.Mesh) -> tuple[Floats, np.ndarray, np.ndarray]:
    return mesh.points, mesh.cells, mesh.nodes("hilum")


def tool(problem: Problem) -> tuple[Floats, np.ndarray]:
    """Points of the lower half of a capsule along y around the origin, and its outward triangles."""
    radius, half = problem.radius, problem.length / 2
    quarter = AROUND // 4
    angles = np.linspace(0, np.pi / 2, quarter + 1)
    ring = [(radius * np.sin(a), -half - radius * np.cos(a)) for a in angles]
    n = max(1, round(problem.length / (1.5 * np.pi * radius / AROUND * 2))) if half else 0
    ring += [(radius, y) for y in np.linspace(-half, half, n + 1)[1:]] if half else []
    ring += [(radius * np.cos(a), half + radius * np.sin(a)) for a in angles[1:]]
    # Around y from -x by -z to +x.
    turns = np.linspace(0, np.pi, AROUND // 2 + 1)
    points: list[tuple[float, float, float]] = []
    numbers: list[list[int]] = []
    number_of: dict[tuple[int, int, int], int] = {}
    for r, y in ring:
        row = []
        for t in turns:
            key = (round(r * 1e9), round(y * 1e9), 0 if r < 1e-9 else round(t * 1e6))
            if key not in number_of:
                number_of[key] = len(points)
                points.append((-r * np.cos(t), y, -r * np.sin(t)))
            row.append(number_of[key])
        numbers.append(row)
    triangles: list[tuple[int, int, int]] = []
    for one, other in itertools.pairwise(numbers):
        for j in range(len(turns) - 1):
            a, b, c, d = one[j], one[j + 1], other[j + 1], other[j]
            triangles += [t for t in ((a, b, c), (a, c, d)) if len(set(t)) == 3]
    x, t = np.array(points), np.array(triangles)
    normal = np.cross(x[t[:, 1]] - x[t[:, 0]], x[t[:, 2]] - x[t[:, 0]])
    axis = np.stack([np.zeros(len(t)), np.clip(x[t].mean(axis=1)[:, 1], -half, half), np.zeros(len(t))], axis=1)
    inward = np.einsum("ij,ij->i", normal, x[t].mean(axis=1) - axis) < 0
    t[inward] = t[inward][:, ::-1]
    return x, t


def deck(problem: Problem, mesh: vs.Mesh, penalty: float, finer: int) -> str:
    n, m = len(mesh.points), len(mesh.cells)
    shell, triangles = tool(problem)
    start = problem.start(mesh)
    inner = 0.8 * shell
    lines = ["*NODE, NSET=ORGAN"]
    lines += [f"{i + 1}," + ",".join(f"{v:.9e}" for v in x) for i, x in enumerate(mesh.points)]
    lines += ["*NODE, NSET=TOOL"]
    lines += [f"{n + i + 1}," + ",".join(f"{v:.9e}" for v in x + start) for i, x in enumerate([*shell, *inner])]
    lines += ["*ELEMENT, TYPE=C3D4, ELSET=TISSUE"]
    lines += [f"{i + 1}," + ",".join(str(c + 1) for c in cell) for i, cell in enumerate(mesh.cells.tolist())]
    lines += ["*ELEMENT, TYPE=C3D6, ELSET=STEEL"]
    for i, t in enumerate(triangles.tolist()):
        wedge = [n + len(shell) + c + 1 for c in t] + [n + c + 1 for c in t]
        lines.append(f"{m + i + 1}," + ",".join(map(str, wedge)))
    lines += ["*NSET, NSET=HELD"] + [f"{i + 1}," for i in mesh.nodes("hilum").tolist()]
    lines += ["*MATERIAL, NAME=TISSUE", "*HYPERELASTIC, MOONEY-RIVLIN", ",".join(map(number, (C1, 0.0, 2 / KAPPA)))]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "1e6,0.3"]
    lines += ["*SOLID SECTION, ELSET=TISSUE, MATERIAL=TISSUE", "*SOLID SECTION, ELSET=STEEL, MATERIAL=STEEL"]
    lines += ["*SURFACE, NAME=SLAVE, TYPE=ELEMENT", *near(problem, mesh)]
    lines += ["*SURFACE, NAME=MASTER, TYPE=ELEMENT", *(f"{m + i + 1},S2" for i in range(len(triangles)))]
    lines += ["*SURFACE INTERACTION, NAME=LAYER", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines += [f"{number(penalty)},{number(1e-2)},{number(1e-3)}"]
    if problem.friction:
        lines += ["*FRICTION", f"{problem.friction},{number(penalty)}"]
    lines += ["*CONTACT PAIR, INTERACTION=LAYER, TYPE=SURFACE TO SURFACE", "SLAVE,MASTER"]
    lines += ["*BOUNDARY", "HELD,1,3,0."]
    ways = (0.0, -problem.down), (problem.along, -problem.down)
    for (x, z), steps in [each for each in zip(ways, problem.increments, strict=True) if each[1]]:
        lines += ["*STEP, NLGEOM, INC=10000", "*STATIC"]
        increment = number(1 / (finer * steps))
        lines += [f"{increment},1.,1e-6,{increment}"]
        lines += ["*BOUNDARY", f"TOOL,1,1,{number(x)}", "TOOL,2,2,0.", f"TOOL,3,3,{number(z)}"]
        lines += ["*NODE PRINT, NSET=TOOL, TOTALS=ONLY", "RF", "*END STEP"]
    return "\n".join(lines) + "\n"


def near(problem: Problem, mesh: vs.Mesh) -> list[str]:
    """Faces of cells that the tool may come near."""
    cells = {tuple(sorted(cell[face])): (i, k) for i, cell in enumerate(mesh.cells) for k, face in enumerate(FACES)}
    start = problem.start(mesh)
    reach = 1.3 * problem.radius + 0.01
    found = []
    for triangle in mesh.surface:
        x = mesh.points[triangle].mean(axis=0) - start
        along = np.clip(x[0], 0.0, problem.along)
        axis = np.clip(x[1], -problem.length / 2, problem.length / 2)
        if np.hypot(x[0] - along, x[1] - axis) < reach and x[2] > -problem.radius - 2 * problem.down - 0.01:
            cell, k = cells[tuple(sorted(triangle))]
            found.append(f"{cell + 1},S{k + 1}")
    return found


def solve(text: str) -> Floats:
    """The time, over both steps, and the force on the organ (n, 4) after every increment."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "organ.inp").write_text(text, encoding="ascii")
        run = subprocess.run(["ccx", "organ"], cwd=folder, capture_output=True, text=True, check=False)
        printed = (Path(folder) / "organ.dat").read_text(encoding="ascii")
    if run.returncode or "*ERROR" in run.stdout:
        sys.exit(f"ccx did not reach the end:\n{run.stdout[-3000:]}{run.stderr}")
    total = r"total force .* time +(\S+)\n\s*\n?\s+(\S+) +(\S+) +(\S+)"
    return np.array([[float(v) for v in found] for found in re.findall(total, printed)])


def main() -> None:
    data: dict[str, Any] = dict(np.load(DATA)) if DATA.exists() else {}
    version = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout.split()[-1]
    data["versions"] = np.array([f"CalculiX {version}"])
    DECKS.mkdir(parents=True, exist_ok=True)
    meshes = {"liver": vs.organs.liver(), **{name: meshed(edge) for name, edge in EDGES.items()}}
    for mesh in EDGES:
        for key, array in zip(("points", "cells", "hilum"), parts(meshes[mesh]), strict=True):
            data[f"{mesh}/{key}"] = array
    packed = set()
    for name, mesh, factor, finer in CASES:
        if name not in (sys.argv[1:] or PROBLEMS):
            continue
        text = deck(PROBLEMS[name], meshes[mesh], factor * PENALTY, finer)
        if (name, mesh) not in packed:
            (DECKS / f"{name}-{mesh}.inp.xz").write_bytes(lzma.compress(text.encode()))
            packed.add((name, mesh))
        found = data[f"{name}/{mesh}/{factor}/{finer}"] = solve(text)[finer - 1 :: finer]
        print(name, mesh, factor, finer, len(found), found[-1], flush=True)
        np.savez_compressed(DATA, **data)


if __name__ == "__main__":
    main()
