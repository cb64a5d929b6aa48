"""The study of trust (benchmarks/trust.py): its bodies, its touches, and what it makes of them."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest


@pytest.fixture(scope="module")
def trust() -> Iterator[ModuleType]:
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.syspath_prepend(Path(__file__).resolve().parents[2] / "benchmarks")
        yield importlib.import_module("trust")


def test_the_study_has_ten_bodies_and_every_law_that_can_be_reduced(trust: ModuleType) -> None:
    cases = trust.study()
    bodies = {case.body.partition(",")[0] for case in cases}
    assert len(bodies) == 10
    assert len({type(case.law).__name__ for case in cases}) == 8
    assert all(case.law.is_analytic for case in cases)


def test_meshes_that_are_made_are_sound(trust: ModuleType) -> None:
    made = {case.mesh for case in [*trust.study(), *trust.tuning()] if case.mesh.__module__ == "trust"}
    assert len(made) > 10
    for make in made:
        mesh = make()
        x = mesh.points[mesh.cells]
        assert (np.linalg.det(x[:, 1:] - x[:, :1]) > 0.0).all(), make.__name__
        assert len(mesh.sets["held"]) > 3


def test_a_linear_organ_is_trusted_and_right(trust: ModuleType) -> None:
    case = next(case for case in trust.study() if type(case.law).__name__ == "Linear")
    rows = trust.ask(case.reduce(), 4, 1)
    assert len(rows) == 4 * len(trust.DEPTHS)
    assert all(row.is_right and row.is_trusted for row in rows)
    assert max(row.error for row in rows) < 2e-3


def test_the_bound_is_that_of_poisson(trust: ModuleType) -> None:
    assert trust.bound(0, 1000) == pytest.approx(-np.log(0.05) / 1000)
    assert trust.bound(3, 1000) == pytest.approx(7.7537 / 1000, rel=1e-4)  # half the chi-square quantile of 8 degrees
