"""CalculiX (the program `ccx`): a neo-Hookean law whose volumetric energy is in J - 1, as it has no other."""

from __future__ import annotations

import re
import resource
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from viscera.bench.peers import Solution
from viscera.bench.problem import Problem
from viscera.errors import VisceraError
from viscera.mesh import Floats


def solve(problem: Problem, option: str) -> Solution:
    """One analysis of the program, reading and writing included."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "cube.inp").write_text(deck(problem, option), encoding="ascii")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        run = subprocess.run(["ccx", "cube"], cwd=folder, capture_output=True, text=True, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        printed = Path(folder) / "cube.dat"
        if run.returncode or not printed.exists():
            raise VisceraError(f"ccx failed: {(run.stderr or run.stdout).strip()[-200:]}")
        displacement = _displacement(printed.read_text(encoding="ascii"))
    iterations = len(re.findall(r"^ *iteration +\d+$", run.stdout, re.MULTILINE))
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Solution(displacement, iterations, seconds, _version())


def deck(problem: Problem, solver: str) -> str:
    """The input of `ccx`. `C10 = mu/2`, `D1 = 2/kappa` with `kappa = lam + 2/3 mu`."""
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{k + 1}," + ",".join(f"{x:.12e}" for x in point) for k, point in enumerate(problem.points)]
    lines += ["*ELEMENT, TYPE=C3D4, ELSET=BODY"]
    lines += [f"{k + 1}," + ",".join(str(c + 1) for c in cell) for k, cell in enumerate(problem.cells.tolist())]
    bulk = problem.lam + 2 / 3 * problem.mu
    lines += ["*MATERIAL, NAME=TISSUE", "*HYPERELASTIC, NEO HOOKE", f"{problem.mu / 2:.12e},{2 / bulk:.12e}"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=TISSUE", "*STEP, NLGEOM, INC=1000"]
    lines += [f"*STATIC, DIRECT, SOLVER={solver.upper()}", f"{1 / problem.steps},1."]
    lines += ["*CONTROLS, PARAMETERS=FIELD", f"{problem.tolerance:e},{problem.tolerance:e}", "*BOUNDARY"]
    target = problem.prescribed(1.0)
    lines += [f"{k + 1},{a + 1},{a + 1},{target[k, a]:.12e}" for k, a in np.argwhere(problem.held).tolist()]
    return "\n".join([*lines, f"*NODE PRINT, NSET=ALL, FREQUENCY={problem.steps}", "U", "*END STEP", ""])


def _displacement(printed: str) -> Floats:
    blocks = re.split(r" displacements .* time +(\S+)\n", printed)
    if len(blocks) < 3 or float(blocks[-2]) != 1.0:
        raise VisceraError("ccx did not reach the full load")
    table = np.array([line.split() for line in blocks[-1].splitlines() if line.strip()], dtype=float)
    return np.asarray(table[np.argsort(table[:, 0]), 1:])


def _version() -> str:
    return subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout.split()[-1]
