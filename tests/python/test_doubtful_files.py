"""A shape that is no equilibrium under its loads is written as such, and deforms an image with a warning alone."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera.cli import main
from viscera.output import state as statefile

DOUBT = {"not_converged": "did not converge", "not_settled": "had not settled"}


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(replace(bar, axes="RAS"), vs.NeoHookean(young=1e4, poisson=0.3), fixed="root")


@pytest.fixture(scope="module")
def shapes(organ: vs.Organ) -> dict[str, vs.State | vs.Frame]:
    """By the mark that its files have."""
    frame = organ.stepper(iterations=1).frame({"tip": (None, None, -0.05)})
    hopeless = {"max_iterations": 1, "smallest_step": 0.5}
    state = organ.solve(displacement={"tip": (-0.39, 0, 0)}, settings=hopeless)
    assert not frame.is_settled
    assert not state.is_converged
    return {"not_settled": frame, "not_converged": state}


@pytest.mark.parametrize("ending", statefile.VOLUMES)
@pytest.mark.parametrize("mark", DOUBT)
def test_files_say_that_a_shape_is_no_equilibrium(
    tmp_path: Path, organ: vs.Organ, shapes: dict[str, vs.State | vs.Frame], mark: str, ending: str
) -> None:
    if ending == ".xdmf":
        pytest.importorskip("h5py")
    path = tmp_path / f"shape{ending}"
    for shape in (shapes[mark], organ.moved(shapes[mark])):
        shape.write(path)
        read = statefile.read(path, in_scan=True)
        assert read.doubt == mark
        assert np.allclose(read.displacement, shape.displacement, atol=1e-9)
    organ.solve(force={"tip": (0, 0, -0.01)}, throw=True).write(path)
    assert statefile.read(path).doubt == ""


def test_a_part_of_a_scene_is_as_doubtful_as_the_scene(tmp_path: Path, organ: vs.Organ) -> None:
    frame = vs.Scene({"bar": organ}).stepper(iterations=1).frame({"bar/tip": (None, None, -0.05)})
    frame["bar"].write(tmp_path / "bar.vtu")
    assert statefile.read(tmp_path / "bar.vtu").doubt == "not_settled"


@pytest.mark.parametrize("mark", DOUBT)
def test_an_image_deformed_by_such_a_shape_is_told_of(
    tmp_path: Path,
    organ: vs.Organ,
    shapes: dict[str, vs.State | vs.Frame],
    mark: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("nibabel", reason="images need nibabel: pip install viscera[scan]")
    pytest.importorskip("SimpleITK", reason="images need SimpleITK: pip install viscera[scan]")
    image, written = str(tmp_path / "scan.nii.gz"), tmp_path / "moved.nii.gz"
    vs.Scan.of(organ.mesh, voxel=0.02).write(image)
    with pytest.warns(UserWarning, match=DOUBT[mark]):
        assert shapes[mark].on_grid(image).inside.any()
    with pytest.warns(UserWarning, match=DOUBT[mark]):
        organ.moved(shapes[mark]).on_grid(image)
    shapes[mark].write(tmp_path / "shape.vtu")
    line = ["warp", image, "--with", str(tmp_path / "shape.vtu"), "-o", str(written)]
    assert main([*line, "--json", str(tmp_path / "said")]) == 1
    said = json.loads((tmp_path / "said").read_text())
    assert said["status"] == mark.replace("_", " ")
    assert DOUBT[mark] in said["message"]
    assert f"shape.vtu: {said['message']}\n" in capsys.readouterr().out
    assert written.exists()
    settled = organ.solve(force={"tip": (0, 0, -0.01)}, throw=True)
    settled.write(tmp_path / "shape.vtu")
    assert main(line) == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        settled.on_grid(image)
