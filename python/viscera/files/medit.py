"""Medit's mesh files, ASCII (`.mesh`) and binary (`.meshb`), of versions 1 to 4: vertices, cells, and their references.

After libMeshb: a keyword stands before the count of its rows, and `End` after the last of them; what binary files call
by a number has a name in ASCII. Keywords that do not concern the mesh, such as `RequiredTriangles`, are passed over.
meshio refuses most of them, and takes a file for whole that has no end.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import meshio
import numpy as np
from meshio.medit._medit_internal import medit_codes
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.files.numbers import INT, REAL, Numbers, parsed
from viscera.quantity import brief

KINDS = {
    "Edges": ("line", 2),
    "Triangles": ("triangle", 3),
    "Quadrilaterals": ("quad", 4),
    "Tetrahedra": ("tetra", 4),
    "Prisms": ("wedge", 6),
    "Pyramids": ("pyramid", 5),
    "Hexahedra": ("hexahedron", 8),
    "Hexaedra": ("hexahedron", 8),
    "EdgesP2": ("line3", 3),
    "TrianglesP2": ("triangle6", 6),
    "TetrahedraP2": ("tetra10", 10),
}
"""Kind and number of nodes of the cells that a keyword lists."""
OTHER_SOLIDS = re.compile(r"(Tetrahedra|Hexahedra|Prisms|Pyramids|Polyhedra)([PQ]\d)?")
CELLS_OR_POINTS = re.compile(rf"Dimension|Vertices|{'|'.join(KINDS)}|{OTHER_SOLIDS.pattern}")
UNSEEN = re.compile(r'#[^\n]*|"[^"\n]*"')
"""Comments, and names of files."""
KEYWORD = re.compile(r"(?<!\S)(?!(?i:nan|inf)(?!\S))[A-Za-z]\w*(?!\S)")
VERSIONS = {1: (INT, "f4", INT), 2: (INT, REAL, INT), 3: (INT, REAL, "i8"), 4: ("i8", REAL, "i8")}
"""Kinds of whole numbers, of other numbers and of places in the file, in a binary file of each version."""


class Section(NamedTuple):
    """A keyword, and its numbers: whole ones and others of these kinds."""

    keyword: str
    numbers: Numbers
    whole: str = INT
    real: str = REAL


def read(path: Path) -> meshio.Mesh:
    """Points, and cells by kind, with the references of both as `medit:ref`."""
    data = path.read_bytes()
    dimension, points, point_refs = 3, None, np.empty(0, np.int64)
    blocks: list[tuple[str, NDArray[Any]]] = []
    refs: list[NDArray[Any]] = []
    for section in _binary(data) if path.suffix.lower() == ".meshb" else _text(data):
        if section.keyword == "Dimension":
            (dimension,) = section.numbers.row(INT, 1)
            if dimension not in (2, 3):
                raise VisceraError(f"damaged: its Dimension is {dimension}")
        elif section.keyword == "Vertices":
            points, point_refs = _rows(section, (section.real, dimension), (section.whole, 1))
        elif section.keyword in KINDS:
            kind, width = KINDS[section.keyword]
            nodes, cell_refs = _rows(section, (section.whole, width), (section.whole, 1))
            blocks.append((kind, nodes.astype(np.int64) - 1))
            refs.append(cell_refs[:, 0].astype(np.int64))
        elif count := section.numbers.row(section.whole, 1)[0]:
            raise VisceraError(f"it holds {count} {section.keyword}, which are not read; remesh it with tetrahedra")
    if points is None:
        raise VisceraError("it holds no Vertices")
    point_data = {"medit:ref": point_refs[:, 0].astype(np.int64)}
    return meshio.Mesh(points.astype(np.float64), blocks, point_data=point_data, cell_data={"medit:ref": refs})


def _rows(section: Section, *columns: tuple[str, int]) -> list[NDArray[Any]]:
    """All rows of a section, by columns of one kind."""
    (count,) = section.numbers.row(section.whole, 1)
    found = section.numbers.table(count, *columns)
    if not section.numbers.is_over:
        raise VisceraError(f"damaged: its {section.keyword} hold more numbers than they declare")
    return found


def _text(data: bytes) -> Iterator[Section]:
    """The sections of a file in ASCII that concern the mesh."""
    text = UNSEEN.sub("", data.decode("utf-8-sig", errors="replace"))
    found = list(KEYWORD.finditer(text))
    words = [match[0] for match in found]
    if words[:1] != ["MeshVersionFormatted"]:
        raise ValueError("it does not begin with MeshVersionFormatted")
    ends = [match.start() for match in found[1:]] + [len(text)]
    bodies = [text[match.end() : end] for match, end in zip(found, ends, strict=True)]
    _require_version(bodies[0].strip())
    for word, body in zip(words, bodies, strict=True):
        if CELLS_OR_POINTS.fullmatch(word):
            yield Section(word, Numbers(word, parsed(word, body), "<"))
    if "End" not in words:
        raise VisceraError("cut short: it has no End; if nothing is missing, write that as its last line")


def _require_version(word: str) -> None:
    if word not in ("0", *map(str, VERSIONS)):
        raise VisceraError(f"its MeshVersionFormatted is {brief(word)}; versions 1 to 4 are read")


def _binary(data: bytes) -> Iterator[Section]:
    """The sections of a binary file that concern the mesh. Each tells where the next one is."""
    order = {b"\1\0\0\0": "<", b"\0\0\0\1": ">"}.get(data[:4])
    if order is None:
        raise ValueError("it does not begin with the number 1")
    head = Numbers("head", data, order, 4)
    (version,) = head.row(INT, 1)
    _require_version(str(version))
    whole, real, place = VERSIONS[version or 1]
    while True:
        (code,) = head.row(INT, 1)
        keyword = medit_codes.get(code, ("", "", ""))[0].removeprefix("Gmf")
        if keyword == "End":
            return
        (after,) = head.row(place, 1)
        if not head.at < after < len(data):
            raise VisceraError(f"cut short or damaged: what follows its {keyword or f'section {code}'} is not there")
        if CELLS_OR_POINTS.fullmatch(keyword):
            yield Section(keyword, Numbers(keyword, data[head.at : after], order), whole, real)
        head.at = after
