"""Every reference solution of codes that are not ours: FElupe, NGSolve, scikit-fem, CalculiX and SOFA.

All solve the same discrete problem (linear tetrahedra, displacements only), so nothing but round-off and the digits
that a code prints is allowed for. The first three agree with each other to 1e-13; we ask for 1e-6 of the largest value.
"""

from __future__ import annotations

import json
import os
from functools import cache
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

import viscera as vs
from viscera.law import Law

FOLDER = Path(os.environ.get("VISCERA_SHARED", Path(__file__).resolve().parents[3] / "shared")) / "reference"
CASES = sorted(path.stem.removesuffix("_u") for path in FOLDER.glob("*_u.npz")) or ["none: skipped"]
TOLERANCE = 1e-6
PRINTED = {"CalculiX": 5e-6}  # seven digits of each displacement, reactions summed over up to 350 nodes
SETTINGS = {"tolerance": 1e-10}


@cache
def mesh(path: Path, scale: float = 1.0) -> vs.Mesh:
    grid = meshio.read(path)
    return vs.mesh(np.array(grid.points, dtype=float) * scale, np.array(grid.cells_dict["tetra"]))


def law(case: dict[str, Any]) -> Law:
    name, lame, parameters = case["law"]["name"], case["law"]["lame"], case["law"]["parameters"]
    if name == "mr":
        return vs.MooneyRivlin(parameters["c1"], parameters["c2"], parameters["kappa"], volumetric="J-1")
    if name == "mra":
        return vs.MooneyRivlin(parameters["c1"], parameters["c2"], alpha=parameters["alpha"], volumetric="J^2-1")
    laws = {"linear": vs.Linear, "svk": vs.SaintVenantKirchhoff, "nh": vs.NeoHookean}
    return laws[name](mu=lame["mu"], lam=lame["lambda"])


def supports(case: dict[str, Any]) -> dict[str, list[float | None]]:
    """Prescribed components at load 1 by node set; None where free."""
    values: dict[str, list[float | None]] = {}
    for entry in case["dirichlet"]:
        values.setdefault(entry["set"], [None] * 3)["xyz".index(entry["component"])] = entry["value_at_load_1"]
    return values


def steps_to(load: float, previous: float, case: str) -> list[float]:
    """Load levels on the way. The artery buckles between 0.1 and 0.2: larger steps may find another equilibrium."""
    if not case.startswith("artery") or load <= previous:
        return [load]
    count = int(np.ceil((load - previous) / (0.0125 if load <= 0.25 else 0.05) - 1e-9))
    return list(np.linspace(previous, load, count + 1)[1:])


@pytest.mark.parametrize("name", CASES)
def test_equilibria_are_those_of_other_codes(name: str, shared: Path) -> None:
    """All nodes and levels against the field stored; named nodes, reactions and strain energy against each code."""
    case = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    full = np.load(FOLDER / f"{name}_u.npz")
    sets = {key: np.array(nodes) for key, nodes in case["node_sets"].items()}
    held = supports(case)
    (fixed,) = (key for key, values in held.items() if values == [0.0, 0.0, 0.0])
    organ = vs.Organ(mesh((FOLDER / case["mesh"]["file"]).resolve()), law(case), fixed=sets[fixed], element="P1")

    unit = np.zeros_like(organ.mesh.points)
    if case["nodal_forces_at_load_1"]["nodes"]:
        unit[case["nodal_forces_at_load_1"]["nodes"]] = case["nodal_forces_at_load_1"]["force"]
    body = {key: case["body_force"][key] for key in ("gravity", "density")} if case["body_force"] else {}

    state, previous = None, 0.0
    for level, (load, expected) in enumerate(zip(full["loads"], full["u"], strict=True)):
        for step in steps_to(load, previous, name):
            moved = {
                tuple(sets[key]): [None if v is None else v * step for v in values]
                for key, values in held.items()
                if key != fixed
            }
            state = organ.solve(
                displacement=moved, force=unit * step, start=state, settings=SETTINGS, throw=True, **body
            )
        previous = load
        assert state is not None
        assert np.abs(state.displacement - expected).max() <= TOLERANCE * np.abs(expected).max(), f"load {load}"
        for result in case["results"]:
            compare(state, result["levels"][level], {k: (sets[k], v) for k, v in held.items()}, result["code"])


def compare(state: vs.State, level: dict[str, Any], held: dict[str, Any], code: str) -> None:
    """Named nodes, reactions at constrained components and strain energy of one code at one load."""
    where = f"{code} at load {level['load']}"
    tolerance = PRINTED.get(code.split()[0], TOLERANCE)
    nodes = np.array(list(level["u"]), dtype=int)
    expected = np.array(list(level["u"].values()))
    assert np.abs(state.displacement[nodes] - expected).max() <= tolerance * np.abs(expected).max(), where
    if level["energy"] is not None:  # CalculiX gives none for the nonlinear laws
        assert state.energy == pytest.approx(level["energy"], rel=tolerance), where
    constrained = [
        (state.reaction(nodes)[axis], level["reaction"][key][axis])
        for key, (nodes, values) in held.items()
        for axis in range(3)
        if values[axis] is not None
    ]
    ours, theirs = np.array(constrained).T
    assert np.abs(ours - theirs).max() <= tolerance * np.abs(theirs).max(), where


@pytest.mark.parametrize("index", range(5))
def test_sofa_finds_the_same_statics(index: int, shared: Path) -> None:
    """A liver pulled at its tip, to the digits printed: nine of the tip's displacement, six of the largest."""
    sheet = json.loads((FOLDER / "sofa_static.json").read_text(encoding="utf-8"))
    case, parameters = sheet["results"][index], sheet["parameters"]
    organ_mesh = mesh((FOLDER / case["mesh"]).resolve(), case["scale"])
    points, boundary = organ_mesh.points, organ_mesh.surface_nodes
    axis = int(np.argmax(np.ptp(points, axis=0)))
    length = np.ptp(points[:, axis])
    fixed = np.flatnonzero(points[:, axis] < points[:, axis].min() + 0.1 * length)
    tip = boundary[np.argmax(points[boundary, axis])]
    distance = np.linalg.norm(points[boundary] - points[tip], axis=1)
    patch = boundary[distance < max(0.12 * length, np.sort(distance)[3] * (1 + 1e-12))]
    assert [len(fixed), tip, len(patch)] == [case["fixed_nodes"], case["tip"], case["patch_nodes"]]

    laws = {"linear": vs.Linear, "svk": vs.SaintVenantKirchhoff, "nh": vs.NeoHookean}
    material = laws[case["law"]](young=parameters["E"], poisson=parameters["nu"])
    organ = vs.Organ(organ_mesh, material, fixed=fixed, element="P1")
    force = np.zeros_like(points)
    force[patch] = np.array(case["load"]) / len(patch)
    state = organ.solve(force=force, settings=SETTINGS, throw=True)
    assert state.displacement[tip] == pytest.approx(case["u_tip"], abs=1e-8 * np.linalg.norm(case["u_tip"]))
    assert state.max_displacement == pytest.approx(case["max_u"], rel=1e-6)
