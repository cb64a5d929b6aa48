"""Reading surfaces from STL, OBJ and PLY files: points and triangles as they stand, in the units of the file.

They are read here: meshio never comes back from a PLY header that is cut, and knows neither `vertex_index`, 16-bit
numbers nor colours of faces in binary PLY, nor STL in upper case, nor relative vertices or continued lines in OBJ.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError, did_you_mean
from viscera.quantity import brief

Floats = NDArray[np.float64]
Faces = NDArray[np.int64]
TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
"""The types of PLY, and the whole numbers of 64 bits that meshio writes."""
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
CORNERS = ("vertex_index", "vertex_indices")
"""What the list of a face's points is called, at first and by most programs today."""
FACET = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("rest", "V2")])
STL_HEAD = 84


class Property(NamedTuple):
    """A number of a PLY element, or a list of numbers, which its length precedes."""

    name: str
    kind: np.dtype[Any]
    counter: np.dtype[Any] | None


class Element(NamedTuple):
    """What a PLY header declares: rows with these properties."""

    name: str
    n_rows: int
    properties: list[Property]


def read(path: Path) -> tuple[Floats, Faces, str]:
    """Points (n, 3), triangles (t, 3), possibly none, and the world axes that 3D Slicer states in the file.

    Raises `VisceraError` for a file that is damaged or cut short, and for points that are not finite.
    """
    ending = path.suffix.lower()
    try:
        data = path.read_bytes()
        with np.errstate(invalid="ignore"):  # of damaged numbers, which are refused below
            points, faces = {".stl": _stl, ".ply": _ply, ".obj": _obj}[ending](data)
        _refuse_not_finite(points, has_own_corners=ending == ".stl")
    except VisceraError as error:
        raise VisceraError(f"{path}: {error}") from None
    except Exception as error:  # of a damaged file numpy raises whatever it meets
        raise VisceraError(f"{path}: not a readable {ending} file ({type(error).__name__}: {error})") from error
    stated = re.search(rb"SPACE=(RAS|LPS)", data[:1000])
    return points, faces, stated[1].decode() if stated else ""


def _refuse_not_finite(points: Floats, has_own_corners: bool) -> None:
    wrong = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(wrong):
        k = int(wrong[0])
        where = f"corner {k % 3} of triangle {k // 3}" if has_own_corners else f"vertex {k}"
        raise VisceraError(f"{where}, counted from 0, is {points[k].tolist()}; every coordinate must be finite")


def _obj(data: bytes) -> tuple[Floats, Faces]:
    """Vertices, whose colour some programs write behind their position, and faces: `v x y z`, `f a/texture/normal b c`.

    A corner is the number of a vertex, counted from 1; a negative one counts back from the last vertex before the face.
    """
    points: list[list[float]] = []
    faces: list[list[int]] = []
    places: list[int] = []
    for number, words in _statements(data):
        if words[0] == b"v":
            points.append([_number(word) for word in words[1:4]])
            if len(points[-1]) < 3:
                raise VisceraError(f"its vertices have {len(points[-1])} coordinates; a surface needs three")
        elif words[0] == b"f":
            first, *others = [_corner(word, len(points), number) for word in words[1:]] or [0]
            faces += [[first, *pair] for pair in pairwise(others)]
            places += [number] * (len(faces) - len(places))
    found = np.array(faces, dtype=np.int64).reshape(-1, 3)
    beyond = np.flatnonzero((found >= len(points)).any(axis=1))
    if len(beyond):
        raise VisceraError(
            f"damaged or cut short: the face in line {places[beyond[0]]} names vertex {found[beyond[0]].max() + 1}, "
            f"and there are {len(points)}; export it again"
        )
    return np.array(points, dtype=np.float64).reshape(-1, 3), found


def _statements(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """The words of each line, without comments, and its number; a line that ends in a backslash goes on in the next."""
    begun = b""
    for number, line in enumerate([*data.splitlines(), b""], start=1):
        text = begun + line.partition(b"#")[0].rstrip()
        begun = text[:-1] + b" " if text.endswith(b"\\") else b""
        if not begun and (words := text.split()):
            yield number, words


def _corner(word: bytes, count: int, line: int) -> int:
    """The vertex, counted from 0, that a corner of a face names after so many vertices."""
    said = word.partition(b"/")[0]
    try:
        number = int(said)
    except ValueError:
        number = 0
    if number == 0 or number < -count:
        raise VisceraError(
            f"damaged: the face in line {line} names the vertex {brief(said.decode('latin-1'))}, with {count} before "
            "it; vertices are counted from 1, or back from -1"
        )
    return number - 1 if number > 0 else count + number


def _fans(polygons: list[NDArray[Any]]) -> Faces:
    """Triangles (t, 3) of polygons (k, n), each a fan around its first corner; n may be different in each array."""
    fans = [np.empty((0, 3), dtype=np.int64)]
    for corners in polygons:
        if corners.shape[1] >= 3:
            fan = [[0, k, k + 1] for k in range(1, corners.shape[1] - 1)]
            fans.append(np.asarray(corners, dtype=np.int64)[:, fan].reshape(-1, 3))
    return np.concatenate(fans)


def _stl(data: bytes) -> tuple[Floats, Faces]:
    """Points three by three, in the order of the triangles."""
    if b"\0" in data and len(data) < STL_HEAD:
        raise VisceraError(f"cut short: it has {len(data)} bytes, and the header of binary STL alone has {STL_HEAD}")
    promised = int.from_bytes(data[STL_HEAD - 4 : STL_HEAD], "little")
    # Binary files may begin with "solid" as well, so their size decides.
    if len(data) >= STL_HEAD and len(data) == STL_HEAD + FACET.itemsize * promised:
        corners = np.frombuffer(data, FACET, promised, STL_HEAD)["corners"].reshape(-1, 3).astype(np.float64)
    elif re.match(rb"\s*solid\b", data, re.I) and re.search(rb"\b(facet|endsolid)\b", data[:2000], re.I):
        corners = _stl_text(data)
    elif b"\0" in data:
        held = (len(data) - STL_HEAD) / FACET.itemsize
        raise VisceraError(
            f"damaged or cut short: its header promises {promised} triangles, and its size holds {held:.9g}; "
            "export it again"
        )
    else:
        raise VisceraError("not a readable .stl file: it does not begin with 'solid', and is not binary")
    return corners, np.arange(len(corners), dtype=np.int64).reshape(-1, 3)


def _stl_text(data: bytes) -> Floats:
    lines = data.replace(b"\r", b"\n")
    n_facets = len(re.findall(rb"^[ \t]*facet\b", lines, re.I | re.M))
    found = re.findall(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", lines, re.I | re.M)
    if len(found) != 3 * n_facets:
        raise VisceraError(f"damaged or cut short: {n_facets} facets have {len(found)} vertices; they need three each")
    return _numbers(word for vertex in found for word in vertex).reshape(-1, 3)


def _numbers(words: Iterable[bytes]) -> Floats:
    return np.fromiter(map(_number, words), dtype=np.float64)


def _number(word: bytes) -> float:
    try:
        return float(word)
    except ValueError:
        raise VisceraError(f"damaged: it has {brief(word.decode('latin-1'))} where a number belongs") from None


def _ply(data: bytes) -> tuple[Floats, Faces]:
    elements, order, at = _header(data)
    if not order:  # text becomes what a binary file of nothing but doubles would hold
        data, at = _numbers(data[at:].split()).tobytes(), 0
    points, faces = None, np.empty((0, 3), dtype=np.int64)
    for element in elements:
        groups, at = _groups(data, at, element)
        if element.name == "vertex":
            points = _positions(element, groups)
        elif element.name == "face":
            faces = _fans(_corners(element, groups))
    if points is None:
        raise VisceraError("its header declares no element 'vertex'")
    return points, faces


def _header(data: bytes) -> tuple[list[Element], str, int]:
    """The elements, the order of bytes ("" in text), and where the header ends."""
    begin = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    if not begin:
        raise VisceraError("not a readable .ply file: its first line is not 'ply'")
    end = re.compile(rb"(?<=[\r\n])[ \t]*end_header[ \t]*" + begin[1]).search(data, begin.end() - 1)
    if not end:
        raise VisceraError("cut short: its header has no line 'end_header'; export it again")
    order, elements = None, []
    for line in data[begin.end() : end.start()].decode("latin-1").split(begin[1].decode()):
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, "1.0"] if name in ORDERS and order is None:
                order = ORDERS[name]
            case ["element", name, count] if count.isdecimal() and order is not None:
                elements.append(Element(name, int(count), []))
            case ["property", "list", counter, kind, name] if elements:
                elements[-1].properties.append(Property(name, _kind(kind, order), _kind(counter, order)))
            case ["property", kind, name] if elements:
                elements[-1].properties.append(Property(name, _kind(kind, order), None))
            case _:
                raise VisceraError(f"its header has the line {line.strip()!r}, which PLY does not know there")
    if order is None:
        raise VisceraError(f"its header has no line 'format NAME 1.0'; NAME is one of {', '.join(ORDERS)}")
    return elements, order, end.end()


def _kind(name: str, order: str | None) -> np.dtype[Any]:
    if name not in TYPES:
        raise VisceraError(f"its header has the type {name!r}, which PLY does not know; {did_you_mean(name, TYPES)}")
    return np.dtype(order + TYPES[name] if order else np.float64)


Groups = list[tuple[NDArray[np.int64], NDArray[Any]]]
"""Rows with lists of equal lengths, and their numbers."""


def _groups(data: bytes, at: int, element: Element) -> tuple[Groups, int]:
    """The rows of an element that begin at a place of the file, and where they end."""
    if not (element.n_rows and element.properties):
        return [], at
    lengths, _ = _lengths(data, at, element, 0)
    kind = _row(element, lengths)
    rows = np.frombuffer(data, kind, min(element.n_rows, (len(data) - at) // kind.itemsize), at)
    listed = [p.name for p in element.properties if p.counter is not None]
    if not listed and len(rows) < element.n_rows:
        raise _cut(element, len(rows))
    # Most surfaces have nothing but triangles, which are read at once.
    is_even = all((rows[_counter(name)] == n).all() for name, n in zip(listed, lengths, strict=True))
    if len(rows) == element.n_rows and is_even:
        return [(np.arange(len(rows)), rows)], at + rows.nbytes
    places: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for number in range(element.n_rows):
        lengths, end = _lengths(data, at, element, number)
        places.setdefault(lengths, []).append((number, at))
        at = end
    groups = []
    for lengths, found in places.items():
        kind = _row(element, lengths)
        joined = b"".join(data[start : start + kind.itemsize] for _, start in found)
        groups.append((np.array([number for number, _ in found]), np.frombuffer(joined, kind)))
    return groups, at


def _lengths(data: bytes, at: int, element: Element, number: int) -> tuple[tuple[int, ...], int]:
    """The lengths of the lists of a row that begins at a place of the file, and where the row ends."""
    lengths = []
    for _, kind, counter in element.properties:
        if counter is None:
            at += kind.itemsize
        elif at + counter.itemsize <= len(data):
            lengths.append(int(np.frombuffer(data, counter, 1, at)[0]))
            if lengths[-1] < 0:
                raise VisceraError(f"damaged: element {element.name!r} {number} has a list of {lengths[-1]} values")
            at += counter.itemsize + kind.itemsize * lengths[-1]
        else:
            at = len(data) + 1
        if at > len(data):
            raise _cut(element, number)
    return tuple(lengths), at


def _cut(element: Element, held: int) -> VisceraError:
    return VisceraError(
        f"damaged or cut short: its header declares {element.n_rows} of the element {element.name!r}, and the file "
        f"holds {held}; export it again"
    )


def _row(element: Element, lengths: tuple[int, ...]) -> np.dtype[Any]:
    fields: list[Any] = []
    rest = iter(lengths)
    for name, kind, counter in element.properties:
        fields += [(name, kind)] if counter is None else [(_counter(name), counter), (name, kind, (next(rest),))]
    return np.dtype(fields)


def _counter(name: str) -> str:
    return f"{name} count"  # no name of PLY has a space


def _positions(element: Element, groups: Groups) -> Floats:
    single = [p.name for p in element.properties if p.counter is None]
    if missing := [axis for axis in "xyz" if axis not in single]:
        raise VisceraError(f"its vertices have no property {missing[0]!r}; they have {', '.join(single) or 'none'}")
    points = np.empty((element.n_rows, 3))
    for numbers, rows in groups:
        points[numbers] = np.column_stack([rows[axis] for axis in "xyz"])
    return points


def _corners(element: Element, groups: Groups) -> list[NDArray[Any]]:
    name = next((p.name for p in element.properties if p.name in CORNERS and p.counter is not None), None)
    found = [rows[name] for _, rows in groups] if name else []
    for corners in found:
        is_number = (corners == np.rint(corners)) & (np.abs(corners) < 2.0**53)
        if not is_number.all():
            raise VisceraError(
                f"damaged: a face names the vertex {corners[~is_number][0]:g}; vertices have whole numbers"
            )
    return found
