"""Parameters of laws at the boundary: conversions, per-cell values, refusals; and the formulas of the docstrings."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera import laws

F = np.eye(3) + 0.1 * np.random.default_rng(3).standard_normal((4, 3, 3))


def invariants(F: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    C = F.transpose(0, 2, 1) @ F
    trace = np.trace(C, axis1=1, axis2=2)
    return trace, 0.5 * (trace**2 - np.trace(C @ C, axis1=1, axis2=2)), np.linalg.det(F)


def test_young_and_poisson_are_the_lame_constants() -> None:
    law = vs.NeoHookean(young=2.6e5, poisson=0.3)
    assert law.mu == pytest.approx(1e5)
    assert law.lam == pytest.approx(1.5e5)
    assert vs.Linear(mu=law.mu, lam=law.lam).parameters.tolist() == law.parameters.tolist()


@pytest.mark.parametrize("kind", [vs.Linear, vs.Corotated, vs.SaintVenantKirchhoff, vs.NeoHookean])
@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"young": 0.0, "poisson": 0.3}, "young is 0"),
        ({"young": -1.0, "poisson": 0.3}, "young is -1"),
        ({"young": np.nan, "poisson": 0.3}, "young is nan; it must be finite"),
        ({"young": 1e5, "poisson": 0.5}, "poisson is 0.5; it must lie above -1 and below 0.5"),
        ({"young": 1e5, "poisson": -1.0}, "poisson is -1"),
        ({"young": [1e5, 1e5, -2.0], "poisson": 0.3}, "young of cell 2 is -2"),
        ({"young": [1e5, 1e5], "poisson": [0.3, 0.3, 0.3]}, "different lengths"),
        ({"mu": 0.0, "lam": 1.0}, "mu is 0"),
        ({"mu": 3.0, "lam": -2.0}, "lam is -2"),
        ({"young": 1e5}, "either young and poisson, or mu and lam"),
        ({"young": 1e5, "poisson": 0.3, "mu": 1.0}, "either young and poisson, or mu and lam"),
    ],
)
def test_impossible_parameters_are_refused(kind: type, parameters: dict[str, Any], words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        kind(**parameters)


def test_mooney_rivlin_bulk_modulus_by_volumetric_form() -> None:
    for form, factor in {"J^2-1": 4.0, "J-1": 1.0, "ln J": 1.0}.items():
        assert vs.MooneyRivlin(1.0, 0.5, alpha=2.0, volumetric=form).parameters.tolist() == [[1.0, 0.5, 2.0 * factor]]
        assert vs.MooneyRivlin(1.0, 0.5, 7.0, volumetric=form).parameters.tolist() == [[1.0, 0.5, 7.0]]


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"c1": 1.0, "c2": 0.0}, "either kappa or alpha"),
        ({"c1": 1.0, "c2": 0.0, "kappa": 1.0, "alpha": 1.0}, "either kappa or alpha"),
        ({"c1": 1.0, "c2": -1.0, "kappa": 1.0}, r"c1 \+ c2 is 0"),
        ({"c1": 1.0, "c2": 0.0, "kappa": 0.0}, "bulk modulus is 0"),
        ({"c1": 1.0, "c2": 0.0, "kappa": 1.0, "volumetric": "lnJ"}, "did you mean 'ln J'"),
    ],
)
def test_mooney_rivlin_refusals(parameters: dict[str, Any], words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        vs.MooneyRivlin(**parameters)


def test_neo_hookean_energy_is_its_formula() -> None:
    law = vs.NeoHookean(mu=3.0, lam=5.0)
    I1, _, J = invariants(F)
    assert law.energy(F) == pytest.approx(1.5 * (I1 - 3) - 3 * np.log(J) + 2.5 * np.log(J) ** 2, rel=1e-12)


@pytest.mark.parametrize("form", ["J^2-1", "J-1", "ln J"])
def test_mooney_rivlin_energy_is_its_formula(form: str) -> None:
    law = vs.MooneyRivlin(c1=3.0, c2=2.0, alpha=5.0, volumetric=form)
    I1, I2, J = invariants(F)
    W = {"J^2-1": J**2 - 1, "J-1": J - 1, "ln J": np.log(J)}[form]
    formula = 3 * (I1 * J ** (-2 / 3) - 3) + 2 * (I2 * J ** (-4 / 3) - 3) + 2.5 * W**2
    assert law.energy(F) == pytest.approx(formula, rel=1e-12)


def test_corotated_energy_is_its_formula() -> None:
    law = vs.Corotated(mu=3.0, lam=5.0)
    singular = np.linalg.svd(F, compute_uv=False)
    formula = 3 * ((singular - 1) ** 2).sum(axis=1) + 2.5 * (singular - 1).sum(axis=1) ** 2
    assert law.energy(F) == pytest.approx(formula, rel=1e-12)


def test_yeoh_energy_is_its_formula() -> None:
    law = vs.Yeoh(3.0, -2.0, 1.5, kappa=7.0)
    I1, _, J = invariants(F)
    x = I1 * J ** (-2 / 3) - 3
    assert law.energy(F) == pytest.approx(3 * x - 2 * x**2 + 1.5 * x**3 + 3.5 * (J - 1) ** 2, rel=1e-12)


def test_ogden_energy_is_its_formula() -> None:
    law = vs.Ogden([3.0, -0.5], [1.7, -6.4], kappa=7.0)
    J = np.linalg.det(F)
    stretches = np.linalg.svd(F, compute_uv=False) * J[:, None] ** (-1 / 3)
    formula = sum(mu / a * ((stretches**a).sum(axis=1) - 3) for mu, a in ((3.0, 1.7), (-0.5, -6.4)))
    assert law.energy(F) == pytest.approx(formula + 3.5 * (J - 1) ** 2, rel=1e-12)


def test_an_ogden_term_may_have_values_per_cell_beside_a_number() -> None:
    moduli, alpha = [-20.0, -40.0], [1.3, -7.7]
    mixed: list[Any] = [100.0, np.array(moduli)]
    law = vs.Ogden(mixed, alpha, kappa=1e3)
    for cell, modulus in enumerate(moduli):
        assert law.parameters[cell].tolist() == vs.Ogden([100.0, modulus], alpha, kappa=1e3).parameters[0].tolist()


@pytest.mark.parametrize("both", [False, True])
def test_holzapfel_gasser_ogden_energy_is_its_formula(both: bool) -> None:
    fibres = np.array([[1.0, 2.0, 2.0], [0.0, 0.0, 5.0]])
    law = vs.HolzapfelGasserOgden(3.0, 2.0, 0.7, fibres=fibres, dispersion=0.2, kappa=7.0, bear_compression=both)
    I1, _, J = invariants(F)
    formula = 1.5 * (I1 * J ** (-2 / 3) - 3) + 3.5 * (J - 1) ** 2
    for a in fibres / np.linalg.norm(fibres, axis=1, keepdims=True):
        I4 = ((F @ a) ** 2).sum(axis=1)
        E = 0.2 * (I1 * J ** (-2 / 3) - 3) + 0.4 * (I4 * J ** (-2 / 3) - 1)
        assert E.min() < 0 < E.max(), "both sides of the switch are tried"
        formula += 2.0 / 1.4 * (np.exp(0.7 * (E if both else np.maximum(E, 0.0)) ** 2) - 1)
    assert law.energy(F) == pytest.approx(formula, rel=1e-12)
    assert law.is_analytic == both


def test_compressibility_by_poissons_ratio() -> None:
    """Each law's bulk modulus is that of Hooke's law with its own shear modulus."""
    nu, fibres = 0.4, np.eye(3)[:2]
    for law, mu in [
        (vs.Yeoh(50.0, poisson=nu), 100.0),
        (vs.Ogden([80.0, -20.0], [2.0, -2.0], poisson=nu), 100.0),
        (vs.HolzapfelGasserOgden(100.0, 1.0, 1.0, fibres=fibres, dispersion=1 / 3, poisson=nu), 100.0),
    ]:
        hooke = vs.Linear(young=2 * mu * (1 + nu), poisson=nu)
        assert law.tangent(np.eye(3)[None]) == pytest.approx(hooke.tangent(np.eye(3)[None]), abs=1e-9)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: vs.Yeoh(0.0, kappa=1.0), "Yeoh: c10 is 0"),
        (lambda: vs.Yeoh(1.0), r"Yeoh takes either kappa \[Pa\] or poisson"),
        (lambda: vs.Yeoh(1.0, kappa=1.0, poisson=0.3), "either kappa"),
        (lambda: vs.Yeoh(1.0, poisson=0.5), "poisson is 0.5"),
        (lambda: vs.Yeoh(1.0, kappa=-1.0), "kappa is -1"),
        (lambda: vs.Yeoh("soft", kappa=1.0), "c10 must be one number or an array"),
        (lambda: vs.Ogden([1.0, 2.0], [1.0], kappa=1.0), "2 terms in mu but 1 in alpha"),
        (lambda: vs.Ogden(np.ones(9), 2.0, kappa=1.0), "mu has 9 terms; give one to 3"),
        (lambda: vs.Ogden(1.0, -2.0, kappa=1.0), "half the sum of mu alpha, is -1"),
        (lambda: vs.Ogden([1.0, 1.0], [2.0, 0.0], kappa=1.0), "alpha2 is 0; it must not be zero"),
        (lambda: vs.HolzapfelGasserOgden(1, 1, 0, fibres=np.eye(3)[:2], kappa=1), "k2 is 0"),
        (lambda: vs.HolzapfelGasserOgden(1, 1, 1, fibres=np.eye(3)[:2], dispersion=0.4, kappa=1), "dispersion is 0.4"),
        (lambda: vs.HolzapfelGasserOgden(1, 1, 1, fibres=np.eye(3), kappa=1), r"two directions .* got shape \(3, 3\)"),
        (lambda: vs.HolzapfelGasserOgden(1, 1, 1, fibres=np.zeros((2, 3)), kappa=1), "fibre 1 of cell 0 is .0.0"),
        (
            lambda: vs.HolzapfelGasserOgden([1, 1], 1, 1, fibres=np.ones((2, 3, 3)), kappa=1),
            "different lengths: {'c': 2, 'fibre 1x': 3",
        ),
    ],
)
def test_refusals_of_the_other_laws(make: Any, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        make()


def test_helical_fibres_wind_round_their_axis() -> None:
    artery = vs.organs.artery()
    fibres = vs.helical_fibres(artery, 30.0, axis=(0, 0, 2))
    assert np.linalg.norm(fibres, axis=-1) == pytest.approx(1.0)
    assert fibres[0, :, 2] == pytest.approx(0.5)
    assert fibres[1, :, 2] == pytest.approx(-0.5)
    radial = artery.centroids * [1, 1, 0]
    assert np.abs(np.einsum("fmi,mi->fm", fibres, radial)).max() < 1e-15
    with pytest.raises(vs.VisceraError, match="axis of helical fibres has no length"):
        vs.helical_fibres(artery, 30.0, axis=(0, 0, 0))
    with pytest.raises(vs.VisceraError, match="centroid of cell 7 lies on the axis"):
        vs.helical_fibres(artery, 30.0, through=artery.centroids[7])


FIBRES = [(1.0, 0.5, 0.0), (1.0, -0.5, 0.0)]
ALL = [
    vs.Linear(young=2.0, poisson=0.3),
    vs.Corotated(young=2.0, poisson=0.3),
    vs.SaintVenantKirchhoff(young=2.0, poisson=0.3),
    vs.NeoHookean(young=2.0, poisson=0.3),
    vs.MooneyRivlin(0.3, 0.1, 2.0),
    vs.Yeoh(0.4, 0.1, 0.02, poisson=0.3),
    vs.Ogden([0.5, -0.2], [1.6, -2.7], poisson=0.3),
    vs.HolzapfelGasserOgden(0.4, 0.3, 0.9, fibres=FIBRES, dispersion=0.1, poisson=0.3),
    vs.HolzapfelGasserOgden(0.4, 0.3, 0.9, fibres=FIBRES, poisson=0.3, bear_compression=True),
]


@pytest.mark.parametrize("law", ALL, ids=lambda law: law.name)
def test_stress_and_tangent_are_derivatives(law: laws.Law) -> None:
    step, direction = 1e-6, np.random.default_rng(5).standard_normal((1, 3, 3))
    ahead, behind = F + step * direction, F - step * direction
    slope = (law.energy(ahead) - law.energy(behind)) / (2 * step)
    assert np.einsum("kij,kij->k", law.stress(F), np.broadcast_to(direction, F.shape)) == pytest.approx(slope, rel=1e-7)
    change = (law.stress(ahead) - law.stress(behind)) / (2 * step)
    assert np.einsum("kijlm,lm->kij", law.tangent(F), direction[0]) == pytest.approx(change, rel=1e-6, abs=1e-8)


def test_each_cell_answers_with_its_own_parameters() -> None:
    law = vs.NeoHookean(young=[1e3, 2e3], poisson=0.3)
    assert law.stress(F, cell=1) == pytest.approx(2 * law.stress(F, cell=0), rel=1e-12)
    with pytest.raises(vs.VisceraError, match="cell 2 has no parameters"):
        law.stress(F, cell=2)
    with pytest.raises(vs.VisceraError, match=r"shape \(k, 3, 3\), got \(3, 3\)"):
        law.stress(np.eye(3))
    assert law.stress(F, cell=np.int32(1)).tolist() == law.stress(F, cell=1).tolist()


@pytest.mark.parametrize("young", [1e3, [1e3, 2e3]], ids=["one row", "a row per cell"])
@pytest.mark.parametrize("cell", [1.5, 0.0, "a", None, True, -1, [0], float("nan"), 2**40])
def test_what_is_no_number_of_a_cell_is_refused(young: Any, cell: Any) -> None:
    law = vs.NeoHookean(young=young, poisson=0.3)
    for ask in (law.energy, law.stress, law.tangent):
        with pytest.raises(vs.VisceraError, match="the cell must be a whole number from 0 to"):
            ask(F, cell)
    with pytest.raises(vs.VisceraError, match="the cell must be a whole number from 0 to"):
        law.curve("uniaxial", cell=cell)


def test_a_law_with_one_row_has_it_for_every_cell() -> None:
    law = vs.NeoHookean(young=1e3, poisson=0.3)
    assert law.energy(F, cell=5).tolist() == law.energy(F).tolist()


@pytest.mark.parametrize("law", ALL, ids=lambda law: law.name)
def test_a_law_returns_from_its_core_name(law: laws.Law) -> None:
    again = laws.from_core(law.name, law.parameters)
    assert type(again) is type(law)
    assert again.parameters == pytest.approx(law.parameters, rel=1e-15)


def test_unknown_laws_are_named() -> None:
    with pytest.raises(vs.VisceraError, match="did you mean 'NeoHookean'"):
        laws.named("NeoHokean")
    with pytest.raises(vs.VisceraError, match="'ogden' with 2 parameters is not known"):
        laws.from_core("ogden", [[1.0, 2.0]])
