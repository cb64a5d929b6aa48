"""One reduced model for a range of a parameter: against organs of that very parameter, and the words that refuse."""

from __future__ import annotations

import pickle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera import cli
from viscera.cases.case import read_case
from viscera.reduced.touch import load_bytes
from viscera.reduced.vary import law_at
from viscera.reducible import _warn_if_coarse
from viscera.viewer.surface import surface_model
from viscera.viewer.web import web_model

TOP: dict[str, Any] = {
    "touchable": lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.16),
    "radius": 0.07,
    "depth": 0.02,
    "order": 3,
}
POINT, PUSH = (0.27, 0.05, 0.1), np.array([5e-4, 0.0, -2e-3])


def waist(x: np.ndarray) -> np.ndarray:
    return np.asarray((x[:, 0] > 0.1) & (x[:, 0] < 0.2))


def organ_of(bar: vs.Mesh, young: float, poisson: float = 0.3) -> vs.Organ:
    stiffness = bar.per_cell(1e5, {waist: young})
    return vs.Organ(bar, vs.NeoHookean(young=stiffness, poisson=poisson), fixed="root", element="P1")


def gap(touch: vs.Touch, organ: vs.Organ) -> float:
    """Relative distance of an answer's field from the full solution."""
    full = organ.solve(displacement={touch.patch(POINT): PUSH})
    answer = touch(POINT, PUSH)
    assert answer.is_trusted
    return float(np.linalg.norm(answer.displacement - full.displacement) / np.linalg.norm(full.displacement))


@pytest.fixture(scope="module")
def touch(bar: vs.Mesh) -> vs.Touch:
    return organ_of(bar, 1e5).reduce(**TOP, vary=vs.Vary("young", 5e4, 2e6, part=waist, nodes=6))


def test_a_part_of_any_stiffness(touch: vs.Touch, bar: vs.Mesh) -> None:
    soft, stiff = touch.at(5e4), touch.at(2e6)
    change = np.linalg.norm(stiff(POINT, PUSH).force) / np.linalg.norm(soft(POINT, PUSH).force)
    assert change > 1.5, "the finger feels what bends between it and the root"
    for young in (5e4, 1.3e5, 7e5, 2e6):
        assert gap(touch.at(young), organ_of(bar, young)) < 0.005


def test_a_range_with_too_few_nodes_is_told(
    bar: vs.Mesh, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    coarse = organ_of(bar, 1e5).reduce(**TOP, vary=vs.Vary("young", 1e4, 1e7, part=waist, nodes=2))
    assert "the 2 values of young that were solved" in caplog.text
    assert "the model trusts none; give Vary more nodes" in caplog.text
    coarse.save(tmp_path / "coarse.viscera")
    words = ["check", str(tmp_path / "coarse.viscera"), "--value", "2e6", "--touches", "1", "--depths", "2%"]
    assert cli.main(words) == 1
    assert "reduce with more nodes in Vary, or a narrower range" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("error", "depth", "told"),
    [
        (0.009, 0.05, ""),
        (0.035, 0.05, "up to 3.5 % off, so that the model trusts none;"),
        (0.03, 0.07, "up to 3 % off, so that the model trusts none;"),
        (0.03, 0.10, "the model trusts none at a depth below 150 mm, 7.5 % of the diagonal;"),
        (0.06, 0.15, "up to 6 % off, so that the model trusts none;"),
    ],
)
def test_what_a_coarse_range_costs_is_told_for_the_depth_of_the_model(
    error: float, depth: float, told: str, caplog: pytest.LogCaptureFixture
) -> None:
    """On a body 2 m across; between 5 and 10 % of it, 1 to 5 % are allowed."""
    touch: Any = SimpleNamespace(
        metadata={"errors": {"parameter": error}}, depth=2 * depth, mesh=SimpleNamespace(diagonal=2)
    )
    _warn_if_coarse(vs.Vary("young", 1e4, 1e5, nodes=3), touch)
    assert told in caplog.text if told else not caplog.text


def test_a_model_that_trusts_no_answer_says_so(bar: vs.Mesh, caplog: pytest.LogCaptureFixture) -> None:
    touch = organ_of(bar, 1e5).reduce(**TOP, vary=vs.Vary("young", 8e4, 1.25e5, "x > 10%", nodes=2))
    assert 0.01 < touch.metadata["errors"]["parameter"] < 0.05, "at 4.7 % of the diagonal, 1 % is allowed"
    assert "the model trusts none; give Vary more nodes" in caplog.text
    answers = [touch.at(young)(POINT, share * PUSH) for young in (9e4, 1e5) for share in (0.01, 1.0)]
    assert not any(answer.is_trusted for answer in answers)
    model = touch.at(9e4)
    felt = model.probe().place(np.add(POINT, (0, 0, model.radius - 0.002)))
    for reason in (felt.reason, *(answer.reason for answer in answers)):
        assert reason.startswith("between the values of young that were solved, answers are up to ")
        assert reason.endswith("; give Vary more nodes")


def test_forces_are_proportional_to_the_modulus_of_all_that_is_elastic(bar: vs.Mesh) -> None:
    """Whatever the range and its nodes, since nothing else resists; a support that stays as stiff does."""
    organ, vary = organ_of(bar, 1e5), vs.Vary("young", 1e4, 1e6, nodes=2)
    touch, one = organ.reduce(**TOP, vary=vary), organ.reduce(**TOP)
    assert touch.metadata["errors"]["parameter"] < 1e-6
    expected = one(POINT, PUSH)
    assert expected.is_trusted
    for young in (1e4, 3e5, 1e6):
        answer = touch.at(young)(POINT, PUSH)
        assert answer.is_trusted
        assert answer.force == pytest.approx(young / 1e5 * expected.force, rel=1e-6)
        assert answer.stiffness == pytest.approx(young / 1e5 * expected.stiffness, rel=1e-6)
        assert answer.displacement == pytest.approx(expected.displacement, abs=1e-3 * expected.max_displacement)
    lying = vs.Organ(bar, organ.law, supports=[vs.ElasticSupport("root", stiffness=1e6)], element="P1")
    assert lying.reduce(**TOP, vary=vary).metadata["errors"]["parameter"] > 0.05


def test_the_model_begins_at_the_organs_own_value(
    touch: vs.Touch, bar: vs.Mesh, caplog: pytest.LogCaptureFixture
) -> None:
    assert touch.value == pytest.approx(1e5)
    assert gap(touch, organ_of(bar, 1e5)) < 0.005
    assert "young = 100000" in repr(touch)
    with caplog.at_level("WARNING"):
        outside = organ_of(bar, 1e4).reduce(**TOP, vary=vs.Vary("young", 5e4, 2e6, part=waist, nodes=2))
    assert (
        "the organ's own young, 10000 Pa, is outside the range from 50000 to 2e+06; the model begins at" in caplog.text
    )
    assert outside.value == pytest.approx(np.sqrt(5e4 * 2e6)), "the middle of the range, over the logarithm"


@pytest.mark.parametrize(
    ("vary", "values"),
    [
        (vs.Vary("young", 1e3, 1e5), "3000 to 30000 Pa"),
        (vs.Vary("young", 1e3, 1e5, part="x > 10%"), "3000 to 30000 Pa"),
        (vs.Vary("poisson", 0.1, 0.4), "0.2 to 0.3, which"),
    ],
)
def test_cells_of_different_values_are_not_made_equal(vary: vs.Vary, values: str, bar: vs.Mesh) -> None:
    stiff = waist(bar.centroids)
    law = vs.NeoHookean(young=np.where(stiff, 3e4, 3e3), poisson=np.where(stiff, 0.2, 0.3))
    organ = vs.Organ(bar, law, fixed="root")
    with pytest.raises(vs.VisceraError, match=f"{vary.name} varies in cells of different {vary.name}, {values}"):
        organ.reduce(**TOP, vary=vary)


def test_a_model_at_a_value_checks_itself_against_that_organ(touch: vs.Touch, tmp_path: Path) -> None:
    touch.save(tmp_path / "bar.viscera")
    other = vs.load(tmp_path / "bar.viscera").at(4e5)
    full = other.organ()
    mu, lam = full.law.parameters.T
    young = mu * (3 * lam + 2 * mu) / (lam + mu)
    inside = waist(full.mesh.centroids)
    assert young[inside] == pytest.approx(4e5)
    assert young[~inside] == pytest.approx(1e5)
    result = other.check(touches=4, depths=["1%", "3%"])
    assert result.is_passed
    assert result.overall.trusted > 4
    for row in result.rows:
        assert row.displacement_error is not None
        assert row.estimate >= touch.metadata["errors"]["parameter"]


def test_poissons_ratio_of_the_whole_organ(bar: vs.Mesh) -> None:
    touch = organ_of(bar, 1e5).reduce(**TOP, vary=vs.Vary("poisson", 0.2, 0.45, nodes=5))
    for poisson in (0.2, 0.33, 0.45):
        assert gap(touch.at(poisson), organ_of(bar, 1e5, poisson)) < 0.005


def test_the_contact_radius(bar: vs.Mesh) -> None:
    organ = organ_of(bar, 1e5)
    touch = organ.reduce(**TOP, vary=vs.Vary("radius", 0.06, 0.09, nodes=5))
    assert touch.radius == pytest.approx(0.07)
    assert touch.parameter == {"name": "radius", "value": 0.07, "range": [0.06, 0.09]}
    assert touch.at("80 mm").radius == touch.at(0.08).radius == 0.08
    for radius in (0.06, 0.08, 0.09):
        other = touch.at(radius)
        assert other.radius == radius
        node = bar.points[other._model.array("positions")[4]]
        assert other.patch(node).weights == pytest.approx(organ.patch(node, radius).weights)
        assert gap(other, organ) < 0.01


def test_laws_with_another_parameter(bar: vs.Mesh) -> None:
    cells = np.array([3, 5], dtype=np.uint32)
    changed = law_at(vs.MooneyRivlin(c1=1e3, c2=2e3, kappa=1e5), "young", 6e4, cells, 192)
    shear, bulk = changed.core().moduli().T
    young = 9 * bulk * shear / (3 * bulk + shear)
    assert young[cells] == pytest.approx(6e4)
    assert changed.parameters[0].tolist() == [1e3, 2e3, 1e5]
    ogden = law_at(vs.Ogden(mu=[500.0], alpha=[3.0], poisson=0.45), "young", 4e3, np.empty(0, dtype=np.uint32), 192)
    assert ogden.parameters[0, 3] == 3.0, "an exponent is no stress"
    with pytest.raises(vs.VisceraError, match="MooneyRivlin is not made from a Poisson's ratio"):
        law_at(changed, "poisson", 0.4, cells, 192)
    by_place = vs.laws.Several(bar, {"x < 50%": vs.NeoHookean(young=1e3, poisson=0.3), "x > 49%": changed})
    with pytest.raises(vs.VisceraError, match="the Poisson's ratio of an organ with laws by place cannot vary"):
        law_at(by_place, "poisson", 0.4, cells, 192)
    organ = vs.Organ(bar, vs.Yeoh(c10=500.0, poisson=0.4), fixed="root")
    told = (
        "Yeoh .* keeps coefficients .* even where it was given one; vary its young, or take .*: Linear, .* NeoHookean"
    )
    with pytest.raises(vs.VisceraError, match=told):
        organ.reduce(**TOP, vary=vs.Vary("poisson", 0.3, 0.42, nodes=2))


@pytest.mark.parametrize(("parameter", "low", "high"), [("young", 5e3, 7e5), ("poisson", 0.0, 0.499)])
def test_a_value_that_a_law_has_already_leaves_it_as_it_is(parameter: str, low: float, high: float) -> None:
    """To the last bit: the core sets the law of a model to its value, too."""
    law = vs.NeoHookean(young=1e4, poisson=0.3)
    for value in np.linspace(low, high, 50).tolist():
        once = law_at(law, parameter, value, np.array([], dtype=np.uint32), 1)
        twice = law_at(once, parameter, value, np.array([], dtype=np.uint32), 1)
        assert twice.parameters.tolist() == once.parameters.tolist()


def test_a_range_that_ends_where_cells_lock_has_an_element_that_does_not(
    bar: vs.Mesh, caplog: pytest.LogCaptureFixture
) -> None:
    vary = vs.Vary("poisson", 0.43, 0.485, nodes=3)

    def organ(poisson: float, element: str | None = None) -> vs.Organ:
        return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=poisson), fixed="root", element=element)

    of_law = pickle.loads(pickle.dumps(organ(0.44)))
    assert of_law.element == "P1"
    model = of_law.reduce(**TOP, vary=vary)
    assert model.element == "P1 mean volume"
    assert not caplog.records
    assert gap(model.at(0.47), organ(0.47)) < 0.01
    state = of_law.solve(gravity=(0, 0, -9.81), density=1e3)
    with pytest.raises(vs.VisceraError, match=r"the state to reduce about was found with 'P1'"):
        of_law.reduce(**TOP, vary=vary, start=state)
    chosen, _ = vary.family(pickle.loads(pickle.dumps(organ(0.44, "P1"))), 0.07)
    assert chosen.element == "P1"
    assert "the element 'P1' locks" in caplog.text
    assert vs.Vary("poisson", 0.3, 0.45, nodes=3).family(organ(0.44), 0.07)[0].element == "P1"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("yuong", 1e3, 1e4), "the varied parameter 'yuong' is unknown; did you mean 'young'"),
        (("young", 1e4, 1e3), "must ascend"),
        (("radius", 0.0, 0.1), "the lower end of the range of radius must be a number above 0 and at most 1000"),
        (
            ("poisson", 0.1, 0.6),
            "the upper end of the range of poisson must be a number above -1 and below 0.5, got 0.6",
        ),
        (("poisson", -1, 0.4), "the lower end of the range of poisson must be a number above -1 and below 0.5, got -1"),
        (("young", "1 kPa", 1e4), "the lower end of the range of young must be a number in Pa, .* got '1 kPa'"),
        (("radius", "8%", "5%"), "the range of radius runs from 8% to 5%; it must ascend"),
        (("young", 1e3, 1e4, None, 1), "nodes of young must be a whole number from 2 to 12, got 1"),
        (("radius", 0.01, 0.1, waist), "belongs to no part"),
    ],
)
def test_ranges_that_are_none(words: Any, sentence: str) -> None:
    with pytest.raises(vs.VisceraError, match=sentence):
        vs.Vary(*words)


@pytest.mark.parametrize(
    ("low", "high", "sentence"),
    [
        (5, 900, "the lower end of the range of radius is 5 m; it may be at most the organ's diagonal, 0.424264 m"),
        (0.05, 900, "the upper end of the range of radius is 900 m; it may be at most the organ's diagonal"),
        ("5 mm", "101%", "the upper end of the range of radius is 0.428507 m; it may be at most"),
        ("5%", 0.02, "the range of radius runs from 0.0212132 to 0.02; it must ascend"),
        ("0 mm", "5 mm", r"the lower end of the range of radius must be a number above 0"),
    ],
)
def test_a_range_of_radii_that_no_organ_has(bar: vs.Mesh, low: Any, high: Any, sentence: str) -> None:
    with pytest.raises(vs.VisceraError, match=sentence):
        organ_of(bar, 1e5).reduce(**TOP, vary=vs.Vary("radius", low, high))


def test_a_range_in_words_has_values_on_a_mesh(bar: vs.Mesh) -> None:
    words = vs.Vary("radius", "5 mm", "1 cm", nodes=2)
    with pytest.raises(vs.VisceraError, match=r"in words, which `on\(mesh\)` turns into numbers"):
        _ = words.values
    assert words.on(bar).values == pytest.approx(vs.Vary("radius", 0.005, 0.01, nodes=2).values)


def test_what_a_model_cannot_be_set_to(touch: vs.Touch, bar: vs.Mesh) -> None:
    for value in (1e3, "50 mm"):
        with pytest.raises(vs.VisceraError, match=r"young of this model .* from 50000 to 2e\+06 \[Pa\], got"):
            touch.at(value)
    organ = organ_of(bar, 1e5)
    plain = organ.reduce(**TOP)
    with pytest.raises(vs.VisceraError, match="no parameter to set"):
        plain.at(1e5)
    state = organ.solve(force={"tip": (0, 0, -1.0)})
    with pytest.raises(ValueError, match="the loaded shape is another for every young"):
        organ.reduce(**TOP, start=state, vary=vs.Vary("young", 5e4, 2e6, nodes=2))


def test_the_page_shows_the_value_the_model_is_set_to(touch: vs.Touch) -> None:
    stiff = touch.at(2e6)
    page = load_bytes(surface_model(stiff, "bar"))
    assert page.value is None
    assert page(POINT, PUSH).force == pytest.approx(stiff(POINT, PUSH).force)
    small = web_model(stiff, "bar")
    assert load_bytes(small.data)(POINT, PUSH).force == pytest.approx(stiff(POINT, PUSH).force, rel=1e-4)


def test_a_case_with_a_range(tmp_path: Path) -> None:
    path = tmp_path / "beam.toml"
    path.write_text(
        """
mesh = "organ:beam"
fixed = "clamp"
[material]
law = "NeoHookean"
young = 1e5
poisson = 0.3
[reduce]
touchable = "x > 90% and z > 99%"
depth = "2%"
order = 2
[reduce.vary]
parameter = "young"
part = "x > 60%"
low = 1e4
high = 1e6
nodes = 2
""",
        encoding="utf-8",
    )
    case = read_case(path)
    touch = case.reduce(case.organ())
    assert touch.at(3e5).value == 3e5
    path.write_text(path.read_text().replace("low =", "lwo ="), encoding="utf-8")
    with pytest.raises(vs.VisceraError, match=r"unknown key 'lwo' in \[reduce.vary\]; did you mean 'low'"):
        read_case(path)


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ('[reduce.vary]\nparameter = "radius"\nlow = 5\nhigh = 900', "the lower end of the range of radius is 5 m"),
        ("radius = 5", "radius is 5 m"),
        ("depth = 5", "depth is 5 m"),
    ],
)
def test_a_case_with_a_length_in_mm_is_refused_before_its_loads_are_solved(
    table: str, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "beam.toml"
    path.write_text(
        f"""
mesh = "organ:beam"
fixed = "clamp"
material = {{ law = "NeoHookean", young = 1e5, poisson = 0.3 }}
[loads.force]
tip = [0, 0, -1]
[reduce]
start = "loads"
{table}
""",
        encoding="utf-8",
    )
    case = read_case(path)
    organ = case.organ()
    monkeypatch.setattr(vs.Organ, "solve", lambda *_, **__: pytest.fail("the loads are solved"))
    with pytest.raises(
        vs.VisceraError, match=rf"beam.toml: \[reduce\]: {sentence}; it may be at most the organ's diagonal, 1.03923 m"
    ):
        case.reduce(organ)
