"""Rigid tools on the liver as CalculiX finds them: the numbers kept in tests/reference, which need no other code here.

Both solve the same cells and the same law. They differ in where contact is sampled, in the facets of CalculiX's tool
and in the penalty.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import viscera as vs

REFERENCE = Path(__file__).resolve().parents[1] / "reference"
DATA = np.load(REFERENCE / "data" / "contact.npz")


@pytest.fixture
def problems(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(REFERENCE)
    return importlib.import_module("contact_problems")


def test_a_sphere_pressed_deep_needs_the_force_that_calculix_finds(problems: ModuleType) -> None:
    """2 cm into the liver, a contact as wide as the sphere: 2 % from half the depth on, and 6 % with its direction."""
    theirs = DATA["indentation/liver/1/1"][4:, 1:]
    ours = problems.forces(problems.PROBLEMS["indentation"], vs.organs.liver())[4:]
    sizes = np.linalg.norm(theirs, axis=1)
    assert np.linalg.norm(ours, axis=1) == pytest.approx(sizes, rel=0.02)
    assert (np.linalg.norm(ours - theirs, axis=1) < 0.06 * sizes).all()


def test_a_dragged_capsule_takes_the_mean_force_that_calculix_finds(problems: ModuleType) -> None:
    """2 cm with friction over a dozen triangles, within 5 %; CalculiX goes in steps of a quarter of a millimetre."""
    theirs = DATA["drag/liver/1/4"][-20:, 1:]
    ours = problems.forces(problems.PROBLEMS["drag"], vs.organs.liver())[-20:]
    mean, other = (np.linalg.norm(forces, axis=1).mean() for forces in (ours, theirs))
    assert mean == pytest.approx(other, rel=0.05)
