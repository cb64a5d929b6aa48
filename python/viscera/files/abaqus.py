"""Abaqus input files: nodes, elements, sets of both. Keywords that generate or move nodes and elements are refused.

After Abaqus' user's guide: `*KEYWORD, PARAMETER=VALUE, ...` stands before lines of data, and `**` before a comment.
meshio keeps the last of several blocks of nodes, and leaves out sets that name sets.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import meshio
import numpy as np
from meshio._common import num_nodes_per_cell
from meshio.abaqus._abaqus import abaqus_to_meshio_type
from numpy.typing import NDArray

from viscera.errors import VisceraError

FLAT = "let Abaqus/CAE write the file without parts and assemblies (Model > Edit Attributes)"
MAKERS = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY")
"""Keywords that generate nodes and elements."""
MOVERS = {"SYSTEM": "write their coordinates in the global system, without it", "INSTANCE": FLAT}
"""Keywords that move nodes by their data, and what to do."""


@dataclass(frozen=True)
class Block:
    """A keyword with its parameters, in capitals, and its lines of data, as words."""

    keyword: str
    parameters: Mapping[str, str]
    rows: list[list[str]] = field(default_factory=list)

    def words(self) -> list[str]:
        """The words of all lines."""
        return [word for row in self.rows for word in row if word]


@dataclass(frozen=True, eq=False)
class Elements:
    """Elements of one type: their numbers (m,), and those of their nodes (m, nodes of the kind)."""

    kind: str
    numbers: NDArray[np.int64]
    nodes: NDArray[np.int64]


@dataclass
class Model:
    """What the blocks say, by the numbers of the file."""

    points: dict[int, list[float]] = field(default_factory=dict)
    elements: list[Elements] = field(default_factory=list)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    element_numbers: set[int] = field(default_factory=set)

    def take(self, block: Block) -> None:
        """Adds a block; most keywords do not concern the mesh."""
        if block.keyword == "NODE":
            self._nodes(block)
        elif block.keyword == "ELEMENT":
            self._elements(block)
        elif block.keyword == "NSET":
            members = _members(block, "NSET", self.node_sets, self.points)
            if "ELSET" in block.parameters:
                members += self._nodes_of(_found(block.parameters["ELSET"], self.element_sets))
            self.node_sets.setdefault(_name(block, "NSET"), []).extend(members)
        elif block.keyword == "ELSET":
            members = _members(block, "ELSET", self.element_sets, self.element_numbers)
            self.element_sets.setdefault(_name(block, "ELSET"), []).extend(members)
        elif block.keyword in MAKERS:
            raise VisceraError(f"*{block.keyword} is not read; write every node and element on a line of its own")
        elif block.keyword in MOVERS and _moves(block):
            raise VisceraError(
                f"*{block.keyword} moves the nodes of the file, which is not read; {MOVERS[block.keyword]}"
            )

    def _nodes(self, block: Block) -> None:
        if block.parameters.get("SYSTEM", "R").upper() != "R":
            raise VisceraError(
                f"*NODE, SYSTEM={block.parameters['SYSTEM']}: only nodes in rectangular coordinates are read"
            )
        numbers = [int(row[0]) for row in block.rows]
        for number, row in zip(numbers, block.rows, strict=True):
            place = [float(word) for word in row[1:4]]
            if len(place) != 3:
                raise VisceraError(f"node {number} has {len(place)} coordinates; it needs three")
            if self.points.setdefault(number, place) != place:
                raise VisceraError(
                    f"node {number} stands at {self.points[number]} and at {place}; parts that count their nodes each "
                    f"for itself are not read: {FLAT}"
                )
        if "NSET" in block.parameters:
            self.node_sets.setdefault(block.parameters["NSET"], []).extend(numbers)

    def _elements(self, block: Block) -> None:
        kind = _kind(_name(block, "TYPE"))
        width = num_nodes_per_cell[kind] + 1
        words = [int(word) for word in block.words()]
        if len(words) % width:
            raise VisceraError(f"its *ELEMENT, TYPE={block.parameters['TYPE']} ends amid an element")
        table = np.array(words, dtype=np.int64).reshape(-1, width)
        numbers = table[:, 0].tolist()
        again = next((n for n, count in Counter(numbers).items() if count > 1 or n in self.element_numbers), None)
        if again is not None:
            raise VisceraError(
                f"two elements have the number {again}; parts that count their elements each for itself are not read: "
                f"{FLAT}"
            )
        self.element_numbers.update(numbers)
        self.elements.append(Elements(kind, table[:, 0], table[:, 1:]))
        if "ELSET" in block.parameters:
            self.element_sets.setdefault(block.parameters["ELSET"], []).extend(numbers)

    def _nodes_of(self, chosen: list[int]) -> list[int]:
        nodes = [each.nodes[np.isin(each.numbers, chosen)].ravel() for each in self.elements]
        return [int(node) for node in np.unique(np.concatenate([*nodes, np.empty(0, dtype=np.int64)]))]

    def mesh(self) -> meshio.Mesh:
        """The model by the indices of its points and cells."""
        index = {number: k for k, number in enumerate(self.points)}
        blocks = [(each.kind, _indices(each, index)) for each in self.elements]
        points = {name: np.array([index[number] for number in nodes]) for name, nodes in self.node_sets.items()}
        cells = {
            name: [np.flatnonzero(np.isin(each.numbers, chosen)) for each in self.elements]
            for name, chosen in self.element_sets.items()
        }
        places = np.array([*self.points.values()]).reshape(-1, 3)
        return meshio.Mesh(places, blocks, point_sets=points, cell_sets=cells)


def read(path: Path) -> meshio.Mesh:
    """Points, cells by kind, and the sets of both under their names."""
    model = Model()
    for block in _blocks(path):
        model.take(block)
    return model.mesh()


def _blocks(path: Path) -> list[Block]:
    found: list[Block] = []
    for line in _lines(path):
        if line.startswith("*"):
            found.append(Block(line[1:].partition(",")[0].strip().upper(), _parameters(line)))
        elif found:
            found[-1].rows.append([word.strip() for word in line.removesuffix(",").split(",")])
    return found


def _lines(path: Path, within: tuple[Path, ...] = ()) -> Iterator[str]:
    """The lines of a file and of those that it names, without comments; a keyword and its parameters on one line."""
    keyword = ""
    for line in map(str.strip, path.read_text(encoding="utf-8", errors="replace").splitlines()):
        if not line or line.startswith("**"):
            continue
        if keyword.endswith(",") and line[0].isalpha():
            keyword += line
            continue
        if keyword:
            yield from _with_its_file(keyword, path, within)
        keyword = line if line.startswith("*") else ""
        if not keyword:
            yield line
    if keyword:
        yield from _with_its_file(keyword, path, within)


def _with_its_file(keyword: str, path: Path, within: tuple[Path, ...]) -> Iterator[str]:
    """A keyword, and the lines of the file that holds its data; of *INCLUDE, these lines alone."""
    if not keyword.upper().startswith("*INCLUDE"):
        yield keyword
    name = _parameters(keyword).get("INPUT")
    if name is None:
        return
    other = path.parent / name
    if other in (path, *within):
        raise VisceraError(f"{name} includes itself")
    if not other.is_file():
        raise VisceraError(f"it takes lines from {name}, and there is no such file beside it")
    yield from _lines(other, (*within, path))


def _parameters(line: str) -> dict[str, str]:
    words = [word.partition("=") for word in line.split(",")[1:]]
    return {name.strip().upper(): value.strip().strip('"') for name, _, value in words}


def _name(block: Block, parameter: str) -> str:
    name = block.parameters.get(parameter, "")
    if not name:
        raise VisceraError(f"a *{block.keyword} has no {parameter}=")
    return name


def _kind(name: str) -> str:
    """meshio's name of a type of elements; to a mesh, tetrahedra of every formulation are the same."""
    solid = re.fullmatch(r"(?:C|DC|AC)3D(4|10)[A-Z]*", name.upper())
    if solid:
        return "tetra" if solid[1] == "4" else "tetra10"
    if name.upper() not in abaqus_to_meshio_type:
        raise VisceraError(f"elements of the type {name} are not read; leave them out")
    return str(abaqus_to_meshio_type[name.upper()])


def _members(block: Block, parameter: str, sets: Mapping[str, list[int]], known: Collection[int]) -> list[int]:
    """The numbers in a set: listed, generated from first, last and step, or those of sets before it."""
    if "GENERATE" in block.parameters:
        spans = [([int(word) for word in row if word] + [1])[:3] for row in block.rows]
        return [n for first, last, step in spans for n in range(first, last + 1, step) if n in known]
    found: list[int] = []
    for word in block.words():
        found += [int(word)] if word.isdecimal() else _found(word, sets)
    missing = next((number for number in found if number not in known), None)
    if missing is not None:
        noun = "node" if parameter == "NSET" else "element"
        raise VisceraError(f"{_name(block, parameter)!r} names {noun} {missing}, which is not there")
    return found


def _found(name: str, sets: Mapping[str, list[int]]) -> list[int]:
    """The members of a set that another names: as it is spelt, in other capitals, or behind its instance's name."""
    capitals = {each.upper(): members for each, members in sets.items()}
    own = name.strip('"')
    for spelt in (own.upper(), own.upper().rpartition(".")[2]):
        if spelt in capitals:
            return sets.get(own, capitals[spelt])
    raise VisceraError(f"a set names {name!r}, and no set before it is called so")


def _moves(block: Block) -> bool:
    """Whether the data of *SYSTEM or *INSTANCE are more than an origin at zero."""
    return len(block.rows) > 1 or any(float(word) != 0.0 for word in block.words())


def _indices(elements: Elements, index: Mapping[int, int]) -> NDArray[np.int64]:
    for number, nodes in zip(elements.numbers.tolist(), elements.nodes.tolist(), strict=True):
        missing = next((node for node in nodes if node not in index), None)
        if missing is not None:
            raise VisceraError(f"element {number} names node {missing}, which is not there")
    flat = [index[node] for node in elements.nodes.ravel().tolist()]
    return np.array(flat, dtype=np.int64).reshape(elements.nodes.shape)
