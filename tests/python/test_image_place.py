"""Images lie where their headers say, and those that do not say it are refused."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.scans.grid import Grid

sitk = pytest.importorskip("SimpleITK", reason="images need SimpleITK: pip install viscera[scan]")

VOXELS = np.ones((4, 5, 6), dtype=np.uint8)
META = {"Offset": "10 20 30", "TransformMatrix": "0 1 0 1 0 0 0 0 1", "ElementSpacing": "2 3 4"}
NRRD = {"space": "left-posterior-superior", "space origin": "(10,20,30)", "space directions": "(0,2,0) (3,0,0) (0,0,4)"}
AFFINE = 1e-3 * np.array([[0, 3, 0, 10], [2, 0, 0, 20], [0, 0, 4, 30]])
OLDER = [
    ("Offset", "Position"),
    ("Offset", "Origin"),
    ("Offset", "ImagePosition"),
    ("TransformMatrix", "Rotation"),
    ("TransformMatrix", "Orientation"),
    ("ElementSpacing", "ElementSize"),
]
"""What fields of a MetaImage are called, and were."""


def meta(path: Path, fields: Mapping[str, str], sign: str = " = ") -> Path:
    """A MetaImage of VOXELS: of one file, or with its data beside it."""
    is_whole = path.suffix == ".mha"
    head = {"ObjectType": "Image", "NDims": "3", "BinaryData": "True", **fields, "DimSize": "4 5 6"}
    head |= {"ElementType": "MET_UCHAR", "ElementDataFile": "LOCAL" if is_whole else "voxels.raw"}
    said, data = "".join(f"{name}{sign}{value}\n" for name, value in head.items()).encode(), VOXELS.tobytes()
    path.write_bytes(said + data if is_whole else said)
    path.with_name("voxels.raw").write_bytes(data)
    return path


def nrrd(path: Path, fields: Mapping[str, str]) -> Path:
    """A NRRD file of VOXELS."""
    head = {"type": "uint8", "dimension": "3", **fields, "sizes": "4 5 6", "encoding": "raw"}
    said = "NRRD0005\n" + "".join(f"{name}: {value}\n" for name, value in head.items()) + "\n"
    path.write_bytes(said.encode() + VOXELS.tobytes())
    return path


def expect_place(path: Path, exact: NDArray[np.float64]) -> None:
    scan, places = vs.scan(path), Grid.of(path, "LPS")
    assert scan.axes == "LPS"
    assert np.allclose(scan.affine, exact, atol=1e-9)
    assert np.allclose(np.column_stack([places.matrix, places.origin]), exact, atol=1e-9)


def expect_refusal(path: Path, words: str) -> None:
    for read in (vs.scan, Grid.of):
        with pytest.raises(vs.VisceraError, match=words) as refused:
            read(path)
        assert str(refused.value).startswith(str(path))


@pytest.mark.parametrize("ending", [".mha", ".mhd"])
@pytest.mark.parametrize("sign", [" = ", "=", ": "])
def test_a_meta_image_lies_where_it_says(tmp_path: Path, ending: str, sign: str) -> None:
    expect_place(meta(tmp_path / f"image{ending}", META, sign), AFFINE)


@pytest.mark.parametrize(("name", "older"), OLDER)
def test_older_names_of_its_place_count(tmp_path: Path, name: str, older: str) -> None:
    fields = {older if key == name else key: value for key, value in META.items()}
    expect_place(meta(tmp_path / "image.mha", fields), AFFINE)


@pytest.mark.parametrize("ending", [".mha", ".mhd"])
@pytest.mark.parametrize("name", META)
def test_a_meta_image_that_does_not_say_where_it_lies_is_refused(tmp_path: Path, ending: str, name: str) -> None:
    rest = {key: value for key, value in META.items() if key != name}
    words = f"its header does not say where the image lies; write `{name} = ` there with [39] numbers"
    expect_refusal(meta(tmp_path / f"image{ending}", rest), words)
    expect_refusal(meta(tmp_path / f"image{ending}", rest | {"Comment": f"{name} = {META[name]}"}), words)


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("cm", 1e-2), ("um", 1e-6), ("?", 1e-3)])
def test_the_unit_that_a_meta_image_states_is_its_unit(tmp_path: Path, unit: str, metres: float) -> None:
    expect_place(meta(tmp_path / "image.mha", META | {"DistanceUnits": unit}), metres / 1e-3 * AFFINE)


def test_a_meta_image_in_no_unit_is_refused(tmp_path: Path) -> None:
    path = meta(tmp_path / "image.mha", META | {"DistanceUnits": "furlong"})
    expect_refusal(path, "its header has `DistanceUnits = furlong`; write one of m, cm, mm")


@pytest.mark.parametrize("name", ["space origin", "space directions"])
def test_a_nrrd_file_that_does_not_say_where_it_lies_is_refused(tmp_path: Path, name: str) -> None:
    expect_place(nrrd(tmp_path / "image.nrrd", NRRD), AFFINE)
    rest = {key: value for key, value in NRRD.items() if key != name}
    expect_refusal(
        nrrd(tmp_path / "image.nrrd", rest),
        rf"its header does not say where the image lies; write `{name}: \(x,y,z\).*` there",
    )


@pytest.mark.parametrize("ending", [".nrrd", ".nhdr", ".mha", ".mhd"])
def test_what_simpleitk_writes_says_where_it_lies(tmp_path: Path, ending: str) -> None:
    image = sitk.GetImageFromArray(VOXELS)
    sitk.WriteImage(image, str(tmp_path / f"image{ending}"))
    expect_place(tmp_path / f"image{ending}", 1e-3 * np.eye(3, 4))
