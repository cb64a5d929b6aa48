"""Our organs as FElupe and CalculiX solve them: the committed numbers of tests/reference, which needs neither to run.

FElupe solves the same discrete equations to round-off: 1e-6 of the largest value is asked. CalculiX prints seven
digits, of each component for itself, and stops at corrections of 1e-8: 2e-6.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera import _core

REFERENCE = Path(__file__).resolve().parents[1] / "reference"
TOLERANCE = {"felupe": 1e-6, "calculix": 2e-6}


def _problems() -> ModuleType:
    spec = importlib.util.spec_from_file_location("reference_problems", REFERENCE / "problems.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look themselves up here
    spec.loader.exec_module(module)
    return module


problems = _problems()
DATA = {peer: np.load(REFERENCE / "data" / f"{peer}.npz") for peer in TOLERANCE}
CASES = [(peer, *key.split("/")[:2]) for peer, data in DATA.items() for key in data.files if key.endswith("/u")]


def solve(p: Any, law: str) -> vs.State:
    """A problem through the public interface; only a mean over a set of our own choice needs the core's patch."""
    organ = vs.Organ(p.mesh, p.law(law), fixed=p.fixed, element="P1")
    moved = dict(p.displacement)
    for name, target in p.mean.items():
        moved[_core.Patch(p.mesh.nodes(name), problems.area_shares(p.mesh, name))] = target
    weight = {"gravity": p.gravity, "density": p.density} if p.density else {}
    loads = {"displacement": moved, "force": p.force, "pressure": p.pressure}
    return organ.solve(**loads, steps=min(p.steps, 10), throw=True, **weight)


@pytest.mark.parametrize(("peer", "name", "law"), CASES)
def test_a_peer_finds_the_same_equilibrium(peer: str, name: str, law: str) -> None:
    problem = problems.PROBLEMS[name]
    state = solve(problem, law)
    expected = DATA[peer][f"{name}/{law}/u"]
    deviation = float(np.abs(state.displacement - expected).max() / np.abs(expected).max())
    assert deviation <= TOLERANCE[peer]
    if f"{name}/{law}/reaction" in DATA[peer]:
        reaction = DATA[peer][f"{name}/{law}/reaction"]
        assert state.reaction(problem.fixed) == pytest.approx(reaction, abs=TOLERANCE[peer] * np.linalg.norm(reaction))


@pytest.mark.parametrize("law", problems.STUDY_LAWS)
@pytest.mark.parametrize("label", problems.STUDY)
def test_a_peer_finds_the_same_artery_of_the_study(label: str, law: str) -> None:
    """The protocol of paper B at full drive; CalculiX has three of the laws."""
    u = solve(problems.STUDY[label], law).displacement
    found = {peer: np.load(problems.study_data(peer)) for peer in TOLERANCE}
    name = f"{label}/{problems.STUDY_LAWS[law]}"
    peers = [peer for peer in TOLERANCE if name in found[peer]]
    assert "felupe" in peers
    assert ("calculix" in peers) == (law in {"linear", "svk", "mr"})
    for peer in peers:
        assert np.abs(u - found[peer][name]).max() <= TOLERANCE[peer] * np.abs(found[peer][name]).max()


def test_every_problem_was_solved_by_a_peer_and_most_by_both() -> None:
    solved = {peer: {name for by, name, _ in CASES if by == peer} for peer in TOLERANCE}
    assert solved["felupe"] | solved["calculix"] == set(problems.PROBLEMS)
    assert len(solved["felupe"] & solved["calculix"]) == len(problems.PROBLEMS) - 2
    assert all(DATA[peer]["versions"].size for peer in TOLERANCE)
