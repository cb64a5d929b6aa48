"""Solves the problems with CalculiX (`ccx` on the path) and writes data/calculix.npz: displacements (n, 3) [m].

Laws that are ours to the letter: *ELASTIC without NLGEOM is linear elasticity, with it Saint Venant-Kirchhoff, and
*HYPERELASTIC, MOONEY-RIVLIN has the volumetric energy (J - 1)^2 / D1, so D1 = 2 / kappa. CalculiX's neo-Hookean solid
splits off the volume and is another law than ours; we do not compare it. Displacements are printed to seven digits.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from problems import (
    PROBLEMS,
    STUDY,
    STUDY_LAWS,
    Problem,
    area_shares,
    nodal_forces,
    prescribed,
    pressed,
    study_data,
)

DATA = Path(__file__).parent / "data" / "calculix.npz"
LAWS = ("linear", "svk", "mr")
FACES = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]
TOLERANCE = 1e-8  # of the residual and of the last correction; the default, 5e-3, is for engineers


def number(value: float) -> str:
    """A number in the 20 characters that CalculiX reads; what is longer it cuts off, exponent and all."""
    return f"{value:.12e}"


def material(problem: Problem, law: str) -> list[str]:
    c1, c2, kappa = problem.mooney_rivlin
    if law == "mr":
        return ["*HYPERELASTIC, MOONEY-RIVLIN", ",".join(map(number, (c1, c2, 2 / kappa)))]
    return ["*ELASTIC", f"{number(problem.young)},{number(problem.poisson)}"]


def means(problem: Problem, free_number: int) -> Iterator[tuple[list[str], list[str]]]:
    """Equations that tie a node of its own to each mean, and the displacement prescribed there."""
    for name, target in problem.mean.items():
        nodes, shares = problem.mesh.nodes(name) + 1, area_shares(problem.mesh, name)
        for axis in (1, 2, 3):
            terms = [f"{node},{axis},{number(share)}" for node, share in zip(nodes, shares, strict=True)]
            terms.append(f"{free_number},{axis},-1.")
            yield ["*EQUATION", str(len(terms)), *terms], [f"{free_number},{axis},{axis},{number(target[axis - 1])}"]


def faces(problem: Problem) -> Iterator[str]:
    """Pressures on faces of cells; CalculiX's face k + 1 of a tetrahedron has the corners FACES[k]."""
    cells = {
        tuple(sorted(cell[face])): (i, k) for i, cell in enumerate(problem.mesh.cells) for k, face in enumerate(FACES)
    }
    for triangle, pressure in pressed(problem):
        cell, k = cells[tuple(sorted(triangle))]
        yield f"{cell + 1},P{k + 1},{number(pressure)}"


def deck(problem: Problem, law: str) -> str:
    mesh = problem.mesh
    n = len(mesh.points)
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i + 1}," + ",".join(map(number, x)) for i, x in enumerate(mesh.points)]
    tied = list(means(problem, n + 1))
    if tied:
        lines += ["*NODE", f"{n + 1},0.,0.,0."]
    lines += ["*ELEMENT, TYPE=C3D4, ELSET=BODY"]
    lines += [f"{i + 1}," + ",".join(str(c + 1) for c in cell) for i, cell in enumerate(mesh.cells.tolist())]
    lines += ["*MATERIAL, NAME=TISSUE", *material(problem, law), "*DENSITY", number(problem.density or 1.0)]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=TISSUE"]
    for equation, _ in tied:
        lines += equation
    increment = 1 / problem.steps
    if law == "linear":
        lines += ["*STEP", "*STATIC"]
    else:
        lines += ["*STEP, NLGEOM, INC=1000", "*STATIC, DIRECT", f"{number(increment)},1."]
        lines += ["*CONTROLS, PARAMETERS=FIELD", f"{number(TOLERANCE)},{number(TOLERANCE)}"]
    target = prescribed(problem)
    lines += ["*BOUNDARY"]
    lines += [f"{i + 1},{a + 1},{a + 1},{number(target[i, a])}" for i, a in np.argwhere(~np.isnan(target)).tolist()]
    for _, boundary in tied:
        lines += boundary
    forces = nodal_forces(problem)
    if forces.any():
        lines += ["*CLOAD"] + [f"{i + 1},{a + 1},{number(forces[i, a])}" for i, a in np.argwhere(forces).tolist()]
    if problem.density:
        size = float(np.linalg.norm(problem.gravity))
        lines += ["*DLOAD", f"BODY,GRAV,{number(size)}," + ",".join(number(g / size) for g in problem.gravity)]
    if problem.pressure:
        lines += ["*DLOAD", *faces(problem)]
    lines += [f"*NODE PRINT, NSET=ALL, FREQUENCY={problem.steps}", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def solve(problem: Problem, law: str) -> np.ndarray:
    """Displacement (n, 3) at full load, as printed."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "organ.inp").write_text(deck(problem, law), encoding="ascii")
        run = subprocess.run(["ccx", "organ"], cwd=folder, capture_output=True, text=True, check=False)
        printed = (Path(folder) / "organ.dat").read_text(encoding="ascii")
    blocks = re.split(r" displacements .* time +(\S+)\n", printed)
    if run.returncode or len(blocks) < 3 or float(blocks[-2]) != 1.0:
        sys.exit(f"ccx did not reach the full load:\n{run.stdout[-2000:]}{run.stderr}")
    table = np.array([line.split() for line in blocks[-1].splitlines() if line.strip()], dtype=float)
    return table[np.argsort(table[:, 0]), 1:]


def main() -> None:
    version = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout.split()[-1]
    stamp = {"versions": np.array([f"CalculiX {version}"])}
    data: dict[str, Any] = dict(stamp)
    for name, problem in PROBLEMS.items():
        for law in [law for law in LAWS if law in problem.laws]:
            data[f"{name}/{law}/u"] = solve(problem, law)
            report(name, law, data[f"{name}/{law}/u"])
    DATA.parent.mkdir(exist_ok=True)
    np.savez_compressed(DATA, **data)
    study: dict[str, Any] = dict(stamp)
    for label, problem in STUDY.items():
        for law in LAWS:
            study[f"{label}/{STUDY_LAWS[law]}"] = solve(problem, law)
            report(label, law, study[f"{label}/{STUDY_LAWS[law]}"])
    np.savez_compressed(study_data("calculix"), **study)


def report(name: str, law: str, u: np.ndarray) -> None:
    print(f"{name:16} {law:7} largest displacement {np.linalg.norm(u, axis=1).max():.7g} m", flush=True)


if __name__ == "__main__":
    main()
