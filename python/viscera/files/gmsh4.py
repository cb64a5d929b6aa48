"""Gmsh's mesh files of version 4.0, of numbers in ASCII, and of 4.1, in ASCII or binary.

After Gmsh's reference manual, "MSH file format": each geometric entity lists the physical groups that it is in, with a
minus where its orientation is reversed, and the elements of one entity stand in a block. meshio loses the groups with a
minus and all but the first of those without a name; it takes a file for cut short whose entities are not all in groups,
and every file of version 4.0.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from meshio._common import num_nodes_per_cell
from meshio.gmsh.common import _gmsh_to_meshio_order, _gmsh_to_meshio_type
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.files.numbers import INT, REAL, Numbers, parsed

FORMAT = re.compile(rb"^\$MeshFormat\s+(\d+(?:\.\d+)?)\s+([01])\s+(\d+)[ \t]*\r?\n", re.MULTILINE)

Blocks = list[tuple[str, NDArray[np.int64]]]
Groups = dict[tuple[int, int], dict[int, NDArray[np.int64]]]
"""Members by dimension and tag of the group: the indices of its elements in each block where it has some."""


class File:
    """The sections of a file, and what its version and its program's machine make of them."""

    def __init__(self, data: bytes) -> None:
        found = FORMAT.search(data)
        if found is None:
            raise VisceraError("it has no $MeshFormat")
        self.data = data
        self.is_binary = found[2] == b"1"
        self.order = ">" if self.is_binary and data[found.end() : found.end() + 4] == b"\0\0\0\1" else "<"
        self.is_first = float(found[1]) < 4.1 and not self._has_later_nodes()
        if int(found[3]) not in (4, 8):
            raise VisceraError(f"damaged: its $MeshFormat declares sizes of {int(found[3])} bytes, not of 4 or 8")
        self.size = f"u{int(found[3])}"
        if self.is_first and self.is_binary:
            raise VisceraError("it is binary of version 4.0, which is not read; let Gmsh save it as version 4.1 or 2.2")

    @contextmanager
    def section(self, name: str) -> Iterator[Numbers | None]:
        """The numbers of a section, all of which are to be taken; none if the file does not have it."""
        start = re.search(rb"^\$%s[ \t]*\r?\n" % name.encode(), self.data, re.MULTILINE)
        if start is None:
            yield None
            return
        end = b"$End" + name.encode()
        if self.is_binary:
            numbers = Numbers(f"${name}", self.data[start.end() :], self.order)
            yield numbers
            is_over = self.data[start.end() + numbers.at :].lstrip().startswith(end)
        else:
            text, mark, rest = self.data[start.end() :].partition(end)
            if re.search(rb"^\$%s[ \t]*\r?\n" % name.encode(), rest, re.MULTILINE):
                raise VisceraError(f"it has two sections ${name}; a file of Gmsh has one")
            numbers = Numbers(f"${name}", parsed(f"${name}", text.decode("latin-1")), self.order)
            yield numbers
            is_over = bool(mark) and numbers.is_over
        if not is_over:
            raise VisceraError(f"damaged or cut short: ${end.decode()[1:]} is not where its ${name} is over")

    def _has_later_nodes(self) -> bool:
        """Whether the nodes of a file in ASCII begin as in version 4.1: some programs call that "4"."""
        first = re.search(rb"^\$Nodes\s+(.*)$", self.data, re.MULTILINE)
        return not self.is_binary and first is not None and len(first[1].split()) == 4


def read(data: bytes) -> tuple[NDArray[np.float64], Blocks, Groups]:
    """Points, the nodes of the elements by kind, a block for each entity, and the members of the physical groups.

    Raises `VisceraError` where the file does not hold what it declares.
    """
    file = File(data)
    with file.section("Nodes") as numbers:
        tags, points = _nodes(file, numbers) if numbers else (np.empty(0, np.int64), np.empty((0, 3)))
    physicals = {**_physicals(file, "Entities"), **_physicals(file, "PartitionedEntities")}
    with file.section("Elements") as numbers:
        listed = list(_elements(file, numbers)) if numbers else []
    order = np.argsort(tags, kind="stable")
    blocks: Blocks = []
    groups: Groups = {}
    for k, (entity, kind, nodes) in enumerate(listed):
        if physicals and entity not in physicals:
            raise VisceraError(f"damaged: entity {entity[1]} of dimension {entity[0]} has elements, and is not listed")
        blocks.append((kind, np.asarray(_gmsh_to_meshio_order(kind, _indices(nodes, tags, order)))))
        for physical in physicals.get(entity, ()):
            groups.setdefault((entity[0], physical), {})[k] = np.arange(len(nodes))
    return points, blocks, groups


def _physicals(file: File, name: str) -> dict[tuple[int, int], list[int]]:
    """The tags of the physical groups of each entity, by its dimension and tag; those of a partitioned mesh, too."""
    found: dict[tuple[int, int], list[int]] = {}
    with file.section(name) as numbers:
        if numbers is None:
            return {}
        is_partitioned = name != "Entities"
        if is_partitioned:
            _, n_ghosts = numbers.row(file.size, 2)
            numbers.skip(INT, 2 * n_ghosts)
        for dimension, count in enumerate(numbers.row(file.size, 4)):
            for _ in range(count):
                (tag,) = numbers.row(INT, 1)
                if is_partitioned:
                    numbers.skip(INT, 2)  # the entity that it is a part of
                    numbers.skip(INT, *numbers.row(file.size, 1))
                numbers.skip(REAL, 3 if dimension == 0 and not file.is_first else 6)
                groups = numbers.row(INT, *numbers.row(file.size, 1))
                found[dimension, tag] = [abs(group) for group in groups]
                if dimension > 0:  # what bounds it
                    numbers.skip(INT, *numbers.row(file.size, 1))
    return found


def _nodes(file: File, numbers: Numbers) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The tags of all nodes, and their places."""
    n_blocks, declared = numbers.row(file.size, 2 if file.is_first else 4)[:2]
    tags, places = [np.empty((0, 1), np.int64)], [np.empty((0, 3))]
    for _ in range(n_blocks):
        head = numbers.row(INT, 3)
        dimension = head[1] if file.is_first else head[0]
        if dimension not in range(4):
            raise VisceraError(f"damaged: its nodes lie on an entity of dimension {dimension}")
        (count,) = numbers.row(file.size, 1)
        coordinates = (REAL, 3 + (dimension if head[2] else 0))  # on its entity, too
        if file.is_first:
            number, place = numbers.table(count, (file.size, 1), coordinates)
        else:
            (number,) = numbers.table(count, (file.size, 1))
            (place,) = numbers.table(count, coordinates)
        tags.append(number.astype(np.int64))
        places.append(place[:, :3])
    found = np.concatenate(tags)[:, 0]
    if len(found) != declared:
        raise VisceraError(f"damaged: its header declares {declared} nodes, and its blocks hold {len(found)}")
    numbered, times = np.unique(found, return_counts=True)
    if (times > 1).any():
        raise VisceraError(f"it has two nodes of number {numbered[times > 1][0]}")
    return found, np.concatenate(places).astype(np.float64)


def _elements(file: File, numbers: Numbers) -> Iterator[tuple[tuple[int, int], str, NDArray[np.int64]]]:
    """Each block's entity, by dimension and tag, the kind of its elements, and the tags of their nodes."""
    n_blocks, declared = numbers.row(file.size, 2 if file.is_first else 4)[:2]
    held = 0
    for _ in range(n_blocks):
        first, second, number = numbers.row(INT, 3)
        (count,) = numbers.row(file.size, 1)
        kind = _gmsh_to_meshio_type.get(number)
        if kind is None:
            raise VisceraError(f"its elements of type {number} are not read; remesh it with tetrahedra")
        (rows,) = numbers.table(count, (file.size, 1 + num_nodes_per_cell[kind]))
        held += count
        yield (second, first) if file.is_first else (first, second), kind, rows[:, 1:].astype(np.int64)
    if held != declared:
        raise VisceraError(f"damaged: its header declares {declared} elements, and its blocks hold {held}")


def _indices(nodes: NDArray[np.int64], tags: NDArray[np.int64], order: NDArray[np.int64]) -> NDArray[np.int64]:
    """Nodes by index instead of tag, however far the tags reach. `order` sorts the tags."""
    place = np.searchsorted(tags, nodes, sorter=order)
    index = order[np.minimum(place, len(tags) - 1)] if len(tags) else np.zeros_like(nodes)
    missing = nodes[tags[index] != nodes] if len(tags) else nodes
    if missing.size:
        raise VisceraError(f"damaged: an element names node {missing.flat[0]}, which is not there")
    return index
