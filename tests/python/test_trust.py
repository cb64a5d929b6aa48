"""The study of trust (benchmarks/trust.py): its bodies, and a twentieth of it with seeds of its own."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from tests.conftest import block

import viscera as vs
from viscera.law import LAWS, Law
from viscera.reduced.check import Full, allowed_error


@pytest.fixture(scope="module")
def trust() -> Iterator[ModuleType]:
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.syspath_prepend(Path(__file__).resolve().parents[2] / "benchmarks")
        yield importlib.import_module("trust")


@pytest.fixture(scope="module")
def rows_of(trust: ModuleType) -> dict[str, list[Any]]:
    """Touches of the smaller bodies, by law."""
    cases = {(case.body, type(case.law).__name__): case for case in trust.study()}
    some = [("coarse block", "NeoHookean"), ("bar", "MooneyRivlin")]
    return {law: trust.ask(cases[body, law].reduce(), 30, 9000 + k) for k, (body, law) in enumerate(some)}


def test_what_is_trusted_is_right(rows_of: dict[str, list[Any]]) -> None:
    for rows in rows_of.values():
        trusted = [row for row in rows if row.is_trusted]
        assert len(rows) > 110
        assert len(trusted) > 0.8 * len(rows)
        assert max(row.excess for row in trusted) <= 1.0


def test_what_is_right_is_trusted(rows_of: dict[str, list[Any]]) -> None:
    """The whole study trusts 98 to 100 % of the right answers of these cases (benchmarks/results/trust.txt)."""
    for law, rows in rows_of.items():
        share = np.mean([row.is_trusted for row in rows if row.is_right])
        assert share > (0.9 if law == "NeoHookean" else 0.8), law
    assert np.median([row.estimate / row.error for rows in rows_of.values() for row in rows]) < 6.0


def test_what_is_wrong_is_not_trusted(trust: ModuleType) -> None:
    """A law that fails in compression, on a coarse mesh: a quarter of the answers are off by more than they may."""
    cases = {(case.body, type(case.law).__name__): case for case in trust.study()}
    rows = trust.ask(cases["coarse block", "SaintVenantKirchhoff"].reduce(), 30, 9002)
    wrong = [row for row in rows if not row.is_right]
    assert len(wrong) > 0.1 * len(rows)
    assert not any(row.is_trusted for row in wrong)
    assert any(row.is_trusted for row in rows)


ISOTROPIC = "mu / 2 * (I1bar - 3) + kappa / 2 * log(J) ** 2"


@pytest.mark.parametrize(
    "law",
    [
        vs.Yeoh(c10=500.0, c20=0.0, c30=500.0, poisson=0.4),  # stiffens one order after the last
        vs.StrainEnergy(f"{ISOTROPIC} + c * (I1bar - 3) ** 4", mu=1e3, kappa=5e3, c=1e4),  # three orders after
        vs.StrainEnergy(f"{ISOTROPIC} + c * (I1bar - 3) ** 4", mu=1e3, kappa=2e3, c=1e7),
    ],
    ids=["next order", "third order", "third order, stiff"],
)
def test_a_stiffening_that_the_orders_do_not_see_is_not_trusted(law: Law) -> None:
    mesh = vs.mesh(*block((5, 5, 5), (0.1, 0.1, 0.1)))
    touch = vs.Organ(mesh, law, fixed="z < 1%").reduce("z > 99%")
    rows = touch.check(touches=20).rows
    off = [max(row.force_error or 0.0, row.displacement_error or 0.0) for row in rows]
    assert max(off) > 2.0 * allowed_error(0.1)
    assert all(row.is_within_limits for row in rows)


def test_the_study_has_ten_bodies_and_every_law_that_can_be_reduced(trust: ModuleType) -> None:
    cases = trust.study()
    bodies = {case.body.partition(",")[0] for case in cases}
    assert len(bodies) == 10
    laws = {type(case.law) for case in cases}
    assert laws == set(LAWS.values()) - {vs.StrainEnergy}
    for body in {case.body for case in cases}:
        assert {type(case.law) for case in cases if case.body == body} == laws
    assert all(case.law.is_analytic for case in cases)


def test_every_case_can_be_touched(trust: ModuleType) -> None:
    for case in trust.bodies():
        organ = vs.Organ(case.mesh(), case.law, fixed=case.fixed, element=case.element)
        assert len(organ.touchable(case.touchable)) > 20, case


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


def test_shares_are_measured_where_orders_are_summed_in_their_pade_form(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    settings: dict[str, Any] = {"touchable": "z > 99 mm and x > 25 cm", "radius": 0.07, "depth": 0.02, "order": 3}
    measured, polynomial = (organ.reduce(**settings, pade=pade).metadata for pade in (True, False))
    assert len(measured["interpolation_shares"]) == 2
    assert all(0.0 < share < 2.0 for share in measured["interpolation_shares"])
    assert 0.0 < measured["truncation_share"] < 2.0
    assert measured["is_pole_aware"]
    assert not {"interpolation_shares", "truncation_share", "is_pole_aware"} & set(polynomial)


def test_an_answer_is_not_trusted_where_a_thin_part_turns_aside() -> None:
    """The margin of the liver, pushed along itself: from 8 % of the diagonal on it leaves the path of the series."""
    liver = vs.organs.liver()
    organ = vs.Organ(liver, vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element="P1")
    point, direction = np.array([-0.0055468, -0.0209482, 0.0743734]), np.array([0.5108337, 0.6746813, -0.5327795])
    near = np.intersect1d(organ.touchable("anterior"), liver.near(point, 0.06 * liver.diagonal))
    touch = organ.reduce(near, depth=0.1 * liver.diagonal, order=4)
    full, patch, state = Full(touch), touch.patch(point), None
    for fraction, is_right in ((0.05, True), (0.075, True), (0.09, False), (0.1, False)):
        push = fraction * liver.diagonal * direction
        state = full.solve(patch, push, state)
        assert state.status == "converged"  # the organ is stable: it turns aside smoothly
        answer, field = touch(point, push), full.added(state)
        error = np.linalg.norm(answer.displacement - field) / np.linalg.norm(field)
        assert (error < allowed_error(fraction)) == is_right
        assert (answer.is_trusted and answer.is_shape_trusted) == is_right
