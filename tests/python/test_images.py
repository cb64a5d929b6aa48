"""Which voxels an image file gives, and where they lie."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.cli import main
from viscera.scans import grid

nibabel = pytest.importorskip("nibabel", reason="images need nibabel: pip install viscera[scan]")
sitk = pytest.importorskip("SimpleITK", reason="images need SimpleITK: pip install viscera[scan]")

AFFINE = np.diag([10.0, 10.0, 10.0, 1.0])
"""Voxels of 1 cm [mm]."""


def nifti(path: Path, voxels: Any) -> None:
    nibabel.save(nibabel.Nifti1Image(voxels, AFFINE), path)


def voxels_of(path: Path) -> Any:
    """The voxels (i, j, k) that are deformed."""
    return sitk.GetArrayFromImage(grid.read(path)).transpose(2, 1, 0)


def box(label: int) -> Any:
    labels = np.zeros((8, 7, 6), dtype=np.uint8)
    labels[2:6, 2:5, 2:4] = label
    return labels


def test_an_image_is_its_own_and_not_that_beside_it(tmp_path: Path) -> None:
    """SimpleITK takes the voxels of scan.nii for those of scan.nii.gz."""
    nifti(tmp_path / "scan.nii.gz", box(1))
    nifti(tmp_path / "scan.nii", box(7))
    organ = vs.Organ(vs.scan(tmp_path / "scan.nii.gz").mesh(edge=0.02), vs.NeoHookean(young=1e4, poisson=0.3))
    organ.moved(np.zeros_like(organ.mesh.points)).write(tmp_path / "still.vtu")
    line = ["warp", str(tmp_path / "scan.nii.gz"), "--with", str(tmp_path / "still.vtu"), "--quiet"]
    assert main([*line, "-o", str(tmp_path / "moved.nii.gz")]) == 0
    assert np.array_equal(np.asarray(nibabel.load(tmp_path / "moved.nii.gz").dataobj), box(1))
    assert np.array_equal(voxels_of(tmp_path / "scan.nii"), box(7))


@pytest.mark.parametrize("kind", ["u1", "i2", ">i2", ">f4", "f8", "i8", "u8"])
def test_the_voxels_of_a_nifti_file_keep_their_values_and_type(tmp_path: Path, kind: str) -> None:
    values = np.arange(24).reshape(2, 3, 4).astype(kind)
    header = nibabel.Nifti1Header(endianness=">" if kind[0] == ">" else "<")
    nibabel.save(nibabel.Nifti1Image(values, AFFINE, header, dtype=values.dtype), tmp_path / "image.nii")
    found = voxels_of(tmp_path / "image.nii")
    assert np.array_equal(found, values)
    assert found.dtype == values.dtype.newbyteorder("=")


def test_several_values_at_a_voxel_are_one_vector(tmp_path: Path) -> None:
    """Frames, and the components that NIfTI keeps in the fifth dimension."""
    values = np.arange(72, dtype=np.int16).reshape(2, 3, 4, 3)
    for name, shaped in {"frames": values, "components": values[:, :, :, None]}.items():
        nifti(tmp_path / f"{name}.nii", shaped)
        image = grid.read(tmp_path / f"{name}.nii")
        assert image.GetNumberOfComponentsPerPixel() == 3
        assert np.array_equal(sitk.GetArrayFromImage(image).transpose(2, 1, 0, 3), values)


def test_what_is_no_volume_of_numbers_is_refused(tmp_path: Path) -> None:
    nifti(tmp_path / "flat.nii", np.zeros((4, 5), dtype=np.int16))
    nifti(tmp_path / "complex.nii", np.zeros((4, 5, 6), dtype=np.complex64))
    nifti(tmp_path / "colour.nii", np.zeros((4, 5, 6), dtype=[("R", "u1"), ("G", "u1"), ("B", "u1")]))
    sitk.WriteImage(sitk.Image([4, 5, 6, 2], sitk.sitkUInt8), str(tmp_path / "four.nrrd"))
    for name, words in {
        "flat.nii": r"it has 2 dimensions \(4, 5\); a volume has three",
        "complex.nii": "its voxels hold complex64; give an image of real numbers",
        "colour.nii": "its voxels hold .*'R'",
        "four.nrrd": r"it has 4 dimensions \(4, 5, 6, 2\); a volume has three, so save one volume of it",
    }.items():
        with pytest.raises(vs.VisceraError, match=rf"{name}: {words}"):
            grid.read(tmp_path / name)


@pytest.mark.parametrize(("header", "data"), [("scan.nhdr", "scan.raw"), ("scan.mhd", "scan.raw")])
def test_a_header_with_its_data_beside_it_is_deformed(tmp_path: Path, header: str, data: str) -> None:
    image = sitk.GetImageFromArray(box(3).transpose(2, 1, 0))
    image.SetSpacing([10.0, 10.0, 10.0])
    sitk.WriteImage(image, str(tmp_path / header))
    assert (tmp_path / data).exists()
    organ = vs.Organ(vs.scan(tmp_path / header).mesh(edge=0.02), vs.NeoHookean(young=1e4, poisson=0.3))
    organ.moved(np.full_like(organ.mesh.points, [0.01, 0.0, 0.0])).write(tmp_path / "state.vtu")
    line = ["warp", str(tmp_path / header), "--with", str(tmp_path / "state.vtu"), "--quiet"]
    assert main([*line, "-o", str(tmp_path / "moved.nii")]) == 0
    assert np.array_equal(voxels_of(tmp_path / "moved.nii")[1:], box(3)[:-1])


def test_a_header_is_not_written_without_its_data(tmp_path: Path) -> None:
    for ending in (".nhdr", ".mhd"):
        with pytest.raises(vs.VisceraError, match="images are not written in that format"):
            grid.checked(tmp_path / f"moved{ending}")


def test_sheared_voxels_are_refused_in_every_format(tmp_path: Path) -> None:
    """SimpleITK holds them, and turns them into others where it writes NIfTI."""
    image = sitk.Image([4, 5, 6], sitk.sitkUInt8)
    image.SetDirection([1.0, 0.4, 0.0, 0.0, 0.9165, 0.0, 0.0, 0.0, 1.0])
    for ending in (".nrrd", ".mha"):
        sitk.WriteImage(image, str(tmp_path / f"image{ending}"))
        with pytest.raises(vs.VisceraError, match=rf"image\{ending}: its voxels are sheared"):
            grid.read(tmp_path / f"image{ending}")
