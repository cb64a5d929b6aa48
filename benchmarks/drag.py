"""A capsule dragged over the liver with friction: its mean force beside CalculiX's, mesh by mesh.

    python benchmarks/drag.py [--write]

The problem is "drag" of tests/reference/contact_problems.py: 8 mm down, then 2 cm along with a friction of 0.3.
CalculiX's forces on each mesh, with a penalty of about our layer's and with four times that, are kept in
tests/reference/data; ours are those of settled frames on the same cells.
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


def mesh_of(data: Mapping[str, np.ndarray], name: str) -> vs.Mesh:
    """The built-in liver, or the mesh that is kept with the forces."""
    if name == "liver":
        return vs.organs.liver()
    return vs.mesh(data[f"{name}/points"], data[f"{name}/cells"], {"hilum": data[f"{name}/hilum"]})


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
    for name in MESHES:
        mesh = mesh_of(data, name)
        ours = np.linalg.norm(forces(problem, mesh)[-along:], axis=1).mean()
        known = [data[f"drag/{name}/{k}"] for k in PENALTIES if f"drag/{name}/{k}" in data]
        theirs = [np.linalg.norm(found[-along:, 1:], axis=1).mean() for found in known]
        told = "".join(f"{force:10.3f} ({ours / force:.3f})" for force in theirs)
        lines.append(f"{name:8s}{len(mesh.points):7d}{ours:9.3f}{told}")
        print(lines[-1], file=sys.stderr, flush=True)
    print("\n".join(lines))
    if write:
        (ROOT / "benchmarks" / "results" / "drag.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
