"""A capsule dragged over the liver with friction: its mean force beside CalculiX's, mesh by mesh.

    python benchmarks/drag.py [--write]

The problem is "drag" of tests/reference/contact_problems.py: 8 mm down, then 2 cm along with a friction of 0.3.
CalculiX's forces on each mesh, with a penalty of about our layer's and with four times that, are kept in
tests/reference/data; ours are those of settled frames on the same cells. CalculiX's force lags behind the tool by
about an increment, so there is also what shorter increments give.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping

import numpy as np
from machine import ROOT, describe

import viscera as vs

REFERENCE = ROOT / "tests" / "reference"
sys.path.insert(0, str(REFERENCE))

from contact_problems import PROBLEMS, forces  # noqa: E402

MESHES = ("coarse", "liver", "fine")
PENALTIES = (1, 4)
FINER = 4
"""Increments of CalculiX in each of ours, of 1 mm."""
INCREMENTS = (1, 4, 8)
"""The same on the coarse mesh."""


def mesh_of(data: Mapping[str, np.ndarray], name: str) -> vs.Mesh:
    """The built-in liver, or the mesh that is kept with the forces."""
    if name == "liver":
        return vs.organs.liver()
    return vs.mesh(data[f"{name}/points"], data[f"{name}/cells"], {"hilum": data[f"{name}/hilum"]})


def mean(forces: np.ndarray) -> float:
    """Of the size of vectors (n, 3)."""
    return float(np.linalg.norm(forces, axis=1).mean())


def main() -> None:
    """One line for each mesh."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true", help="keep it in benchmarks/results")
    write = parser.parse_args().write
    data, problem = np.load(REFERENCE / "data" / "contact.npz"), PROBLEMS["drag"]
    along = problem.increments[1]
    lines = [
        describe(),
        "mean force of a dragged capsule [N], CalculiX's with its penalty and with four times that, and ours over it",
        "mesh      nodes     ours  CalculiX          four times",
    ]
    told = {}
    for name in MESHES:
        mesh = mesh_of(data, name)
        ours = told[name] = mean(forces(problem, mesh)[-along:])
        known = [data[key][-along:, 1:] for k in PENALTIES if (key := f"drag/{name}/{k}/{FINER}") in data]
        theirs = "".join(f"{force:10.3f} ({ours / force:.3f})" for force in map(mean, known))
        lines.append(f"{name:8s}{len(mesh.points):7d}{ours:9.3f}{theirs}")
        print(lines[-1], file=sys.stderr, flush=True)
    for finer in INCREMENTS:
        force = mean(data[f"drag/coarse/1/{finer}"][-along:, 1:])
        lines.append(f"coarse, increments of {1 / finer:5.3f} mm: {force:.3f} ({told['coarse'] / force:.3f})")
    print("\n".join(lines))
    if write:
        (ROOT / "benchmarks" / "results" / "drag.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
