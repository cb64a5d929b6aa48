"""The search of a fit: exponents through zero, long curves at few stretches, laws that cannot be fitted."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera.cli import fit as command
from viscera.cli import main
from viscera.fitting import condensed
from viscera.fitting.condensed import N_KEPT
from viscera.fitting.families import FAMILIES, family
from viscera.fitting.homogeneous import incompressible_stress
from viscera.fitting.problem import Problem
from viscera.mesh import Floats
from viscera.progress import Progress

SQUEEZED = np.linspace(0.85, 1.0, 30)


def of_ogden(mu: float, alpha: float, stretch: Floats = SQUEEZED) -> vs.MaterialTest:
    """The closed form of one term in uniaxial tension and compression."""
    return vs.MaterialTest("uniaxial", stretch, mu * (stretch ** (alpha - 1.0) - stretch ** (-0.5 * alpha - 1.0)))


@pytest.mark.parametrize("alpha", [0.15, 0.1, 0.05, 0.02, 0.005, -0.05, -0.15])
def test_an_exponent_next_to_zero_is_found_from_either_side(alpha: float) -> None:
    mu = np.copysign(4e4, alpha)
    found = vs.fit("Ogden", of_ogden(mu, alpha), terms=1)
    # The product is found to rounding, and the exponent to that of a stress in proportion to it.
    assert found.parameters == pytest.approx({"mu1": mu, "alpha1": alpha}, rel=1e-7)
    assert found.vanishing == {}
    assert found.intervals["mu1"] is not None


def test_the_limit_of_a_vanishing_exponent_is_the_logarithmic_strain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stress = 6e3 * np.log(SQUEEZED) / SQUEEZED
    found = vs.fit("Ogden", vs.MaterialTest("uniaxial", SQUEEZED, stress), terms=1)
    assert abs(found.parameters["alpha1"]) == pytest.approx(1e-3)
    assert found.parameters["mu1"] * found.parameters["alpha1"] == pytest.approx(4e3, rel=1e-4)
    # A term of exponent a differs from its limit by a ln(stretch) / 4 of itself.
    assert found.stresses[0] == pytest.approx(stress, abs=1e-4 * np.abs(stress).max())
    assert found.vanishing == {"mu1": "alpha1"}
    assert found.intervals["mu1"] is None
    rows = "\n".join(f"{k:.9g},{s:.9g}" for k, s in zip(SQUEEZED, stress, strict=True))
    (tmp_path / "a.csv").write_text(f"stretch,stress\n{rows}\n")
    assert main(["fit", str(tmp_path / "a.csv"), "--law", "Ogden", "--terms", "1"]) == 0
    said = r"\(alpha1 may be 0, the logarithmic strain: the curves determine mu1 alpha1 = (3999|4000)\.\d+ Pa\)"
    assert re.search(said, capsys.readouterr().out)


def test_intervals_of_a_term_are_those_of_its_own_parameters() -> None:
    """Against the derivatives of the closed form in mu and alpha."""
    mu, alpha, k = 700.0, 2.5, np.linspace(0.5, 1.5, 20)
    noise = 5.0 * np.random.default_rng(0).normal(size=20)
    found = vs.fit("Ogden", vs.MaterialTest("uniaxial", k, of_ogden(mu, alpha, k).stress + noise), terms=1)
    mu, alpha = found.parameters.values()
    by_mu = k ** (alpha - 1.0) - k ** (-0.5 * alpha - 1.0)
    by_alpha = mu * np.log(k) * (k ** (alpha - 1.0) + 0.5 * k ** (-0.5 * alpha - 1.0))
    J = np.column_stack([by_mu, by_alpha])
    deviations = found.standard_error * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    for name, value, deviation in zip(("mu1", "alpha1"), (mu, alpha), deviations, strict=True):
        band = found.intervals[name]
        assert band is not None
        assert 0.5 * (band[1] - band[0]) == pytest.approx(2.100922 * deviation, rel=1e-5)  # Student's t, 18 degrees
        assert 0.5 * (band[1] + band[0]) == pytest.approx(value)


def test_one_law_that_cannot_be_fitted_leaves_the_others_ranked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = Problem.best

    def best_of_others(problem: Problem) -> Floats:
        if problem.kind.name == "Ogden":
            raise vs.VisceraError("Ogden has no equilibrium at a stretch of 0.9")
        return best(problem)

    monkeypatch.setattr(Problem, "best", best_of_others)
    stages = list[tuple[int, int, str]]()

    @contextmanager
    def listed(is_quiet: bool) -> Iterator[Progress]:
        yield lambda *event: stages.append(event)

    monkeypatch.setattr(command, "bar", listed)
    test = of_ogden(700.0, 2.5, np.linspace(0.6, 1.4, 20))
    rows = "\n".join(f"{k:.9g},{s:.9g}" for k, s in zip(test.stretch, test.stress, strict=True))
    (tmp_path / "a.csv").write_text(f"stretch,stress\n{rows}\n")
    main(["fit", str(tmp_path / "a.csv"), "--json", str(tmp_path / "r.json")])
    facts = json.loads((tmp_path / "r.json").read_text())
    assert {found["law"] for found in facts["fits"]} == {"NeoHookean", "MooneyRivlin", "Yeoh"}
    assert facts["left_out"] == ["Ogden has no equilibrium at a stretch of 0.9"] * 3
    assert stages == [(done, 7, "fitting laws") for done in range(8)]


@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "pure shear", "simple shear"])
def test_a_condensed_curve_has_the_squared_error_of_all_its_points(mode: str) -> None:
    stretch = np.random.default_rng(0).uniform(0.35, 2.0, 3000) - (1.0 if mode == "simple shear" else 0.0)
    test = vs.MaterialTest(mode, stretch, 1e3 * np.sin(3.0 * stretch))
    short = condensed.condensed(test, 0.7)
    assert len(short.test.stretch) == N_KEPT
    laws = [vs.Ogden(1e3 / alpha, alpha, poisson=0.49) for alpha in (-30.0, -1.0, 2.0, 30.0)]
    for law in [*laws, vs.Yeoh(500.0, 80.0, 20.0, poisson=0.49)]:
        whole = 0.7**2 * np.square(incompressible_stress(law, test) - test.stress).sum()
        few = np.square(short.weighted(incompressible_stress(law, short.test)) - short.target).sum()
        assert few == pytest.approx(whole, rel=1e-12)  # rounding


def test_a_curve_of_few_stretches_is_condensed_to_them() -> None:
    stretch = np.tile([0.8, 0.9, 1.1], 400)
    test = vs.MaterialTest("uniaxial", stretch, np.arange(1200.0))
    short = condensed.condensed(test, 1.0)
    assert short.test.stretch.tolist() == [0.8, 0.9, 1.1]
    whole = np.square(100.0 * (stretch - 1.0) - test.stress).sum()
    few = np.square(short.weighted(100.0 * (short.test.stretch - 1.0)) - short.target).sum()
    assert few == pytest.approx(whole, rel=1e-12)


def test_a_long_curve_is_fitted_as_if_all_its_points_were_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    long = of_ogden(700.0, 2.5, np.linspace(0.5, 1.5, 1000))
    noisy = vs.MaterialTest("uniaxial", long.stretch, long.stress + np.random.default_rng(0).normal(size=1000))
    few = vs.fit("Ogden", noisy, terms=1)
    monkeypatch.setattr(condensed, "SHORT", 1000)
    every = vs.fit("Ogden", noisy, terms=1)
    assert few.parameters == pytest.approx(every.parameters, rel=1e-7)  # as far as the search goes on
    assert few.sse == pytest.approx(every.sse, rel=1e-12)


@pytest.mark.parametrize("law", ["Fung", "VerondaWestmann"])
def test_a_start_whose_stress_no_number_holds_is_passed_over(law: str) -> None:
    stretch = np.linspace(0.4, 1.8, 30)
    exact = (
        vs.laws.Fung(500.0, 0.1, poisson=0.49) if law == "Fung" else vs.laws.VerondaWestmann(300.0, 0.1, poisson=0.49)
    )
    stress = incompressible_stress(exact, vs.MaterialTest("equibiaxial", stretch, stretch))
    found = vs.fit(law, vs.MaterialTest("equibiaxial", stretch, stress))
    assert list(found.parameters.values())[1] == pytest.approx(0.1, rel=1e-6)


def test_a_parameter_at_its_bound_is_marked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A neo-Hookean curve has no exponential stiffening: the smallest `b` is the best."""
    stretch = np.linspace(0.7, 1.5, 9)
    test = vs.MaterialTest("uniaxial", stretch, 1e3 * (stretch - stretch**-2))
    found = vs.fit(vs.Fung, test)
    assert found.at_bound == ("b",)
    assert found.intervals["b"] is None
    assert "b=0.001 (at its bound);" in repr(found)
    assert "mu=999.654," in repr(found)
    assert vs.fit(vs.NeoHookean, test).at_bound == ()
    np.savetxt(
        tmp_path / "a.csv", np.column_stack([stretch, test.stress]), delimiter=",", header="stretch,stress", comments=""
    )
    assert main(["fit", str(tmp_path / "a.csv"), "--law", "Fung", "--json", str(tmp_path / "r.json")]) == 0
    assert "b = 0.001   (no interval: at its bound)" in capsys.readouterr().out
    assert json.loads((tmp_path / "r.json").read_text())["fits"][0]["at_bound"] == ["b"]


def test_the_page_names_the_bounds_of_exponents() -> None:
    page = " ".join((Path(__file__).parents[2] / "docs/measured-laws.md").read_text(encoding="utf-8").split())
    bullet = page[page.index("Exponents are searched within a range") :].partition(" - **")[0]
    named = {"Ogden": "`alpha_p`", "Fung": "`b`", "VerondaWestmann": "`c2`", "ArrudaBoyce": "`lambda_m`"}
    assert {name for name in FAMILIES if family(name).exponents} == set(named)
    for law, parameter in named.items():
        for low, high in family(law).exponent_bounds:
            assert re.search(rf"{parameter}( and \S+ `c2`)? from {low:g} to {high:g}\b", bullet), law
