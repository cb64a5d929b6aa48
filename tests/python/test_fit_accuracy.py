"""What a fit says of itself: intervals beside bounds, parameters not told apart, and a law off the curve of its fit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera.cli import main
from viscera.fitting.accuracy import confused, without_sign
from viscera.fitting.families import family
from viscera.fitting.homogeneous import incompressible_stress
from viscera.fitting.problem import Problem
from viscera.mesh import Floats


def noisy(mode: str, law: vs.laws.Law, parameter: Floats, noise: float, seed: int = 0) -> vs.MaterialTest:
    """The law's own curve with Gaussian noise [Pa]."""
    exact = incompressible_stress(law, vs.MaterialTest(mode, parameter, parameter))
    return vs.MaterialTest(mode, parameter, exact + noise * np.random.default_rng(seed).normal(size=len(exact)), mode)


def test_intervals_beside_a_parameter_at_its_bound_hold_the_truth() -> None:
    stretch, truths = np.linspace(0.7, 0.98, 15), {"c10": 500.0, "c20": 100.0}
    law, bands = vs.Yeoh(500.0, 100.0, 50.0, poisson=0.49), []
    for seed in range(150):
        intervals = vs.fit("Yeoh", noisy("uniaxial", law, stretch, 10.0, seed)).intervals
        if intervals["c30"] is None:
            bands.append([intervals[name] for name in truths])
    assert len(bands) > 20
    for told, truth in zip(np.array(bands, dtype=float).transpose(1, 0, 2), truths.values(), strict=True):
        assert np.mean((told[:, 0] <= truth) & (truth <= told[:, 1])) >= 0.93


@pytest.mark.parametrize("modes", [("simple shear",), ("pure shear",), ("simple shear", "pure shear")])
def test_tests_that_do_not_tell_parameters_apart_are_refused(modes: tuple[str, ...]) -> None:
    law = vs.MooneyRivlin(300.0, 200.0, kappa=1e6)
    parameters = {"simple shear": np.linspace(0.05, 0.8, 15), "pure shear": np.linspace(1.05, 1.8, 15)}
    tests = [noisy(mode, law, parameters[mode], 1.0) for mode in modes]
    with pytest.raises(
        vs.VisceraError, match="do not tell c1 and c2 of MooneyRivlin apart; add a test of another kind"
    ):
        vs.fit("MooneyRivlin", tests)
    found = vs.fit("MooneyRivlin", [*tests, noisy("uniaxial", law, np.linspace(0.5, 1.8, 30), 1.0)])
    assert found.parameters["c1"] == pytest.approx(300.0, rel=0.02)


@pytest.mark.parametrize("modes", [("simple shear",), ("pure shear",), ("simple shear", "pure shear")])
@pytest.mark.parametrize("terms", [1, 2])
def test_shear_does_not_tell_the_sign_of_an_exponent(modes: tuple[str, ...], terms: int) -> None:
    """A term and that of the other sign are one curve in shear, and apart in tension, which then decides."""
    mu, alpha = [-500.0, 30.0][:terms], [-2.0, 7.0][:terms]
    law, twin = vs.Ogden(mu, alpha, poisson=0.499), vs.Ogden([500.0, *mu[1:]], [2.0, *alpha[1:]], poisson=0.499)
    parameters = {"simple shear": np.linspace(0.05, 0.8, 15), "pure shear": np.linspace(0.6, 1.6, 20)}
    tests = [noisy(mode, law, parameters[mode], 5.0) for mode in modes]
    for test in tests:
        assert incompressible_stress(twin, test) == pytest.approx(incompressible_stress(law, test), rel=1e-9)
    with pytest.raises(
        vs.VisceraError, match=r"do not tell the sign of alpha.* of Ogden: -mu\d, -alpha\d.*; add a uniaxial or an equi"
    ):
        vs.fit("Ogden", tests, terms=terms)
    pull = noisy("uniaxial", law, np.linspace(0.7, 1.4, 12), 5.0)
    assert incompressible_stress(twin, pull)[0] != pytest.approx(incompressible_stress(law, pull)[0], rel=0.2)
    found = vs.fit("Ogden", [*tests, pull], terms=terms)
    assert terms == 2 or found.parameters["alpha1"] == pytest.approx(-2.0, abs=0.1)


def test_the_ranking_passes_over_what_shear_does_not_determine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    test = noisy("pure shear", vs.Ogden(-500.0, -2.0, poisson=0.499), np.linspace(0.6, 1.6, 21), 5.0)
    rows = "\n".join(f"{k:.9g},{s:.9g}" for k, s in zip(test.stretch, test.stress, strict=True))
    (tmp_path / "a.csv").write_text(f"stretch,stress\n{rows}\n")
    assert main(["fit", str(tmp_path / "a.csv"), "--mode", "pure shear"]) == 0
    said = capsys.readouterr().out
    assert "left out: these tests do not tell the sign of alpha1 of Ogden: -mu1, -alpha1 give the same curves" in said
    assert "Ogden (" not in said


def test_signs_that_make_one_law_are_no_fault_of_the_tests() -> None:
    """Next to zero both are that of the logarithmic strain; a term without a coefficient has none. A pair of both signs
    is its own twin, but not that of two equal terms."""
    test = noisy("pure shear", vs.Ogden(1e3, 2.0, poisson=0.499), np.linspace(0.6, 1.6, 21), 0.0)
    one, two = (Problem(family("Ogden", terms), (test,), np.ones(1), 0.499, True) for terms in (1, 2))
    assert without_sign(one, np.array([1e3, 1e-3])) == []
    assert without_sign(one, np.array([1e3, 0.1])) == ["alpha1"]
    assert without_sign(two, np.array([1e3, 0.0, 2.0, 5.0])) == ["alpha1"]
    assert without_sign(two, np.array([1e3, 1e3, 3.0, -3.0])) == ["alpha1", "alpha2"]


def test_a_compressible_law_has_a_sign_in_pure_shear_alone() -> None:
    """The volume of a stretched sheet changes, as the law has it; that of simple shear does not."""
    law = vs.Ogden(-500.0, -2.0, poisson=0.4)
    stretch, stress = law.curve("pure shear", (0.7, 1.5))
    pure = vs.MaterialTest("pure shear", stretch, stress)
    found = vs.fit("Ogden", pure, terms=1, poisson=0.4, incompressible=False)
    assert found.parameters["alpha1"] == pytest.approx(-2.0, rel=1e-4)
    simple = noisy("simple shear", law, np.linspace(0.05, 0.8, 15), 0.0)
    with pytest.raises(vs.VisceraError, match="do not tell the sign of alpha1"):
        vs.fit("Ogden", simple, terms=1, poisson=0.4, incompressible=False)


def test_shear_to_both_sides_says_no_more_than_to_one() -> None:
    two_sided = vs.MaterialTest("simple shear", [-0.2, -0.1, 0.1, 0.2], [-202, -99, 101, 200])
    with pytest.raises(vs.VisceraError, match="points at 2 stretches off rest"):
        vs.fit("Yeoh", two_sided)
    assert vs.fit("Yeoh", two_sided, terms=2).is_ranked
    stretch = np.array([1.0 / 1.2, 1.0 / 1.1, 1.1, 1.2])  # the invariants of k and 1 / k in pure shear are the same
    reciprocal = vs.MaterialTest("pure shear", stretch, 1000.0 * (stretch - stretch**-3))
    with pytest.raises(vs.VisceraError, match="do not tell c10 and c20 and c30 of Yeoh apart"):
        vs.fit("Yeoh", reciprocal)
    assert vs.fit("Yeoh", reciprocal, terms=2).is_ranked


def test_laws_of_many_terms_are_found_from_a_test_that_hardly_tells_them_apart() -> None:
    test = noisy("simple shear", vs.Ogden([700.0, -60.0], [2.5, -4.0], poisson=0.49), np.linspace(0.01, 0.2, 15), 0.0)
    problem = Problem(family("Ogden", 3), (test,), np.ones(1), 0.499, True)
    error = problem.derivatives(problem.best())[0] - test.stress
    assert np.linalg.norm(error) / np.sqrt(test.n_points - 6) < 0.01


def test_terms_that_no_test_would_tell_apart_are_no_fault_of_the_tests() -> None:
    stretch = np.linspace(0.6, 1.5, 10)
    test = vs.MaterialTest("uniaxial", stretch, 900.0 * (stretch - stretch**-2))
    alike = Problem(family("Ogden", 2), (test,), np.ones(1), 0.499, True)
    values = np.array([500.0, 400.0, 2.0, 2.0])
    assert confused(alike, values, alike.derivatives(values)[1]) == []
    assert vs.fit("Ogden", test, terms=3).standard_error < 1e-6


def test_a_compressible_law_that_misses_the_curve_of_its_fit_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stretch = np.linspace(0.6, 1.4, 9)
    test = vs.MaterialTest("uniaxial", stretch, 900.0 * (stretch - stretch**-2))
    for poisson in (0.3, 0.45, 0.499):
        found = vs.fit("NeoHookean", test, poisson=poisson)
        own = found.law.curve("uniaxial", (0.6, 1.0))[1][0]
        off = abs(own / test.stress[0] - 1.0)
        assert found.compressibility_error == pytest.approx(off, rel=1e-3)
        assert found.is_followed_by_law == (off < 0.02) == (poisson == 0.499)
        assert (f"law with its bulk modulus up to {off:.1%} off" in repr(found)) != found.is_followed_by_law
    compressible = vs.fit("NeoHookean", test, poisson=0.3, incompressible=False)
    assert compressible.is_followed_by_law
    shear = vs.MaterialTest("simple shear", [0.1, 0.2], [90.0, 180.0])  # keeps the volume
    assert vs.fit("NeoHookean", shear, poisson=0.3).compressibility_error == pytest.approx(0.0, abs=1e-9)
    rows = "\n".join(f"{k:.9g},{s:.9g}" for k, s in zip(stretch, test.stress, strict=True))
    (tmp_path / "a.csv").write_text(f"stretch,stress\n{rows}\n")
    words = ["fit", str(tmp_path / "a.csv"), "--law", "NeoHookean", "--json", str(tmp_path / "r.json")]
    for options, is_told in ((["--poisson", "0.3"], True), ([], False)):
        assert main([*words, *options]) == 0
        assert ("up to 25.5% of the largest stress off the fit" in capsys.readouterr().out) == is_told
        (facts,) = json.loads((tmp_path / "r.json").read_text())["fits"]
        assert facts["followed_by_law"] != is_told


def test_compressible_laws_are_fitted_from_the_shell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    law = vs.SaintVenantKirchhoff(mu=1200.0, lam=1800.0)
    stretch, stress = law.curve("uniaxial", (0.85, 1.4))
    rows = "\n".join(f"{k:.12g},{s:.12g}" for k, s in zip(stretch, stress, strict=True))
    (tmp_path / "a.csv").write_text(f"stretch,stress\n{rows}\n")
    words = ["fit", str(tmp_path / "a.csv"), "--poisson", "0.3", "--json", str(tmp_path / "r.json")]
    assert main([*words, "--law", "SaintVenantKirchhoff"]) == 2
    assert "no incompressible form; fit it with incompressible=False, in the shell with --compressible" in (
        capsys.readouterr().err
    )
    assert main([*words, "--law", "SaintVenantKirchhoff", "--compressible"]) == 0
    (facts,) = json.loads((tmp_path / "r.json").read_text())["fits"]
    assert facts["parameters"]["mu"] == pytest.approx(1200.0, rel=1e-8)
    assert main([*words, "--compressible"]) == 2
    assert "--compressible belongs to one law; name it with --law" in capsys.readouterr().err
    assert main([*words, "--law", "MooneyRivlin", "--compressible"]) == 2
    assert "fit it without incompressible=False, in the shell without --compressible" in capsys.readouterr().err
