"""Gmsh's mesh files of version 1, of numbers in ASCII: `$NOD`, then `$ELM`. meshio reads the later ones.

After Gmsh's reference manual, "MSH file format version 1": a node is `number x y z`, an element is
`number type reg-phys reg-elem number-of-nodes nodes`, with types and orders of nodes as in later versions.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import meshio
import numpy as np

from viscera.errors import VisceraError

KINDS = {
    1: ("line", 2),
    2: ("triangle", 3),
    3: ("quad", 4),
    4: ("tetra", 4),
    5: ("hexahedron", 8),
    6: ("wedge", 6),
    7: ("pyramid", 5),
    8: ("line3", 3),
    9: ("triangle6", 6),
    11: ("tetra10", 10),
    15: ("vertex", 1),
}
"""Kind and number of nodes of each type of element."""
SWAPPED = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]
"""Gmsh's order of the nodes of a ten-node tetrahedron, in that of all others."""


def read(path: Path) -> meshio.Mesh:
    """Points, cells by kind, and the physical and elementary regions of the cells under meshio's names."""
    words = iter(path.read_text(encoding="ascii").split())
    _expect(words, "$NOD")
    points: list[list[float]] = []
    index: dict[int, int] = {}
    for _ in range(int(next(words))):
        number = int(next(words))
        if number in index:
            raise VisceraError(f"it has two nodes of number {number}")
        index[number] = len(points)
        points.append([float(next(words)) for _ in range(3)])
    _expect(words, "$ENDNOD")
    _expect(words, "$ELM")
    cells: dict[str, list[list[int]]] = {}
    regions: dict[str, list[list[int]]] = {}
    for _ in range(int(next(words))):
        number, kind, physical, elementary, count = (int(next(words)) for _ in range(5))
        name, expected = KINDS.get(kind, ("", 0))
        if count != expected:
            raise VisceraError(f"element {number} is of type {kind} with {count} nodes, which is none of Gmsh's")
        nodes = [int(next(words)) for _ in range(count)]
        missing = [node for node in nodes if node not in index]
        if missing:
            raise VisceraError(f"element {number} names node {missing[0]}, which is not there")
        cells.setdefault(name, []).append([index[node] for node in nodes])
        regions.setdefault(name, []).append([physical, elementary])
    _expect(words, "$ENDELM")
    blocks = [(name, np.array(nodes)[:, SWAPPED] if name == "tetra10" else nodes) for name, nodes in cells.items()]
    physicals, elementaries = ([np.array(regions[name])[:, k] for name in cells] for k in (0, 1))
    data = {"gmsh:physical": physicals, "gmsh:geometrical": elementaries}
    return meshio.Mesh(np.array(points).reshape(-1, 3), blocks, cell_data=data)


def _expect(words: Iterator[str], mark: str) -> None:
    """The next word must be this one."""
    word = next(words, "its end")
    if word != mark:
        raise VisceraError(f"cut short, or no Gmsh file of version 1: {word} stands where {mark} is due")
