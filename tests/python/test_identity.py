"""Objects that hold arrays are compared by identity: equal arrays have no one truth value, and NumPy would raise."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import pytest

import viscera as vs

ARRAYS = ("Floats", "Indices", "NDArray")
NOT_NEEDED = ("viscera.__main__", "viscera.bench.peers.", "viscera.libviscera")
"""A program, modules that import codes which may not be installed, and a library that is no module."""


def kinds() -> Iterator[type]:
    """All dataclasses of the package."""
    for module in pkgutil.walk_packages(vs.__path__, "viscera."):
        if not module.name.startswith(NOT_NEEDED):
            for thing in vars(importlib.import_module(module.name)).values():
                if isinstance(thing, type) and is_dataclass(thing) and thing.__module__ == module.name:
                    yield thing


def test_no_dataclass_compares_its_arrays() -> None:
    found = list(kinds())
    assert {vs.Frame, vs.MaterialTest} <= set(found)
    assert [
        kind.__qualname__
        for kind in found
        for field in fields(kind)
        if any(word in str(field.type) for word in ARRAYS) and "Callable" not in str(field.type)
        if "__eq__" in vars(kind)
    ] == []


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), "root")


def frame(organ: vs.Organ) -> vs.Frame:
    return organ.stepper().frame({"tip": (None, None, -1e-3)})


def contact(organ: vs.Organ) -> Any:
    tool = vs.Tool(vs.Sphere(0.03), position=(0.35, 0.05, 0.14))
    return organ.solve(contact=[tool]).contact(tool)


MADE: dict[str, Callable[[vs.Organ], Any]] = {
    "a frame": frame,
    "a contact": contact,
    "values at points": lambda organ: organ.moved(0.0 * organ.mesh.points).at([[0.2, 0.05, 0.05]]),
    "a path": lambda organ: organ.path(force={"tip": (0, 0, -1.0)}, order=3),
    "an expansion": lambda organ: organ.path(force={"tip": (0, 0, -1.0)}, order=3).expansions[0],
    "an unloaded organ": lambda organ: organ.unloaded(gravity=(0, 0, -1.0), density=100),
    "a material test": lambda _: vs.MaterialTest("uniaxial", [0.9, 1.1, 1.2], [-340, 280, 494]),
    "a fit": lambda _: vs.fit(vs.NeoHookean, [vs.MaterialTest("uniaxial", [0.9, 1.1, 1.2], [-340, 280, 494])]),
    "a comparison": lambda organ: vs.compare(
        organ, laws={"one": organ.law}, reference="one", force={"tip": (0, 0, -0.1)}
    ),
}


@pytest.mark.parametrize("what", MADE)
def test_results_are_compared_and_collected(organ: vs.Organ, what: str) -> None:
    one, other = MADE[what](organ), MADE[what](organ)
    assert one == one
    assert one != other
    assert other in [one, other]
    assert len({one, other, one}) == 2
