"""Organ meshes from other people's codes, as a user meets them: inspect, reduce, check and touch on the command line.

A patch of each surface only, so that the file stays quick.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import viscera as vs
from viscera.cli import main
from viscera.inspection import inspect
from viscera.reduced.check import allowed_error


class Specimen(NamedTuple):
    """A mesh file, its scale, and how its organ is held and touched."""

    file: str
    units: str
    fixed: str
    touchable: str
    poisson: str
    litres: float
    """Volume that the mesh's source states for these units."""
    depths: tuple[str, ...]
    """Of the check; deeper, the finest mesh has touches past an instability, where Newton stalls for half a minute."""


SPECIMENS = [
    Specimen("liver_sofa_1441.vtu", "0.035", "y < 15%", "z > 96%", "0.48", 38.97 * 0.035**3 * 1e3, ("2%", "5%")),
    Specimen("kidney_openhelp_676.vtu", "mm", "z < 15%", "z > 92%", "0.45", 0.1887, ("5%", "10%")),
    Specimen("liver_mor_4293.vtu", "0.035", "y < 15%", "z > 99.6%", "0.48", 38.96 * 0.035**3 * 1e3, ("1%", "2%")),
]


class Model(NamedTuple):
    """A specimen's model file, and what `viscera reduce` said of it."""

    path: Path
    facts: dict[str, Any]


def run(folder: Path, *words: str) -> dict[str, Any]:
    """The JSON of one command line that succeeds."""
    target = folder / f"{words[0]}.json"
    code = main([*words, "--quiet", "--json", str(target)])
    facts: dict[str, Any] = json.loads(target.read_text(encoding="utf-8"))
    assert code == 0, facts
    return facts


@pytest.fixture(scope="module", params=SPECIMENS, ids=lambda specimen: Path(specimen.file).stem)
def specimen(request: pytest.FixtureRequest) -> Specimen:
    return request.param  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def mesh_file(specimen: Specimen, shared: Path) -> str:
    path = shared / "meshes" / specimen.file
    if not path.is_file():
        pytest.skip(f"no mesh {path}; name the folder of meshes/ in VISCERA_SHARED")
    return str(path)


@pytest.fixture(scope="module")
def model(specimen: Specimen, mesh_file: str, tmp_path_factory: pytest.TempPathFactory) -> Model:
    folder = tmp_path_factory.mktemp("real")
    path = folder / "organ.viscera"
    organ = ["--units", specimen.units, "--fixed", specimen.fixed, "--young", "0.17e6", "--poisson", specimen.poisson]
    facts = run(folder, "reduce", mesh_file, *organ, "--touchable", specimen.touchable, "-o", str(path))
    return Model(path, facts)


def test_the_mesh_is_sound(specimen: Specimen, mesh_file: str, tmp_path: Path) -> None:
    facts = run(tmp_path, "inspect", mesh_file, "--units", specimen.units)
    assert facts["status"] == "sound"
    assert facts["problems"] == []
    assert facts["parts"] == 1
    assert facts["volume_ml"] == pytest.approx(1e3 * specimen.litres, rel=1e-3)


EVERY_MESH = (
    "artery.vtu", "artery_vmtk_400.vtu", "beam.vtu", "kidney_openhelp_676.vtu", "liver_181.vtu", "liver_2663.vtu",
    "liver_mor_4293.vtu", "liver_sofa_1441.vtu", "liver_sofa_181.vtu", "liver_sofa_4497.vtu", "pdms_cylinder.vtk",
)  # fmt: skip


@pytest.mark.parametrize("file", EVERY_MESH)
def test_the_cells_of_real_meshes_fit_together(shared: Path, file: str) -> None:
    path = shared / "meshes" / file
    if not path.is_file():
        pytest.skip(f"no mesh {path}; name the folder of meshes/ in VISCERA_SHARED")
    facts = inspect(path)
    assert [problem for problem in facts["problems"] if "implausible" not in problem] == []
    assert facts["parts"] == 1


def test_a_patch_is_reduced(model: Model) -> None:
    assert 5 <= model.facts["positions"] <= 60
    assert model.facts["terms"] == 34
    assert model.facts["file_bytes"] == model.path.stat().st_size


def test_trusted_answers_are_within_their_limits(specimen: Specimen, model: Model, tmp_path: Path) -> None:
    facts = run(tmp_path, "check", str(model.path), "--touches", "4", "--depths", *specimen.depths)
    assert len(facts["touches"]) == 8
    compared = [row for row in facts["touches"] if row["is_trusted"] and row["is_converged"]]
    assert compared, "nothing trusted, so nothing was checked"
    for row in compared:
        assert max(row["displacement_error"], row["force_error"]) <= allowed_error(row["depth_fraction"]), row


def test_a_push_is_resisted(model: Model, tmp_path: Path) -> None:
    touch = vs.load(model.path)
    corners = touch.mesh.points[touch.touchable_triangles[0]]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    point = corners.mean(axis=0)
    push = -0.02 * touch.mesh.diagonal * normal / np.linalg.norm(normal)
    words = ["--at", *map(str, point), "--push", *map(str, push)]
    facts = run(tmp_path, "touch", str(model.path), *words)
    force, stiffness = np.array(facts["force"]), np.array(facts["stiffness"])
    assert facts["is_trusted"], facts["reason"]
    # The tool holds the organ where it pushed it: its force points inward, the organ's resistance outward.
    assert force @ push > 0.5 * np.linalg.norm(force) * np.linalg.norm(push)
    assert np.linalg.eigvalsh(stiffness + stiffness.T).min() > 0
    assert np.array(facts["contact_point"]) == pytest.approx(point, abs=1e-6 * touch.mesh.diagonal)
    assert facts["max_displacement"] >= 0.9 * np.linalg.norm(push)
