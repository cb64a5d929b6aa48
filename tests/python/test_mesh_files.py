"""Mesh files: what other programs write, what is written is read again, and what is damaged."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

import viscera as vs
from viscera.errors import VisceraError
from viscera.inspection import inspect

TET = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
ENDINGS = (".vtu", ".vtk", ".msh", ".mesh", ".inp", ".feb")


def same_sets(a: vs.Mesh, b: vs.Mesh) -> bool:
    return sorted(a.sets) == sorted(b.sets) and all(np.array_equal(a.sets[name], b.sets[name]) for name in a.sets)


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


def test_units_that_a_file_denies_are_refused(bar: vs.Mesh, tmp_path: Path) -> None:
    replace(bar, axes="RAS").write(tmp_path / "bar.vtu")
    for units in ("cm", 0.5):
        with pytest.raises(
            VisceraError, match=r"bar.vtu: it states its unit, metres, and the units are .*: leave them"
        ):
            vs.read(tmp_path / "bar.vtu", units=units)
    for said in ("m", 1.0):
        assert vs.read(tmp_path / "bar.vtu", units=said).axes == "RAS"


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
    parts = {name: cells.tolist() for name, cells in found.cell_sets.items()}
    assert parts == ({"P": [0]} if "name" in FEBIO[version] else {}), "one part has its name"
    vs.mesh(found.points, found.cells).write(tmp_path / "whole.feb")
    assert not vs.read(tmp_path / "whole.feb").cell_sets, "what is written without parts has none"
    expected = {"1.2": {}, "2.5": {"fix": [0, 2]}, "4.0": {"fix": [0, 2], "load": [1, 2, 3]}}[version]
    assert {name: nodes.tolist() for name, nodes in found.sets.items()} == expected


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('<NodeSet name="fix">7, 8:10</NodeSet>', "<NodeSet name='fix'> holds '8:10', and only numbers are read there"),
        ('<NodeSet name="fix">@surface:load</NodeSet>', "<NodeSet name='fix'> holds '@surface:load'"),
        ('<ElementSet name="all">1:1:1</ElementSet>', "<ElementSet name='all'> holds '1:1:1'"),
        ('<Surface name="load"><tri3 id="3">7,8,x</tri3></Surface>', "<tri3 id='3'> holds 'x'"),
        ('<NodeSet name="fix">7, 99</NodeSet>', "<NodeSet name='fix'> names node 99, which is not in <Nodes>"),
    ],
)
def test_a_febio_set_in_a_form_that_is_not_read_is_named(tmp_path: Path, more: str, words: str) -> None:
    text = f'<febio_spec version="4.0">{FEBIO["4.0"].replace("</Mesh>", more + "</Mesh>")}</febio_spec>'
    (tmp_path / "a.feb").write_text(text)
    with pytest.raises(VisceraError, match=rf"a\.feb: {re.escape(words)}"):
        vs.read(tmp_path / "a.feb")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('<Instance part="P" name="a"><scale>2,2,2</scale></Instance>', "moves the nodes of its part by <scale>"),
        (
            '<Instance part="P" name="a"><transform><translate>0,0,1</translate></transform></Instance>',
            "moves the nodes of its part by <translate>, which is not read; write the nodes where they are to stand",
        ),
        ('<Instance part="P" name="b"/><Instance part="P" name="a"/>', "is the second of the part 'P'"),
    ],
)
def test_febio_instances_that_move_or_repeat_a_part_are_refused(tmp_path: Path, more: str, words: str) -> None:
    text = f'<febio_spec version="2.5">{FEBIO["2.5"].replace("</Geometry>", more + "</Geometry>")}</febio_spec>'
    (tmp_path / "a.feb").write_text(text)
    with pytest.raises(VisceraError, match=rf"a\.feb: <Instance name='a'> {re.escape(words)}"):
        vs.read(tmp_path / "a.feb")
    still = '<Instance part="P" name="a"><scale>1,1,1</scale><rotate>0,0,0</rotate><translate/></Instance>'
    (tmp_path / "a.feb").write_text(text.replace(more, still))
    assert len(vs.read(tmp_path / "a.feb").cells) == 1


def test_febio_numbers_that_two_have_are_refused(tmp_path: Path) -> None:
    text = f'<febio_spec version="4.0">{FEBIO["4.0"]}</febio_spec>'
    (tmp_path / "a.feb").write_text(text.replace("</Nodes>", '<node id="8">1,1,1</node></Nodes>'))
    with pytest.raises(VisceraError, match=r"a\.feb: two nodes have the number 8; parts that number theirs each for"):
        vs.read(tmp_path / "a.feb")
    other = '<node id="11">1,1,1</node></Nodes><Elements type="tet4" name="Q"><elem id="1">8,9,10,11</elem></Elements>'
    (tmp_path / "a.feb").write_text(text.replace("</Nodes>", other))
    assert sorted(vs.read(tmp_path / "a.feb").cell_sets) == ["P", "Q"]
    named = '<ElementSet name="s">1</ElementSet></Mesh>'
    (tmp_path / "a.feb").write_text(text.replace("</Nodes>", other).replace("</Mesh>", named))
    with pytest.raises(VisceraError, match="<ElementSet name='s'> names element 1, and two elements have that number"):
        vs.read(tmp_path / "a.feb")


def test_parts_and_element_sets_of_ten_node_febio_cells_are_read(tmp_path: Path) -> None:
    ends = [[*pair] for pair in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))]
    corners = np.array([*TET, [0.1, 0.1, 0.1]])
    solids = [[0, 1, 2, 3], [1, 4, 2, 3]]
    middles = [corners[solid][ends].mean(axis=1) for solid in solids]
    points = np.concatenate([corners, *middles])
    nodes = "".join(f'<node id="{k}">{x},{y},{z}</node>' for k, (x, y, z) in enumerate(points.tolist()))
    parts = ""
    for k, (name, solid) in enumerate(zip(("liver", "tumour"), solids, strict=True)):
        listed = ",".join(map(str, [*solid, *range(5 + 6 * k, 11 + 6 * k)]))
        parts += f'<Elements type="tet10" name="{name}"><elem id="{k + 7}">{listed}</elem></Elements>'
    mesh = f'<Mesh><Nodes>{nodes}</Nodes>{parts}<ElementSet name="nodule">8</ElementSet></Mesh>'
    (tmp_path / "a.feb").write_text(f'<febio_spec version="4.0">{mesh}</febio_spec>')
    found = vs.read(tmp_path / "a.feb")
    assert len(found.points) == 5
    assert {name: cells.tolist() for name, cells in found.cell_sets.items()} == {
        "liver": [0],
        "tumour": [1],
        "nodule": [1],
    }


def test_node_sets_that_lose_midpoints_are_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    ends = [[*pair] for pair in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))]
    points = np.vstack([TET, np.asarray(TET, dtype=float)[ends].mean(axis=1)]).tolist()
    nodes = "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(points, start=1))
    sets = {"probes": "5,6", "edge": "1,5,2", "corner": "1,2,3,5,8,9"}
    text = f"*NODE\n{nodes}*ELEMENT, TYPE=C3D10\n1,1,2,3,4,5,6,7,8,9,10\n"
    (tmp_path / "a.inp").write_text(text + "".join(f"*NSET, NSET={name}\n{held}\n" for name, held in sets.items()))
    found = vs.read(tmp_path / "a.inp")
    assert {name: held.tolist() for name, held in found.sets.items()} == {"edge": [0, 1], "corner": [0, 1, 2]}
    lost = (
        "the node set 'probes' is left out: all its nodes are midpoints of edges",
        "the node set 'corner' has lost 2 of its 6 nodes: midpoints of edges whose ends it does not hold",
    )
    assert found.messages[1:] == lost
    assert [record.message for record in caplog.records if record.levelname == "WARNING"][: len(lost)] == [*lost]


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


def test_a_section_without_cells_is_no_kind_of_cells(bar: vs.Mesh, tmp_path: Path) -> None:
    bar.write(tmp_path / "a.mesh")
    text = (tmp_path / "a.mesh").read_text()
    (tmp_path / "a.mesh").write_text(text.replace("\nTetrahedra", "\nHexahedra\n0\nTetrahedra"))
    assert np.array_equal(vs.read(tmp_path / "a.mesh").cells, bar.cells)
    (tmp_path / "a.mesh").write_text(text.partition("\nTetrahedra")[0] + "\nTetrahedra\n0\nEnd\n")
    with pytest.raises(VisceraError, match=r"it has no tetrahedra \(no cells at all\)"):
        vs.read(tmp_path / "a.mesh")


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
