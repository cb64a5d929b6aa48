"""Specimens fitted through their own finite-element model: parameters found again, derivatives, and refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.fitting import specimen
from viscera.fitting.families import family
from viscera.fitting.problem import Problem
from viscera.fitting.specimen import SpecimenProblem, cylinder
from viscera.mesh import Floats

RADIUS, HEIGHT, BRICKS = 0.025, 0.03, (2, 2)
TRAVEL = -HEIGHT * np.array([0.04, 0.08, 0.12, 0.16, 0.2])
"""[m], short of the ends of the springs between which the model is solved."""


def measured(law: vs.laws.Law, travel: Floats = TRAVEL) -> vs.SpecimenTest:
    """The curve that a stuck cylinder of this law has, by one static solution a point."""
    organ = vs.Organ(cylinder(RADIUS, HEIGHT, BRICKS), law, fixed="bottom", element="P1 mean volume")
    forces, state = [], None
    for along in travel:
        state = organ.solve(displacement={"top": (0, 0, along)}, start=state, throw=True)
        forces.append(state.reaction("top")[2])
    return vs.SpecimenTest.cylinder(RADIUS, HEIGHT, travel, forces, bricks=BRICKS)


@pytest.mark.parametrize(
    ("law", "terms"),
    [
        (vs.NeoHookean(young=2.9e3, poisson=0.45), None),
        (vs.Yeoh(500.0, 300.0, 100.0, poisson=0.45), 3),
        (vs.Ogden([400.0], [4.0], poisson=0.45), 1),
    ],
    ids=lambda value: type(value).__name__,
)
def test_the_law_of_a_stuck_cylinder_is_found_again(law: vs.laws.Law, terms: int | None) -> None:
    found = vs.fit(type(law), measured(law), terms=terms, poisson=0.45)
    stress = measured(law).stress
    assert found.standard_error < 1e-4 * np.abs(stress).max()
    np.testing.assert_allclose(found.law.core().moduli(), law.core().moduli(), rtol=2e-3)
    assert found.tests[0].n_points == len(TRAVEL)


def test_without_its_plates_the_law_would_be_too_stiff() -> None:
    law = vs.NeoHookean(young=2.9e3, poisson=0.45)
    test = measured(law)
    plain = vs.MaterialTest("uniaxial", test.stretch, test.stress)
    stuck, free = (vs.fit(vs.NeoHookean, each, poisson=0.45).parameters["mu"] for each in (test, plain))
    assert stuck == pytest.approx(1e3, rel=1e-3)
    assert free > 1.3 * stuck


@pytest.mark.parametrize(("name", "terms", "values"), [("Yeoh", 2, (500.0, 90.0)), ("Ogden", 1, (300.0, 5.0))])
def test_derivatives_are_those_of_differences(name: str, terms: int, values: tuple[float, ...]) -> None:
    test = measured(vs.NeoHookean(young=3e3, poisson=0.45))
    problem = SpecimenProblem(family(name, terms), (test,), np.ones(1), 0.45, True)
    at = np.array(values)
    _, exact = problem.derivatives(at)
    for k, value in enumerate(at):
        step = 1e-4 * value * np.eye(len(at))[k]
        (more, _), (less, _) = problem.derivatives(at + step), problem.derivatives(at - step)
        difference = (more - less) / (2e-4 * value)
        np.testing.assert_allclose(exact[:, k], difference, rtol=2e-4, atol=2e-5 * np.abs(difference).max())


def test_specimens_and_homogeneous_tests_are_fitted_together() -> None:
    law = vs.Ogden([400.0], [4.0], poisson=0.45)
    pulled = np.linspace(1.05, 1.4, 6)
    problem = Problem(
        family("Ogden", 1), (vs.MaterialTest("uniaxial", pulled, pulled, "pull"),), np.ones(1), 0.45, True
    )
    pull = vs.MaterialTest("uniaxial", pulled, problem.stress(law), "pull")
    found = vs.fit(vs.Ogden, [measured(law), pull], terms=1, poisson=0.45)
    assert found.parameters["mu1"] == pytest.approx(400.0, rel=5e-3)
    assert found.parameters["alpha1"] == pytest.approx(4.0, rel=5e-3)
    assert found.intervals["alpha1"] is not None


def test_a_range_without_equilibrium_is_named() -> None:
    test = vs.SpecimenTest.cylinder(RADIUS, HEIGHT, 4.5 * TRAVEL, [-1.0, -2.0, -3.0, -5.0, -8.0], bricks=(4, 4))
    with pytest.raises(vs.VisceraError, match=r"cylinder: SaintVenantKirchhoff.* has no equilibrium at a stretch of 0"):
        vs.fit(vs.SaintVenantKirchhoff, test, poisson=0.3, incompressible=False)


def test_a_side_that_would_touch_the_plates_is_told() -> None:
    test = vs.SpecimenTest.cylinder(RADIUS, HEIGHT, -HEIGHT * np.array([0.2, 0.4, 0.6]), [-1.0, -3.0, -9.0])
    with pytest.raises(vs.VisceraError, match=r"at a stretch of 0\.[45]\d* its side bulges .* fit a shorter range"):
        list(test._responses(vs.NeoHookean(young=3e3, poisson=0.499)))


def test_compressed_rubber_may_have_a_negative_first_coefficient() -> None:
    stretch = np.linspace(0.5, 0.95, 10)
    law = vs.MooneyRivlin(-50.0, 300.0, kappa=1e5, volumetric="J-1")
    problem = Problem(family("MooneyRivlin"), (vs.MaterialTest("uniaxial", stretch, stretch),), np.ones(1), 0.45, True)
    found = vs.fit(vs.MooneyRivlin, vs.MaterialTest("uniaxial", stretch, problem.stress(law)))
    assert found.parameters["c1"] == pytest.approx(-50.0, rel=1e-9)
    assert found.parameters["c2"] == pytest.approx(300.0, rel=1e-9)
    assert found.intervals["c1"] is not None


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"moved": [0]}, "the moved place of the specimen holds no triangle"),
        ({"axis": (0, 0, -1)}, "turn the axis"),
        ({"axis": (0, 0, 0)}, "it must not be zero"),
        ({"fixed": "lid"}, "lid"),
        ({"force": [1.0]}, "3 stretches but 1 stresses"),
        ({"travel": [-0.001, -0.002, -0.03]}, "stretch"),
    ],
)
def test_bad_specimens_are_refused(options: dict[str, Any], sentence: str) -> None:
    usual = {"travel": [-0.001, -0.002, -0.003], "force": [-1.0, -2.0, -3.0], "fixed": "bottom", "moved": "top"}
    with pytest.raises(vs.VisceraError, match=sentence):
        vs.SpecimenTest(cylinder(RADIUS, HEIGHT, BRICKS), **{**usual, **options})


@pytest.mark.parametrize("size", [0.0, -1.0, float("nan")])
def test_a_cylinder_has_a_size(size: float) -> None:
    with pytest.raises(vs.VisceraError, match="it must be positive"):
        vs.SpecimenTest.cylinder(size, 0.03, [-0.001, -0.002], [-1, -2])


def softening() -> vs.SpecimenTest:
    """A curve that no law without a negative coefficient follows."""
    test = measured(vs.NeoHookean(mu=1e3, lam=499e3))
    return vs.SpecimenTest.cylinder(
        RADIUS, HEIGHT, TRAVEL, test.stress * test.area * (1.0 - 3.0 * (TRAVEL / HEIGHT) ** 2), bricks=BRICKS
    )


@pytest.mark.parametrize(
    ("name", "terms", "bound"),
    [("ArrudaBoyce", None, {"lambda_m": 20.0}), ("Fung", None, {"b": 0.001}), ("Yeoh", 3, {"c30": 0.0})],
)
def test_a_parameter_of_a_specimen_is_on_its_bound_and_marked(
    name: str, terms: int | None, bound: dict[str, float]
) -> None:
    found = vs.fit(name, softening(), terms=terms)
    assert found.at_bound == tuple(bound)
    for parameter, value in bound.items():
        assert found.parameters[parameter] == pytest.approx(value, rel=1e-9, abs=0.0)
        assert found.intervals[parameter] is None


def test_a_term_on_its_bound_leaves_the_fit_without_it() -> None:
    """Yeoh's law of two terms is that of three with `c30 = 0`."""
    test = softening()
    two, three = (vs.fit(vs.Yeoh, test, terms=terms) for terms in (2, 3))
    assert three.sse == pytest.approx(two.sse, rel=1e-8)  # as far as the derivatives are known
    assert three.parameters["c20"] == pytest.approx(two.parameters["c20"], rel=1e-6)


@pytest.mark.parametrize("coefficients", [(-100.0, 700.0), (700.0, -150.0)])
def test_one_coefficient_of_a_stuck_cylinder_may_be_negative(coefficients: tuple[float, float]) -> None:
    bulk = 4.0 / 3.0 * sum(coefficients) * 1.45 / 0.1
    test = measured(vs.MooneyRivlin(*coefficients, kappa=bulk, volumetric="J-1"))
    found = vs.fit(vs.MooneyRivlin, test, poisson=0.45)
    # As far as the spline gives the points between the solved positions.
    np.testing.assert_allclose(list(found.parameters.values()), coefficients, rtol=1e-4)
    assert found.at_bound == ()
    assert found.intervals["c1"] is not None


def test_no_coefficient_is_negative_where_the_best_sum_would_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """A curve that hardly resists at first, and stiffens more the further it is pulled than the law can."""
    monkeypatch.setattr(specimen, "N_SOLVED", 4)  # quick; the curve is no law's
    travel = -2.0 * TRAVEL
    force = 4e4 * (travel / HEIGHT) ** 3 * np.pi * RADIUS**2
    found = vs.fit(vs.MooneyRivlin, vs.SpecimenTest.cylinder(RADIUS, HEIGHT, travel, force, bricks=BRICKS))
    assert found.at_bound == ("c2",)


def test_the_search_beyond_the_bounds_comes_back_from_laws_without_equilibrium(monkeypatch: pytest.MonkeyPatch) -> None:
    curve, solved = softening(), vs.SpecimenTest._solved

    def failing(test: vs.SpecimenTest, organ: vs.Organ, travel: float, start: Any) -> Any:
        if organ.law.parameters[0].min() < 0.0:
            raise vs.VisceraError("no equilibrium")
        return solved(test, organ, travel, start)

    monkeypatch.setattr(vs.SpecimenTest, "_solved", failing)
    found = vs.fit(vs.MooneyRivlin, curve)
    assert found.at_bound == ("c2",)
    assert found.parameters["c2"] == 0.0
