"""Displacements on image grids and images deformed: read back by SimpleITK, whose conventions are the measure."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.conftest import full_disk

import viscera as vs
from viscera.cli import main
from viscera.scans import grid
from viscera.scans.warp import labels_moved, warp

sitk = pytest.importorskip("SimpleITK", reason="images need SimpleITK: pip install viscera[scan]")

Floats = NDArray[np.float64]
LAW = vs.NeoHookean(young=1e4, poisson=0.3)
RAS = np.array([-1.0, -1.0, 1.0])
TURN = np.linalg.qr(np.array([[1.0, 0.2, 0.1], [-0.3, 1.0, 0.2], [0.1, -0.2, 1.0]]))[0]
TURN *= np.sign(np.diag(TURN))
"""Directions of an oblique scan."""
GRADIENT = np.array([[0.05, 0.1, 0.0], [0.0, -0.1, 0.05], [0.1, 0.0, 0.1]])


def scan(direction: Floats = TURN, spacing: tuple[float, float, float] = (3.0, 4.0, 5.0)) -> Any:
    """An empty scan [mm, LPS] around the cube of 100 mm, whichever axes its mesh is in."""
    counts = [int(320 / step) for step in spacing]
    image = sitk.Image(counts, sitk.sitkUInt8)
    image.SetSpacing(spacing)
    image.SetDirection(direction.ravel().tolist())
    middle = direction @ (np.array(spacing) * (np.array(counts) - 1) / 2)
    image.SetOrigin((-middle).tolist())
    return image


def affine(cube: vs.Mesh, element: str = "P1") -> vs.Moved:
    """The cube about the origin under a uniform gradient."""
    mesh = vs.mesh(cube.points - 0.05, cube.cells, cube.sets)
    organ = vs.Organ(mesh, LAW, fixed="bottom", element=element)
    return organ.moved(organ.mesh.points @ GRADIENT.T + [0.01, 0.0, -0.005])


def after(x: Floats) -> Floats:
    return np.asarray(x + x @ GRADIENT.T + [0.01, 0.0, -0.005])


@pytest.mark.parametrize("ending", [".nii.gz", ".nii", ".NII", ".nrrd", ".mha"])
def test_an_image_is_written_under_its_own_name_alone(tmp_path: Path, ending: str) -> None:
    grid.write(tmp_path / f"image{ending}", scan())
    assert [path.name for path in tmp_path.iterdir()] == [f"image{ending}"]
    again = grid.read(tmp_path / f"image{ending}")
    assert again.GetSize() == scan().GetSize()
    assert np.allclose(again.GetOrigin(), scan().GetOrigin(), atol=1e-3)


def test_an_image_that_cannot_be_written_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(vs.VisceraError, match=r"image\.nii: could not be written \(SimpleITK: "):
        grid.write(tmp_path / "image.nii", sitk.Image([4, 4, 4], sitk.sitkLabelUInt8))
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("ending", [".nii.gz", ".nii", ".nrrd", ".mha"])
def test_a_part_of_an_image_is_no_image(tmp_path: Path, ending: str) -> None:
    """On a full disk SimpleITK says nothing of some formats."""
    image = sitk.GetImageFromArray(np.random.default_rng(0).integers(0, 99, (20, 30, 40)).astype(np.int16))
    for most in (2000, 4096, 8192):
        with full_disk(most), pytest.raises(vs.VisceraError, match=rf"image{ending}: could not be written \("):
            grid.write(tmp_path / f"image{ending}", image)
        assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("ending", [".nii.gz", ".nrrd", ".mha"])
@pytest.mark.parametrize("axes", ["RAS", "LPS"])
@pytest.mark.parametrize("element", ["P1", "P2"])
def test_itk_moves_points_as_the_organ_moves(
    cube: vs.Mesh, tmp_path: Path, axes: str, ending: str, element: str
) -> None:
    """A field on file, taken for a transform by ITK [mm, LPS], maps X to x; the inverse one maps x to X."""
    shape = affine(cube, element)
    sitk.WriteImage(scan(), str(tmp_path / "scan.nii.gz"))
    sign = RAS if axes == "RAS" else np.ones(3)
    places = np.random.default_rng(0).uniform(-0.045, 0.045, (40, 3))
    for inverse, start, end in ((False, places, after(places)), (True, after(places), places)):
        field = shape.on_grid(tmp_path / "scan.nii.gz", axes=axes, inverse=inverse)
        field.write(tmp_path / f"field{ending}")
        image = sitk.ReadImage(str(tmp_path / f"field{ending}"), sitk.sitkVectorFloat64)
        transform = sitk.DisplacementFieldTransform(image)
        for X, x in zip(start, end, strict=True):
            moved = transform.TransformPoint((1e3 * sign * X).tolist())
            assert np.array(moved) == pytest.approx(1e3 * sign * x, abs=2e-3), "single precision, and spacing of files"


def test_nifti_says_ras_to_those_who_read_it_so(cube: vs.Mesh, tmp_path: Path) -> None:
    nibabel = pytest.importorskip("nibabel")
    field = affine(cube).on_grid(scan(), axes="RAS")
    field.write_mask(tmp_path / "mask.nii.gz")
    image = nibabel.load(tmp_path / "mask.nii.gz")
    assert image.affine[:3, :3] == pytest.approx(1e3 * field.grid.matrix, abs=1e-4)
    assert image.affine[:3, 3] == pytest.approx(1e3 * field.grid.origin, abs=1e-3)
    kept = np.asarray(image.dataobj)
    assert ((kept == 2) == field.inside).all()
    assert ((kept > 0) == field.is_known).all()


def test_inside_is_where_the_cube_is(cube: vs.Mesh) -> None:
    image = scan()
    field = affine(cube).on_grid(image, axes="LPS")
    for index in np.ndindex(field.inside.shape):
        x = 1e-3 * np.array(image.TransformIndexToPhysicalPoint((np.array(index) + field.first).tolist()))
        depth = 0.05 - np.abs(x).max()
        if abs(depth) > 1e-9:
            assert field.inside[index] == (depth > 0.0)
        if field.inside[index]:
            assert field.displacement[index] == pytest.approx(after(x) - x, abs=1e-12)
    outside = ~field.is_known
    assert not field.displacement[outside].any()
    assert field.is_known.sum() > field.inside.sum()
    bare = affine(cube).on_grid(image, axes="LPS", margin=0.0)
    assert bare.is_known.sum() == bare.inside.sum() == field.inside.sum()


def labels_of(inside: Any, image: Any) -> Any:
    """A label map: 3 where `inside` says so of places [m, RAS], 7 far away, 0 elsewhere."""
    places = grid.Grid.of(image, "RAS")
    index = np.stack(np.meshgrid(*map(np.arange, places.shape), indexing="ij"), -1)
    x = places.places(index)
    voxels = np.where(inside(x), 3, np.where(x[..., 2] < -0.11, 7, 0)).astype(np.uint8)
    return places.image(voxels)


def voxels_of(image: Any) -> NDArray[Any]:
    return np.asarray(sitk.GetArrayFromImage(image).transpose(2, 1, 0))


def in_cube(x: Floats) -> NDArray[np.bool_]:
    return np.asarray((np.abs(x) < 0.05).all(axis=-1))


def in_moved_cube(x: Floats) -> NDArray[np.bool_]:
    back = np.linalg.inv(np.eye(3) + GRADIENT)
    return in_cube((x - [0.01, 0.0, -0.005]) @ back.T)


def test_a_label_map_moves_with_the_organ_and_leaves_nothing_behind(cube: vs.Mesh) -> None:
    """Every voxel but those that the surface cuts is as if the moved organ had been segmented anew."""
    image = scan(spacing=(2.5, 2.5, 2.5))
    shape = affine(cube)
    before, exact = labels_of(in_cube, image), voxels_of(labels_of(in_moved_cube, image))
    fields = [shape.on_grid(image, inverse=inverse) for inverse in (False, True)]
    warped = warp(before, *fields, interpolation="nearest")
    found = voxels_of(warped)
    assert set(np.unique(found)) == {0, 3, 7}
    assert (found == 7).sum() == (exact == 7).sum()
    assert abs((found == 3).sum() / (exact == 3).sum() - 1) < 0.02
    depth = fields[1].is_known ^ fields[1].inside
    box = tuple(slice(first, first + n) for first, n in zip(fields[1].first, depth.shape, strict=True))
    assert (found[box] == exact[box])[fields[1].inside].mean() > 0.98
    elsewhere = np.ones(found.shape, dtype=bool)
    elsewhere[box] = ~fields[1].is_known
    assert (found == 3)[elsewhere].sum() == 0, "no shell of the organ stays where it was"


def test_what_lies_beside_the_organ_stays_unless_the_organ_covers_it(cube: vs.Mesh) -> None:
    """A neighbour that touches the organ, and that the mesh cuts into by a voxel here and there."""
    places = grid.Grid.of(scan(np.eye(3), (2.5, 2.5, 2.5)), "RAS")
    x = places.places(np.stack(np.meshgrid(*map(np.arange, places.shape), indexing="ij"), -1))
    cut = (x[..., 0] > 0.047) & (np.abs(x[..., 1]) < 0.01)
    neighbour = (x[..., 0] > 0.05) & (x[..., 0] < 0.08) & (np.abs(x[..., 1:]) < 0.05).all(axis=-1)
    before = np.where(in_cube(x) & ~cut, 3, np.where(neighbour | (in_cube(x) & cut), 5, 0)).astype(np.uint8)
    shape = vs.Organ(vs.mesh(cube.points - 0.05, cube.cells), LAW, fixed="z < 1%")
    shift = np.zeros_like(shape.mesh.points)
    for step in (-0.02, 0.01):
        shift[:, 0] = step
        fields = [shape.moved(shift).on_grid(places.image(before), inverse=inverse) for inverse in (False, True)]
        found = voxels_of(warp(places.image(before), *fields, interpolation="nearest"))
        voxels = round(-step / 2.5e-3)  # LPS, and the organ in RAS
        assert np.array_equal(found == 3, np.roll(before == 3, voxels, axis=0))
        assert np.array_equal(found == 5, (before == 5) & (found != 3))
        labels = labels_moved(places.image(before), fields[0])
        assert labels is not None
        assert labels.tolist() == [3]


def test_an_image_resampled_by_itk_is_the_same_inside(cube: vs.Mesh) -> None:
    image = scan(spacing=(4.0, 4.0, 4.0))
    places = grid.Grid.of(image, "RAS")
    index = np.stack(np.meshgrid(*map(np.arange, places.shape), indexing="ij"), -1)
    x = places.places(index)
    scene = places.image((100 * np.sin(40 * x[..., 0]) + 5e2 * x[..., 1] + 1e3 * x[..., 2] ** 2).astype(np.float32))
    fields = [affine(cube).on_grid(image, inverse=inverse) for inverse in (False, True)]
    ours = voxels_of(warp(scene, *fields))
    vectors = fields[1].grid.image(RAS * fields[1].displacement * 1e3)
    theirs = voxels_of(sitk.Resample(scene, scene, sitk.DisplacementFieldTransform(vectors), sitk.sitkLinear))
    at = tuple((np.argwhere(fields[1].inside) + fields[1].first).T)
    assert len(at[0]) > 5000
    assert ours[at] == pytest.approx(theirs[at], abs=1e-3)


@pytest.fixture(name="files")
def files_fixture(cube: vs.Mesh, tmp_path: Path) -> Path:
    mesh = vs.mesh(cube.points - 0.05, cube.cells, cube.sets)
    organ = vs.Organ(mesh, LAW, fixed="bottom", element="P2")
    organ.solve(force={"top": (5.0, 0.0, -5.0)}).write(tmp_path / "state.vtu")
    sitk.WriteImage(labels_of(in_cube, scan(spacing=(5.0, 5.0, 5.0))), str(tmp_path / "labels.nii.gz"))
    return tmp_path


def test_warp_from_the_command_line(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [str(files / "labels.nii.gz"), "--with", str(files / "state.vtu")]
    written = ["-o", str(files / "moved.nrrd"), "--field", str(files / "field.nii.gz"), "--json", str(files / "said")]
    assert main(["warp", *words, *written]) == 0
    keys = {"status", "seconds", "voxels", "voxels_moved", "interpolation", "labels_moved"}
    assert set(json.loads((files / "said").read_text())) == keys, "as docs/cli.md says"
    assert "nearest interpolation" in capsys.readouterr().out
    moved = voxels_of(sitk.ReadImage(str(files / "moved.nrrd")))
    before = voxels_of(sitk.ReadImage(str(files / "labels.nii.gz")))
    assert set(np.unique(moved)) == {0, 3, 7}
    assert (moved != before).sum() > 100
    field = sitk.ReadImage(str(files / "field.nii.gz"))
    assert field.GetNumberOfComponentsPerPixel() == 3


def blocks() -> Any:
    """A label map in which each block of 4 x 4 x 4 voxels has a label of its own."""
    image = scan(spacing=(5.0, 5.0, 5.0))
    return filled(image, np.tensordot([256, 16, 1], np.indices(image.GetSize()) // 4, axes=1) + 1)


def filled(image: Any, values: NDArray[Any]) -> Any:
    """The image with other values (i, j, k), in their type."""
    made = sitk.GetImageFromArray(np.ascontiguousarray(values.transpose(2, 1, 0)))
    made.CopyInformation(image)
    return made


def noise(image: Any, low: int, high: int, kind: type) -> Any:
    """A scan of noise around two tissues, cut off at its range; around them is nothing."""
    rng = np.random.default_rng(0)
    tissue = np.where(voxels_of(image) > 0, high, (low + high) / 2)
    values = np.rint(tissue + rng.normal(scale=0.1 * (high - low), size=tissue.shape)).clip(low, high)
    values[:20] = low
    return filled(image, values.astype(kind))


@pytest.mark.parametrize(
    ("make", "interpolation"),
    [
        (lambda: sitk.Cast(labels_of(in_cube, scan(spacing=(5.0, 5.0, 5.0))), sitk.sitkFloat32), "nearest"),
        (lambda: sitk.Cast(blocks(), sitk.sitkInt16), "nearest"),
        (lambda: noise(labels_of(in_cube, scan(spacing=(5.0, 5.0, 5.0))), 0, 60, np.uint8), "linear"),
        (lambda: noise(labels_of(in_cube, scan(spacing=(5.0, 5.0, 5.0))), 0, 4000, np.uint16), "linear"),
        (lambda: noise(labels_of(in_cube, scan(spacing=(5.0, 5.0, 5.0))), -1000, 400, np.int16), "linear"),
        (lambda: 0.5 * sitk.Cast(labels_of(in_cube, scan(spacing=(5.0, 5.0, 5.0))), sitk.sitkFloat32), "linear"),
    ],
    ids=["labels as floats", "many labels", "scan of few values", "scan from 0", "scan", "halves"],
)
def test_label_maps_take_the_nearest_voxel_however_they_are_stored(
    files: Path, capsys: pytest.CaptureFixture[str], make: Callable[[], Any], interpolation: str
) -> None:
    sitk.WriteImage(make(), str(files / "image.nrrd"))
    line = ["warp", str(files / "image.nrrd"), "--with", str(files / "state.vtu"), "-o", str(files / "moved.nrrd")]
    other = {"nearest": "linear", "linear": "nearest"}[interpolation]
    assert main(line) == 0
    printed = capsys.readouterr().out
    assert f"{interpolation} interpolation: it holds" in printed
    assert f"say --interpolation {other}" in printed
    before, moved = (voxels_of(sitk.ReadImage(str(files / name))) for name in ("image.nrrd", "moved.nrrd"))
    if interpolation == "nearest":
        assert set(np.unique(moved)) <= set(np.unique(before))
    assert main([*line, "--interpolation", other]) == 0
    assert f"{other} interpolation\n" in capsys.readouterr().out
    assert (voxels_of(sitk.ReadImage(str(files / "moved.nrrd"))) != moved).any()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (["--axes", "RPS"], "the axes 'RPS' is unknown"),
        (["--with", "{0}/labels.nii.gz"], "is no solution with its volume"),
        (["-o", "{0}/moved.png"], "moved.png: images are not written in that format; the formats are .nii"),
        (["-o", "{0}/there/moved.nii"], "does not exist; create it first"),
        (["--background", "0.5"], "the background 0.5 is no value of an image of uint8"),
    ],
)
def test_warp_refuses_in_a_sentence(
    files: Path, capsys: pytest.CaptureFixture[str], change: list[str], words: str
) -> None:
    line = ["warp", str(files / "labels.nii.gz"), "--with", str(files / "state.vtu"), "-o", str(files / "moved.nii")]
    assert main(line + [word.format(files) for word in change]) == 2
    assert words in capsys.readouterr().err
    assert not (files / "moved.nii").exists()


@pytest.mark.parametrize("ending", [".vtu", ".vtk", ".msh"])
def test_a_registered_organ_deforms_the_scan_by_its_shape_alone(
    cube: vs.Mesh, tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str
) -> None:
    """A file of where it was found leads to the axes of the intervention; that of its shape stays in the scan's."""
    mesh = replace(vs.mesh(cube.points - 0.05, cube.cells, cube.sets), axes="RAS")
    organ = vs.Organ(mesh, LAW, fixed="bottom")
    found = organ.register(points=(mesh.points, 0.0 * mesh.points + [0.03, 0.0, 0.0]), noise="1 mm")
    found.write(tmp_path / f"found{ending}")
    found.state.write(tmp_path / f"shape{ending}")
    sitk.WriteImage(labels_of(in_cube, scan(spacing=(5.0, 5.0, 5.0))), str(tmp_path / "labels.nii"))
    line = ["warp", str(tmp_path / "labels.nii"), "-o", str(tmp_path / "moved.nii"), "--with"]
    assert main([*line, str(tmp_path / f"found{ending}")]) == 2
    told = capsys.readouterr().err
    assert f"found{ending}: its displacement leads to the axes of the intervention" in told
    assert "viscera register --shape shape.vtu" in told
    assert not (tmp_path / "moved.nii").exists()
    assert main([*line, str(tmp_path / f"shape{ending}")]) == 0
    if ending == ".vtu":
        assert (
            b"<!-- axes: RAS, metres, at rest; by the displacement to the axes of the intervention -->"
            in (tmp_path / "found.vtu").read_bytes()
        )
        assert vs.output.state.read(tmp_path / "found.vtu")[0].axes == "RAS"


def test_an_image_of_another_place_or_kind_is_refused(cube: vs.Mesh, tmp_path: Path) -> None:
    shape = affine(cube)
    away = scan()
    away.SetOrigin([5e3, 0.0, 0.0])
    with pytest.raises(vs.VisceraError, match=r"no voxel of the image lies in the organ.*are they of one scan"):
        shape.on_grid(away)
    (tmp_path / "broken.nrrd").write_text("NRRD")
    with pytest.raises(vs.VisceraError, match=r"broken\.nrrd: not a readable \.nrrd image"):
        shape.on_grid(tmp_path / "broken.nrrd")
    with pytest.raises(vs.VisceraError, match="no such image"):
        shape.on_grid(tmp_path / "none.nrrd")
    sitk.WriteImage(sitk.Image([4, 4], sitk.sitkUInt8), str(tmp_path / "flat.nrrd"))
    with pytest.raises(vs.VisceraError, match="has 2 dimensions"):
        shape.on_grid(tmp_path / "flat.nrrd")
    field = shape.on_grid(scan())
    with pytest.raises(vs.VisceraError, match="several values at a voxel"):
        warp(field.grid.image(field.displacement), field, field)


def test_the_span_of_an_oblique_image_is_that_of_all_its_corners(cube: vs.Mesh) -> None:
    half = float(np.sqrt(0.5))
    turned = scan(np.array([[half, -half, 0.0], [half, half, 0.0], [0.0, 0.0, 1.0]]), (4.0, 4.0, 4.0))  # LPS
    turned.SetOrigin([0.0, 0.0, 0.0])
    shape = affine(cube)
    away = shape.organ.moved(np.add(shape.displacement, [9.0, 0.0, 0.0]))
    far = 79 * 4e-3 * half
    words = f"the image spans {[-round(far, 3), 0.0, 0.0]} to {[round(far, 3), round(2 * far, 3), 0.316]} m"
    with pytest.raises(vs.VisceraError, match=re.escape(words)):
        away.on_grid(turned, axes="LPS", inverse=True)


@pytest.mark.parametrize("axes", ["RAS", "LPS"])
def test_a_scan_in_memory_is_the_grid_of_its_file(cube: vs.Mesh, tmp_path: Path, axes: str) -> None:
    moved = affine(cube)
    labels = vs.Scan.of(moved.organ.mesh, voxel=0.02).in_axes(axes)
    labels.write(tmp_path / "labels.nrrd")
    own, read = moved.on_grid(labels), moved.on_grid(tmp_path / "labels.nrrd")
    assert own.inside.any()
    assert np.array_equal(own.inside, read.inside)
    np.testing.assert_allclose(own.displacement, read.displacement, rtol=0, atol=1e-12)
    own.write(tmp_path / "field.nrrd")


def test_what_is_no_image_is_refused(cube: vs.Mesh) -> None:
    moved = affine(cube)
    kinds: list[Any] = [np.zeros((4, 4, 4)), 3, sitk.Image([4, 4], sitk.sitkUInt8)]
    for wrong in kinds:
        with pytest.raises(vs.VisceraError, match="the image must be a file, a Scan, or a SimpleITK image of three"):
            moved.on_grid(wrong)
    sheared = np.array([[0.02, 0.01, 0, -0.1], [0, 0.02, 0, -0.1], [0, 0, 0.02, -0.1]])
    with pytest.raises(vs.VisceraError, match="the scan: its voxels are sheared"):
        moved.on_grid(vs.Scan(np.ones((12, 12, 12), dtype=int), sheared))


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_a_mesh_that_states_its_axes_is_placed_by_them(
    cube: vs.Mesh, tmp_path: Path, element: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """In memory, and on file as the solution states them; other axes are refused."""
    mesh = replace(vs.mesh(cube.points - [0.02, 0.01, 0.0], cube.cells, cube.sets), axes="LPS")
    organ = vs.Organ(mesh, LAW, fixed="bottom", element=element)
    state = organ.solve(force={"top": (5.0, 0.0, -5.0)})
    known = state.on_grid(scan())
    assert known.grid.axes == "LPS"
    assert np.array_equal(known.inside, state.on_grid(scan(), axes="LPS").inside)
    with pytest.raises(vs.VisceraError, match="the mesh comes from a scan in LPS"):
        state.on_grid(scan(), axes="RAS")
    state.write(tmp_path / "state.vtu")
    sitk.WriteImage(scan(), str(tmp_path / "scan.nrrd"))
    line = ["warp", str(tmp_path / "scan.nrrd"), "--with", str(tmp_path / "state.vtu")]
    assert main([*line, "--forward-field", str(tmp_path / "field.nrrd")]) == 0
    written = sitk.GetArrayFromImage(sitk.ReadImage(str(tmp_path / "field.nrrd"))).transpose(2, 1, 0, 3)
    assert np.allclose(written, 1e3 * known.displacement, atol=1e-3)
    assert main([*line, "--axes", "RAS", "-o", str(tmp_path / "moved.nrrd")]) == 2
    told = capsys.readouterr()
    assert "comes from a scan in LPS" in told.err
    assert "does not state its axes" not in told.out
    state.write(tmp_path / "state.vtk")
    line[3] = str(tmp_path / "state.vtk")
    assert main([*line, "--axes", "LPS", "-o", str(tmp_path / "moved.nrrd")]) == 0
    assert "does not state its axes" not in capsys.readouterr().out
    main([*line, "-o", str(tmp_path / "moved.nrrd")])
    assert "state.vtk does not state its axes; taken as RAS, see --axes" in capsys.readouterr().out


def test_a_nifti_with_two_places_is_where_the_scan_is(tmp_path: Path) -> None:
    """As registration leaves it: the qform where the scanner had it, the sform where it was aligned to."""
    nibabel = pytest.importorskip("nibabel")
    labels = np.zeros((12, 10, 8), dtype=np.uint8)
    labels[3:9, 2:8, 2:6] = 1
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    scanner, aligned = np.eye(4), np.eye(4)
    scanner[:3, 3] = (-20.0, -20.0, -20.0)
    aligned[:3, :3], aligned[:3, 3] = turn * [2.0, 2.0, 3.0], (10.0, 0.0, 5.0)
    image = nibabel.Nifti1Image(labels, scanner)
    image.set_qform(scanner, 1)
    image.set_sform(aligned, 2)
    nibabel.save(image, tmp_path / "aligned.nii.gz")
    places = grid.Grid.of(tmp_path / "aligned.nii.gz")
    affine_map = vs.scan(tmp_path / "aligned.nii.gz").affine
    assert np.allclose(np.column_stack([places.matrix, places.origin]), affine_map, atol=1e-9)
    sheared = aligned.copy()
    sheared[0, 1] += 0.5
    image.set_sform(sheared, 2)
    nibabel.save(image, tmp_path / "sheared.nii")
    image.set_qform(None, 0)
    nibabel.save(image, tmp_path / "alone.nii")
    for name in ("sheared", "alone"):
        with pytest.raises(vs.VisceraError, match=f"{name}.nii: its voxels are sheared"):
            grid.read(tmp_path / f"{name}.nii")
    (tmp_path / "damaged.nii").write_bytes(b"no image" * 100)
    with pytest.raises(vs.VisceraError, match=r"damaged\.nii: not a readable \.nii image"):
        grid.read(tmp_path / "damaged.nii")
