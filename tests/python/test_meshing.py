"""Tetrahedra from label maps: angles, volumes, what is cut, dropped and refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.scans import meshing
from viscera.scans.meshing import edge_means, least_angles

VOXEL = 0.003
HUMAN = "scans/totalsegmentator_example_seg.nii.gz"
LABELS = {"spleen": 1, "right kidney": 2, "left kidney": 3, "gallbladder": 4, "liver": 5}


@pytest.fixture(scope="module")
def liver() -> vs.Scan:
    """The built-in liver as a scanner with voxels of 3 mm would see it, with a vein through it: labels 1 and 2."""
    scan = vs.Scan.of(vs.organs.liver(), voxel=VOXEL)
    place = np.moveaxis(np.indices(scan.values.shape), 0, -1) * VOXEL + scan.affine[:, 3]
    vein = np.hypot(place[..., 0] + 0.03, place[..., 1] - 0.01) < 0.008
    values = np.where(vein & (place[..., 2] > -0.05), 2, scan.values)
    return vs.Scan(values, scan.affine, names={1: "liver", 2: "vein"})


def volume_errors(scan: vs.Scan, mesh: vs.Mesh, labels: dict[str, int]) -> dict[str, float]:
    voxel = abs(np.linalg.det(scan.affine[:, :3]))
    cells = mesh.facts["cell_volumes"]
    return {name: cells[mesh.cell_sets[name]].sum() / (voxel * scan.labels[n]) - 1.0 for name, n in labels.items()}


def test_an_organ_keeps_its_volume_and_has_good_angles(liver: vs.Scan) -> None:
    mesh = liver.mesh({"liver": 1}, edge="10 mm")
    assert abs(volume_errors(liver, mesh, {"liver": 1})["liver"]) < 0.01
    assert least_angles(mesh.points, mesh.cells).min() > 8.0
    assert edge_means(mesh.points, mesh.cells).mean() == pytest.approx(0.010, rel=0.05)
    assert mesh.axes == "RAS"


def test_a_meshed_organ_is_solved(liver: vs.Scan) -> None:
    mesh = liver.mesh({"liver": 1}, edge=0.014, fixed="z > 80%")
    organ = vs.Organ(mesh, vs.NeoHookean(young=3e3, poisson=0.45), fixed="fixed")
    state = organ.solve(gravity=(0, 0, -9.81), density=1060)
    assert state.is_converged
    weight = 1060 * 9.81 * mesh.volume
    assert state.reaction("fixed")[2] == pytest.approx(weight, rel=1e-6)


def test_labels_share_their_nodes_and_every_cell_has_one(liver: vs.Scan) -> None:
    labels = {"liver": 1, "vein": 2}
    mesh = liver.mesh(labels, edge=0.008)
    assert least_angles(mesh.points, mesh.cells).min() > 5.0
    errors = volume_errors(liver, mesh, labels)
    assert abs(errors["liver"]) < 0.01
    assert abs(errors["vein"]) < 0.05
    cells = np.concatenate([mesh.cell_sets[name] for name in labels])
    assert np.array_equal(np.sort(cells), np.arange(len(mesh.cells)))
    # Conforming: the area between the two parts is what their surfaces add up to more than the whole's.
    parts = [vs.mesh(*packed(mesh, mesh.cell_sets[name])) for name in labels]
    areas = [area(part) for part in parts]
    shared = np.intersect1d(mesh.cells[mesh.cell_sets["vein"]], mesh.cells[mesh.cell_sets["liver"]])
    assert len(shared) > 50
    between = 0.5 * (sum(areas) - area(mesh))
    assert between > 0.5 * areas[1]
    assert mesh.facts["n_parts"] == 1


def test_edges_are_short_at_a_vein_and_grow_away_from_it(liver: vs.Scan) -> None:
    labels = {"liver": 1, "vein": 2}
    mesh = liver.mesh(labels, edge={"liver": "16 mm", "vein": "4 mm"})
    errors = volume_errors(liver, mesh, labels)
    assert abs(errors["liver"]) < 0.01
    assert abs(errors["vein"]) < 0.05
    assert least_angles(mesh.points, mesh.cells).min() > 8.0
    edges, away = edge_means(mesh.points, mesh.cells), from_vein(mesh)
    for close in (mesh.cell_sets["vein"], np.flatnonzero(away < 0.002)):
        assert edges[close].mean() < 0.004, "the liver's cells beside the vein are as small as the vein's"
        assert edges[close].max() < 1.5 * 0.004
    assert edges[away > 0.040].mean() == pytest.approx(0.016, rel=0.15)
    assert mesh.facts["n_parts"] == 1
    even = 12.0 * mesh.volume * (0.911 / 0.004) ** 3
    assert len(mesh.cells) < 0.15 * even
    assert not [message for message in mesh.messages if "lengths double" in message]


def from_vein(mesh: vs.Mesh) -> NDArray[np.float64]:
    """Distance of each cell's middle from the vein of `liver` [m]."""
    middle = mesh.centroids
    beside = np.maximum(np.hypot(middle[:, 0] + 0.03, middle[:, 1] - 0.01) - 0.008, 0.0)
    return np.asarray(np.hypot(beside, np.maximum(-0.05 - middle[:, 2], 0.0)))


def test_lengths_that_double_are_told(liver: vs.Scan) -> None:
    """Of 20 and 8 mm the lattice keeps one, and the other becomes 16 or 5 mm."""
    mesh = liver.mesh({"liver": 1, "vein": 2}, edge={"liver": 0.020, "vein": 0.008})
    told = [message for message in mesh.messages if "lengths double" in message]
    assert told in (
        ["lengths double from cube to cube, so edges are 16 mm in 'liver'"],
        ["lengths double from cube to cube, so edges are 5 mm in 'vein'"],
    )


def packed(mesh: vs.Mesh, cells: NDArray[np.uint32]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    used, numbers = np.unique(mesh.cells[cells], return_inverse=True)
    return mesh.points[used], numbers.reshape(-1, 4)


def area(mesh: vs.Mesh) -> float:
    a, b, c = (mesh.points[mesh.surface[:, k]] for k in range(3))
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def test_the_boundary_is_smooth() -> None:
    """A tilted half space, whose voxels are stairs: the mesh's boundary is a plane to a fraction of a voxel."""
    normal = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    depth = np.tensordot(normal, np.indices((40, 40, 40)) - 19.5, axes=1)
    mesh = vs.Scan(depth < 0.0, VOXEL * np.eye(3, 4)).mesh({"block": 1}, edge=0.006)
    free = np.setdiff1d(mesh.surface_nodes, mesh.sets["cut"])
    off = mesh.points[free] @ normal / VOXEL - 19.5 * normal.sum()
    assert np.abs(off).max() < 0.3, "stairs would be off by 0.5 to 1"
    assert off.std() < 0.1


def nodule(radius: float, depth: float = 6.0) -> vs.Scan:
    """A ball of 44.6 ml, label 1, with a small one in it, label 2."""
    values = (from_middle() < 22.0).astype(np.uint16)
    values[from_middle(depth) < radius] = 2
    return vs.Scan(values, 1e-3 * np.eye(3, 4))


def from_middle(depth: float = 0.0) -> NDArray[np.float64]:
    """Distances of 60 voxels cubed from a place near their middle [voxels]."""
    middle = np.reshape([29.5, 29.5, 29.5 + depth], (3, 1, 1, 1))
    return np.asarray(np.linalg.norm(np.indices((60, 60, 60)) - middle, axis=0))


@pytest.mark.parametrize(("radius", "edge"), [(5, "6 mm"), (5, "4 mm"), (4, "5 mm"), (3.5, "3 mm"), (2.5, "3 mm")])
def test_a_small_label_keeps_its_volume_and_place(radius: float, edge: str) -> None:
    scan, labels = nodule(radius, 5.5), {"organ": 1, "tumour": 2}
    mesh = scan.mesh(labels, edge=edge)
    errors = volume_errors(scan, mesh, labels)
    assert abs(errors["organ"]) < 0.005
    told = [message for message in mesh.messages if "'tumour' is" in message]
    assert bool(told) == (abs(errors["tumour"]) > 0.02)
    assert abs(errors["tumour"]) < 0.2
    away = np.linalg.norm(mesh.points[mesh.cells[mesh.cell_sets["tumour"]]] - 1e-3 * np.array([29.5, 29.5, 35]), axis=2)
    assert away.max() < 2e-3 * radius, "no shell round the organ"


@pytest.mark.parametrize("n_planes", [1, 2])
@pytest.mark.parametrize(("radius", "edge"), [(5, "3.5 mm"), (4, "3.5 mm"), (3, "3.5 mm")])
def test_a_small_label_has_no_cells_where_others_meet(n_planes: int, radius: float, edge: str) -> None:
    """A nodule in an organ that planes divide: away from it, three owners meet along lines, or four."""
    scan = nodule(radius, 10.0)
    _, y, z = np.indices(scan.values.shape)
    part = (z > 29) + 2 * (y > 29) * (n_planes == 2)
    values = np.where(scan.values == 1, 1 + part, np.where(scan.values == 2, 9, 0))
    labels = {f"part {label}": int(label) for label in np.unique(values[values > 0])}
    mesh = vs.Scan(values, scan.affine).mesh(labels, edge=edge)
    away = np.linalg.norm(
        mesh.points[mesh.cells[mesh.cell_sets["part 9"]]] - 1e-3 * np.array([29.5, 29.5, 39.5]), axis=2
    )
    assert away.max() < 2e-3 * radius


def test_a_part_with_another_volume_than_its_voxels_is_told() -> None:
    mesh = nodule(3.5, 5.5).mesh({"organ": 1, "tumour": 2}, edge="4 mm")
    told = r"'tumour' is 1\d % too small \(its mesh has 0.14\d ml, its voxels 0.168 ml\): give a shorter edge where"
    assert re.match(told, mesh.messages[-1])


def test_a_part_that_the_edge_is_too_long_for_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshing, "MOST_OFF", 0.1)
    words = r"the edge is too long for 'tumour': its mesh has 0.14\d ml, its voxels 0.168 ml; give a shorter one"
    with pytest.raises(vs.VisceraError, match=words):
        nodule(3.5, 5.5).mesh({"organ": 1, "tumour": 2}, edge="4 mm")


def tissues(seed: int, n: int, wave: float, origin: float) -> NDArray[np.int64]:
    """Four tissues in n voxels cubed, 0 to 3, whose surfaces curve and meet at random."""
    rng = np.random.default_rng(seed)
    waves, phases = wave * rng.normal(size=(4, 6, 3)), rng.uniform(0, 2 * np.pi, (4, 6))
    places = np.moveaxis(np.indices((n, n, n)), 0, -1) - origin
    sums = np.cos(np.einsum("ijkd,lwd->ijklw", places, waves) + phases).sum(axis=-1)
    return np.asarray(sums.argmax(axis=-1))


@pytest.mark.parametrize(
    ("seed", "is_cut", "edge", "is_tangled"),
    [(8, True, 3, True), (115, False, 4, False), (121, False, 3.5, False), (77, True, 3, True)],
)
def test_surfaces_that_are_close_do_not_tangle(seed: int, is_cut: bool, edge: float, is_tangled: bool) -> None:
    """Maps whose surfaces are close; of two, the first lattice makes cells that are turned over. Separate pieces that
    the cells miss have no part in the volumes."""
    if is_cut:
        values = tissues(seed, 18, 0.35, 0.0)
    else:
        values = tissues(seed, 24, 0.25, 11.5) + 1
        values[np.linalg.norm(np.indices(values.shape) - 11.5, axis=0) > 9.0] = 0
    scan = vs.Scan(values, 1.5e-3 * np.eye(3, 4))
    labels = {f"tissue {label}": label for label, count in scan.labels.items() if count > 100}
    told: list[int] = []
    mesh = scan.mesh(labels, edge=f"{edge} mm", progress=lambda done, total, stage: told.append(done))
    assert (told.count(1) > 1) == is_tangled, "more than one lattice was tried"
    assert least_angles(mesh.points, mesh.cells).min() > 5.0
    lost = dict.fromkeys(labels, 0.0)
    for amount, name in re.findall(r"([\d.]+) ml of '([^']+)'", " ".join(mesh.messages)):
        lost[name] += 1e-6 * float(amount)
    voxel = abs(np.linalg.det(scan.affine[:, :3]))
    for name, error in volume_errors(scan, mesh, labels).items():
        assert abs(error + lost[name] / (voxel * scan.labels[labels[name]])) < 0.02


def test_supports_by_condition_label_and_paint(liver: vs.Scan, tmp_path: Path) -> None:
    alone = liver.mesh({"liver": 1}, edge=0.012, fixed="label:vein")
    where = alone.points[alone.sets["fixed"]]
    assert (np.hypot(where[:, 0] + 0.03, where[:, 1] - 0.01) < 0.008 + 1.5 * VOXEL).all()
    together = liver.mesh({"liver": 1, "vein": 2}, edge=0.010, fixed="label:2")
    shared = np.intersect1d(together.cells[together.cell_sets["vein"]], together.cells[together.cell_sets["liver"]])
    assert np.array_equal(together.sets["fixed"], shared)
    painted = np.zeros_like(liver.values)
    painted[liver.at(liver_places(liver)).reshape(painted.shape) == 1] = 1
    painted[:, :, : painted.shape[2] // 2] = 0
    vs.Scan(painted, liver.affine).in_axes("LPS").write(tmp_path / "paint.nii.gz")
    held = liver.mesh({"liver": 1}, edge=0.014, fixed=str(tmp_path / "paint.nii.gz"))
    middle = liver.affine[2, 3] + VOXEL * (painted.shape[2] // 2)
    assert held.points[held.sets["fixed"]][:, 2].min() > middle - 1.3 * VOXEL
    for bad, words in {"label:9": "no voxel has the label 9", "x < -90%": "selects no node"}.items():
        with pytest.raises(vs.VisceraError, match=words):
            liver.mesh({"liver": 1}, edge=0.02, fixed=bad)


def liver_places(scan: vs.Scan) -> NDArray[np.float64]:
    index = np.moveaxis(np.indices(scan.values.shape), 0, -1).reshape(-1, 3)
    return np.asarray(index @ scan.affine[:, :3].T + scan.affine[:, 3])


def test_refusals_say_what_to_do(liver: vs.Scan) -> None:
    with pytest.raises(
        vs.VisceraError, match=r"name the labels to mesh; the image has the labels 1 'liver' \(\d+ voxels\)"
    ):
        liver.mesh(edge=0.01)
    with pytest.raises(vs.VisceraError, match="no voxel has the label 7; the image has the labels 1"):
        liver.mesh(7, edge=0.01)
    with pytest.raises(vs.VisceraError, match=r"the edge, 50 mm, is longer than 'vein', which is \d\d\.?\d* mm across"):
        liver.mesh({"liver": 1, "vein": 2}, edge="50 mm")
    with pytest.raises(vs.VisceraError, match="the edge, 30 mm, is too long for 'vein': no cell of it is left"):
        liver.mesh({"liver": 1, "vein": 2}, edge="30 mm")
    with pytest.raises(vs.VisceraError, match=r"an edge of 0.01 mm would make .* cells; give a longer one"):
        liver.mesh(1, edge="0.01 mm")
    with pytest.raises(vs.VisceraError, match=r"edge 'vien' is of no part; did you mean 'vein'\?"):
        liver.mesh({"liver": 1, "vein": 2}, edge={"liver": 0.01, "vien": 0.005})
    with pytest.raises(vs.VisceraError, match="edge has no length for 'vein'; give one for every part"):
        liver.mesh({"liver": 1, "vein": 2}, edge={"liver": 0.01})
    with pytest.raises(vs.VisceraError, match="edge of 'liver' must be a number above 0"):
        liver.mesh({"liver": 1}, edge={"liver": 0.0})
    with pytest.raises(vs.VisceraError, match="label 1 is given twice, as 'a' and as 'b'"):
        liver.mesh({"a": 1, "b": [1, 2]}, edge=0.01)
    with pytest.raises(vs.VisceraError, match="edge must be a number above 0"):
        liver.mesh(1, edge=-0.01)
    with pytest.raises(vs.VisceraError, match="every voxel is 0"):
        vs.Scan(np.zeros((4, 4, 4)), np.eye(4)).mesh(edge=0.01)
    with pytest.raises(vs.VisceraError, match="margin must be a whole number from 0"):
        vs.Scan.of(vs.organs.beam(), margin=-1)
    with pytest.raises(vs.VisceraError, match=r"voxels of 0.01 mm would be .*e\+\d\d; take larger ones"):
        vs.Scan.of(vs.organs.beam(), voxel="0.01 mm")


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        ({"b": 1.5}, "part 'b' must be a label's number, or several, got 1.5"),
        ({"b": None}, "part 'b' must be a label's number, or several, got None"),
        ({"b": []}, "part 'b' has no label; give one or several of the labels 1 'liver'"),
        ({"b": [1.5]}, "a label is a whole number, got 1.5"),
        ({"": 1}, "the name of a part must be a text that is not empty, got ''"),
        ({3: 1}, "the name of a part must be a text that is not empty, got 3"),
        (1.5, "labels must be a label's number, or several, got 1.5"),
        (np.array(1.5), "labels must be a label's number, or several, got array(1.5)"),
    ],
)
def test_labels_that_are_none_are_refused(liver: vs.Scan, labels: Any, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=re.escape(words)):
        liver.mesh(labels, edge="12 mm")


@pytest.mark.parametrize("fixed", [3, None, [3], ["z > 90%", 0.1]])
def test_fixed_is_in_words(liver: vs.Scan, fixed: Any) -> None:
    with pytest.raises(vs.VisceraError, match="fixed must be one place or several in words, such as 'z > 90%'"):
        liver.mesh({"liver": 1}, edge="12 mm", fixed=fixed)


@pytest.mark.parametrize(
    ("edge", "words"),
    [
        ("8 m m", "edge{} '8 m m' is not a length; write it as '8 mm' (in m, cm, mm, um, inch)"),
        ("8 ells", "edge{} '8 ells' is not a length; write it as '8 mm'"),
        ("8", "edge{} '8' is not a length; write it as '8 mm'"),
        ("10%", "edge{}: a percentage of what? write '10%' with its unit, such as '8 mm'"),
        ("0 mm", "edge{} must be a number above 0"),
    ],
)
def test_an_edge_is_a_length(liver: vs.Scan, edge: str, words: str) -> None:
    beam = vs.organs.beam()
    with pytest.raises(vs.VisceraError, match=re.escape(words.format(""))):
        liver.mesh({"liver": 1}, edge=edge)
    with pytest.raises(vs.VisceraError, match=re.escape(words.format(" of 'liver'"))):
        liver.mesh({"liver": 1}, edge={"liver": edge})
    with pytest.raises(vs.VisceraError, match=re.escape(words.format(""))):
        vs.mesh_surface((beam.points, beam.surface), edge=edge)


def test_whoever_watches_can_end_it(liver: vs.Scan) -> None:
    def watch(done: int, total: int, stage: str) -> None:
        assert 0 <= done < total
        assert stage == "meshing"
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        liver.mesh(1, edge=0.02, progress=watch)


def test_whoever_watches_is_asked_within_sweeps_and_cuts(liver: vs.Scan) -> None:
    told: list[int] = []
    liver.mesh({"liver": 1}, edge=0.02, progress=lambda done, total, stage: told.append(total))
    assert told[0] > 100, "four times in each of 24 sweeps, and once for each surface of a cut"
    assert len(told) == told[0]


def test_directions_of_a_vector_image_become_those_of_cells(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    ball = vs.Scan(np.linalg.norm(np.indices((24, 24, 24)) - 11.5, axis=0) < 9.0, VOXEL * np.eye(3, 4))
    mesh = ball.mesh(1, edge=0.008)
    place = np.moveaxis(np.indices((24, 24, 24)), 0, -1) * VOXEL - 11.5 * VOXEL
    around = np.cross([0.0, 0.0, 1.0], place)
    around[..., 2] = 1e-6
    around[::2] *= -1.0  # a fibre has no sense
    fibres = vs.image_fibres(mesh, (around, ball.affine))
    expected = np.cross([0.0, 0.0, 1.0], mesh.centroids - 11.5 * VOXEL)
    is_off_axis = np.linalg.norm(expected, axis=1) > 2.0 * VOXEL
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    cosine = np.abs(np.einsum("ij,ij->i", fibres[0], expected))
    assert cosine[is_off_axis].min() > np.cos(np.radians(10.0))
    assert np.array_equal(fibres[0], fibres[1])
    law = vs.HolzapfelGasserOgden(c=1e3, k1=2e3, k2=1.0, poisson=0.45, fibres=fibres, dispersion=0.1)
    assert law is not None
    nibabel = pytest.importorskip("nibabel")
    affine = np.vstack([1e3 * ball.affine, [0, 0, 0, 1]])
    nibabel.save(nibabel.Nifti1Image(around[:, :, :, None, :].astype(np.float32), affine), tmp_path / "fibres.nii")
    assert np.allclose(np.abs(vs.image_fibres(mesh, tmp_path / "fibres.nii")), np.abs(fibres), atol=1e-4)
    assert np.allclose(vs.image_fibres(mesh, (1e200 * around, ball.affine)), fibres)
    plain = vs.mesh(mesh.points, mesh.cells)
    caplog.clear()
    vs.image_fibres(plain, tmp_path / "fibres.nii")
    assert "the mesh states no world axes; they are taken for RAS" in caplog.text
    with pytest.raises(vs.VisceraError, match="lie outside image 1 of fibres"):
        vs.image_fibres(mesh, (around[:12], ball.affine))
    with pytest.raises(vs.VisceraError, match="has no direction around"):
        vs.image_fibres(mesh, (0.0 * around, ball.affine))
    with pytest.raises(vs.VisceraError, match="needs three components per voxel"):
        vs.image_fibres(mesh, (around[..., :2], ball.affine))


@pytest.fixture(scope="module")
def human(shared: Path) -> vs.Scan:
    if not (shared / HUMAN).exists():
        pytest.skip(f"no human scan in {shared}; name its folder in VISCERA_SHARED")
    pytest.importorskip("nibabel")
    return vs.scan(shared / HUMAN)


@pytest.mark.parametrize("organ", LABELS)
def test_organs_of_a_human_scan(human: vs.Scan, organ: str) -> None:
    radius = (0.75 / np.pi * VOXEL**3 * human.labels[LABELS[organ]]) ** (1 / 3)
    for edge, tolerance in ((radius / 6.0, 0.01), (0.008, 0.03)):
        mesh = human.mesh({organ: LABELS[organ]}, edge=edge)
        assert abs(volume_errors(human, mesh, {organ: LABELS[organ]})[organ]) < tolerance
        assert least_angles(mesh.points, mesh.cells).min() > 8.0
        is_cut = any("the image's edge cuts" in message for message in mesh.messages)
        assert is_cut == (organ != "gallbladder")
        assert not [m for m in mesh.messages if "edge cuts" not in m]


def test_a_human_liver_with_short_edges_at_its_veins(human: vs.Scan) -> None:
    labels = {"portal vein": 64, "vena cava": 63, "liver": 5}
    mesh = human.mesh(labels, edge={"portal vein": 0.003, "vena cava": 0.003, "liver": 0.008}, fixed="label:63")
    errors = volume_errors(human, mesh, labels)
    assert abs(errors["liver"]) < 0.03
    assert max(abs(errors["portal vein"]), abs(errors["vena cava"])) < 0.05
    assert least_angles(mesh.points, mesh.cells).min() > 5.0
    assert mesh.facts["n_parts"] == 1
    edges = edge_means(mesh.points, mesh.cells)
    for vessel in ("portal vein", "vena cava"):
        assert edges[mesh.cell_sets[vessel]].mean() < 0.003
    assert edges[mesh.cell_sets["liver"]].max() < 1.2 * 0.008
    assert np.percentile(edges[mesh.cell_sets["liver"]], 90) == pytest.approx(0.006, rel=0.1), "as a note says"
    cava = np.unique(mesh.cells[mesh.cell_sets["vena cava"]])
    assert np.isin(mesh.sets["fixed"], cava).all()
