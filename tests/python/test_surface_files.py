"""Surfaces from STL, OBJ and PLY files: every kind that programs write is read, damage is told with its place."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import meshio
import numpy as np
import pytest

import viscera as vs
from viscera import cli
from viscera.errors import VisceraError
from viscera.files import surface as surfacefile
from viscera.registration.measured import read_cloud

BOX = np.array(list(np.ndindex(2, 2, 2)), dtype=float)
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
MIXED = [*QUADS[:5], [1, 5, 7], [1, 7, 3]]
ORDERS = ("ascii", "binary_little_endian", "binary_big_endian")


def ply(
    order: str, *, number: str = "float", index: str = "int", name: str = "vertex_index", ending: str = "\n"
) -> bytes:
    """A box as PLY with a colour of each vertex and face, texture coordinates, and edges between the two."""
    lines = [
        "ply",
        f"format {order} 1.0",
        "comment SPACE=LPS",
        "element vertex 8",
        *(f"property {number} {axis}" for axis in "xyz"),
        "property uchar red",
        "element edge 2",
        "property int vertex1",
        "property int vertex2",
        f"element face {len(MIXED)}",
        "property short flags",
        f"property list uchar {index} {name}",
        "property list uint8 float texcoord",
        "end_header",
    ]
    head = ending.join([*lines, ""]).encode()
    rows: list[list[tuple[str, float]]] = [[*((number, x) for x in p), ("uchar", 200)] for p in BOX.tolist()]
    rows += [[("int", 0), ("int", 1)], [("int", 1), ("int", 2)]]
    for face in MIXED:
        corners = [("uchar", len(face)), *((index, k) for k in face)]
        rows.append([("short", -5), *corners, ("uint8", 2), ("float", 0.25), ("float", 0.5)])
    return head + (written(rows, ending) if order == "ascii" else packed(rows, order))


def written(rows: Sequence[Sequence[tuple[str, float]]], ending: str) -> bytes:
    return "".join(" ".join(f"{x:g}" for _, x in row) + ending for row in rows).encode()


def packed(rows: Sequence[Sequence[tuple[str, float]]], order: str) -> bytes:
    first = "<" if order == "binary_little_endian" else ">"
    return b"".join(np.array(x, dtype=first + surfacefile.TYPES[kind]).tobytes() for row in rows for kind, x in row)


@pytest.mark.parametrize("name", ["vertex_index", "vertex_indices"])
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("number", ["float", "double", "float32", "float64", "char", "int16", "uint16", "uint32"])
def test_every_kind_of_ply_is_read(tmp_path: Path, order: str, number: str, name: str) -> None:
    (tmp_path / "box.ply").write_bytes(ply(order, number=number, name=name))
    points, triangles, axes = surfacefile.read(tmp_path / "box.ply")
    assert points.tolist() == BOX.tolist()
    assert len(triangles) == 12
    assert axes == "LPS"
    assert vs.mesh_surface(tmp_path / "box.ply", edge="300 mm").volume == pytest.approx(1.0, rel=1e-3)
    assert np.array_equal(read_cloud(tmp_path / "box.ply", "mm"), 1e-3 * BOX)


@pytest.mark.parametrize("index", ["uchar", "int8", "ushort", "short", "uint", "int32", "int64"])
@pytest.mark.parametrize("order", ORDERS)
def test_faces_of_every_whole_number_are_read(tmp_path: Path, order: str, index: str) -> None:
    (tmp_path / "box.ply").write_bytes(ply(order, index=index, ending="\r\n"))
    _, triangles, _ = surfacefile.read(tmp_path / "box.ply")
    assert sorted(map(sorted, triangles.tolist())) == sorted(
        sorted(face[k] for k in fan) for face in MIXED for fan in ([0, 1, 2], [0, 2, 3])[: len(face) - 2]
    )


@pytest.mark.parametrize("binary", [True, False])
def test_what_meshio_writes_is_read(tmp_path: Path, binary: bool) -> None:
    organ = vs.organs.liver()
    meshio.ply.write(str(tmp_path / "a.ply"), meshio.Mesh(organ.points, [("triangle", organ.surface)]), binary=binary)
    meshio.stl.write(str(tmp_path / "a.stl"), meshio.Mesh(organ.points, [("triangle", organ.surface)]), binary=binary)
    points, triangles, _ = surfacefile.read(tmp_path / "a.ply")
    assert np.array_equal(points, organ.points)
    assert np.array_equal(triangles, organ.surface)
    points, triangles, _ = surfacefile.read(tmp_path / "a.stl")
    assert np.allclose(points[triangles], organ.points[organ.surface], atol=1e-8)


@pytest.mark.parametrize("order", ORDERS)
def test_a_ply_file_that_is_cut_anywhere_is_refused(tmp_path: Path, order: str) -> None:
    whole = ply(order)
    path = tmp_path / "cut.ply"
    for size in range(len(whole) - 4 if order == "ascii" else len(whole)):
        path.write_bytes(whole[:size])
        with pytest.raises(VisceraError, match=r"cut\.ply: "):
            surfacefile.read(path)


def test_a_cut_header_ends_every_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It was read for ever."""
    path = tmp_path / "cut.ply"
    for head in (
        "ply\nformat binary_little_endian 1.0\nelement vertex 8\nproperty double x\n",
        "ply\nformat ascii 1.0\n",
    ):
        path.write_text(head, encoding="utf-8")
        words = re.escape(f"{path}: cut short: its header has no line 'end_header'; export it again")
        with pytest.raises(VisceraError, match=words):
            vs.mesh_surface(path, units="mm", edge="8 mm")
        with pytest.raises(VisceraError, match=words):
            read_cloud(path)
        assert cli.main(["mesh", str(path), "--units", "mm", "--edge", "8mm", "-o", str(tmp_path / "a.vtu")]) == 2
        assert "its header has no line 'end_header'" in capsys.readouterr().err


HEAD = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACE = "element face 1\nproperty list uchar int vertex_index\nend_header\n"
PLACES = "0 0 0\n1 0 0\n0 1 0\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float8 x\nend_header\n",
            "has the type 'float8', which PLY does not know",
        ),
        (HEAD + FACE.replace("int", "integer") + PLACES, "has the type 'integer'"),
        (HEAD.replace("ascii", "text") + FACE, "has the line 'format text 1.0'"),
        ("ply\nend_header\n", "has no line 'format NAME 1.0'"),
        ("ply\nformat ascii 1.0\nend_header\n", "declares no element 'vertex'"),
        (HEAD.replace("float z", "float w") + FACE + PLACES + "3 0 1 2\n", "have no property 'z'; they have x, y, w"),
        (HEAD.replace("3", "4") + FACE + PLACES, "declares 4 of the element 'vertex', and the file holds 3"),
        (HEAD.replace("3", "999999999999") + FACE + PLACES, "declares 999999999999 of the element 'vertex'"),
        (
            HEAD + FACE.replace("1", "2") + PLACES + "3 0 1 2\n",
            "declares 2 of the element 'face', and the file holds 1",
        ),
        (HEAD + FACE + PLACES + "-1\n", "element 'face' 0 has a list of -1 values"),
        (HEAD + FACE + PLACES + "3 0 1 1.5\n", "a face names the vertex 1.5"),
        (HEAD + FACE + PLACES + "3 0 1 inf\n", "a face names the vertex inf"),
        (HEAD + FACE + PLACES + "3 0 1 3\n", "a triangle names a point that is not one of 3"),
        (
            HEAD + FACE + PLACES.replace("1 0 0", "1 nan 0") + "3 0 1 2\n",
            "vertex 1, counted from 0, is [1.0, nan, 0.0]",
        ),
        (HEAD + FACE + PLACES.replace("1 0 0", "1 b 0") + "3 0 1 2\n", "damaged: it has 'b' where a number belongs"),
        (HEAD + "end_header\n" + PLACES, "it has no triangles"),
    ],
)
def test_a_bad_ply_file_is_told_with_its_name(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "bad.ply").write_text(text, encoding="utf-8")
    with pytest.raises(VisceraError, match=re.escape("bad.ply: ") + ".*" + re.escape(words)):
        vs.mesh_surface(tmp_path / "bad.ply", edge=0.1)


def stl(tmp_path: Path, binary: bool) -> Path:
    """A box of twelve triangles."""
    triangles = [[q[0], q[k], q[k + 1]] for q in QUADS for k in (1, 2)]
    meshio.stl.write(str(tmp_path / "box.stl"), meshio.Mesh(BOX, [("triangle", np.array(triangles))]), binary=binary)
    return tmp_path / "box.stl"


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_stl_in_upper_case_is_read(tmp_path: Path, ending: str) -> None:
    path = stl(tmp_path, binary=False)
    path.write_bytes(path.read_text(encoding="utf-8").upper().replace("\n", ending).encode())
    assert vs.mesh_surface(path, edge="300 mm").volume == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("size", "count", "words"),
    [
        (None, 13, "promises 13 triangles, and its size holds 12;"),
        (None, 11, "promises 11 triangles, and its size holds 12;"),
        (84 + 50 * 7 + 20, 12, "promises 12 triangles, and its size holds 7.4;"),
        (None, 2**32 - 1, "promises 4294967295 triangles, and its size holds 12;"),
    ],
)
def test_a_binary_stl_file_of_another_size_is_refused(tmp_path: Path, size: int | None, count: int, words: str) -> None:
    path = stl(tmp_path, binary=True)
    data = path.read_bytes()[:size]
    for head in (data[:80], b"solid box".ljust(80, b"\0")):
        path.write_bytes(head + count.to_bytes(4, "little") + data[84:])
        with pytest.raises(VisceraError, match=r"box\.stl: damaged or cut short: its header " + re.escape(words)):
            vs.mesh_surface(path, edge=0.1)


def test_bad_stl_text_is_told_with_its_name(tmp_path: Path) -> None:
    path = stl(tmp_path, binary=False)
    text = path.read_text(encoding="utf-8")
    path.write_text(text[: text.rindex("vertex")], encoding="utf-8")
    with pytest.raises(VisceraError, match=r"box\.stl: damaged or cut short: 12 facets have 35 vertices"):
        read_cloud(path)
    path.write_text("solid nothing\nendsolid nothing\n", encoding="utf-8")
    with pytest.raises(VisceraError, match=r"box\.stl: it has no triangles"):
        vs.mesh_surface(path, edge=0.1)
    path.write_bytes(b"solid box".ljust(82, b"\0"))
    with pytest.raises(VisceraError, match=r"cut short: it has 82 bytes, and the header of binary STL alone has 84"):
        vs.mesh_surface(path, edge=0.1)
    for data in (b"", b"this is no surface\n" * 20):
        path.write_bytes(data)
        with pytest.raises(VisceraError, match=r"box\.stl: not a readable \.stl file: it does not begin with 'solid'"):
            vs.mesh_surface(path, edge=0.1)


def test_a_corner_that_is_not_finite_is_told_with_its_triangle(tmp_path: Path) -> None:
    path = stl(tmp_path, binary=True)
    data = bytearray(path.read_bytes())
    at = 84 + 50 * 5 + 12 + 12 * 2 + 4  # triangle 5, after its normal, corner 2, y
    data[at : at + 4] = np.float32(np.nan).tobytes()
    path.write_bytes(data)
    words = r"box\.stl: corner 2 of triangle 5, counted from 0, is \[0\.0, nan, 1\.0\]; every coordinate must be finite"
    for read in (lambda: vs.mesh_surface(path, edge=0.1), lambda: read_cloud(path)):
        with pytest.raises(VisceraError, match=words):
            read()
    points = BOX.copy()
    points[3, 0] = np.inf
    with pytest.raises(VisceraError, match=r"point 3 of the surface is \[inf, 1\.0, 1\.0\]; it must be finite"):
        vs.mesh_surface((points, np.array([[0, 1, 3]])), edge=0.1)


def test_obj_with_colours_and_polygons_is_read(tmp_path: Path) -> None:
    lines = [f"v {x:g} {y:g} {z:g} 0.5 0.5 0.5" for x, y, z in BOX.tolist()]
    lines += ["v 0.5 1.2 0 0.5 0.5 0.5", "v 0.5 1.2 1 0.5 0.5 0.5"]  # a ridge: two faces have five corners
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 9, 8], [8, 9, 7, 6], [0, 2, 8, 6, 4], [1, 5, 7, 9, 3]]
    lines += ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    (tmp_path / "roof.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    mesh = vs.mesh_surface(tmp_path / "roof.obj", edge="300 mm")
    assert mesh.messages == ()
    assert mesh.volume == pytest.approx(1.1, rel=1e-3)
    assert len(read_cloud(tmp_path / "roof.obj")) == 10
    (tmp_path / "flat.obj").write_text("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", encoding="utf-8")
    with pytest.raises(VisceraError, match=r"flat\.obj: its vertices have 2 coordinates; a surface needs three"):
        vs.mesh_surface(tmp_path / "flat.obj", edge=0.1)


def obj(corners: Callable[[int], str], *, faces: str = "f", more: str = "") -> str:
    """A box as OBJ; corners: what a face calls a vertex, counted from 0."""
    vertices = [f"v {x:g} {y:g} {z:g}" for x, y, z in BOX.tolist()]
    listed = [f"{faces} {' '.join(map(corners, face))}" for face in MIXED]
    return "\n".join(["# by C:\\programs\\", *vertices, "g box", *listed, more, ""])


@pytest.mark.parametrize(
    "text",
    [
        obj(lambda k: f"{k - 8}"),
        obj(lambda k: f"{k - 8}//-1", more="v 9 9 9"),
        obj(lambda k: f"{k + 1}/7 \\\n"),
        obj(lambda k: f"{k + 1}", faces="f \\\n").replace("\n", "\r\n"),
        obj(lambda k: f"{k + 1}", more="# the end").replace("\nf", " # a face \\\nf"),
    ],
    ids=["relative", "relative before others", "continued", "continued with carriage returns", "comments"],
)
def test_faces_of_obj_may_count_back_and_go_on_in_the_next_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "box.obj").write_bytes(text.encode())
    points, triangles, _ = surfacefile.read(tmp_path / "box.obj")
    assert np.array_equal(points[:8], BOX)
    corners = points[triangles]
    assert len(triangles) == 12
    assert np.linalg.det(corners).sum() / 6.0 == pytest.approx(1.0)  # the volume that the faces enclose


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (obj(lambda k: f"{k + 2}"), r"the face in line 12 names vertex 9, and there are 8; export it again"),
        (obj(lambda k: f"{k}"), r"the face in line 11 names the vertex '0', with 8 before it; vertices are counted"),
        (obj(lambda k: f"{k - 9}"), r"the face in line 11 names the vertex '-9', with 8 before it"),
        (obj(lambda k: "a"), r"the face in line 11 names the vertex 'a'"),
        ("v 0 0 0\nv 1 x 0\n", "damaged: it has 'x' where a number belongs"),
    ],
)
def test_faces_of_obj_name_vertices_that_are_there(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "box.obj").write_text(text)
    with pytest.raises(VisceraError, match=rf"box\.obj: .*{words}"):
        surfacefile.read(tmp_path / "box.obj")
