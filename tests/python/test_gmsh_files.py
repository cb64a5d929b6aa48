"""Gmsh's mesh files of every version, as Gmsh and other programs write them, and what is damaged."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.errors import VisceraError

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


def section(name: str, *rows: tuple[str, list[float]], binary: bool) -> bytes:
    """A section of numbers, row by row: those of one row are of the kinds that its letters give, the last repeated."""
    body = b""
    for kinds, row in rows:
        each = (kinds + kinds[-1] * len(row))[: len(row)]
        body += struct.pack(f"<{each}", *row) if binary else (" ".join(map(str, row)) + "\n").encode()
    return f"${name}\n".encode() + body + f"{binary * chr(10)}$End{name}\n".encode()


Groups = dict[tuple[int, int], list[int]]
POINTS: list[list[float]] = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
CELLS = {(2, 1): [1, 2, 3], (2, 48): [3, 4, 5], (3, 1): [1, 2, 3, 4], (3, 2): [2, 3, 4, 5]}
"""Nodes of the one element of each entity."""
NO_GROUPS: Groups = {entity: [] for entity in CELLS}


def gmsh(groups: Groups, version: str = "4.1", binary: bool = False, names: str = "", tag: int = 5) -> bytes:
    """A file of version 4 with two tetrahedra and two of their faces, each alone on its entity; the last node's tag."""
    is_41 = version == "4.1"
    entities: list[Any] = [("Q", [sum(dim == d for dim, _ in groups) for d in range(4)])]
    for (_, entity), physicals in groups.items():
        rows: list[Any] = [
            ("i", [entity]),
            ("d", [0.0] * 6),
            ("Q", [len(physicals)]),
            ("i", physicals),
            ("Q", [1]),
            ("i", [-7]),
        ]
        entities += [row for row in rows if row[1]]
    nodes: list[Any] = [
        ("Q", [1, 5, 1, tag] if is_41 else [1, 5]),
        ("i", [3, 1, 0] if is_41 else [1, 3, 0]),
        ("Q", [5]),
    ]
    tags = [1, 2, 3, 4, tag]
    if is_41:
        nodes += [("Q", [t]) for t in tags] + [("d", place) for place in POINTS]
    else:
        nodes += [("Qd", [t, *place]) for t, place in zip(tags, POINTS, strict=True)]
    elements: list[Any] = [("Q", [4, 4, 1, 4] if is_41 else [4, 4])]
    for k, ((dim, entity), cell) in enumerate(CELLS.items(), start=1):
        head = [dim, entity, 2 * dim - 2] if is_41 else [entity, dim, 2 * dim - 2]
        elements += [("i", head), ("Q", [1]), ("Q", [k, *[tags[node - 1] for node in cell]])]
    one = struct.pack("<i", 1) + b"\n" if binary else b""
    text = f"$MeshFormat\n{version.removesuffix('.0')} {binary:d} 8\n".encode() + one + b"$EndMeshFormat\n"
    if names:
        text += f"$PhysicalNames\n{names.count(chr(10)) + 1}\n{names}\n$EndPhysicalNames\n".encode()
    text += section("Entities", *entities, binary=binary)
    return text + section("Nodes", *nodes, binary=binary) + section("Elements", *elements, binary=binary)


def read(folder: Path, data: bytes) -> tuple[dict[str, list[int]], dict[str, list[int]]]:
    """The sets of nodes, and those of cells."""
    (folder / "a.msh").write_bytes(data)
    found = vs.read(folder / "a.msh")
    assert found.volume == pytest.approx(0.5)
    nodes, cells = ({name: held.tolist() for name, held in each.items()} for each in (found.sets, found.cell_sets))
    return nodes, cells


VERSIONS = pytest.mark.parametrize(("version", "binary"), [("4.1", False), ("4.1", True), ("4.0", False)])


@VERSIONS
def test_an_entity_that_is_reversed_in_its_group_of_gmsh_is_in_it(tmp_path: Path, version: str, binary: bool) -> None:
    """`Physical Surface("ends") = {1, -48}` gives the tag -1 to the second."""
    groups = {(2, 1): [1], (2, 48): [-1], (3, 1): [2], (3, 2): [-2]}
    names = '2 1 "ends"\n3 2 "tissue"'
    sets, cells = read(tmp_path, gmsh(groups, version, binary, names))
    assert sets == {"ends": [0, 1, 2, 3, 4], "tissue": [0, 1, 2, 3, 4]}
    assert cells == {"tissue": [0, 1]}


@VERSIONS
def test_an_entity_of_gmsh_may_be_in_several_groups_without_a_name(tmp_path: Path, version: str, binary: bool) -> None:
    groups = {(2, 1): [1, 6], (2, 48): [2, 6], (3, 1): [3, 4], (3, 2): [3]}
    sets, cells = read(tmp_path, gmsh(groups, version, binary, '2 6 "ends"'))
    assert sets == {"physical:2:1": [0, 1, 2], "physical:2:2": [2, 3, 4], "ends": [0, 1, 2, 3, 4]} | {
        "physical:3:4": [0, 1, 2, 3]
    }
    assert cells == {"physical:3:4": [0]}, "the third holds everything"


@VERSIONS
def test_gmsh_files_of_which_some_entities_are_in_groups(tmp_path: Path, version: str, binary: bool) -> None:
    """As Gmsh saves them with `Mesh.SaveAll`."""
    sets, cells = read(tmp_path, gmsh({**NO_GROUPS, (2, 1): [7]}, version, binary, '2 7 "clamp"'))
    assert sets == {"clamp": [0, 1, 2]}
    assert not cells


@VERSIONS
def test_partitioned_files_of_gmsh_are_read_whole(tmp_path: Path, version: str, binary: bool) -> None:
    """Elements are then on parts of entities, which are listed in a section of their own."""
    data = gmsh({}, version, binary, '2 1 "clamp"')
    rows: list[Any] = [("Q", [2, 1]), ("i", [9, 2]), ("Q", [1, 0, 2, 2]), ("i", [5, 0, 3]), ("Q", [1]), ("i", [2])]
    rows += [("d", [0.0] * (3 if version == "4.1" else 6)), ("Q", [0])]
    for dim, tag in CELLS:
        rows += [("i", [tag, dim, 4]), ("Q", [2]), ("i", [1, 2]), ("d", [0.0] * 6)]
        rows += [("Q", [1]), ("i", [tag]), ("Q", [0])] if dim == 2 else [("Q", [0]), ("Q", [0])]
    parts = section("PartitionedEntities", *rows, binary=binary)
    sets, _ = read(tmp_path, data.replace(b"$Nodes\n", parts + b"$Nodes\n"))
    assert sets == {"clamp": [0, 1, 2], "physical:2:48": [2, 3, 4]}


def test_gmsh_nodes_with_their_places_on_the_entity(tmp_path: Path) -> None:
    """As Gmsh saves them with `Mesh.SaveParametric`."""
    data = gmsh(NO_GROUPS).replace(b"\n3 1 0\n5\n", b"\n2 1 1\n5\n")
    for place in POINTS:
        row = (" ".join(map(str, place)) + "\n").encode()
        data = data.replace(b"\n" + row, b"\n" + row.strip() + b" 0.5 0.25\n", 1)
    read(tmp_path, data)


def test_what_is_called_version_4_may_be_4_1(tmp_path: Path) -> None:
    read(tmp_path, gmsh(NO_GROUPS).replace(b"4.1 0 8", b"4 0 8"))


def test_gmsh_files_of_a_machine_with_the_other_order_of_bytes(tmp_path: Path) -> None:
    head = b"$MeshFormat\n4.1 1 8\n" + struct.pack(">i", 1) + b"\n$EndMeshFormat\n$Nodes\n"
    places = [*[0.0] * 3, 1.0, *[0.0] * 3, 1.0, *[0.0] * 3, 1.0]
    nodes = struct.pack(">4Q3iQ4Q12d", 1, 4, 1, 4, 3, 1, 0, 4, 1, 2, 3, 4, *places)
    elements = struct.pack(">4Q3iQ5Q", 1, 1, 1, 1, 3, 1, 4, 1, 1, 1, 2, 3, 4)
    data = head + nodes + b"\n$EndNodes\n$Elements\n" + elements + b"\n$EndElements\n"
    (tmp_path / "a.msh").write_bytes(data)
    assert vs.read(tmp_path / "a.msh").volume == pytest.approx(1 / 6)


FAR = 2_000_000_000


@VERSIONS
def test_gmsh_tags_with_a_wide_gap_are_read(tmp_path: Path, version: str, binary: bool) -> None:
    read(tmp_path, gmsh(NO_GROUPS, version, binary, tag=FAR))


def test_gmsh_2_tags_with_a_wide_gap_take_no_memory(tmp_path: Path) -> None:
    """meshio makes room for the largest tag, sixteen gigabytes here."""
    nodes = f"$Nodes\n4\n1 0 0 0\n2 1 0 0\n{FAR} 0 1 0\n3 0 0 1\n$EndNodes\n"
    (tmp_path / "far.msh").write_text(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{nodes}")
    with pytest.raises(VisceraError, match=rf"far\.msh: a node has the tag {FAR}, far beyond its 4 nodes.*renumber"):
        vs.read(tmp_path / "far.msh")


HUGE = 2**60
FEWER = "cut short: there are fewer numbers in its $Nodes than it declares"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("$Nodes\n1 5 1 5", "$Nodes\n1 6 1 5", "damaged: its header declares 6 nodes, and its blocks hold 5"),
        ("$Nodes\n1 5 1 5", f"$Nodes\n{HUGE} 5 1 5", FEWER),
        ("3 1 0\n5\n", f"3 1 0\n{HUGE}\n", FEWER),
        ("3 1 0\n5\n1\n", "3 1 0\n5\n2\n", "it has two nodes of number 2"),
        ("3 1 0\n5\n1\n", "3 1 0\n5\n1.5\n", "damaged: 1.5 stands in its $Nodes where a whole number is due"),
        ("3 1 0\n5\n1\n", "3 1 0\n5\n1e300\n", "damaged: 1e+300 stands in its $Nodes where a whole number is due"),
        ("3 1 0\n5\n1\n", "3 1 0\n5\ninf\n", "damaged: inf stands in its $Nodes where a whole number is due"),
        ("3 1 0\n5\n1\n", "7 1 0\n5\n1\n", "damaged: its nodes lie on an entity of dimension 7"),
        (" 0 8\n", " 0 9\n", "damaged: its $MeshFormat declares sizes of 9 bytes, not of 4 or 8"),
        (
            "$Entities\n",
            "$Nodes\n0 0 0 0\n$EndNodes\n$Entities\n",
            "it has two sections $Nodes; a file of Gmsh has one",
        ),
        ("3 1 0\n5\n1\n", "3 1 0\n5\n9\n", "damaged: an element names node 1, which is not there"),
        ("$Elements\n4 4", "$Elements\n4 3", "damaged: its header declares 3 elements, and its blocks hold 4"),
        ("\n3 2 4\n", "\n3 5 4\n", "damaged: entity 5 of dimension 3 has elements, and is not listed"),
        ("\n3 2 4\n", "\n3 2 20\n", "its elements of type 20 are not read; remesh it with tetrahedra"),
        ("$EndNodes", "7\n$EndNodes", "damaged or cut short: $EndNodes is not where its $Nodes is over"),
        ("$EndElements", "", "damaged or cut short: $EndElements is not where its $Elements is over"),
        ("4.1 0 8", "4 1 8", "it is binary of version 4.0, which is not read; let Gmsh save it as version 4.1 or 2.2"),
        ("$Entities\n0", "$Entities\n0x", "damaged: '0x' stands in its $Entities where a number is due"),
    ],
)
def test_damaged_gmsh_files_of_version_4(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    text = gmsh(NO_GROUPS).decode()
    assert old in text
    with pytest.raises(VisceraError, match=rf"a\.msh: {re.escape(sentence)}$"):
        read(tmp_path, text.replace(old, new, 1).encode())


def test_a_cut_or_damaged_binary_file_of_gmsh_is_refused_and_takes_no_memory(tmp_path: Path) -> None:
    data = gmsh({**NO_GROUPS, (2, 1): [7]}, binary=True)
    for length in range(40, len(data) - len("$EndElements\n"), 3):
        with pytest.raises(VisceraError, match=r"a\.msh: (cut short|damaged|it has no tetrahedra)"):
            read(tmp_path, data[:length])
    start = data.index(b"$Nodes\n") + len(b"$Nodes\n") + 4 * 8 + 3 * 4
    for at, sentence in ((start + 6, FEWER), (start + 8 + 6, "an element names node 1, which")):
        with pytest.raises(VisceraError, match=re.escape(sentence)):
            read(tmp_path, data[:at] + b"\4" + data[at + 1 :])
    said = []
    for at in range(data.index(b"$Entities"), len(data)):
        (tmp_path / "a.msh").write_bytes(data[:at] + bytes([data[at] ^ 0x81]) + data[at + 1 :])
        try:
            vs.read(tmp_path / "a.msh")
        except VisceraError as error:
            said.append(str(error))
    assert said
    assert not [sentence for sentence in said if "not a readable" in sentence]


def test_a_volume_in_two_groups_of_gmsh_2_is_read_once(tmp_path: Path) -> None:
    """Gmsh lists its elements once for each group, reversed for one with a minus."""
    nodes = "".join(f"{k} {x} {y} {z}\n" for k, (x, y, z) in enumerate(POINTS, start=1))
    names = '$PhysicalNames\n2\n3 5 "all"\n3 3 "a"\n$EndPhysicalNames\n'
    head = f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{names}$Nodes\n5\n{nodes}$EndNodes\n"
    listed = ["4 2 3 1 1 2 3 4", "4 2 5 1 1 2 3 4", "4 2 4 2 3 2 4 5", "4 2 5 2 2 3 4 5", "15 2 1 1 2"]

    def text(lines: list[str]) -> bytes:
        body = "".join(f"{k} {line}\n" for k, line in enumerate(lines, start=1))
        return f"{head}$Elements\n{len(lines)}\n{body}$EndElements\n".encode()

    sets, cells = read(tmp_path, text(listed))
    assert cells == {"a": [0], "all": [0, 1], "physical:3:4": [1]}
    assert sets["physical:0:1"] == [1]
    with pytest.raises(VisceraError, match="are on the same four points as an earlier cell"):
        read(tmp_path, text([*listed, listed[0]]))
    with pytest.raises(VisceraError, match=r"cut short: it ends before \$EndElements"):
        read(tmp_path, text(listed).removesuffix(b"$EndElements\n"))


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


def test_elements_of_gmsh_2_with_their_partitions_print_nothing(
    bar: vs.Mesh, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bar.write(tmp_path / "bar.msh")
    text = (tmp_path / "bar.msh").read_text()
    (tmp_path / "bar.msh").write_text(re.sub(r"^(\d+ 4) 2 (\d+ \d+)", r"\1 4 \2 1 3", text, flags=re.MULTILINE))
    assert np.array_equal(vs.read(tmp_path / "bar.msh").cells, bar.cells)
    assert capfd.readouterr() == ("", "")


def test_what_is_not_read_of_gmsh_2_is_told(bar: vs.Mesh, tmp_path: Path) -> None:
    bar.write(tmp_path / "bar.msh")
    text = (tmp_path / "bar.msh").read_text().replace("Nodes", "ParametricNodes")
    (tmp_path / "bar.msh").write_text(text)
    with pytest.raises(
        VisceraError, match=r"bar\.msh: its nodes have their places on the geometry, too.*SaveParametric"
    ):
        vs.read(tmp_path / "bar.msh")
    meshio.gmsh.write(str(tmp_path / "bar.msh"), gmsh_mesh(bar), fmt_version="2.2", binary=True)
    data = (tmp_path / "bar.msh").read_bytes()
    first = data.index(b"$Nodes\n") + len(b"$Nodes\n81\n")
    assert data[first : first + 4] == struct.pack("<i", 1)
    (tmp_path / "bar.msh").write_bytes(data[:first] + struct.pack("<i", 99) + data[first + 4 :])
    with pytest.raises(
        VisceraError, match=r"binary of version 2 with .* gaps .*; let Gmsh save it as version 4\.1, or"
    ):
        vs.read(tmp_path / "bar.msh")


def test_a_volume_in_two_groups_of_gmsh_1_is_read_once(tmp_path: Path) -> None:
    points = np.array(POINTS)
    cells = [(4, 3, [0, 1, 2, 3]), (4, 5, [0, 1, 2, 3]), (4, 5, [1, 2, 3, 4])]
    _, cell_sets = read(tmp_path, first_gmsh(points, cells).encode())
    assert cell_sets == {"physical:3:3": [0]}, "the fifth holds everything"


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
