"""Values that a mask declares invalid are refused: NumPy forgets masks, and takes what is under them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import viscera as vs

LAW = vs.NeoHookean(young=1e5, poisson=0.3)


def masked(values: Any) -> Any:
    """An array whose last entry is masked."""
    array = np.ma.array(values)
    array[-1:] = np.ma.masked
    return array


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, LAW, "root")


CALLS: dict[str, Callable[[vs.Organ], Any]] = {
    "points must be rows": lambda organ: vs.mesh(masked(organ.mesh.points), organ.mesh.cells),
    "cells must be rows": lambda organ: vs.mesh(organ.mesh.points, masked(organ.mesh.cells)),
    "set 'a' must be": lambda organ: vs.mesh(organ.mesh.points, organ.mesh.cells, {"a": masked([1, 2])}),
    "test: stress must be": lambda _: vs.MaterialTest("uniaxial", [0.9, 1.1], masked([-1.0, 1.0])),
    "young must be": lambda organ: vs.NeoHookean(young=masked(np.full(len(organ.mesh.cells), 1e4)), poisson=0.3),
    "poisson must be": lambda _: vs.NeoHookean(young=1e4, poisson=masked([0.3])[0]),
    "gravity must be": lambda organ: organ.solve(gravity=masked([0.0, 0.0, 1.0]), density=1e3),
    "some of it is masked": lambda organ: organ.solve(force=masked(np.ones_like(organ.mesh.points))),
    "density must be": lambda organ: organ.solve(
        gravity=(0, 0, 1), density=masked(np.full(len(organ.mesh.cells), 1e3))
    ),
    "a place must be": lambda organ: organ.solve(force=[(masked([1, 2]), (0, 0, 1))]),
    "must be a list of nodes": lambda organ: organ.mesh.nodes(masked([1, 2])),
    "of a predicate must be": lambda organ: organ.mesh.nodes(lambda x: masked(x[:, 0] > 0.1)),
    "of `moved` must be": lambda organ: organ.moved(masked(np.zeros_like(organ.mesh.points))),
    "the places must be": lambda organ: organ.moved(np.zeros_like(organ.mesh.points)).at(
        masked([[0.1, 0.05, 0.05]] * 2)
    ),
    "surface must be (list)": lambda organ: organ.register([*masked(organ.mesh.points[:9])], noise=1e-3),
    "surface must be": lambda organ: organ.register(masked(organ.mesh.points[:9]), noise=1e-3),
    "values of a label map": lambda _: vs.Scan(masked(np.ones((3, 3, 3), dtype=int)), np.eye(3, 4) * 1e-3),
    "velocity must be": lambda organ: setattr(
        organ.stepper(density=1e3, time_step=0.1, dynamics="newmark"),
        "velocity",
        masked(np.zeros_like(organ.mesh.points)),
    ),
    "position of a tool must be": lambda _: vs.Tool(vs.Sphere(0.1), position=masked([0.0, 0.0, 1.0])),
}


@pytest.mark.parametrize("words", CALLS)
def test_what_is_masked_is_refused(organ: vs.Organ, words: str) -> None:
    with pytest.raises(vs.VisceraError) as refusal:
        CALLS[words](organ)
    assert "is masked; leave those values out, or replace them" in str(refusal.value)
    assert words.removesuffix(" (list)") in str(refusal.value)


def test_an_array_without_anything_masked_is_taken(organ: vs.Organ) -> None:
    assert np.array_equal(organ.mesh.nodes(np.ma.array([1, 2])), [1, 2])
    assert not organ.moved(np.ma.array(np.zeros_like(organ.mesh.points))).displacement.any()
