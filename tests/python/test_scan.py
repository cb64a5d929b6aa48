"""Label maps in and out: places, world axes, what is refused, and `viscera mesh`."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera import cli
from viscera.scans.grid import Grid

AFFINE = np.array([[0.0, -2e-3, 0.0, 0.08], [1.5e-3, 0.0, 0.0, -0.12], [0.0, 0.0, 3e-3, 0.9]])
SHAPE = (40, 30, 20)


@pytest.fixture
def labelled() -> vs.Scan:
    """A box of label 7 beside one of label 300, on a turned grid with three spacings."""
    values = np.zeros(SHAPE, dtype=np.uint16)
    values[8:20, 6:24, 4:16] = 7
    values[20:32, 6:24, 4:16] = 300
    return vs.Scan(values, AFFINE)


@pytest.mark.parametrize("name", ["labels.nii.gz", "labels.nii", "labels.nrrd", "labels.mha"])
def test_a_label_map_is_where_it_was(labelled: vs.Scan, tmp_path: Path, name: str) -> None:
    pytest.importorskip("nibabel" if ".nii" in name else "SimpleITK")
    labelled.write(tmp_path / name)
    again = vs.scan(tmp_path / name)
    assert again.axes == ("RAS" if ".nii" in name else "LPS")
    assert np.array_equal(again.values, labelled.values)
    assert np.allclose(again.in_axes("RAS").affine, AFFINE, atol=1e-8)
    assert again.labels == {7: 12 * 18 * 12, 300: 12 * 18 * 12}
    place = AFFINE[:, :3] @ [25, 10, 10] + AFFINE[:, 3]
    assert again.in_axes("RAS").at([place, [9.0, 9.0, 9.0]]).tolist() == [300, 0]


@pytest.mark.parametrize("name", ["labels.mhd", "labels.nhdr", "labels.dcm", "labels.png"])
def test_a_label_map_is_not_torn_into_header_and_data(labelled: vs.Scan, tmp_path: Path, name: str) -> None:
    with pytest.raises(vs.VisceraError, match=r"not written in that format; the formats are \.nii, \.nii\.gz, \.nrrd"):
        labelled.write(tmp_path / name)
    assert not any(tmp_path.iterdir())


def test_both_libraries_see_a_nifti_file_in_the_same_place(labelled: vs.Scan, tmp_path: Path) -> None:
    pytest.importorskip("nibabel")
    sitk = pytest.importorskip("SimpleITK")
    labelled.write(tmp_path / "labels.nii.gz")
    image = sitk.ReadImage(str(tmp_path / "labels.nii.gz"))
    index = (25, 10, 10)
    lps = 1e-3 * np.array(image.TransformIndexToPhysicalPoint(index))
    assert np.allclose(lps * [-1, -1, 1], AFFINE[:, :3] @ index + AFFINE[:, 3], atol=1e-8)
    assert image[index] == 300


def test_images_that_are_no_label_map_are_refused(labelled: vs.Scan, tmp_path: Path) -> None:
    nibabel = pytest.importorskip("nibabel")
    eye = np.eye(4)
    nibabel.save(nibabel.Nifti1Image(np.zeros((4, 4, 4, 3), dtype=np.int16), eye), tmp_path / "four.nii")
    with pytest.raises(vs.VisceraError, match=r"four.nii: it has 4 dimensions \(4, 4, 4, 3\); a label map has three"):
        vs.scan(tmp_path / "four.nii")
    nibabel.save(nibabel.Nifti1Image(np.full((4, 4, 4), 0.5), eye), tmp_path / "half.nii")
    with pytest.raises(vs.VisceraError, match=r"it holds 0.5, which is no label"):
        vs.scan(tmp_path / "half.nii")
    thirds = np.full((4, 4, 4), 3, dtype=np.float32) * np.float32(1 / 3)
    nibabel.save(nibabel.Nifti1Image(np.float32(255) * thirds * np.float32(1 + 1e-7), eye), tmp_path / "thirds.nii")
    assert vs.scan(tmp_path / "thirds.nii").labels == {255: 64}
    nibabel.save(nibabel.Nifti1Image(np.full((4, 4, 4), -3, dtype=np.int16), eye), tmp_path / "minus.nii")
    with pytest.raises(vs.VisceraError, match="its values go from -3 to -3; labels are 0 to 65535"):
        vs.scan(tmp_path / "minus.nii")
    (tmp_path / "broken.nii").write_bytes(b"nothing")
    for name, words in {
        "broken.nii": "not a readable .nii image",
        "none.nii": "no such file",
        "x.png": "unknown",
    }.items():
        with pytest.raises(vs.VisceraError, match=words):
            vs.scan(tmp_path / name)
    with pytest.raises(vs.VisceraError, match="places no voxels"):
        vs.Scan(labelled.values, np.zeros((3, 4)))
    with pytest.raises(vs.VisceraError, match="axes 'LAS' is unknown"):
        vs.Scan(labelled.values, AFFINE, "LAS")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_what_is_no_number_is_no_label(value: float) -> None:
    with pytest.raises(vs.VisceraError, match=f"it holds {value}, which is no label"):
        vs.Scan(np.where(np.indices((4, 4, 4))[0] > 2, value, 1.0), AFFINE)


def nrrd(path: Path, *, size: float = 3.0, space: str = "left-posterior-superior", more: str = "") -> Path:
    """A label map of one voxel, 1 at the index (1, 2, 3), with its first voxel 10 units from the origin."""
    values = np.zeros((4, 5, 6), dtype=np.uint8)
    values[1, 2, 3] = 1
    said = f"space: {space}\n" if space else "space dimension: 3\n"
    directions = f"({size},0,0) (0,{size},0) (0,0,{size})"
    head = f"NRRD0005\n# units\ntype: uint8\ndimension: 3\n{said}sizes: 4 5 6\nspace directions: {directions}\n"
    head += f"kinds: domain domain domain\nspace origin: ({10 * size / 3},0,0)\nencoding: raw\nmine:=cm\n{more}\n"
    path.write_bytes(head.encode() + values.tobytes(order="F"))
    return path


@pytest.mark.parametrize(
    ("unit", "size"), [("mm", 3.0), ("cm", 0.3), ("m", 0.003), ("um", 3000.0), ("", 3.0), ("???", 3.0)]
)
def test_the_unit_that_a_nrrd_file_states_is_its_unit(tmp_path: Path, unit: str, size: float) -> None:
    pytest.importorskip("SimpleITK")
    path = nrrd(tmp_path / "labels.nrrd", size=size, more=f'space units: "{unit}" "{unit}" "{unit}"\n')
    exact = [[3e-3, 0.0, 0.0, 10e-3], [0.0, 3e-3, 0.0, 0.0], [0.0, 0.0, 3e-3, 0.0]]
    assert np.allclose(vs.scan(path).affine, exact, atol=1e-9)  # rounding of products
    places = Grid.of(path, "LPS")
    assert np.allclose(np.column_stack([places.matrix, places.origin]), exact, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"more": 'space units: "furlong" "furlong" "furlong"\n'},
            '"furlong" "furlong" "furlong"`; write one of m, cm',
        ),
        ({"more": 'space units: "mm" "mm" "cm"\n'}, "the same for each axis"),
        ({"space": "3D-right-handed"}, "the space '3D-right-handed', which is not that of a patient"),
        ({"space": "scanner-xyz"}, "write `space: left-posterior-superior` there if x points left"),
        ({"space": ""}, "its header states no space"),
    ],
)
def test_a_nrrd_file_in_no_unit_or_no_patient_is_refused(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    pytest.importorskip("SimpleITK")
    path = nrrd(tmp_path / "labels.nrrd", **change)
    for read in (vs.scan, Grid.of):
        with pytest.raises(vs.VisceraError) as refused:
            read(path)
        assert words in str(refused.value)
        assert str(refused.value).startswith(str(path))


def test_a_nifti_file_that_lies_nowhere_is_refused(labelled: vs.Scan, tmp_path: Path) -> None:
    nibabel = pytest.importorskip("nibabel")
    pytest.importorskip("SimpleITK")
    path = tmp_path / "labels.nii.gz"
    image = nibabel.Nifti1Image(labelled.values, None)
    image.header.set_zooms((3.0, 3.0, 3.0))
    nibabel.save(image, path)
    for read in (vs.scan, Grid.of):
        with pytest.raises(vs.VisceraError, match="its header does not say where the image lies") as refused:
            read(path)
        assert str(refused.value).startswith(str(path))
    for code in ("sform", "qform"):
        placed = nibabel.Nifti1Image(labelled.values, None)
        getattr(placed, f"set_{code}")(np.vstack([1e3 * AFFINE, [0.0, 0.0, 0.0, 1.0]]), "scanner")
        nibabel.save(placed, path)
        for affine in (vs.scan(path).affine, np.column_stack([Grid.of(path).matrix, Grid.of(path).origin])):
            assert np.allclose(affine, AFFINE, atol=1e-8)


def test_a_nrrd_file_in_ras_is_turned(tmp_path: Path) -> None:
    pytest.importorskip("SimpleITK")
    found = vs.scan(nrrd(tmp_path / "labels.nrrd", space="RAS"))
    assert np.allclose(found.in_axes("RAS").affine[:, 3], [10e-3, 0.0, 0.0], atol=1e-9)


def test_a_mesh_keeps_the_axes_of_its_scan(labelled: vs.Scan, tmp_path: Path) -> None:
    mesh = labelled.in_axes("LPS").mesh({"a": 7, "b": 300}, edge=0.006)
    mesh.write(tmp_path / "mesh.vtu")
    again = vs.read(tmp_path / "mesh.vtu")
    assert (mesh.axes, again.axes) == ("LPS", "LPS")
    assert again.quadratic().axes == "LPS"
    middle = AFFINE[:, :3] @ [19.5, 14.5, 9.5] + AFFINE[:, 3]
    assert np.allclose(mesh.bounding_box.mean(axis=0), middle * [-1, -1, 1], atol=1e-3)
    plain = vs.organs.beam()
    plain.write(tmp_path / "plain.vtu")
    assert vs.read(tmp_path / "plain.vtu").axes == ""


@pytest.mark.parametrize(("ending", "lacks"), [("mesh", "sets and parts and the axes RAS"), ("vtk", "the axes RAS")])
def test_what_a_format_cannot_hold_is_told(
    labelled: vs.Scan, tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str, lacks: str
) -> None:
    pytest.importorskip("nibabel")
    labelled.write(tmp_path / "labels.nii.gz")
    words = ["mesh", str(tmp_path / "labels.nii.gz"), "--label", "left=7", "--edge", "8mm"]
    assert cli.main([*words, "-o", str(tmp_path / f"organ.{ending}")]) == 0
    assert f".{ending} cannot hold {lacks}; .vtu does" in capsys.readouterr().out
    assert cli.main([*words, "-o", str(tmp_path / "organ.vtu")]) == 0
    assert "cannot hold" not in capsys.readouterr().out
    words[3] = "left=7+7"
    assert cli.main([*words, "-o", str(tmp_path / "organ.vtu")]) == 2
    assert "part 'left' has the label 7 twice" in capsys.readouterr().err


def test_the_command_line(labelled: vs.Scan, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("nibabel")
    labels, target = str(tmp_path / "labels.nii.gz"), str(tmp_path / "organ.vtu")
    labelled.write(labels)
    words = ["mesh", labels, "--label", "left=7", "--label", "right=300", "--edge", "6mm", "--fixed", "label:300"]
    assert cli.main([*words, "-o", target, "--json", str(tmp_path / "mesh.json")]) == 0
    told = capsys.readouterr().out
    assert "40 x 30 x 20 voxels of 1.5 x 2 x 3 mm, axes RAS" in told
    assert "in metres, axes RAS" in told
    facts = json.loads((tmp_path / "mesh.json").read_text(encoding="utf-8"))
    assert set(facts["parts"]) == {"left", "right"}
    for part in facts["parts"].values():
        assert part["volume"] == pytest.approx(part["voxel_volume"], rel=0.01)
    assert facts["least_angle"] > 8.0
    mesh = vs.read(target)
    assert set(mesh.cell_sets) == {"left", "right"}
    assert len(mesh.nodes("fixed")) == facts["sets"]["fixed"]
    assert cli.main(["inspect", target]) == 0
    assert "axes          RAS (right, anterior, superior), in metres" in capsys.readouterr().out


def test_edges_by_part_on_the_command_line(labelled: vs.Scan, tmp_path: Path) -> None:
    pytest.importorskip("nibabel")
    labelled.write(tmp_path / "labels.nii.gz")
    words = ["mesh", str(tmp_path / "labels.nii.gz"), "--label", "left=7", "--label", "right=300"]
    words += ["--edge", "12mm", "--edge", "left=3mm", "-o", str(tmp_path / "organ.vtu")]
    assert cli.main([*words, "--json", str(tmp_path / "mesh.json")]) == 0
    parts = json.loads((tmp_path / "mesh.json").read_text(encoding="utf-8"))["parts"]
    assert parts["left"]["edges"][1] < 0.0035
    assert parts["right"]["edges"][1] > 0.006
    assert parts["left"]["cells"] > 1.5 * parts["right"]["cells"], "of two boxes of one size"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--edge", "6mm"], "name the labels to mesh; the image has the labels 7 (2592 voxels), 300 (2592 voxels)"),
        (["--edge", "6mm", "--label", "5"], "no voxel has the label 5"),
        (["--edge", "90mm", "--label", "7"], "is longer than 'label_7'"),
        (["--edge", "6mm", "--label", "a=x"], "--label a=x is not NAME=NUMBER"),
        (["--edge", "6mm", "--label", "=7"], "--label =7 names no part; say NAME=NUMBER, or the number alone"),
        (["--edge", "6mm", "--label", " =7", "--label", "b=300"], "--label =7 names no part"),
        (["--edge", "=6mm", "--label", "7"], "--edge =6mm names no part; say NAME=LENGTH, or the length alone"),
        (["--edge", "a=6mm", "--label", "a=7", "--label", "b=300"], "--edge: none for 'b'"),
        (["--edge", "6mm", "--edge", "c=3mm", "--label", "a=7"], "--edge c=3mm: 'c' is no part; known: 'a'"),
        (["--edge", "6mm", "--edge", "5mm", "--label", "a=7"], "--edge 5mm: the other parts have an edge already"),
        (["--edge", "a=6mm", "--edge", "a=5mm", "--label", "a=7"], "--edge a=5mm: 'a' has an edge already"),
        (["--edge", "a=0mm", "--label", "a=7"], "edge of 'a' must be a number above 0"),
        (["--edge", "6 ells", "--label", "7"], "--edge 6 ells:"),
        (["--edge", "6mm", "--label", "7", "--units", "mm"], "--units is for surfaces"),
    ],
)
def test_bad_words_are_one_sentence(
    labelled: vs.Scan, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], sentence: str
) -> None:
    pytest.importorskip("nibabel")
    labelled.write(tmp_path / "labels.nii.gz")
    assert cli.main(["mesh", str(tmp_path / "labels.nii.gz"), *words, "-o", str(tmp_path / "organ.vtu")]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("\n") == 1
    assert not (tmp_path / "organ.vtu").exists()


def test_a_surface_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    beam = vs.organs.beam()
    lines = [f"v {x} {y} {z}" for x, y, z in (1e3 * beam.points).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (beam.surface + 1).tolist()]
    (tmp_path / "beam.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    words = ["mesh", str(tmp_path / "beam.obj"), "--edge", "80mm", "-o", str(tmp_path / "beam.vtu")]
    assert cli.main(words) == 2
    assert "a surface needs its --units" in capsys.readouterr().err
    assert cli.main([*words, "--units", "mm", "--fixed", "x < 10%"]) == 0
    mesh = vs.read(tmp_path / "beam.vtu")
    assert mesh.volume == pytest.approx(beam.volume, rel=1e-3)
    assert len(mesh.nodes("fixed")) > 3


def test_labels_of_one_name_are_parts_of_their_own() -> None:
    labels = np.zeros((24, 16, 16), dtype=int)
    labels[3:10, 4:12, 4:12], labels[14:21, 4:12, 4:12] = 1, 2
    scan = vs.Scan(labels, 0.004 * np.eye(3, 4), names={1: "lesion", 2: "lesion"})
    assert sorted(scan.mesh([1, 2], edge="10 mm").cell_sets) == ["lesion (1)", "lesion (2)"]
    with pytest.raises(vs.VisceraError, match="the labels 1, 2 have the name 'lesion'"):
        scan.mesh("lesion", edge="10 mm")
    assert sorted(scan.mesh(2, edge="10 mm").cell_sets) == ["lesion"]
    assert [region.name for region in scan.regions([2, 2])] == ["lesion"]
    values = labels.copy()
    values[10:13, 4:12, 4:12] = 3
    named = vs.Scan(values, scan.affine, names={1: "lesion", 2: "lesion", 3: "lesion (1)", 9: "lesion (1)"})
    assert [r.numbers for r in named.regions([1, 2, 3])] == [(1,), (2,), (3,)], "a name that looks numbered drops none"
    assert [r.numbers for r in named.regions("lesion (1)")] == [(3,)], "no voxel has the other label of this name"


def test_a_label_within_a_part_of_several_fixes_no_nodes() -> None:
    labels = np.zeros((24, 16, 16), dtype=int)
    labels[3:12, 4:12, 4:12], labels[12:16, 4:12, 4:12], labels[16:21, 4:12, 4:12] = 1, 2, 3
    scan = vs.Scan(labels, 0.004 * np.eye(3, 4))
    parts: dict[str, Any] = {"liver": 1, "kidneys": [2, 3]}
    for label in ("label:2", "label:3"):
        with pytest.raises(vs.VisceraError, match="is meshed as a part of 'kidneys'"):
            scan.mesh(parts, edge="10 mm", fixed=label)
    alone = scan.mesh(parts, edge="10 mm", fixed="label:1")
    border = np.intersect1d(alone.cells[alone.cell_sets["liver"]], alone.cells[alone.cell_sets["kidneys"]])
    assert np.array_equal(alone.sets["fixed"], border)
    beside = scan.mesh({"liver": 1}, edge="10 mm", fixed="label:2")
    assert (beside.points[beside.sets["fixed"], 0] > 0.004 * 10).all()


def test_a_label_within_a_part_of_several_is_not_said_to_be_touched() -> None:
    """Whether it is most of the part or little of it; a hole of a few voxels makes no part of several labels."""
    labels = np.zeros((24, 16, 16), dtype=int)
    labels[3:12, 4:12, 4:12], labels[12:16, 4:12, 4:12], labels[16:21, 4:12, 4:12] = 1, 2, 3
    labels[7, 8, 8] = 4
    scan = vs.Scan(labels, 0.004 * np.eye(3, 4))
    mesh = scan.mesh({"liver": 1, "kidneys": [2, 3]}, edge="10 mm")
    for label in (2, 3):
        with pytest.raises(vs.VisceraError, match=f"label {label} is meshed as a part of 'kidneys'"):
            scan.touching(mesh, label)
    border = np.intersect1d(mesh.cells[mesh.cell_sets["liver"]], mesh.cells[mesh.cell_sets["kidneys"]])
    assert np.array_equal(scan.touching(mesh, 1), border)
    alone = scan.mesh({"liver": 1}, edge="10 mm")
    assert np.array_equal(scan.touching(alone, 2), scan.mesh({"liver": 1}, edge="10 mm", fixed="label:2").sets["fixed"])


def test_a_label_is_touched_by_its_number_or_its_name_and_no_other(labelled: vs.Scan) -> None:
    named = replace(labelled, names={7: "liver", 300: "vein"})
    mesh = named.mesh({"liver": 7}, edge="15 mm")
    touched = named.touching(mesh, 300)
    assert len(touched) > 0
    for label in ("vein", "300", np.uint16(300)):
        assert np.array_equal(named.touching(mesh, label), touched)
    for label, words in ((999, "no voxel has the label 999; the image has the labels 7"), ("vena", "no label 'vena'")):
        with pytest.raises(vs.VisceraError, match=words):
            named.touching(mesh, label)
        with pytest.raises(vs.VisceraError, match=words):
            named.near(mesh.points, label)
    assert np.array_equal(named.near(mesh.points, "vein"), named.near(mesh.points, [300]))


def test_fibres_are_told_around_voxels_that_are_not_numbers() -> None:
    ball = vs.Scan(np.linalg.norm(np.indices((24, 24, 24)) - 11.5, axis=0) < 9.0, 0.003 * np.eye(3, 4))
    mesh = ball.mesh(edge="9 mm")
    vectors = np.zeros((24, 24, 24, 3))
    vectors[..., 0] = 1.0
    vectors[12, 12, 12] = np.nan
    vectors[0, 0, 0] = np.inf
    assert np.allclose(np.abs(vs.image_fibres(mesh, (vectors, ball.affine))), [1.0, 0.0, 0.0])
    vectors[8:16, 8:16, 8:16] = np.nan
    with pytest.raises(vs.VisceraError, match="has no direction around"):
        vs.image_fibres(mesh, (vectors, ball.affine))


def test_a_scan_of_a_mesh_has_all_its_cells() -> None:
    ball = vs.Scan(np.linalg.norm(np.indices((24, 24, 24)) - 11.5, axis=0) < 9.0, 0.003 * np.eye(3, 4))
    mesh = ball.mesh(edge="9 mm")
    left = np.flatnonzero(mesh.centroids[:, 0] < np.median(mesh.centroids[:, 0])).astype(np.uint32)
    near = np.flatnonzero(np.linalg.norm(mesh.centroids - mesh.centroids.mean(axis=0), axis=1) < 0.01).astype(np.uint32)
    whole = vs.Scan.of(mesh, voxel=0.003)
    cut = vs.Scan.of(replace(mesh, cell_sets={"left": left}), voxel=0.003)
    assert cut.names == {1: "left", 2: "rest"}
    assert abs(sum(cut.labels.values()) - sum(whole.labels.values())) <= 2
    everything = np.arange(len(mesh.cells), dtype=np.uint32)
    nested = vs.Scan.of(replace(mesh, cell_sets={"nodule": near, "organ": everything}), voxel=0.003)
    assert nested.labels[1] > 0
    assert sum(nested.labels.values()) == sum(whole.labels.values())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"affine": "x"}, "the affine map must be an array"),
        ({"affine": 3}, "the affine map must be an array"),
        ({"affine": np.zeros((3, 4))}, "places no voxels"),
        ({"values": [[[1], [1, 2]]]}, "the values of a label map must be an array"),
        ({"names": ["liver"]}, "the names of labels must be a mapping"),
    ],
)
def test_what_places_no_labels_is_refused(change: dict[str, Any], words: str) -> None:
    given: dict[str, Any] = {"values": np.ones((4, 4, 4), dtype=int), "affine": 1e-7 * np.eye(3, 4)}
    vs.Scan(**given)  # however small its voxels
    with pytest.raises(vs.VisceraError, match=words):
        vs.Scan(**(given | change))


NO_MESH: Any = "a.vtu"
ALONE: Any = np.ones((2, 2, 2, 3))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda scan: scan.at([1.0, 2.0]), r"the places must be finite numbers \(k, 3\) \[m\], got \[1.0, 2.0\]"),
        (lambda scan: scan.at("x"), r"the places must be finite numbers"),
        (lambda scan: scan.at([[np.nan, 0, 0]]), r"the places must be finite numbers"),
        (
            lambda scan: scan.mesh(7, edge="15 mm", progress=3),
            "progress must be a function of .done, total, stage., or None, got 3",
        ),
        (lambda scan: scan.touching(3, 1), "the mesh must be a Mesh"),
        (lambda scan: scan.near([[0, 0, 0]], "--7"), "the image has no label '--7'"),
        (lambda scan: scan.near([[0, 0, 0]], [7], reach=5), "reach, in voxels, must be a number from 0 to 1, got 5"),
        (lambda scan: scan.write(None), "the file to write must be named by a text or a path, got None"),
        (lambda _: vs.Scan.of(NO_MESH, voxel=0.003), r"the mesh must be a Mesh, such as vs.read.*, got 'a.vtu'"),
        (
            lambda scan: vs.image_fibres(vs.organs.beam(), scan),
            "image 1 of fibres must be a file of vectors, or vectors",
        ),
        (lambda _: vs.image_fibres(vs.organs.beam(), ALONE), "image 1 of fibres must be a file of"),
        (lambda scan: vs.image_fibres(vs.organs.beam(), ("x", scan.affine)), "image 1 of fibres must be vectors"),
    ],
)
def test_wrong_questions_to_a_scan(labelled: vs.Scan, make: Callable[[Any], object], words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        make(labelled)


def test_one_point_is_asked_as_several_are(labelled: vs.Scan) -> None:
    place = AFFINE @ [10, 10, 10, 1]
    assert labelled.at(place).tolist() == labelled.at([place]).tolist() == [7]
    assert np.allclose(labelled.index(place.tolist()), [[10, 10, 10]])
    assert labelled.near(place, [7]).tolist() == [True]
    assert labelled.at([1e300, 0, 0]).tolist() == [0]
