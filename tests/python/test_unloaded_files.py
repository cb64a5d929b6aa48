"""An organ without the loads of its scan lies elsewhere than in the scan: by its states no image is deformed."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.cli import main
from viscera.joined import parted_mesh
from viscera.navigation import Unloaded
from viscera.output import state as statefile

pytest.importorskip("nibabel", reason="images need nibabel: pip install viscera[scan]")
pytest.importorskip("SimpleITK", reason="images need SimpleITK: pip install viscera[scan]")

WEIGHT: dict[str, Any] = {"gravity": (0, 0, -9.81), "density": 1000.0}
VOLUMES = (".vtu", ".vtk", ".xdmf", ".msh")


@pytest.fixture
def scanned(bar: vs.Mesh) -> Unloaded:
    mesh = replace(bar, axes="RAS")
    return vs.Organ(mesh, vs.NeoHookean(young=4e5, poisson=0.3), fixed="root").unloaded(**WEIGHT, throw=True)


@pytest.fixture
def image(bar: vs.Mesh, tmp_path: Path) -> Path:
    vs.Scan.of(bar, voxel=0.02).write(tmp_path / "scan.nii.gz")
    return tmp_path / "scan.nii.gz"


def warped(image: Path, state: Path) -> int:
    return main(["warp", str(image), "--with", str(state), "-o", str(image.with_name("moved.nii.gz")), "--quiet"])


@pytest.mark.parametrize("ending", VOLUMES)
def test_a_state_of_the_unloaded_organ_does_not_deform_the_scan(
    scanned: Unloaded, image: Path, ending: str, capsys: pytest.CaptureFixture[str]
) -> None:
    if ending == ".xdmf":
        pytest.importorskip("h5py")
    path = image.with_name(f"rest{ending}")
    scanned.organ.solve(**WEIGHT, start=scanned.state).write(path)
    assert warped(image, path) == 2
    told = capsys.readouterr().err
    assert f"rest{ending}: its points are not those under the loads of the scan" in told
    assert "`rest.from_scan(state).write`" in told
    assert not image.with_name("moved.nii.gz").exists()
    assert statefile.read(path)[0].is_unloaded


def test_a_state_counted_from_the_scan_deforms_it(scanned: Unloaded, image: Path) -> None:
    back = scanned.from_scan(scanned.organ.solve(**WEIGHT, start=scanned.state))
    back.write(image.with_name("back.vtu"))
    assert warped(image, image.with_name("back.vtu")) == 0
    assert vs.scan(image.with_name("moved.nii.gz")).labels == vs.scan(image).labels
    assert not statefile.read(image.with_name("back.vtu"))[0].is_unloaded


def test_its_displacement_is_on_no_grid_of_the_scan(scanned: Unloaded, image: Path) -> None:
    for shape in (scanned.state, scanned.organ.stepper().frame(), scanned.organ.moved(scanned.state)):
        with pytest.raises(vs.VisceraError, match="the mesh is not under the loads of its scan"):
            shape.on_grid(image)
    assert scanned.from_scan(scanned.state).on_grid(image).inside.any()
    vectors = np.ones((*vs.scan(image).values.shape, 3))
    with pytest.raises(vs.VisceraError, match="the mesh is not under the loads of its scan"):
        vs.image_fibres(scanned.organ.mesh, (vectors, vs.scan(image).affine))


def test_the_mesh_of_the_unloaded_organ_is_known_as_such(scanned: Unloaded, tmp_path: Path) -> None:
    rest = scanned.organ.mesh
    model = scanned.organ.reduce("tip", depth="2%", order=2)
    model.save(tmp_path / "rest.viscera")
    kept = (pickle.loads(pickle.dumps(rest)), rest.quadratic().linear(), vs.load(tmp_path / "rest.viscera").mesh)
    assert all(mesh.is_unloaded and mesh.axes == "RAS" for mesh in (rest, *kept))
    assert not scanned.scan.is_unloaded
    rest.write(tmp_path / "rest.vtu")
    assert vs.read(tmp_path / "rest.vtu").axes == "", "a mesh that lies in no scan"


def test_a_model_lies_in_the_scan_if_it_starts_from_the_state_of_the_scan(
    scanned: Unloaded, image: Path, tmp_path: Path
) -> None:
    tip, push = scanned.scan.points[scanned.scan.nodes("tip")].mean(axis=0), (0, 0, -1e-3)
    turned = scanned.organ.solve(gravity=(0, 3.0, 0), density=1000.0, start=scanned.state)
    loaded = vs.Organ(scanned.scan, vs.NeoHookean(young=4e5, poisson=0.3), fixed="root")
    for organ, start, lies_there in (
        (scanned.organ, scanned.state, True),
        (scanned.organ, turned, False),
        (loaded, loaded.solve(gravity=(0, 3.0, 0), density=1000.0), False),
    ):
        organ.reduce("tip", depth="2%", order=2, start=start).save(tmp_path / "touch.viscera")
        answer = vs.load(tmp_path / "touch.viscera")(tip, push)
        if lies_there:
            assert answer.on_grid(image).inside.any()
        else:
            with pytest.raises(vs.VisceraError, match=r"the mesh is not under the loads of its scan.*reduced about"):
                answer.on_grid(image)


def test_the_organs_of_an_unloaded_scene_are_unloaded(bar: vs.Mesh) -> None:
    organ = vs.Organ(replace(bar, axes="LPS"), vs.NeoHookean(young=4e5, poisson=0.3), fixed="root")
    scene: Any = vs.Scene({"bar": organ}).unloaded(**WEIGHT).organ
    assert scene.mesh.is_unloaded
    for part in (scene.organ("bar").mesh, parted_mesh(scene.mesh)["bar"]):
        assert part.is_unloaded
        assert part.axes == "LPS"
