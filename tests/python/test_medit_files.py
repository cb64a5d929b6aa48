"""Medit's mesh files, ASCII and binary, with the keywords that Mmg and Gmsh write, and what is damaged."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import pytest

import viscera as vs
from viscera.errors import VisceraError

TEXT = """MeshVersionFormatted 2
# of two cells
Dimension
3
Vertices
5
0 0 0 0
1 0 0 0
0 1 0 0
0 0 1 7
1 1 1 0
Tetrahedra 2
1 2 3 4 1
2 3 4 5 2
Triangles
1
1 2 3 -5
End
"""
MORE = """Corners
1
1
RequiredVertices
1
1
RequiredTriangles
1
1
Ridges
0
Information 1 2 3
Geometry "of the Vertices 3.mesh"
NormalAtVertices
1
1 1
"""
SETS = {"ref:0:7": [3], "ref:2:-5": [0, 1, 2], "ref:3:1": [0, 1, 2, 3], "ref:3:2": [1, 2, 3, 4]}


def read(path: Path) -> dict[str, list[int]]:
    """The sets of nodes."""
    found = vs.read(path)
    assert found.volume == pytest.approx(0.5)
    assert {name: cells.tolist() for name, cells in found.cell_sets.items()} == {"ref:3:1": [0], "ref:3:2": [1]}
    return {name: nodes.tolist() for name, nodes in found.sets.items()}


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_keywords_that_do_not_concern_the_mesh_are_passed_over(
    tmp_path: Path, version: int, capfd: pytest.CaptureFixture[str]
) -> None:
    text = TEXT.replace("Formatted 2", f"Formatted\n{version}").replace("Tetra", MORE + "Tetra").replace("\n", "\r\n")
    (tmp_path / "a.mesh").write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert read(tmp_path / "a.mesh") == SETS
    assert capfd.readouterr() == ("", "")


def test_cells_of_ten_nodes_in_the_order_in_which_gmsh_writes_them(tmp_path: Path) -> None:
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    ends = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    middles = [[(a + b) / 2 for a, b in zip(corners[i], corners[j], strict=True)] for i, j in ends]
    points = "".join(f"{x} {y} {z} 0\n" for x, y, z in [*corners, *middles])
    cells = "TrianglesP2\n1\n1 2 3 5 6 7 9\nTetrahedraP2\n1\n1 2 3 4 5 6 7 8 9 10 1\n"
    (tmp_path / "a.mesh").write_text(f"MeshVersionFormatted 2\nDimension 3\nVertices\n10\n{points}{cells}End\n")
    found = vs.read(tmp_path / "a.mesh")
    assert found.volume == pytest.approx(1 / 6)
    assert found.nodes("ref:2:9").tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("End\n", "", "cut short: it has no End; if nothing is missing, write that as its last line"),
        ("Triangles\n1\n1 2 3 -5\nEnd\n", "", "cut short: it has no End; if nothing is missing, write that as its"),
        ("Formatted 2", "Formatted 5", "its MeshVersionFormatted is '5'; versions 1 to 4 are read"),
        ("Vertices\n5", "Vertices\n6", "cut short: there are fewer numbers in its Vertices than it declares"),
        ("Tetrahedra 2", f"Tetrahedra {2**60}", "cut short: there are fewer numbers in its Tetrahedra than it"),
        ("Tetrahedra 2", "Tetrahedra 1", "damaged: its Tetrahedra hold more numbers than they declare"),
        ("1 2 3 4 1\n", "1 2 3 4.5 1\n", "damaged: 4.5 stands in its Tetrahedra where a whole number is due"),
        ("1 2 3 4 1\n", "1 2 3 4- 1\n", "damaged: '4-' stands in its Tetrahedra where a number is due"),
        ("End", "TetrahedraP3\n4\nEnd", "it holds 4 TetrahedraP3, which are not read; remesh it with tetrahedra"),
        ("End", "Hexahedra\n1\n1 2 3 4 5 1 2 3 1\nEnd", "it holds 1 hexahedron cells; only tetrahedra are read"),
        ("Dimension\n3", "Dimension\n4", "damaged: its Dimension is 4"),
        ("Tetrahedra 2", "Tetrahedra -2", "damaged: its Tetrahedra declares a count of -2"),
        ("Vertices", "Vertexes", "it holds no Vertices"),
    ],
)
def test_damaged_files(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    assert old in TEXT
    (tmp_path / "a.mesh").write_text(TEXT.replace(old, new))
    with pytest.raises(VisceraError, match=rf"a\.mesh: {re.escape(sentence)}"):
        vs.read(tmp_path / "a.mesh")


def binary(version: int, order: str = "<") -> bytes:
    """The file above, with one section more that is passed over."""
    whole, real, place = [("i", "f", "i"), ("i", "d", "i"), ("i", "d", "q"), ("q", "d", "q")][version - 1]
    data = struct.pack(f"{order}ii", 1, version)
    rows: dict[int, list[tuple[str, list[float]]]] = {3: [("i", [3])]}
    points: list[tuple[float, ...]] = [(0, 0, 0, 0), (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 7), (1, 1, 1, 0)]
    rows[4] = [(whole, [5]), *((f"3{real}{whole}", [*point]) for point in points)]
    rows[17] = [(whole, [1]), (whole, [1])]
    rows[8] = [(whole, [2]), (f"5{whole}", [1, 2, 3, 4, 1]), (f"5{whole}", [2, 3, 4, 5, 2])]
    rows[6] = [(whole, [1]), (f"4{whole}", [1, 2, 3, -5])]
    for code, packed in rows.items():
        body = b"".join(struct.pack(order + kinds, *row) for kinds, row in packed)
        after = len(data) + 4 + struct.calcsize(order + place) + len(body)
        data += struct.pack(f"{order}i{place}", code, after) + body
    return data + struct.pack(f"{order}i{place}", 54, 0)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_binary_files_of_each_version(
    tmp_path: Path, version: int, order: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.meshb").write_bytes(binary(version, order))
    assert read(tmp_path / "a.meshb") == SETS
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("version", [1, 4])
def test_a_cut_or_damaged_binary_file_is_refused_and_takes_no_memory(tmp_path: Path, version: int) -> None:
    data = binary(version)
    end = len(data) - struct.calcsize("<ii" if version == 1 else "<iq")
    for length in range(end + 1):
        (tmp_path / "a.meshb").write_bytes(data[:length])
        with pytest.raises(VisceraError, match=r"a\.meshb: (not a readable .*begin|cut short)"):
            vs.read(tmp_path / "a.meshb")
    said = []
    for at in range(8, end):
        damaged = bytearray(data)
        damaged[at] ^= 0x40
        (tmp_path / "a.meshb").write_bytes(damaged)
        try:
            vs.read(tmp_path / "a.meshb")
        except VisceraError as error:
            said.append(str(error))
    assert said
    assert not [sentence for sentence in said if "not a readable" in sentence]
