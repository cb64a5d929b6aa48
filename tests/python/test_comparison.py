"""The models side by side: they agree where they must, differ where they must, and a failure is said."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera import cli
from viscera.comparison import difference, models, moduli

TISSUE = vs.NeoHookean(young=1e5, poisson=0.4)


@pytest.mark.parametrize("law", [TISSUE, vs.MooneyRivlin(3e4, 1e4, alpha=2e6), vs.Linear(mu=[1e4, 3e4], lam=2e5)])
def test_all_models_have_the_same_moduli_at_small_strain(law: vs.laws.Law) -> None:
    mu, lam = moduli(law)
    for model in models(law).values():
        others = moduli(model)
        assert others[0] == pytest.approx(mu, rel=1e-9)
        assert others[1] == pytest.approx(lam, rel=1e-9)


def test_the_law_of_the_organ_is_among_the_models() -> None:
    law = vs.MooneyRivlin(3e4, 1e4, alpha=2e6)
    assert models(law)["MooneyRivlin J^2-1"] is law
    other = models(law)["MooneyRivlin J-1"]
    assert other.parameters == pytest.approx(law.parameters)


def test_small_deformations_are_the_same_in_all_models(bar: vs.Mesh) -> None:
    result = vs.compare(vs.Organ(bar, TISSUE, fixed="root"), displacement={"tip": (0, 0, 1e-6)}, reference="Linear")
    assert result.is_converged
    for run in result.runs.values():
        assert run.difference is not None
        assert run.difference.node_max < 1e-4


def test_a_rotation_inflates_the_linear_model_alone(bar: vs.Mesh) -> None:
    """The far half of the bar is turned by 60 degrees about its own axis, as a rigid body."""
    turned = bar.with_sets(far=lambda x: x[:, 0] > 0.19)
    angle, x = np.pi / 3, turned.points[turned.nodes("far")] - np.array([0.0, 0.05, 0.05])
    y = np.cos(angle) * x[:, 1] - np.sin(angle) * x[:, 2]
    z = np.sin(angle) * x[:, 1] + np.cos(angle) * x[:, 2]
    moved = np.column_stack([np.zeros(len(x)), y - x[:, 1], z - x[:, 2]])
    result = vs.compare(
        vs.Organ(turned, TISSUE, fixed="root"), displacement={tuple(turned.nodes("far")): moved}, steps=4
    )
    stresses = {name: energy_of_rigid_part(run, turned) for name, run in result.runs.items()}
    assert stresses["Linear"] > 1.0
    assert max(value for name, value in stresses.items() if name != "Linear") < 1e-9


def energy_of_rigid_part(run: object, mesh: vs.Mesh) -> float:
    """Energy density of a cell that only turned, in units of the shear modulus."""
    inside = np.isin(mesh.cells, mesh.nodes("far")).all(axis=1)
    cell = mesh.cells[np.argmax(inside)]
    rest, shape = mesh.points[cell], (mesh.points + run.state.displacement)[cell]  # type: ignore[attr-defined]
    F = np.linalg.solve(rest[1:] - rest[0], shape[1:] - shape[0]).T
    return float(run.law.energy(F[None])[0] / TISSUE.mu[0])  # type: ignore[attr-defined]


def test_differences_are_what_they_say() -> None:
    reference = np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 4.0], [0.0, 0.0, 0.1]])
    u = reference + np.array([[0.0, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.1]])
    free = np.array([[False] * 3, [True] * 3, [True] * 3])
    d = difference(u, reference, free)
    assert d.field == pytest.approx(np.hypot(0.3, 0.1) / np.sqrt(25.01))
    assert (d.node_mean, d.node_max) == pytest.approx((0.04, 0.06))
    assert (d.component_mean, d.component_max) == pytest.approx((0.05, 0.1))  # 0.1 is too small to count
    assert d.axis_max[1:] == pytest.approx((0.1, 0.0))
    assert np.isnan(d.axis_mean[0])


def test_a_model_that_fails_is_not_compared(cube: vs.Mesh) -> None:
    """Saint Venant-Kirchhoff collapses at a stretch of 1 / sqrt(3); the neo-Hookean cube does not."""
    laws = {name: models(TISSUE)[name] for name in ("SaintVenantKirchhoff", "NeoHookean")}
    organ = vs.Organ(cube, TISSUE, fixed="bottom")
    result = vs.compare(organ, laws=laws, reference="NeoHookean", displacement={"top": (0, 0, -0.055)})
    assert result.runs["NeoHookean"].state.is_converged
    assert not result.runs["SaintVenantKirchhoff"].state.is_converged
    assert result.runs["SaintVenantKirchhoff"].difference is None
    assert not result.is_converged
    assert "did not converge" in result.table()


def test_what_cannot_be_compared_is_refused(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, TISSUE, fixed="root")
    with pytest.raises(vs.VisceraError, match="did you mean 'Corotated'"):
        vs.compare(organ, reference="corotated", displacement={"tip": (0, 0, 0.01)})
    with pytest.raises(vs.VisceraError, match="give the case a load"):
        vs.compare(organ)


CASE = """
mesh = "organ:beam"
fixed = "clamp"
[material]
law = "NeoHookean"
young = 1e5
poisson = 0.3
[loads]
force.tip = [0, 0, -10]
"""


def test_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case, facts = tmp_path / "beam.toml", tmp_path / "facts.json"
    case.write_text(CASE, encoding="utf-8")
    assert cli.main(["compare", str(case), "-o", str(tmp_path), "--json", str(facts), "--models", "Linear"]) == 0
    assert "difference from SaintVenantKirchhoff" in capsys.readouterr().out
    told = json.loads(facts.read_text(encoding="utf-8"))
    assert [model["name"] for model in told["models"]] == ["Linear", "SaintVenantKirchhoff"]
    linear = told["models"][0]
    assert linear["difference"]["field"] > 0.01
    assert linear["ratios"]["generation"] > 0
    assert Path(told["picture"]).read_bytes().startswith(b"\x89PNG")
    with Path(told["differences"]).open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert len(rows) == 1 + 3 * len(vs.organs.beam().points)
    gaps = np.array([float(row[4]) for row in rows[1:]])
    truth = np.array([float(row[3]) for row in rows[1:]])
    assert np.linalg.norm(gaps) / np.linalg.norm(truth) == pytest.approx(linear["difference"]["field"])


def test_the_verb_says_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = tmp_path / "beam.toml"
    case.write_text(CASE, encoding="utf-8")
    assert cli.main(["compare", str(case), "-o", str(tmp_path), "--reference", "NeoHooke"]) == 2
    assert "did you mean 'NeoHookean'" in capsys.readouterr().err
    assert cli.main(["compare", str(case), "-o", str(tmp_path), "--models", "Hooke"]) == 2
    assert "unknown model 'Hooke'" in capsys.readouterr().err


def test_the_verb_fails_where_a_model_does(tmp_path: Path, cube: vs.Mesh) -> None:
    cube.write(tmp_path / "cube.vtu")
    words = CASE.replace("organ:beam", "cube.vtu").replace("clamp", "bottom")
    words = words.replace("force.tip = [0, 0, -10]", "displacement.top = [0, 0, -0.055]")
    case, facts = tmp_path / "cube.toml", tmp_path / "facts.json"
    case.write_text('units = "m"\n' + words, encoding="utf-8")
    options = ["--models", "SaintVenantKirchhoff", "--reference", "NeoHookean", "--quiet", "--json", str(facts)]
    assert cli.main(["compare", str(case), "-o", str(tmp_path), *options]) == 1
    failed, reference = json.loads(facts.read_text(encoding="utf-8"))["models"]
    assert (failed["difference"], reference["status"]) == (None, "converged")


def test_the_verb_names_a_reference_that_converged(
    tmp_path: Path, cube: vs.Mesh, capsys: pytest.CaptureFixture[str]
) -> None:
    """Saint Venant-Kirchhoff, the reference unless another is chosen, does not bear what the case's own law bears."""
    cube.write(tmp_path / "cube.vtu")
    words = CASE.replace("organ:beam", "cube.vtu").replace("clamp", "bottom")
    words = words.replace("force.tip = [0, 0, -10]", "displacement.top = [0, 0, -0.055]")
    case = tmp_path / "cube.toml"
    case.write_text('units = "m"\n' + words, encoding="utf-8")
    options = [str(case), "-o", str(tmp_path), "--models", "Linear", "NeoHookean"]
    assert cli.main(["compare", *options]) == 1
    assert "choose a model that did, such as --reference NeoHookean" in capsys.readouterr().out
    assert cli.main(["compare", *options, "--reference", "NeoHookean"]) == 0
    assert "--reference" not in capsys.readouterr().out
