"""Meshes from arrays and from real files of every format, good and bad: each bad one with its sentence."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera import meshfile
from viscera.errors import VisceraError
from viscera.mesh import inspect, report

TET = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
ENDINGS = (".vtu", ".vtk", ".msh", ".mesh", ".inp", ".feb")


def same_sets(a: vs.Mesh, b: vs.Mesh) -> bool:
    return sorted(a.sets) == sorted(b.sets) and all(np.array_equal(a.sets[name], b.sets[name]) for name in a.sets)


# From arrays


def test_facts_of_a_cube(cube: vs.Mesh) -> None:
    assert (cube.points.shape, cube.cells.shape, cube.surface.shape) == ((27, 3), (48, 4), (48, 3))
    assert cube.volume == pytest.approx(1e-3, rel=1e-13)
    assert cube.diagonal == pytest.approx(0.1 * np.sqrt(3))
    assert cube.bounding_box.tolist() == [[0, 0, 0], [0.1, 0.1, 0.1]]
    assert len(cube.surface_nodes) == 26
    assert "27 points" in repr(cube)
    assert "bottom (9)" in repr(cube)


def test_the_surface_looks_outward(cube: vs.Mesh) -> None:
    a, b, c = np.moveaxis(cube.points[cube.surface], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(cube.volume, rel=1e-13)


def test_a_mesh_cannot_be_changed(cube: vs.Mesh) -> None:
    for array in (cube.points, cube.cells, cube.surface, cube.sets["top"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_arrays_given_are_copied() -> None:
    points = TET.copy()
    made = vs.mesh(points, [[0, 1, 2, 3]])
    points[0] = 7
    assert made.points[0].tolist() == [0, 0, 0]


def test_inverted_cells_are_turned_round_with_a_message(cube: vs.Mesh, caplog: pytest.LogCaptureFixture) -> None:
    cells = cube.cells.copy()
    cells[[3, 8]] = cells[[3, 8]][:, [1, 0, 2, 3]]
    with caplog.at_level(logging.INFO, logger="viscera"):
        repaired = vs.mesh(cube.points, cells)
    assert repaired.messages == ("turned round 2 of 48 cells that were inverted",)
    assert repaired.messages[0] in caplog.text
    assert repaired.volume == pytest.approx(cube.volume, rel=1e-13)


def bad_arrays() -> dict[str, tuple[object, object, str]]:
    nan, two = TET.copy(), np.array([[0, 1, 2, 3], [1, 0, 3, 2]])
    nan[2, 1] = np.nan
    flat = np.vstack([TET, [[0.1, 0.1, 0]]])
    return {
        "nan": (nan, [[0, 1, 2, 3]], r"point 2 has a coordinate that is not finite: \[0.0, nan, 0.0\]"),
        "duplicate": (TET, two, "cell 1 is on the same four points as an earlier cell"),
        "zero volume": (flat, [[0, 1, 2, 3], [0, 1, 2, 4]], "cell 1 is of zero volume"),
        "out of range": (TET, [[0, 1, 2, 4]], r"cell 0 \[0, 1, 2, 4\] names a point that is not one of 4"),
        "negative": (TET, [[0, 1, 2, -1]], "cell 0 .* names a point"),
        "loose": (np.vstack([TET, TET + 1]), [[0, 1, 2, 3]], r"4 points \(first: 4, 5, 6, 7\) are in no cell"),
        "flat points": (TET[:, :2], [[0, 1, 2, 3]], r"points must have the shape \(n, 3\)"),
        "triangles": (TET, [[0, 1, 2]], r"cells must have the shape \(m, 4\)"),
        "no cells": (TET, np.zeros((0, 4), int), r"with m > 0, not \(0, 4\)"),
        "real cells": (TET, [[0.0, 1, 2, 3]], "cells must hold integers, not float64"),
        "words": ([["a", "b", "c"]] * 4, [[0, 1, 2, 3]], "points must be numbers"),
    }


@pytest.mark.parametrize("case", bad_arrays())
def test_bad_arrays_are_refused(case: str) -> None:
    points, cells, sentence = bad_arrays()[case]
    with pytest.raises(VisceraError, match=sentence):
        vs.mesh(points, cells)  # type: ignore[arg-type]


def test_a_bad_set_is_refused() -> None:
    with pytest.raises(VisceraError, match="set 'tip' names node 4, but the mesh has 4 nodes"):
        vs.mesh(TET, [[0, 1, 2, 3]], {"tip": [1, 4]})


# Node sets


def test_nodes_by_name_indices_mask_and_predicate(cube: vs.Mesh) -> None:
    top = np.flatnonzero(cube.points[:, 2] == 0.1)
    for where in ("top", top, top[::-1].tolist(), cube.points[:, 2] == 0.1, lambda x: x[:, 2] > 0.09):
        found = cube.nodes(where)
        assert found.dtype == np.uint32
        assert np.array_equal(found, top)
    assert cube.nodes(5).tolist() == [5]


@pytest.mark.parametrize(
    ("where", "sentence"),
    [
        ("botom", r"no node set 'botom'; did you mean 'bottom'\?"),
        ([0, 27], "names node 27, but the mesh has 27 nodes"),
        ([-1], "names node -1"),
        ([], "has no nodes"),
        ([0.5], "must be integers"),
        (lambda x: x[:, 2] > 7, "selects no node; the points lie between"),
        (lambda x: x, r"returned float64 \(27, 3\)"),
    ],
)
def test_bad_sets_are_refused(cube: vs.Mesh, where: object, sentence: str) -> None:
    with pytest.raises(VisceraError, match=sentence):
        cube.nodes(where)  # type: ignore[arg-type]


def test_sets_can_be_added(cube: vs.Mesh) -> None:
    more = cube.with_sets(side=lambda x: x[:, 0] == 0, lid="top")
    assert len(more.nodes("side")) == 9
    assert np.array_equal(more.nodes("lid"), cube.nodes("top"))
    assert "side" not in cube.sets


def test_nodes_near_a_place(cube: vs.Mesh) -> None:
    assert cube.points[cube.near([0.05, 0.05, 0.1], 0.051)].tolist() == [
        [0, 0.05, 0.1],
        [0.05, 0, 0.1],
        [0.05, 0.05, 0.1],
        [0.05, 0.1, 0.1],
        [0.1, 0.05, 0.1],
    ]
    with pytest.raises(VisceraError, match=r"the nearest is 0.9 m away"):
        cube.near([0.05, 0.05, 1], 0.1)


# Files


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_is_written_is_read_again(bar: vs.Mesh, tmp_path: Path, ending: str) -> None:
    bar.write(tmp_path / f"bar{ending}")
    again = vs.read(tmp_path / f"bar{ending}")
    np.testing.assert_allclose(again.points, bar.points, rtol=0, atol=1e-15)
    assert np.array_equal(again.cells, bar.cells)
    assert again.messages == ()
    assert ending == ".mesh" or same_sets(again, bar)


@pytest.mark.parametrize("ending", sorted(set(ENDINGS) - {".mesh"}))
def test_cell_sets_are_written_and_read_again(bar: vs.Mesh, tmp_path: Path, ending: str) -> None:
    parts = bar.with_cell_sets(nodule=lambda x: x[:, 0] > 0.3, core=[3, 4, 5])
    parts.write(tmp_path / f"bar{ending}")
    again = vs.read(tmp_path / f"bar{ending}")
    assert {name: cells.tolist() for name, cells in again.cell_sets.items()} == {
        name: cells.tolist() for name, cells in parts.cell_sets.items()
    }
    assert inspect(tmp_path / f"bar{ending}")["cell_sets"] == {"nodule": 48, "core": 3}


def test_overlapping_cell_sets_are_too_much_for_gmsh(bar: vs.Mesh, tmp_path: Path) -> None:
    with pytest.raises(VisceraError, match=r"cells are in 'b' and in another set, which \.msh cannot say; use \.vtu"):
        bar.with_cell_sets(a=[0, 1], b=[1, 2]).write(tmp_path / "bar.msh")


def test_cell_sets_of_other_programs(bar: vs.Mesh, tmp_path: Path) -> None:
    """A labelled array, as segmentations give it, and groups and references without names."""
    label = np.where(bar.centroids[:, 0] > 0.3, 2, 1)
    grid = meshio.Mesh(bar.points, [("tetra", bar.cells.astype(int))], cell_data={"tissue": [label]})
    meshio.vtu.write(str(tmp_path / "a.vtu"), grid)
    assert sorted(vs.read(tmp_path / "a.vtu").cell_sets) == ["tissue:1", "tissue:2"]
    tags = {key: [label.astype(np.int32)] for key in ("gmsh:physical", "gmsh:geometrical")}
    meshio.gmsh.write(str(tmp_path / "a.msh"), meshio.Mesh(bar.points, grid.cells, cell_data=tags), "2.2", binary=False)
    assert sorted(vs.read(tmp_path / "a.msh").cell_sets) == ["physical:3:1", "physical:3:2"]
    meshio.medit.write(str(tmp_path / "a.mesh"), meshio.Mesh(bar.points, grid.cells, cell_data={"medit:ref": [label]}))
    assert len(vs.read(tmp_path / "a.mesh").cells_in("ref:3:2")) == 48


def test_cells_by_name_indices_mask_and_predicate(bar: vs.Mesh) -> None:
    parts = bar.with_cell_sets(far=lambda x: x[:, 0] > 0.3)
    assert parts.with_sets(again="tip").cells_in("far").tolist() == parts.cells_in("far").tolist()
    assert parts.cells_in([5, 2, 5]).tolist() == [2, 5]
    assert parts.cells_in(np.arange(192) == 7).tolist() == [7]
    values = parts.per_cell(1.0, {"far": 2.0, (0, 191): 3.0})
    assert np.flatnonzero(values == 3.0).tolist() == [0, 191], "the later place wins"
    assert np.flatnonzero(values == 2.0).tolist() == np.setdiff1d(parts.cells_in("far"), [0, 191]).tolist()
    for where, sentence in [
        ("fra", "no cell set 'fra'; did you mean 'far'"),
        ([192], "names cell 192, but the mesh has 192 cells"),
        ([], "has no cells"),
        (lambda x: x[:, 0] > 1, "the predicate selects no cell; the centroids lie between"),
        (lambda x: x[:5, 0] > 0, r"takes centroids \(192, 3\) and returns bool \(192,\)"),
    ]:
        with pytest.raises(VisceraError, match=sentence):
            parts.per_cell(1.0, {where if not isinstance(where, list) else tuple(where): 2.0})
    with pytest.raises(VisceraError, match="cell set 'x' names cell 400"):
        vs.mesh(bar.points, bar.cells, cell_sets={"x": [400]})


@pytest.mark.parametrize(
    ("units", "factor"), [("mm", 1e-3), ("cm", 1e-2), ("inch", 0.0254), ("m", 1.0), (0.035, 0.035), (2, 2.0)]
)
def test_units_scale_the_points(bar: vs.Mesh, tmp_path: Path, units: str | float, factor: float) -> None:
    bar.write(tmp_path / "bar.vtu")
    scaled = vs.read(tmp_path / "bar.vtu", units=units)
    np.testing.assert_allclose(scaled.points, factor * bar.points, rtol=1e-15)


@pytest.mark.parametrize("units", ["metre", 0.0, -1.0, float("nan"), float("inf")])
def test_bad_units_are_refused(bar: vs.Mesh, tmp_path: Path, units: str | float) -> None:
    bar.write(tmp_path / "bar.vtu")
    with pytest.raises(VisceraError, match=r"unknown unit 'metre'.*'m'|metres per unit, must be a number above 0"):
        vs.read(tmp_path / "bar.vtu", units=units)


GMSH_GROUPS = ("clamp", "pull", "organ")


def gmsh_mesh(bar: vs.Mesh) -> meshio.Mesh:
    """A bar with its root as a named group of triangles, one named point, and the volume."""
    root = bar.surface[np.isin(bar.surface, bar.sets["root"]).all(axis=1)]
    blocks = [("triangle", root.astype(int)), ("vertex", np.array([[80]])), ("tetra", bar.cells.astype(int))]
    tags = [np.full(len(data), tag, dtype=np.int32) for tag, (_, data) in enumerate(blocks, start=1)]
    fields = {name: np.array([tag, dim]) for name, tag, dim in zip(GMSH_GROUPS, (1, 2, 3), (2, 0, 3), strict=True)}
    return meshio.Mesh(
        bar.points, blocks, cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags}, field_data=fields
    )


@pytest.mark.parametrize(("version", "binary"), [("2.2", False), ("2.2", True), ("4.1", False), ("4.1", True)])
def test_physical_groups_of_gmsh_are_sets(bar: vs.Mesh, tmp_path: Path, version: str, binary: bool) -> None:
    found = gmsh_mesh(bar)
    if version == "4.1":  # meshio writes groups of this version only with the entity of each point
        dim_tags = np.tile([3, 3], (len(bar.points), 1))
        dim_tags[bar.sets["root"]] = [2, 1]
        dim_tags[80] = [0, 2]
        found.point_data["gmsh:dim_tags"] = dim_tags
    meshio.gmsh.write(str(tmp_path / "bar.msh"), found, fmt_version=version, binary=binary)
    again = vs.read(tmp_path / "bar.msh")
    assert sorted(again.sets) == sorted(GMSH_GROUPS)
    np.testing.assert_allclose(again.points[again.nodes("clamp")][:, 0], 0)
    assert len(again.nodes("clamp")) == len(bar.sets["root"])
    assert again.points[again.nodes("pull")].tolist() == [bar.points[80].tolist()]
    assert len(again.nodes("organ")) == len(bar.points)


def test_groups_without_a_name_are_called_by_dimension_and_number(bar: vs.Mesh, tmp_path: Path) -> None:
    found = gmsh_mesh(bar)
    found.field_data = {}
    meshio.gmsh.write(str(tmp_path / "bar.msh"), found, fmt_version="2.2", binary=False)
    # The volume, which holds every point, is left out.
    assert sorted(vs.read(tmp_path / "bar.msh").sets) == ["physical:0:2", "physical:2:1"]
    triangles, tags = found.cells[0].data, np.full(len(found.cells[0].data), 4)
    medit = meshio.Mesh(
        bar.points,
        [("triangle", triangles), ("tetra", bar.cells.astype(int))],
        cell_data={"medit:ref": [tags, np.zeros(len(bar.cells), int)]},
    )
    meshio.medit.write(str(tmp_path / "bar.mesh"), medit)
    assert np.array_equal(vs.read(tmp_path / "bar.mesh").nodes("ref:2:4"), bar.sets["root"])


def first_gmsh(points: NDArray[Any], elements: list[tuple[int, int, list[int]]]) -> str:
    """A Gmsh file of version 1: node k is called 7 + 3 k; elements are type, physical region and nodes."""
    nodes = [f"{7 + 3 * k} {x!r} {y!r} {z!r}" for k, (x, y, z) in enumerate(points.tolist())]
    lines = [
        f"{k} {kind} {region} 1 {len(cell)} {' '.join(str(7 + 3 * node) for node in cell)}"
        for k, (kind, region, cell) in enumerate(elements, start=1)
    ]
    parts = ["$NOD", str(len(nodes)), *nodes, "$ENDNOD", "$ELM", str(len(lines)), *lines, "$ENDELM"]
    return "\n".join(parts) + "\n"


def test_gmsh_files_of_the_first_version_are_read(bar: vs.Mesh, tmp_path: Path) -> None:
    root = bar.surface[np.isin(bar.surface, bar.sets["root"]).all(axis=1)]
    faces = [(2, 5, face) for face in root.tolist()]
    cells = [(4, 1 + (k >= 100), cell) for k, cell in enumerate(bar.cells.tolist())]
    (tmp_path / "old.msh").write_text(first_gmsh(bar.points, [*faces, *cells, (15, 9, [80])]))
    found = vs.read(tmp_path / "old.msh", units="cm")
    np.testing.assert_allclose(found.points, 0.01 * bar.points)
    assert np.array_equal(found.cells, bar.cells)
    assert np.array_equal(found.nodes("physical:2:5"), bar.sets["root"])
    assert found.nodes("physical:0:9").tolist() == [80]
    assert found.cell_sets["physical:3:2"].tolist() == list(range(100, len(bar.cells)))


def test_ten_node_cells_of_gmsh_1_have_its_order_of_nodes(tmp_path: Path) -> None:
    """The last two midpoints are swapped: of the edges 2-3 and 1-3 in the manual, 1-3 and 2-3 elsewhere."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    edges = [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)]
    points = np.vstack([corners, [corners[list(edge)].mean(axis=0) for edge in edges]])
    (tmp_path / "old.msh").write_text(first_gmsh(points, [(11, 1, list(range(10)))]))
    assert np.array_equal(vs.read(tmp_path / "old.msh").points, corners)


def test_bad_gmsh_files_of_the_first_version(bar: vs.Mesh, tmp_path: Path) -> None:
    good = first_gmsh(bar.points, [(4, 1, cell) for cell in bar.cells.tolist()])
    cases = {
        good[: good.index("\n100 4 1 1 4")]: "cut short",
        good.replace("$ENDELM", ""): "its end stands where $ENDELM is due",
        good.replace("$ENDNOD", "12 0 0 0"): "12 stands where $ENDNOD is due",
        good.replace("\n10 ", "\n7 ", 1): "two nodes of number 7",
        good.replace("\n1 4 1 1 4 ", "\n1 4 1 1 3 "): "element 1 is of type 4 with 3 nodes",
        good.replace("\n1 4 1 1 4 7 ", "\n1 4 1 1 4 8 "): "element 1 names node 8, which is not there",
    }
    for text, sentence in cases.items():
        (tmp_path / "bad.msh").write_text(text)
        with pytest.raises(VisceraError, match=re.escape(sentence)):
            vs.read(tmp_path / "bad.msh")


def test_integer_point_arrays_are_sets(bar: vs.Mesh, tmp_path: Path) -> None:
    n = len(bar.points)
    arrays = {
        "set:tip": np.arange(n) > 75,
        "root": (np.arange(n) < 4).astype(np.int32),
        "region": np.arange(n) // 30,
        "number": np.arange(n),
        "pressure": np.ones(n),
    }
    data = {name: values.astype(np.uint8) if values.dtype == bool else values for name, values in arrays.items()}
    meshio.vtu.write(str(tmp_path / "b.vtu"), meshio.Mesh(bar.points, [("tetra", bar.cells)], point_data=data))
    sets = vs.read(tmp_path / "b.vtu").sets
    assert {name: len(nodes) for name, nodes in sets.items()} == {"tip": 5, "root": 4, "region:1": 30, "region:2": 21}


FEBIO_NODES = (
    "<Nodes>" + "".join(f'<node id="{i + 7}">{x},{y},{z}</node>' for i, (x, y, z) in enumerate(TET)) + "</Nodes>"
)
FEBIO = {
    "1.2": f'<Geometry>{FEBIO_NODES}<Elements><tet4 id="1" mat="1"> 7, 8, 9, 10</tet4></Elements></Geometry>',
    "2.5": f'<Geometry>{FEBIO_NODES}<Elements type="tet4" name="P"><elem id="1">7,8,9,10</elem></Elements>'
    '<NodeSet name="fix"><node id="7"/><node id="9"/></NodeSet></Geometry>',
    "4.0": f'<Mesh>{FEBIO_NODES}<Elements type="tet4" name="P"><elem id="1">7,8,9,10</elem></Elements>'
    '<NodeSet name="fix">7, 9</NodeSet><Surface name="load"><tri3 id="1">8,9,10</tri3></Surface></Mesh>',
}


@pytest.mark.parametrize("version", FEBIO)
def test_every_generation_of_febio_is_read(tmp_path: Path, version: str) -> None:
    text = f'<?xml version="1.0"?><febio_spec version="{version}"><Globals/>{FEBIO[version]}</febio_spec>'
    (tmp_path / "a.feb").write_text(text)
    found = vs.read(tmp_path / "a.feb")
    assert found.volume == pytest.approx(1e-3 / 6)
    assert found.cell_sets == {}, "one part is no part"
    expected = {"1.2": {}, "2.5": {"fix": [0, 2]}, "4.0": {"fix": [0, 2], "load": [1, 2, 3]}}[version]
    assert {name: nodes.tolist() for name, nodes in found.sets.items()} == expected


# Bad files


def test_loose_points_of_a_file_are_dropped_with_a_message(bar: vs.Mesh, tmp_path: Path) -> None:
    points = np.vstack([[[5, 5, 5]], bar.points, [[6, 6, 6]]])
    data = {"tip": (points[:, 0] > 0.39).astype(np.int8)}
    meshio.vtu.write(str(tmp_path / "a.vtu"), meshio.Mesh(points, [("tetra", bar.cells + 1)], point_data=data))
    found = vs.read(tmp_path / "a.vtu")
    assert found.messages == ("dropped 2 of 83 points that belong to no cell",)
    np.testing.assert_allclose(found.points, bar.points)
    assert np.array_equal(found.nodes("tip"), bar.nodes("tip"))


def test_other_kinds_of_cells(bar: vs.Mesh, tmp_path: Path) -> None:
    surface = ("triangle", bar.surface.astype(int))
    tets = ("tetra", bar.cells.astype(int))
    meshio.vtu.write(str(tmp_path / "both.vtu"), meshio.Mesh(bar.points, [surface, tets]))
    assert np.array_equal(vs.read(tmp_path / "both.vtu").cells, bar.cells)
    meshio.vtu.write(str(tmp_path / "shell.vtu"), meshio.Mesh(bar.points, [surface]))
    with pytest.raises(VisceraError, match=rf"it has no tetrahedra \({len(bar.surface)} triangle\)"):
        vs.read(tmp_path / "shell.vtu")
    quadratic = ("tetra10", np.arange(10)[None])
    meshio.vtu.write(str(tmp_path / "p2.vtu"), meshio.Mesh(bar.points, [quadratic]))
    with pytest.raises(VisceraError, match=r"cell 0 is curved: .* edge lengths off its middle; only straight cells"):
        vs.read(tmp_path / "p2.vtu")
    bricks = ("hexahedron", np.arange(8)[None])
    meshio.vtu.write(str(tmp_path / "hex.vtu"), meshio.Mesh(bar.points, [bricks]))
    with pytest.raises(VisceraError, match="it holds 1 hexahedron cells; only tetrahedra are read"):
        vs.read(tmp_path / "hex.vtu")


def test_missing_and_unknown_files(tmp_path: Path) -> None:
    with pytest.raises(VisceraError, match=r"nowhere.vtu: no such file"):
        vs.read(tmp_path / "nowhere.vtu")
    with pytest.raises(VisceraError, match="is a folder"):
        vs.read(tmp_path)
    (tmp_path / "organ.docx").write_text("liver")
    with pytest.raises(VisceraError, match=r"unknown mesh format '.docx'; the formats are .vtu"):
        vs.read(tmp_path / "organ.docx")


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_file_of_another_format_is_refused(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"organ{ending}"
    for content in (b"", b"this is no mesh\n" * 20, bytes(range(256)) * 8):
        path.write_bytes(content)
        with pytest.raises(VisceraError, match=rf"organ\{ending}: (not a readable|it has no tetrahedra|not a FEBio)"):
            vs.read(path)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_a_truncated_file_is_refused(bar: vs.Mesh, tmp_path: Path, ending: str, share: float) -> None:
    plain = vs.mesh(bar.points, bar.cells)  # without sets, so that the cells are what the end of the file holds
    path = tmp_path / f"organ{ending}"
    plain.write(path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(VisceraError, match=rf"organ\{ending}: "):
        vs.read(path)


def test_a_cut_between_two_lines_of_abaqus_shows_as_dropped_points(
    bar: vs.Mesh, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    bar.write(tmp_path / "organ.inp")
    lines = (tmp_path / "organ.inp").read_text().splitlines(keepends=True)
    (tmp_path / "organ.inp").write_text("".join(lines[:100]))  # the format has no end mark
    assert vs.read(tmp_path / "organ.inp").messages
    assert "points that belong to no cell" in caplog.text


def test_a_bad_file_names_the_file_and_the_cells(bar: vs.Mesh, tmp_path: Path) -> None:
    cells = np.vstack([bar.cells, bar.cells[5]])
    meshio.vtu.write(str(tmp_path / "twice.vtu"), meshio.Mesh(bar.points, [("tetra", cells)]))
    with pytest.raises(VisceraError, match=r"twice.vtu: cell 192 is on the same four points"):
        vs.read(tmp_path / "twice.vtu")


# The report


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
    import re

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


def test_two_parts_are_a_mesh(bar: vs.Mesh) -> None:
    both = vs.mesh(np.vstack([bar.points, bar.points + 1]), np.vstack([bar.cells, bar.cells + 81]))
    assert report(both)["parts"] == 2


def test_a_suspicious_size_is_logged(bar: vs.Mesh, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    bar.write(tmp_path / "bar.vtu")
    vs.read(tmp_path / "bar.vtu", units=1000)
    assert "implausible for an organ" in caplog.text
