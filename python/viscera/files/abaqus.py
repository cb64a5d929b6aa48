"""Abaqus input files: nodes, elements, sets of both, surfaces. Keywords that generate or move nodes and elements are
refused.

After Abaqus' user's guide: `*KEYWORD, PARAMETER=VALUE, ...` stands before lines of data, and `**` before a comment.
Capitals do not count in labels; a set has its name as it is spelt first. A label is of its part, its instance or the
assembly: where several have it, those of parts and instances are called `INSTANCE.LABEL`, as the assembly calls them.
meshio keeps the last of several blocks of nodes, and leaves out sets that name sets.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

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
SCOPES = ("PART", "INSTANCE", "END PART", "END INSTANCE", "ASSEMBLY")
"""Keywords with which labels begin or cease to be of a part or an instance alone."""
FACES = {"S1": (0, 1, 2), "S2": (0, 3, 1), "S3": (1, 3, 2), "S4": (2, 3, 0)}
"""Local corners of the faces of a tetrahedron, by Abaqus' names."""


class Line(NamedTuple):
    """A line with its number, and the file that it stands in where that is another."""

    text: str
    number: int
    file: str = ""

    @property
    def words(self) -> list[str]:
        """What commas separate."""
        return [word.strip() for word in _split(self.text)]

    @property
    def place(self) -> str:
        """Where it stands."""
        return f"line {self.number}" + (f" of {self.file}" if self.file else "")

    def whole(self, word: str) -> int:
        """A word as a whole number."""
        try:
            return int(word)
        except ValueError:
            raise VisceraError(f"{self.place}: {word!r} is no whole number") from None

    def real(self, word: str) -> float:
        """A word as a number, as Fortran writes them: `1.5D3` too, and 0 where there is nothing."""
        try:
            return float(word.upper().replace("D", "E") or 0.0)
        except ValueError:
            raise VisceraError(f"{self.place}: {word!r} is no number") from None


@dataclass(frozen=True)
class Block:
    """A keyword with its parameters, in capitals, and its lines of data."""

    keyword: str
    parameters: Mapping[str, str]
    scope: str = ""
    """The part or the instance that it stands in."""
    lines: list[Line] = field(default_factory=list)

    def words(self) -> list[tuple[Line, str]]:
        """The words of all lines, each with its line."""
        return [(line, word) for line in self.lines for word in line.words if word]


@dataclass(frozen=True, eq=False)
class Elements:
    """Elements of one type: their numbers (m,), and those of their nodes (m, nodes of the kind)."""

    kind: str
    numbers: NDArray[np.int64]
    nodes: NDArray[np.int64]


Key = tuple[str, str]
"""The scope of a label, and the label, in capitals."""
Sets = dict[Key, list[int]]


@dataclass
class Model:
    """What the blocks say, by the numbers of the file, and by labels with their scopes."""

    points: dict[int, list[float]] = field(default_factory=dict)
    elements: list[Elements] = field(default_factory=list)
    node_sets: Sets = field(default_factory=dict)
    element_sets: Sets = field(default_factory=dict)
    element_numbers: set[int] = field(default_factory=set)
    surfaces: list[Block] = field(default_factory=list)
    instances: dict[str, Block] = field(default_factory=dict)
    spelt: dict[Key, tuple[str, str]] = field(default_factory=dict)
    """Scopes and labels as they are spelt first."""

    def take(self, block: Block) -> None:
        """Adds a block; most keywords do not concern the mesh."""
        if block.keyword == "NODE":
            self._nodes(block)
        elif block.keyword == "ELEMENT":
            self._elements(block)
        elif block.keyword == "NSET":
            members = self._members(block, "NSET", self.node_sets, self.points)
            if "ELSET" in block.parameters:
                members += self._nodes_of(self._found(block.parameters["ELSET"], self.element_sets, block))
            self._add(self.node_sets, block, "NSET", members)
        elif block.keyword == "ELSET":
            members = self._members(block, "ELSET", self.element_sets, self.element_numbers)
            self._add(self.element_sets, block, "ELSET", members)
        elif block.keyword == "SURFACE":
            self.surfaces.append(block)
        elif block.keyword in MAKERS:
            raise VisceraError(f"*{block.keyword} is not read; write every node and element on a line of its own")
        elif block.keyword in MOVERS and _moves(block):
            raise VisceraError(
                f"*{block.keyword} moves the nodes of the file, which is not read; {MOVERS[block.keyword]}"
            )
        elif block.keyword == "INSTANCE":
            self.instances[block.scope.upper()] = block

    def _add(self, sets: Sets, block: Block, parameter: str, members: list[int]) -> None:
        """Adds members to the set that a parameter of the block names."""
        label = _name(block, parameter)
        key = block.scope.upper(), label.upper()
        self.spelt.setdefault(key, (block.scope, label))
        sets.setdefault(key, []).extend(members)

    def _found(self, name: str, sets: Sets, block: Block, by: str = "a set") -> list[int]:
        """The members of a set that the block names: of its own scope, of the instance that it states or that stands
        before the label, or of any other."""
        label = name.strip('"').upper()
        instance, _, rest = label.rpartition(".")
        scope = block.parameters.get("INSTANCE", block.scope).upper()
        keys = [(scope, label), (self._part(scope), label)]
        keys += [(instance, rest), (self._part(instance), rest), *sets] if instance else [*sets]
        found = next((key for key in keys if key in sets and key[1] in (label, rest)), None)
        if found is None:
            raise VisceraError(f"{by} names {name!r}, and no set before it is called so")
        return sets[found]

    def _part(self, scope: str) -> str:
        """The part of an instance, in capitals."""
        return self.instances[scope].parameters.get("PART", "").upper() if scope in self.instances else ""

    def _members(self, block: Block, parameter: str, sets: Sets, known: Collection[int]) -> list[int]:
        """The numbers in a set: listed, generated from first, last and step, or those of sets before it."""
        if "GENERATE" in block.parameters:
            return [number for line in block.lines for number in _generated(line, known)]
        found: list[int] = []
        for _, word in block.words():
            found += [int(word)] if word.isdecimal() else self._found(word, sets, block)
        missing = next((number for number in found if number not in known), None)
        if missing is not None:
            noun = "node" if parameter == "NSET" else "element"
            raise VisceraError(f"{_name(block, parameter)!r} names {noun} {missing}, which is not there")
        return found

    def _nodes(self, block: Block) -> None:
        if block.parameters.get("SYSTEM", "R").upper() != "R":
            raise VisceraError(
                f"*NODE, SYSTEM={block.parameters['SYSTEM']}: only nodes in rectangular coordinates are read"
            )
        numbers = [line.whole(line.words[0]) for line in block.lines]
        for number, line in zip(numbers, block.lines, strict=True):
            place = [line.real(word) for word in line.words[1:4]]
            if len(place) != 3:
                raise VisceraError(f"node {number} has {len(place)} coordinates; it needs three")
            if self.points.setdefault(number, place) != place:
                raise VisceraError(
                    f"node {number} stands at {self.points[number]} and at {place}; parts that count their nodes each "
                    f"for itself are not read: {FLAT}"
                )
        if "NSET" in block.parameters:
            self._add(self.node_sets, block, "NSET", numbers)

    def _elements(self, block: Block) -> None:
        kind = _kind(_name(block, "TYPE"))
        width = num_nodes_per_cell[kind] + 1
        words = [line.whole(word) for line, word in block.words()]
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
            self._add(self.element_sets, block, "ELSET", numbers)

    def _nodes_of(self, chosen: list[int]) -> list[int]:
        nodes = [each.nodes[np.isin(each.numbers, chosen)].ravel() for each in self.elements]
        return [int(node) for node in np.unique(np.concatenate([*nodes, np.empty(0, dtype=np.int64)]))]

    def _nodes_of_surfaces(self) -> list[str]:
        """Adds the nodes of each surface as a set. Returns what is not read, such as one with the label of a set."""
        unread = []
        for block in self.surfaces:
            label = _name(block, "NAME")
            try:
                members = [node for line in block.lines for node in self._nodes_of_faces(line, block)]
                if set(members) != set(self.node_sets.get((block.scope.upper(), label.upper()), members)):
                    raise VisceraError("a set of other nodes is called so; rename one of them")
            except VisceraError as error:
                unread.append(f"the *SURFACE {label!r} is not read: {error}")
            else:
                self._add(self.node_sets, block, "NAME", members)
        return unread

    def _nodes_of_faces(self, line: Line, surface: Block) -> list[int]:
        """The nodes that a line of a surface names: a node, an element with a face, or a set of either."""
        name, face = (*line.words, "")[:2]
        kind = surface.parameters.get("TYPE", "ELEMENT").upper()
        if kind not in ("NODE", "ELEMENT") or "COMBINE" in surface.parameters:
            raise VisceraError("only lists of nodes and of faces of elements are")
        is_of_nodes = kind == "NODE"
        sets, known = (self.node_sets, self.points) if is_of_nodes else (self.element_sets, self.element_numbers)
        chosen = [int(name)] if name.isdecimal() else self._found(name, sets, surface, "it")
        if chosen and chosen[0] not in known:
            raise VisceraError(f"it names {kind.lower()} {chosen[0]}, which is not there")
        if is_of_nodes:
            return chosen
        held = [(each, np.isin(each.numbers, chosen)) for each in self.elements]
        return [
            node
            for each, is_chosen in held
            if is_chosen.any()
            for node in each.nodes[is_chosen][:, _corners(each.kind, face.upper())].ravel().tolist()
        ]

    def mesh(self) -> meshio.Mesh:
        """The model by the indices of its points and cells."""
        messages = self._nodes_of_surfaces()
        index = {number: k for k, number in enumerate(self.points)}
        blocks = [(each.kind, _indices(each, index)) for each in self.elements]
        points = {
            name: np.array([index[number] for number in nodes])
            for name, nodes in self._named(self.node_sets, "node set", messages).items()
        }
        cells = {
            name: [np.flatnonzero(np.isin(each.numbers, chosen)) for each in self.elements]
            for name, chosen in self._named(self.element_sets, "element set", messages).items()
        }
        places = np.array([*self.points.values()]).reshape(-1, 3)
        return meshio.Mesh(places, blocks, point_sets=points, cell_sets=cells, info={"messages": messages})

    def _named(self, sets: Sets, noun: str, messages: list[str]) -> dict[str, list[int]]:
        """The sets by their labels, with the instance before those that another scope has, too; adds what to say."""
        shared = Counter(label for _, label in sets)
        named = {}
        for key, members in sets.items():
            scope, name = self.spelt[key]
            if scope and shared[key[1]] > 1:
                of_part = [
                    block.scope for block in self.instances.values() if self._part(block.scope.upper()) == key[0]
                ]
                name = f"{of_part[0] if len(of_part) == 1 else scope}.{name}"
                messages.append(
                    f"the {noun} {self.spelt[key][1]!r} of {scope!r} is called {name!r}: another has its name"
                )
            named[name] = members
        return named


def read(path: Path) -> meshio.Mesh:
    """Points, cells by kind, and the sets of both under their names; `info["messages"]` say what is not read."""
    model = Model()
    for block in _blocks(path):
        model.take(block)
    return model.mesh()


def _blocks(path: Path) -> list[Block]:
    found: list[Block] = []
    scope = ""
    for line in _lines(path):
        if line.text.startswith("*"):
            keyword, parameters = line.text[1:].partition(",")[0].strip().upper(), _parameters(line.text)
            if keyword in SCOPES:
                scope = parameters.get("NAME", "") if keyword in ("PART", "INSTANCE") else ""
            found.append(Block(keyword, parameters, scope))
        elif found:
            found[-1].lines.append(line)
    return found


def _lines(path: Path, within: tuple[Path, ...] = ()) -> Iterator[Line]:
    """The lines of a file and of those that it names, without comments; a keyword and its parameters on one line."""
    keyword = Line("", 0)
    file = path.name if within else ""
    for number, text in enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), start=1):
        line = Line(text.strip(), number, file)
        if not line.text or line.text.startswith("**"):
            continue
        if keyword.text.endswith(",") and line.text[0].isalpha():
            keyword = keyword._replace(text=keyword.text + line.text)
            continue
        if keyword.text:
            yield from _with_its_file(keyword, path, within)
        keyword = line if line.text.startswith("*") else Line("", 0)
        if not keyword.text:
            yield line
    if keyword.text:
        yield from _with_its_file(keyword, path, within)


def _with_its_file(keyword: Line, path: Path, within: tuple[Path, ...]) -> Iterator[Line]:
    """A keyword, and the lines of the file that holds its data; of *INCLUDE, these lines alone."""
    if not keyword.text.upper().startswith("*INCLUDE"):
        yield keyword
    name = _parameters(keyword.text).get("INPUT")
    if name is None:
        return
    other = path.parent / name
    if other in (path, *within):
        raise VisceraError(f"{name} includes itself")
    if not other.is_file():
        raise VisceraError(f"it takes lines from {name}, and there is no such file beside it")
    yield from _lines(other, (*within, path))


def _parameters(line: str) -> dict[str, str]:
    words = [word.partition("=") for word in _split(line)[1:]]
    return {name.strip().upper(): value.strip().strip('"') for name, _, value in words}


def _split(line: str) -> list[str]:
    """What commas separate, other than those within quotes: between every other two quotes."""
    pieces = [piece if k % 2 else piece.replace(",", "\n") for k, piece in enumerate(line.split('"'))]
    return '"'.join(pieces).split("\n")


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


def _generated(line: Line, known: Collection[int]) -> list[int]:
    """The numbers from first to last in steps, 1 if there is none, of those that are there; however far they reach."""
    numbers = [line.whole(word) for word in line.words if word]
    if len(numbers) not in (2, 3):
        raise VisceraError(f"{line.place}: a set that is generated needs the first number, the last, and a step")
    first, last, step = (*numbers, 1)[:3]
    if step < 1:
        raise VisceraError(f"{line.place}: the step is {step}; it must be 1 or more")
    span = range(first, last + 1, step)
    # Of the two, the shorter is walked.
    if (last - first) // step < len(known):
        return [number for number in span if number in known]
    return [number for number in sorted(known) if number in span]


def _corners(kind: str, face: str) -> list[int] | slice:
    """Which nodes of an element a face has, as an index. Midpoints of edges are not kept, and left out."""
    if kind.startswith("tetra") and face in FACES:
        return list(FACES[face])
    if kind.startswith(("triangle", "quad")) and face in ("", "SPOS", "SNEG"):
        return slice(None)
    raise VisceraError(f"it names the face {face!r} of a {kind}; name each of its faces, S1 to S4 of a tetrahedron")


def _moves(block: Block) -> bool:
    """Whether the data of *SYSTEM or *INSTANCE are more than an origin at zero."""
    return len(block.lines) > 1 or any(line.real(word) != 0.0 for line, word in block.words())


def _indices(elements: Elements, index: Mapping[int, int]) -> NDArray[np.int64]:
    for number, nodes in zip(elements.numbers.tolist(), elements.nodes.tolist(), strict=True):
        missing = next((node for node in nodes if node not in index), None)
        if missing is not None:
            raise VisceraError(f"element {number} names node {missing}, which is not there")
    flat = [index[node] for node in elements.nodes.ravel().tolist()]
    return np.array(flat, dtype=np.int64).reshape(elements.nodes.shape)
