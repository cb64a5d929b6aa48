"""Images lie where their headers say, and those that do not say it are refused."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

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


SPACES = {"right-anterior-superior": (1.0, 1.0), "LPS": (-1.0, -1.0), "left-anterior-superior": (-1.0, 1.0)}
"""Signs of the first two axes of a space of NRRD in RAS."""


def vectors(path: Path, space: str, components: ArrayLike, frame: str = "") -> Path:
    """A NRRD file whose 26 x 14 x 14 voxels of 3 mm all hold one vector."""
    x, y = SPACES[space]
    head = {"type": "float", "dimension": "4", "space": space, "sizes": "3 26 14 14", "encoding": "raw"}
    head |= {"space directions": f"none ({3 * x},0,0) (0,{3 * y},0) (0,0,3)", "space origin": "(0,0,0)"}
    head |= {"kinds": "vector domain domain domain", "endian": "little"} | (
        {"measurement frame": frame} if frame else {}
    )
    said = "".join(f"{name}: {value}\n" for name, value in head.items())
    data = np.broadcast_to(np.asarray(components, dtype="<f4"), (26 * 14 * 14, 3)).tobytes()
    path.write_bytes(f"NRRD0005\n{said}\n".encode() + data)
    return path


@pytest.mark.parametrize("axes", ["RAS", "LPS"])
@pytest.mark.parametrize("space", SPACES)
def test_vectors_of_nrrd_are_turned_into_the_axes_of_the_mesh(tmp_path: Path, space: str, axes: str) -> None:
    bar = vs.Scan(np.pad(np.ones((20, 8, 8), dtype=np.uint8), 3), 3e-3 * np.eye(3, 4)).in_axes(axes)
    mesh, (x, y) = bar.mesh(1, edge="8 mm"), SPACES[space]
    direction = np.array([1.0, 2.0, 0.5])  # in RAS
    expected = direction * ([1.0, 1.0, 1.0] if axes == "RAS" else [-1.0, -1.0, 1.0]) / np.linalg.norm(direction)
    one = vectors(tmp_path / "one.nrrd", space, direction * [x, y, 1.0])
    # A frame turned by a quarter about z, in which the space's (a, b, c) has the components (b, -a, c).
    measured = vectors(tmp_path / "two.nrrd", space, [2.0 * y, -x, 0.5], "(0,1,0) (-1,0,0) (0,0,1)")
    for family in vs.image_fibres(mesh, one, measured):
        cosine = np.abs(family @ expected)
        assert np.allclose(cosine, 1.0, atol=1e-6)  # vectors in single precision


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ("(1,0,0) (0,1,0) (1,1,0)", r"its header has `measurement frame: \(1,0,0\).*`; write three independent"),
        ("(nan,nan,nan) " * 3, r"its header has `measurement frame: \(nan,nan,nan\).*`; write three independent"),
        ("(1,0,0) (0,1,0)", "not a readable .nrrd image .*measurement_frame"),
    ],
)
def test_a_measurement_frame_is_three_vectors(tmp_path: Path, frame: str, words: str) -> None:
    path = vectors(tmp_path / "bad.nrrd", "LPS", [1.0, 0.0, 0.0], frame)
    with pytest.raises(vs.VisceraError, match=rf"bad\.nrrd: ({words})"):
        vs.image_fibres(vs.organs.beam(), path)
