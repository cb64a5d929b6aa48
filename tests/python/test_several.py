"""Several laws in one organ: each cell answers by its own, everywhere that a law goes."""

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs

HALVES = ("x < 50%", "x >= 50%")
SOFT = vs.NeoHookean(young=3e3, poisson=0.3)
STIFF = vs.Yeoh(c10=4e3, c20=2e3, poisson=0.3)
FORMULA = vs.StrainEnergy("mu/2*(I1bar - 3) + kappa/2*(J - 1)**2", mu=2e3, kappa=2e4)


def halves(first: vs.laws.Law, second: vs.laws.Law) -> dict[str, vs.laws.Law]:
    return dict(zip(HALVES, (first, second), strict=True))


@pytest.fixture(scope="module")
def mesh() -> vs.Mesh:
    return vs.organs.beam()


@pytest.fixture(scope="module")
def organ(mesh: vs.Mesh) -> vs.Organ:
    return vs.Organ(mesh, halves(SOFT, STIFF), fixed="clamp")


@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
@pytest.mark.parametrize("law", [SOFT, STIFF, FORMULA])
def test_the_same_law_twice_answers_as_once(mesh: vs.Mesh, law: vs.laws.Law, element: str) -> None:
    once = vs.Organ(mesh, law, fixed="clamp", element=element)
    twice = vs.Organ(mesh, halves(law, law), fixed="clamp", element=element)
    first, second = (organ.solve(force={"tip": (0, 0, -0.5)}).displacement for organ in (once, twice))
    np.testing.assert_allclose(second, first, atol=1e-9 * mesh.diagonal)


@pytest.mark.parametrize("second", [STIFF, FORMULA], ids=["Yeoh", "formula"])
def test_each_cell_answers_by_its_own_law(mesh: vs.Mesh, second: vs.laws.Law) -> None:
    organ = vs.Organ(mesh, halves(SOFT, second), fixed="clamp", element="P1")
    state = organ.solve(displacement={"tip": (0.1, 0.0, -0.05)})
    edges = np.diff((mesh.points + state.displacement)[mesh.cells], axis=1)
    F = np.swapaxes(np.linalg.solve(np.diff(mesh.points[mesh.cells], axis=1), edges), 1, 2)
    is_first = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 0.5
    for cells, law in ((is_first, SOFT), (~is_first, second)):
        np.testing.assert_allclose(state.stress("pk1")[cells], law.stress(F[cells]), rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(state.energy_density()[cells], law.energy(F[cells]), rtol=1e-6, atol=1e-6)


def test_every_stage_takes_it(organ: vs.Organ, tmp_path: Path) -> None:
    touch = organ.reduce(touchable="x > 90%", depth="3%", order=3)
    assert touch.check(touches=8).is_passed
    touch.save(tmp_path / "two.viscera")
    again = vs.load(tmp_path / "two.viscera")
    push = (touch.locate((1.0, 0.05, 0.05)), (0.0, 0.0, -0.01))
    np.testing.assert_array_equal(again(*push).force, touch(*push).force)
    assert repr(again.organ().law) == repr(organ.law)
    for made in (pickle.loads(pickle.dumps(organ)), copy.deepcopy(organ)):
        assert repr(made.law) == repr(organ.law)
    assert organ.stepper(density=1000.0).frame().is_solved


def test_a_case_file_says_it_and_is_written(organ: vs.Organ, tmp_path: Path) -> None:
    written = organ.to_case(tmp_path / "two.toml", loads={"force": {"tip": (0, 0, -0.1)}})
    again = written.organ()
    np.testing.assert_array_equal(again.law.young, organ.law.young)
    (tmp_path / "hand.toml").write_text(
        'mesh = "organ:beam"\nfixed = "clamp"\n[material]\nlaw = "NeoHookean"\nyoung = 3e3\npoisson = 0.3\n'
        '[material."x >= 50%"]\nlaw = "Yeoh"\nc10 = 4e3\nc20 = 2e3\npoisson = 0.3\n'
        "[loads]\nforce = { tip = [0, 0, -0.1] }\n"
    )
    case = vs.case(tmp_path / "hand.toml")
    hand = case.organ()
    np.testing.assert_allclose(hand.law.parameters, organ.law.parameters)
    assert case.solve(hand).is_converged


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ("law = 'Yeo'", "law in [material.x >= 50%]"),
        ("law = 'Yeoh'\nyoung = 3e3", "[material.x >= 50%] Yeoh: it has no parameter 'young'"),
        ("law = 'MooneyRivlin'\nkappa = 3e3", "[material.x >= 50%] MooneyRivlin: write c1 = ..., c2 = ... there"),
        (
            "law = 'HolzapfelGasserOgden'\nfibres = { axis = [0, 0, 1] }",
            "the key 'angle' is missing in [material.x >= 50%.fibres]",
        ),
        ("law = 'Yeoh'\nc10 = 1e3\npoisson = 0.3\n[material.\"x >= 50%\".tip]\nc10 = 2e3", "no parts"),
        ("law = 'Linear'\nyoung = 3e3\npoisson = 0.3", "Linear stands beside no other law"),
        ("law = 'Yeoh'\nc10 = -1.0\npoisson = 0.3", "c10"),
    ],
)
def test_a_case_file_that_gives_a_part_a_wrong_law_is_refused(part: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "wrong.toml").write_text(
        'mesh = "organ:beam"\nfixed = "clamp"\n[material]\nlaw = "NeoHookean"\nyoung = 3e3\npoisson = 0.3\n'
        f'[material."x >= 50%"]\n{part}\n[loads]\nforce = {{ tip = [0, 0, -0.1] }}\n'
    )
    with pytest.raises(vs.VisceraError) as error:
        vs.case(tmp_path / "wrong.toml").organ()
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("laws", "words"),
    [
        ({}, "a table of laws by place"),
        ({"x < 50%": SOFT}, "960 cells have no law, the first of them cell"),
        ({"x < 50%": 3e3, "x >= 50%": SOFT}, "the law of 'x < 50%' must be one of viscera.laws"),
        ({"nowhere": SOFT}, "nowhere"),
        (halves(SOFT, vs.Linear(young=3e3, poisson=0.3)), "Linear stands beside no other law"),
        (halves(SOFT, vs.NeoHookean(young=[1e3, 2e3], poisson=0.3)), "parameters for 2 cells, the mesh has 1920"),
    ],
)
def test_wrong_tables_are_refused(mesh: vs.Mesh, laws: dict[str, Any], words: str) -> None:
    with pytest.raises(vs.VisceraError) as error:
        vs.Organ(mesh, laws, fixed="clamp")
    assert words in str(error.value)


@pytest.mark.parametrize("index", [-1.0, 0.5, 2.0])
def test_a_row_of_no_law_is_refused(index: float) -> None:
    with pytest.raises(vs.VisceraError, match="row 0 has law"):
        vs.laws.from_core("laws neo_hookean; neo_hookean", [[index, 1e3, 1e3]])


def test_two_fingers_take_it(mesh: vs.Mesh) -> None:
    """Hyper-reduction samples cells of either law."""
    found = []
    for law in (SOFT, halves(SOFT, SOFT)):
        touch = vs.Organ(mesh, law, fixed="clamp").reduce(touchable="x > 60%", depth="3%", order=3)
        places = [touch.locate(point) for point in ((0.65, 0.1, 0.2), (1.0, 0.1, 0.1))]
        found.append(touch.galerkin().grasp(places).solve([(0.0, 0.0, -0.003), (0.0, 0.003, 0.0)]))
    once, twice = found
    assert twice.is_converged
    np.testing.assert_allclose(twice.displacement, once.displacement, atol=1e-7)


def test_young_varies_in_a_part_with_one_law(organ: vs.Organ) -> None:
    about: dict[str, Any] = {"touchable": "x > 95%", "depth": "2%", "order": 2}
    family = organ.reduce(**about, vary=vs.Vary("young", 2e3, 4e3, part="x < 50%", nodes=2))
    point = family.locate((1.0, 0.05, 0.05))
    soft, stiff = (family.at(young)(point, (0.0, 0.0, -0.005)).force[2] for young in (2e3, 4e3))
    assert stiff < soft < 0.0
    with pytest.raises(vs.VisceraError, match="young varies in cells of different young"):
        organ.reduce(**about, vary=vs.Vary("young", 2e3, 4e3))
