"""Voxels that are not finite, as outside a scanner's field of view, in images that are deformed and written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.cli import main
from viscera.scans import grid
from viscera.scans.warp import warp

nibabel = pytest.importorskip("nibabel", reason="images need nibabel: pip install viscera[scan]")
sitk = pytest.importorskip("SimpleITK", reason="images need SimpleITK: pip install viscera[scan]")

VOXEL = 0.01


@pytest.fixture(name="organ")
def organ_fixture(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=4e5, poisson=0.3), fixed="root")


@pytest.fixture(name="scan")
def scan_fixture(bar: vs.Mesh) -> Any:
    """An image of the bar and around it, whose values are those of a scan."""
    places = grid.Grid.of(vs.Scan.of(bar, voxel=VOXEL))
    return places.image(np.random.default_rng(0).normal(100.0, 20.0, places.shape).astype(np.float32))


def values(image: Any) -> Any:
    return sitk.GetArrayFromImage(image).transpose(2, 1, 0)


def with_values(image: Any, at: dict[tuple[int, int, int], float]) -> Any:
    changed = values(image)
    for index, value in at.items():
        changed[index] = value
    return grid.Grid.of(image).image(changed)


@pytest.mark.parametrize("ending", [".nii.gz", ".nii", ".nrrd", ".mha"])
def test_voxels_that_are_not_finite_are_written_as_they_are(tmp_path: Path, scan: Any, ending: str) -> None:
    image = with_values(scan, {(0, 0, 0): np.nan, (1, 2, 3): np.inf, (3, 2, 1): -np.inf})
    grid.write(tmp_path / f"image{ending}", image)
    assert np.array_equal(values(grid.read(tmp_path / f"image{ending}")), values(image), equal_nan=True)
    if ending.startswith(".nii"):
        stored = np.asanyarray(nibabel.load(tmp_path / f"image{ending}").dataobj)
        assert np.array_equal(stored, values(image), equal_nan=True)


@pytest.mark.parametrize("ending", [".nii.gz", ".nrrd"])
def test_an_image_with_nan_is_deformed_on_the_command_line(
    tmp_path: Path, organ: vs.Organ, scan: Any, ending: str
) -> None:
    image = with_values(scan, {(0, 0, 0): np.nan})
    grid.write(tmp_path / f"scan{ending}", image)
    organ.moved(np.full_like(organ.mesh.points, [0.0, 0.0, VOXEL])).write(tmp_path / "state.vtu")
    moved = tmp_path / f"moved{ending}"
    line = ["warp", str(tmp_path / f"scan{ending}"), "--with", str(tmp_path / "state.vtu"), "-o", str(moved)]
    assert main([*line, "--quiet"]) == 0
    found = values(grid.read(moved))
    assert np.argwhere(np.isnan(found)).tolist() == [[0, 0, 0]], "it is far from the organ, and stays"
    assert found[np.isfinite(found)].min() == np.nanmin(values(image)), "the background"


def test_a_value_that_is_not_finite_spreads_to_its_neighbours_alone(organ: vs.Organ, scan: Any) -> None:
    """The organ moves by a third of a voxel, or by a whole one, where only the voxel itself is not known."""
    i, j, k = (int(n) // 2 for n in values(scan).shape)
    for part, count in ((1.0 / 3.0, 2), (1.0, 1)):
        shape = organ.moved(np.full_like(organ.mesh.points, [0.0, 0.0, part * VOXEL]))
        fields = [shape.on_grid(scan, inverse=inverse) for inverse in (False, True)]
        for value in (np.nan, np.inf):
            found = values(warp(with_values(scan, {(i, j, k): value}), *fields))
            without = values(warp(scan, *fields))
            lost = np.argwhere(~np.isfinite(found))
            assert len(lost) == count
            assert (np.abs(lost - [i, j, k]) <= 1).all()
            assert np.array_equal(found[np.isfinite(found)], without[np.isfinite(found)])


def test_an_image_without_a_finite_value_has_no_background(organ: vs.Organ, scan: Any) -> None:
    shape = organ.moved(np.zeros_like(organ.mesh.points))
    fields = [shape.on_grid(scan, inverse=inverse) for inverse in (False, True)]
    empty = grid.Grid.of(scan).image(np.full_like(values(scan), np.nan))
    with pytest.raises(vs.VisceraError, match="no voxel of the image is finite; name a background"):
        warp(empty, *fields)
    assert np.isnan(values(warp(empty, *fields, background=0.0))).any()
