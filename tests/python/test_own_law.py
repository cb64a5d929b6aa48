"""Laws by the recipe, and formulas: each goes through statics, series, reduction, model file, case file and page."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera import _core
from viscera.cases.case import case_of, read_case
from viscera.cases.material import material
from viscera.law import LAWS, ROWS, from_core
from viscera.reduced.vary import law_at
from viscera.viewer.live import live_case

NEO_HOOKEAN = "mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2"
FIBRES = [(1.0, 0.5, 0.0), (1.0, -0.5, 0.0)]
MATERIALS: dict[str, dict[str, Any]] = {
    "StableNeoHookean": {"young": 1e5, "poisson": 0.4},
    "ArrudaBoyce": {"mu": 4e4, "lambda_m": 1.5, "poisson": 0.4},
    "VerondaWestmann": {"c1": 3e4, "c2": 1.5, "poisson": 0.4},
    "Fung": {"mu": 4e4, "b": 1.2, "kappa": 2e5},
    "StrainEnergy": {"energy": NEO_HOOKEAN, "mu": 4e4, "lam": 1e5},
}


def is_same(a: vs.laws.Law, b: vs.laws.Law) -> bool:
    return type(a) is type(b) and a.name == b.name and np.array_equal(a.parameters, b.parameters)


@pytest.mark.parametrize("kind", MATERIALS)
def test_a_law_by_the_recipe_serves_everywhere(kind: str, bar: vs.Mesh, tmp_path: Path) -> None:
    given = MATERIALS[kind]
    law = LAWS[kind](**given)
    organ = vs.Organ(bar, law, fixed="root")

    force = {"tip": (0.0, 0.0, -2.0)}
    state = organ.solve(force=force)
    assert state.status == "converged"
    loads, displacements = organ.path(force=force).curve()
    assert loads[-1] == pytest.approx(1.0, abs=1e-6)
    assert np.abs(displacements[-1] - state.displacement).max() < 1e-4 * state.max_displacement

    touch = organ.reduce("tip", order=3, tolerance=1e-2)
    touch.save(tmp_path / "bar.viscera")
    model = vs.load(tmp_path / "bar.viscera")
    assert model.metadata["law"] == law.name
    assert is_same(from_core(law.name, law.parameters), law)
    assert model.check(2, seed=1, depths=[0.01]).is_passed

    bar.write(tmp_path / "bar.vtu")
    words = "\n".join(f"{key} = {json.dumps(value)}" for key, value in given.items())
    (tmp_path / "case.toml").write_text(
        f'mesh = "bar.vtu"\nunits = "m"\nfixed = "root"\n[material]\nlaw = "{kind}"\n{words}\n'
    )
    case = read_case(tmp_path / "case.toml")
    assert is_same(case.organ().law, law)
    live = _core.Live(live_case(case, "Bar").data)
    assert kind in json.loads(live.describe())["laws"]


def test_every_law_of_the_core_has_a_class_and_comes_back_from_a_model_file() -> None:
    for name, row in ROWS.items():
        law = from_core(name, row["sample"])
        assert law.name == name
        assert law.parameters[0] == pytest.approx(row["sample"], rel=1e-12)
        assert all(law.young > 0.0)
        assert all(np.abs(law.poisson) < 0.5)
    with pytest.raises(vs.VisceraError, match="law 'neo_hookean' with 3 parameters is not known"):
        from_core("neo_hookean", [1.0, 2.0, 3.0])
    with pytest.raises(vs.VisceraError, match="law 'hookean' with 2 parameters is not known"):
        from_core("hookean", [1.0, 2.0])


@pytest.mark.parametrize(
    ("law", "formula"),
    [
        (vs.NeoHookean(mu=2e3, lam=7e3), vs.StrainEnergy(NEO_HOOKEAN, mu=2e3, lam=7e3)),
        (
            vs.MooneyRivlin(2e3, 1e3, 3e4),
            vs.StrainEnergy("a*(I1bar - 3) + b*(I2bar - 3) + k/8*(J**2 - 1)**2", a=2e3, b=1e3, k=3e4),
        ),
        (
            vs.HolzapfelGasserOgden(2e3, 1e3, 0.8, fibres=FIBRES, kappa=3e4),
            vs.StrainEnergy(
                """c/2*(I1bar - 3) + kappa/2*(J - 1)**2
                   + k1/(2*k2)*(exp(k2*max(I4*J**(-2/3) - 1, 0)**2) + exp(k2*max(I6*J**(-2/3) - 1, 0)**2) - 2)""",
                c=2e3, k1=1e3, k2=0.8, kappa=3e4, fibres=FIBRES,
            ),
        ),
    ],
)  # fmt: skip
def test_a_formula_is_the_law_it_writes_out(law: vs.laws.Law, formula: vs.laws.Law, cube: vs.Mesh) -> None:
    F = np.eye(3) + 0.1 * np.random.default_rng(3).standard_normal((4, 3, 3))
    for of in ("energy", "stress", "tangent"):
        exact = getattr(law, of)(F)
        assert getattr(formula, of)(F) == pytest.approx(exact, rel=1e-10, abs=1e-10 * np.abs(exact).max())
    load: dict[str, Any] = {"displacement": {"top": (0.01, 0.0, 0.02)}}
    for element in ("P1", "P1 mean volume"):
        own, exact = (vs.Organ(cube, x, fixed="bottom", element=element).solve(**load) for x in (formula, law))
        assert np.abs(own.displacement - exact.displacement).max() < 1e-7 * exact.max_displacement


def test_parameters_of_a_formula_may_differ_from_cell_to_cell(cube: vs.Mesh) -> None:
    mu = np.linspace(1e3, 3e3, len(cube.cells))
    own, exact = vs.StrainEnergy(NEO_HOOKEAN, mu=mu, lam=5e3), vs.NeoHookean(mu=mu, lam=5e3)
    assert repr(own) == f"StrainEnergy({NEO_HOOKEAN!r}, mu=1000..3000, lam=5000)"
    states = [vs.Organ(cube, law, fixed="bottom").solve(gravity=(0, 0, -9.81), density=1e3) for law in (own, exact)]
    assert states[0].displacement == pytest.approx(states[1].displacement, abs=1e-9)
    assert own.stresses == (0, 1)
    # Where one cell has no fibres, their exponent has no effect there.
    fibred = "mu/2*(I1bar - 3) + k1/k2*(exp(k2*(I4*J**(-2/3) - 1)**2) - 1) + k/2*(J - 1)**2"
    k1 = np.where(np.arange(len(cube.cells)) == 0, 0.0, 4e4)
    assert vs.StrainEnergy(fibred, mu=1e4, k1=k1, k2=1.1, k=2e5, fibres=FIBRES).stresses == (0, 1, 3)
    with pytest.raises(vs.VisceraError, match=r"cannot determine which of its parameters scale the energy.*; write"):
        _ = vs.StrainEnergy("mu*(I1bar - 3) + mu**2*(J - 1)**2", mu=1e3).stresses


@pytest.mark.parametrize(
    ("formula", "stresses"),
    [
        (vs.StrainEnergy("mu/2*(I1bar - 3) + mu*r/2*log(J)**2", mu=1e3, r=5.0), (0,)),
        (vs.StrainEnergy("mu*w*(I1bar - 3) + k*(J - 1)**2", mu=1e3, w=2.0, k=1e4), (0, 2)),
    ],
)
def test_a_modulus_may_multiply_a_ratio(formula: vs.laws.Law, stresses: tuple[int, ...]) -> None:
    assert formula.stresses == stresses
    stiffer = law_at(formula, "young", 2.0 * float(formula.young[0]), np.empty(0, dtype=np.uint32), 1)
    F = np.eye(3) + 0.1 * np.random.default_rng(3).standard_normal((4, 3, 3))
    assert stiffer.stress(F) == pytest.approx(2.0 * formula.stress(F), rel=1e-12)
    assert stiffer.young == pytest.approx(2.0 * formula.young, rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((7, {}), "the energy must be a formula"),
        (("mu*(I1 - 3", {"mu": 1}), r"formula, character 11, at the end: expected \)"),
        (("mu/2*(I1bar - 3)", {"mu": 1}), "both must be positive"),
        (("mu/2*(I1 - 3) + k*(J - 1)**2", {"mu": 1, "k": 1}), "the stress at rest is 1 Pa; it must vanish"),
        (("mu*(I1bar - 3) + k*(J - 1)**2", {"mu": 1}), "has a parameter 'k'; give its value, k="),
        (("mu*(I1bar - 3) + k*(J - 1)**2", {"mu": 1, "k": 1, "kk": 1}), "has no parameter 'kk'; did you mean 'k'"),
        (("mu*(I1bar - 3) + k*(J - 1)**2", {"mu": "soft", "k": 1}), "mu must be one number or an array"),
        (("mu*(I1bar - 3) + k*(J - 1)**2", {"mu": [1, -1], "k": 1}), "mu = -1, k = 1: shear modulus -2"),
        (
            ("mu*(I1bar - 3) + k*(J - 1)**2 + mu*(I1bar - 3)**2.5", {"mu": 1, "k": 1}),
            r"no value beside rest.* write max\(",
        ),
        (
            ("mu*(I1bar - 3) + k*log(J)**2 - q*(I4 - 1)**2", {"mu": 1, "k": 9, "q": 9, "fibres": FIBRES}),
            "lowers the energy, so a body is not stable at rest|both must be positive",
        ),
        (("mu*(I4 - 1)**2 + mu*(I1bar - 3) + k*(J - 1)**2", {"mu": 1, "k": 1}), "uses I4 or I6: give two directions"),
        (("mu*(I1bar - 3) + k*(J - 1)**2", {"mu": 1, "k": 1, "fibres": FIBRES}), "uses no I4 and no I6"),
    ],
)
def test_what_is_no_law_is_refused(arguments: tuple[Any, dict[str, Any]], words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        vs.StrainEnergy(arguments[0], **arguments[1])


def test_fibres_whose_coefficient_is_zero_may_be_given() -> None:
    plain = "mu*(I1bar - 3) + k*(J - 1)**2"
    law = vs.StrainEnergy(f"{plain} + 0*(I4 - 1)**2", mu=1.0, k=9.0, fibres=FIBRES)
    F = np.array([[[1.1, 0.2, 0.0], [0.0, 0.9, 0.1], [0.0, 0.0, 1.05]]])
    assert law.stress(F) == pytest.approx(vs.StrainEnergy(plain, mu=1.0, k=9.0).stress(F), rel=1e-12)
    assert vs.StrainEnergy(**law.words).parameters.tolist() == law.parameters.tolist()
    with pytest.raises(vs.VisceraError, match="uses no I4 and no I6"):
        vs.StrainEnergy("mu*(I1bar - 3) + k_I4*(J - 1)**2", mu=1.0, k_I4=9.0, fibres=FIBRES)


def test_fibres_that_soften_are_refused_along_their_strain() -> None:
    """Along a fibre in x: the shear modulus that is told is the least one, and the strain says where to look."""
    law = "mu/2*(I1 - 3) - mu*log(J) + k/2*log(J)**2 - q*(I4 - 1)**2"
    with pytest.raises(vs.VisceraError, match=r"shear modulus -25666.* along \[1\.00, .*lowers the energy"):
        vs.StrainEnergy(law, mu=1e3, k=9e3, q=1e4, fibres=[[1, 0, 0], [0, 1, 0]])


@pytest.mark.parametrize("k1", [0.0, 5e4, 1e7])
@pytest.mark.parametrize("fibre", ["k1/2*(I4 - 1)**2", "k1/8*(exp(4*max(I4 - 1, 0)**2) - 1) + k1/2*(I6 - 1)**2"])
def test_fibres_stiffer_than_their_matrix_do_not_lock_or_crumple(fibre: str, k1: float) -> None:
    """Clusters share the volume of the matrix alone: between P1, which locks, and P2, by default."""
    fibres = [[0, 0.1, 1], [1, -1, 0.2]]
    law = vs.StrainEnergy(f"mu/2*(I1 - 3) - mu*log(J) + k/2*log(J)**2 + {fibre}", mu=1e4, k=2e5, k1=k1, fibres=fibres)
    assert law.poisson == pytest.approx(2e5 / (2 * (2e5 + 1e4)))
    beam = vs.organs.beam()
    solved = {
        element: vs.Organ(beam, law, fixed="clamp", element=element).solve(
            gravity=(0, 0, -9.81), density=2.0, throw=True
        )
        for element in (None, "P1", "P2")
    }
    stiff, default, soft = (solved[element].max_displacement for element in ("P1", None, "P2"))
    assert 1.2 * stiff < default < soft
    assert solved[None].energy > 0


def test_the_energy_of_a_formula_counts_from_rest(bar: vs.Mesh) -> None:
    own, offset = (
        vs.StrainEnergy(f"mu/2*{first} - mu*log(J) + k/2*log(J)**2", mu=1e4, k=2e4) for first in ("(I1 - 3)", "I1")
    )
    energies = [
        vs.Organ(bar, law, fixed="root").solve(gravity=(0, 0, -9.81), density=1e3).energy for law in (own, offset)
    ]
    assert energies[0] > 0.0
    assert energies[1] == pytest.approx(energies[0], rel=1e-6)


def test_an_energy_that_stays_bounded_is_told_of(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "viscera"):
        vs.StrainEnergy(NEO_HOOKEAN, mu=1e3, lam=5e3)
        assert not caplog.records
        vs.StrainEnergy("mu/2*(I1bar - 3) + k/2*(J - 1)**2", mu=1e3, k=5e3)
    assert "the energy stays bounded as J -> 0" in caplog.text


def test_it_is_told_of_once_for_a_law(bar: vs.Mesh, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Laws made on the way, for the values of a range, for a model file and for parts, say nothing again."""
    told = "the energy stays bounded as J -> 0"
    law = vs.StrainEnergy("mu/2*(I1bar - 3) + k/2*(J - 1)**2", mu=4e4, k=1e5)
    organ = vs.Organ(bar, law, fixed="root")
    touch = organ.reduce("tip", order=2, vary=vs.Vary("young", 5e4, 2e5, part=[0, 1], nodes=2))
    answer = touch.at(1e5)(touch.points[touch.touchable_triangles[0, 0]], (0.0, 0.0, -1e-3))
    answer.stress()
    touch.save(tmp_path / "bar.viscera")
    vs.load(tmp_path / "bar.viscera").organ().solve(force={"tip": (0.0, 0.0, -1.0)})
    vs.Scene({"bar": organ}).organ("bar")
    assert caplog.text.count(told) == 1
    vs.StrainEnergy(law.formula, mu=4e4, k=1e5)
    assert caplog.text.count(told) == 2


def test_fibres_of_a_formula_come_back_from_a_model_file(cube: vs.Mesh) -> None:
    """One family and two, in every cell, and parameters that a formula has no sound energy for."""
    along = np.random.default_rng(4).standard_normal((2, len(cube.cells), 3))
    for squares in ("(I4 - 1)**2", "((I4 - 1)**2 + (I6 - 1)**2)"):
        law = vs.StrainEnergy(f"mu/2*(I1bar - 3) + k*log(J)**2 + q*{squares}", mu=1e3, k=9e3, q=1e3, fibres=along)
        back = from_core(law.name, law.parameters)
        assert isinstance(back, vs.StrainEnergy)
        assert is_same(back, law)
        assert back.parameters is not law.parameters
        assert (back.formula, back.names) == (law.formula, law.names)
    with pytest.raises(vs.VisceraError, match="mu = -1000"):
        from_core(law.name, -law.parameters)


def test_a_formula_with_switches_is_not_reduced(bar: vs.Mesh) -> None:
    law = vs.StrainEnergy("mu/2*(I1bar - 3) + k/2*log(J)**2 + mu*max(I1bar - 3, 0)**2", mu=1e4, k=1e5)
    organ = vs.Organ(bar, law, fixed="root")
    with pytest.raises(vs.VisceraError, match="max, min and step have no power series"):
        organ.reduce("tip")


@pytest.mark.parametrize(
    ("term", "n"),
    [
        ("c*(I1bar - 3)**n", 2),
        ("c*(I1bar - 3)**n", 3),
        ("c*(I1bar - 3)**(n + 1)", 1),
        ("c*(J - 1)**n", 2),
        ("c*log(J)**n", 4),
        ("c*(I4 - 1)**n", 2),
    ],
)
def test_a_whole_exponent_may_be_a_parameter(term: str, n: int, bar: vs.Mesh) -> None:
    """What it raises vanishes at rest; the series are those of the exponent written out."""
    matrix, values = "mu/2*(I1bar - 3) + k/2*log(J)**2 + ", {"mu": 1e4, "k": 1e5, "c": 4e4}
    fibres = {"fibres": FIBRES} if "I4" in term else {}
    written = term.replace("(n + 1)", str(n + 1)).replace("**n", f"**{n}")
    laws = (
        vs.StrainEnergy(matrix + term, n=n, **values, **fibres),
        vs.StrainEnergy(matrix + written, **values, **fibres),
    )
    given, exact = (vs.Organ(bar, law, fixed="root") for law in laws)
    series = [organ.path(force={"tip": (0, 0, -20.0)}, order=8).expansions[0].displacement for organ in (given, exact)]
    assert series[0] == pytest.approx(series[1], rel=1e-7, abs=1e-9 * np.abs(series[1]).max())
    models = [organ.pgd("tip", load=20.0, order=3, tolerance=None) for organ in (given, exact)]
    for ours, theirs in zip(*[[order.F for order in model.orders] for model in models], strict=True):
        assert ours == pytest.approx(theirs, rel=1e-7, abs=1e-9 * np.abs(theirs).max())
    touches = [organ.reduce("tip", depth="5%", order=4, radius="30%") for organ in (given, exact)]
    at, push = touches[0].locate((0.4, 0.05, 0.1)), (0.002, 0.0, -0.008)
    forces = [touch(at, push).force for touch in touches]
    assert forces[0] == pytest.approx(forces[1], rel=1e-6)


def test_a_power_of_zero_that_is_not_whole_has_no_path(bar: vs.Mesh) -> None:
    law = vs.StrainEnergy("mu/2*(I1bar - 3) + k/2*log(J)**2 + mu*max(I1bar - 3, 0)**n", mu=1e4, k=1e5, n=2.5)
    organ = vs.Organ(bar, law, fixed="root")
    with pytest.raises(
        vs.VisceraError, match=r"\*\*n has no power series about rest: .* the power 2.5 .* such as 3, or"
    ):
        organ.path(force={"tip": (0, 0, -1.0)})
    assert organ.solve(force={"tip": (0, 0, -400.0)}).is_converged


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "it needs a formula"),
        ({"energy": 3}, "energy in .material. must be a formula"),
        ({"energy": NEO_HOOKEAN, "mu": "soft", "lam": 1.0}, "mu in .material. must be a number"),
        ({"energy": NEO_HOOKEAN, "mu": 1.0}, "has a parameter 'lam'; give its value"),
    ],
)
def test_formulas_of_case_files_are_checked(given: dict[str, Any], words: str) -> None:
    words_of_case = {"mesh": "organ:beam", "fixed": "clamp", "material": {"law": "StrainEnergy", **given}}
    with pytest.raises(vs.VisceraError, match=words):
        case_of(words_of_case).organ()


@pytest.mark.parametrize(
    ("law", "part"),
    [
        ({"law": "StrainEnergy", "energy": NEO_HOOKEAN, "mu": 1e3, "lam": 4e3}, {"energy": "mu*(I1bar - 3)"}),
        ({"law": "StrainEnergy", "energy": NEO_HOOKEAN, "mu": 1e3, "lam": 4e3}, {"fibres": FIBRES}),
        (
            {"law": "HolzapfelGasserOgden", "c": 1e3, "k1": 1e3, "k2": 1.0, "kappa": 1e5, "fibres": FIBRES},
            {"fibres": FIBRES},
        ),
    ],
)
def test_parts_of_a_law_share_its_formula_and_its_fibres(law: dict[str, Any], part: dict[str, Any]) -> None:
    words = {"mesh": "organ:beam", "fixed": "clamp", "material": {**law, "x > 50%": part}}
    sentence = rf"unknown key '{next(iter(part))}' in \[material.x > 50%\]: the parts .* give this part its own `law`"
    with pytest.raises(vs.VisceraError, match=sentence):
        case_of(words)
    own = {"law": "StrainEnergy", "energy": NEO_HOOKEAN + " + mu*(I4 - 1)**2", "mu": 1e3, "lam": 4e3, "fibres": FIBRES}
    case_of({**words, "material": {**law, "x > 50%": own}}).organ()


def test_a_part_of_another_formula_parameter() -> None:
    """As for every law, by a table of the part's name."""
    mesh = vs.organs.beam()
    mesh = mesh.with_cell_sets(half=lambda x: x[:, 0] > x[:, 0].mean())
    words = {"law": "StrainEnergy", "energy": NEO_HOOKEAN, "mu": 1e3, "lam": 4e3, "half": {"mu": 2e3}}
    law = material(words, mesh)
    assert sorted(set(law.parameters[:, 0].tolist())) == [1e3, 2e3]


def test_stable_neo_hookean_recovers_from_inversion(cube: vs.Mesh) -> None:
    law = vs.StableNeoHookean(young=1e4, poisson=0.4)
    inside_out = np.diag([-0.5, 1.0, 1.0])[None]
    assert np.isfinite(law.energy(inside_out)).all()
    organ = vs.Organ(cube, law, fixed="bottom")
    assert organ.solve(displacement={"top": (0.0, 0.0, -0.03)}).status == "converged"


def test_half_a_letter_in_a_formula_is_told_with_its_place() -> None:
    """As a text has it that was read with `errors="surrogateescape"`; UTF-8 has no form for it."""
    with pytest.raises(vs.VisceraError, match=r'formula, character 6, at "\\\\udcb5": expected a number'):
        vs.StrainEnergy("I1 + \udcb5")
