"""The report of a mesh: what it finds wrong, in which words, and what is refused for it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest

import viscera as vs
from viscera.cli import main
from viscera.errors import VisceraError
from viscera.files import mesh as meshfile
from viscera.files.mesh import RawMesh
from viscera.inspection import inspect, report


def test_the_report_of_a_sound_file(bar: vs.Mesh, tmp_path: Path) -> None:
    bar.write(tmp_path / "bar.vtu")
    facts = inspect(tmp_path / "bar.vtu")
    assert (facts["n_points"], facts["n_cells"], facts["parts"]) == (81, 192, 1)
    assert facts["bounding_box"] == [[0, 0, 0], pytest.approx([0.4, 0.1, 0.1])]
    assert (facts["volume"], facts["volume_ml"]) == (pytest.approx(4e-3), pytest.approx(4000))
    assert 0 < facts["quality"]["min"] <= facts["quality"]["mean"] < 1
    assert facts["sets"] == {"root": 9, "tip": 9}
    assert facts["problems"] == []
    assert report(bar)["volume"] == facts["volume"]


def pushed_through(bar: vs.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """A bar of which one inner point has been moved through its neighbours; the surface is as it was."""
    points = bar.points.copy()
    points[np.linalg.norm(points - [0.2, 0.05, 0.05], axis=1).argmin()] = [0.31, 0.06, 0.055]
    return points, bar.cells


def hinged(bar: vs.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """A bar and its mirror image about its last point, which is all that the two share."""
    mirrored = 2.0 * bar.points[80] - bar.points[:80]
    number = np.append(np.arange(81, 161), 80)
    return np.vstack([bar.points, mirrored]), np.vstack([bar.cells, number[bar.cells]])


# Two tetrahedra on one face, of which the upper is cut in two at the middle of an edge and the lower is not.
TWO = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0.02, 0.02, -0.1], [0.02, 0.02, 0.1], [0.05, 0, 0]])
HANGING = (TWO, np.array([[0, 2, 1, 3], [0, 5, 2, 4], [5, 1, 2, 4]]))
CROWDED = (TWO + np.outer(np.arange(6) == 5, [0, 0.02, 0.05]), np.array([[0, 2, 1, 3], [0, 1, 2, 4], [0, 1, 2, 5]]))


def broken(bar: vs.Mesh) -> dict[str, tuple[np.ndarray, np.ndarray, str]]:
    def with_nan(points: np.ndarray) -> np.ndarray:
        return np.where(np.arange(len(points))[:, None] == 3, np.nan, points)

    inverted, flat = bar.cells.copy(), bar.points.copy()
    inverted[4] = inverted[4][[1, 0, 2, 3]]
    flat[:, 2] = 0
    return {
        "nan": (with_nan(bar.points), bar.cells, "point 3 has a coordinate that is not finite"),
        "inverted": (bar.points, inverted, "cell 4 is inverted; reading the mesh turns them round"),
        "flat": (flat, bar.cells, r"192 cells \(first: 0, 1, 2, 3, 4\) are of zero volume"),
        "duplicate": (bar.points, np.vstack([bar.cells, bar.cells[:1]]), "cell 192 is on the same four points"),
        "loose": (np.vstack([bar.points, [[0, 0, 0.2]]]), bar.cells, "point 81 is in no cell"),
        "parts": (np.vstack([bar.points, bar.points + 1]), np.vstack([bar.cells, bar.cells + 81]), "2 separate parts"),
        "hinge": (*hinged(bar), r"parts meet at point 80 only, without a common face: they turn there as on a hinge"),
        "overlap": (
            *pushed_through(bar),
            r"cells \(first: .*\) are pushed through neighbouring cells: .* add up to 4",
        ),
        "hanging": (*HANGING, r"point 5 is hanging on a face of another cell \(the first on one of cell 0\)"),
        "crowded": (*CROWDED, "cell 2 is on a face that two other cells share already"),
        "metres": (1000 * bar.points, bar.cells, "diagonal of 424 m, implausible for an organ; check `units`"),
        "microscopic": (1e-4 * bar.points, bar.cells, "diagonal of 4.24e-05 m, implausible"),
    }


FAULTS = ("nan", "inverted", "flat", "duplicate", "loose", "parts", "hinge", "overlap", "hanging", "crowded")


@pytest.mark.parametrize("case", [*FAULTS, "metres", "microscopic"])
def test_the_report_names_what_is_wrong(
    bar: vs.Mesh, tmp_path: Path, matches: Callable[[str, list[str]], bool], case: str
) -> None:
    points, cells, sentence = broken(bar)[case]
    meshio.vtu.write(str(tmp_path / "bad.vtu"), meshio.Mesh(points, [("tetra", cells)]))
    facts = inspect(tmp_path / "bad.vtu")
    assert matches(sentence, facts["problems"])
    assert facts["n_cells"] == len(cells)


@pytest.fixture
def matches() -> Callable[[str, list[str]], bool]:

    return lambda pattern, sentences: any(re.search(pattern, sentence) for sentence in sentences)


@pytest.mark.parametrize(
    ("made", "sentence"),
    [
        (pushed_through, r"cells \(first: .*\) are pushed through neighbouring cells"),
        (lambda bar: HANGING, "point 5 is hanging on a face of another cell"),
        (lambda bar: CROWDED, "cell 2 is on a face that two other cells share already"),
    ],
    ids=["overlap", "hanging", "crowded"],
)
def test_cells_that_do_not_fit_together_are_refused(
    bar: vs.Mesh, made: Callable[[vs.Mesh], tuple[np.ndarray, np.ndarray]], sentence: str
) -> None:
    with pytest.raises(VisceraError, match=sentence):
        vs.mesh(*made(bar))


def test_the_cells_that_overlap_are_those_that_the_point_turned(bar: vs.Mesh) -> None:
    points, cells = pushed_through(bar)
    x = points[cells]
    volumes = np.linalg.det(x[:, 1:] - x[:, :1]) / 6.0
    turned = np.flatnonzero(volumes < 0)
    assert len(turned) > 1
    (sentence,) = [problem for problem in report(meshfile.RawMesh(points, cells))["problems"] if "pushed" in problem]
    assert sentence.startswith(f"{len(turned)} cells (first: {', '.join(map(str, turned[:5]))}")
    excess = 1e6 * (np.abs(volumes).sum() - bar.volume)
    assert f"add up to {1e6 * bar.volume + excess:.6g} ml, {excess:.3g} ml more than the surface encloses" in sentence


def test_cells_listed_either_way_round_are_no_overlap(bar: vs.Mesh) -> None:
    cells = bar.cells.copy()
    cells[::3] = cells[::3][:, [1, 0, 2, 3]]
    assert vs.mesh(bar.points, cells).volume == pytest.approx(bar.volume)


def test_a_body_that_touches_another_or_itself_hangs_nowhere(bar: vs.Mesh) -> None:
    """Faces of two bodies that lie on each other need not match; nor are the two lips of a cut one body's points."""
    above = bar.points + np.array([0.02, 0.03, 0.1])
    both = vs.mesh(np.vstack([bar.points, above]), np.vstack([bar.cells, bar.cells + 81]))
    assert report(both)["parts"] == 2


def test_parts_that_share_one_point_are_told_apart(bar: vs.Mesh, caplog: pytest.LogCaptureFixture) -> None:
    both = vs.mesh(*hinged(bar))
    assert report(both)["parts"] == 2
    assert "parts meet at point 80 only" in both.messages[-1]
    assert both.messages[-1] in caplog.text


def test_parts_that_overlap_are_told(bar: vs.Mesh, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A second bar, pushed into the first: 0.4 m by 0.1 m by 0.1 m in cells of 0.05 m."""
    cells = np.vstack([bar.cells, bar.cells + 81])
    for shift, is_overlap in (
        ((0.21, 0.03, 0.02), True),
        ((0.0, 0.0, 0.05), True),  # by one cell: corners lie on corners
        ((0.0, 0.0, 0.025), True),  # by half a cell: corners lie on edges, centroids on faces
        ((0.025, 0.025, 0.025), True),
        ((0.0, 0.0, 0.0999), True),  # 0.1 mm deep, where corners lie above corners
        ((0.0125, 0.0, 0.0999), True),
        ((0.0, 0.0, 0.0), True),
        ((0.0125, 0.025, 0.1), False),  # face on face, not joined
        ((0.0, 0.0, 0.1), False),  # face on face
        ((0.4, 0.1, 0.1), False),  # edge on edge
        ((0.0, 0.0, 0.2), False),
    ):
        points = np.vstack([bar.points, bar.points + np.array(shift)])
        found = [problem for problem in report(RawMesh(points, cells))["problems"] if "inside another part" in problem]
        assert len(found) == is_overlap, (shift, found)
    points[81:] -= np.array([0.0, 0.0, 0.15])  # by half a cell
    grid = meshio.Mesh(points, [("tetra", cells)])
    meshio.vtu.write(tmp_path / "two.vtu", grid)
    caplog.clear()
    both = vs.read(tmp_path / "two.vtu")
    told = [message for message in both.messages if message.endswith("parts overlap; move them apart, or join them")]
    assert len(told) == 1
    assert told[0] in caplog.text
    named = int(re.match(r"(\d+) cells", told[0])[1])  # type: ignore[index]
    is_low, is_high = points[cells][..., 2].min(axis=1) < 0.1, points[cells][..., 2].max(axis=1) > 0.05
    assert 0.5 * (is_low & is_high).sum() < named <= (is_low & is_high).sum()


def test_points_on_one_another_are_told(bar: vs.Mesh, caplog: pytest.LogCaptureFixture) -> None:
    """A node given twice opens as a crack."""
    node, cells = int(bar.cells[50, 0]), bar.cells.astype(np.int64)
    around = np.flatnonzero((cells == node).any(axis=1))
    half = around[: len(around) // 2]
    cells[half] = np.where(cells[half] == node, 81, cells[half])
    for off in (0.0, 1e-12):  # the rounding of a file
        raw = RawMesh(np.vstack([bar.points, bar.points[node] + off]), cells)
        (problem,) = report(raw)["problems"]
        assert problem.startswith("point 81 is at the place of another")
        both = vs.mesh(raw.points, raw.cells)
        assert both.messages == (problem,)
        assert problem in caplog.text
    apart = RawMesh(np.vstack([bar.points, bar.points[node] + 1e-4]), cells)
    assert not [p for p in report(apart)["problems"] if "place of another" in p]


def test_two_parts_are_a_mesh(bar: vs.Mesh) -> None:
    both = vs.mesh(np.vstack([bar.points, bar.points + 1]), np.vstack([bar.cells, bar.cells + 81]))
    assert report(both)["parts"] == 2


def test_a_suspicious_place_is_logged(bar: vs.Mesh, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    vs.mesh(bar.points - [0, 0, 1100], bar.cells).write(tmp_path / "bar.vtu")
    vs.read(tmp_path / "bar.vtu")
    sentence = "a coordinate is 1100 m in size, implausible for an organ; check `units`, or move the mesh"
    assert sentence in caplog.text
    assert inspect(tmp_path / "bar.vtu")["problems"] == [sentence]


def test_a_suspicious_size_is_logged(bar: vs.Mesh, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    bar.write(tmp_path / "bar.vtu")
    vs.read(tmp_path / "bar.vtu", units=1000)
    assert "implausible for an organ" in caplog.text


HINGE = "parts meet at point"


@pytest.mark.parametrize("verb", ["solve", "reduce"])
def test_a_command_says_once_what_a_mesh_has_to_say(
    verb: str,
    bar: vs.Mesh,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.chdir(tmp_path)
    vs.mesh(*hinged(bar)).write("bar.vtu")
    Path("case.toml").write_text(
        'mesh = "bar.vtu"\nunits = "m"\nfixed = ["x < 1%", "x > 99%"]\nreduce = {depth = "1%", order = 2}\n'
        'material = {law = "NeoHookean", young = 1e5, poisson = 0.3}\n'
        "loads = {gravity = [0, 0, -0.1], density = 100}\n"
    )
    caplog.clear()
    assert main([verb, "case.toml"]) == 0
    assert capsys.readouterr().out.count(HINGE) == 1
    assert HINGE not in caplog.text
    assert main([verb, "case.toml", "--quiet"]) == 0
    assert caplog.text.count(HINGE) == 1


def test_what_a_mesh_has_to_say_is_a_note_where_it_is_made(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Two cubes of one label, which meet at a corner."""
    nibabel = pytest.importorskip("nibabel", reason="images need nibabel: pip install viscera[scan]")
    monkeypatch.chdir(tmp_path)
    cubes = np.zeros((10, 10, 10), dtype=np.uint8)
    cubes[2:5, 2:5, 2:5] = cubes[5:8, 5:8, 5:8] = 1
    nibabel.Nifti1Image(cubes, np.eye(4)).to_filename("cubes.nii")
    assert main(["mesh", "cubes.nii", "--edge", "1mm"]) == 0
    assert capsys.readouterr().out.count(HINGE) == 1
    assert HINGE not in caplog.text
