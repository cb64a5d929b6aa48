"""FEBio's XML meshes: `<Mesh>` of versions 3 and 4, `<Geometry>` of the older ones. Geometry and sets only."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.quantity import brief

KINDS = {
    "tet4": "tetra",
    "tet10": "tetra10",
    "hex8": "hexahedron",
    "penta6": "wedge",
    "tri3": "triangle",
    "quad4": "quad",
}
APART = "parts that number theirs each for itself are not read: give each a number of its own"
UNMOVED = {"translate": 0.0, "rotate": 0.0, "scale": 1.0}
"""What an instance holds, and the number that changes nothing."""
WHOLE = "organ"
"""The one part of a mesh that is written. A file's only part of this name is the mesh itself, and no set."""


Arrays = dict[str, NDArray[Any]]


def read(data: bytes) -> tuple[NDArray[Any], Arrays, Arrays, Arrays]:
    """Points (n, 3) in the file's unit, node indices of the elements by kind (m, nodes of the kind), sets of nodes and
    of tetrahedra: named parts, and element sets."""
    root = ET.fromstring(data)
    mesh = root.find("Mesh") if root.find("Mesh") is not None else root.find("Geometry")
    if root.tag != "febio_spec" or mesh is None:
        raise VisceraError("not a FEBio model: it has no <febio_spec> with a <Mesh> or <Geometry>")
    _require_one_in_place(mesh)
    points, number = _points(mesh)
    elements: dict[str, list[list[int]]] = {}
    place: dict[int, list[int]] = {}
    parts: dict[str, list[int]] = {}
    for block in mesh.iter("Elements"):
        for element in block:
            kind = block.get("type", element.tag).lower()
            listed = elements.setdefault(KINDS.get(kind, kind), [])
            if KINDS.get(kind) in ("tetra", "tetra10"):  # a mesh is of one of them alone
                place.setdefault(int(element.get("id", -1)), []).append(len(listed))
                parts.setdefault(block.get("name", ""), []).append(len(listed))
            listed.append(_nodes(element, number))
    cell_sets = {name: np.array(cells) for name, cells in parts.items() if name and [*parts] != [WHOLE]}
    for group in mesh.iter("ElementSet"):
        ids = _numbers(group, int) or [int(element.attrib["id"]) for element in group]
        twice = next((i for i in ids if len(place.get(i, [])) > 1), None)
        if twice is not None:
            raise VisceraError(f"{_called(group)} names element {twice}, and two elements have that number; {APART}")
        cells = sorted({cell for i in ids for cell in place.get(i, [])})
        if cells and group.get("name"):
            cell_sets[group.attrib["name"]] = np.array(cells)

    sets: dict[str, NDArray[Any]] = {}
    for group in [*mesh.iter("Surface"), *mesh.iter("NodeSet")]:  # of one name, the nodes given outright
        members = [i for element in (group, *group) for i in _nodes(element, number)]
        if members and group.get("name"):
            sets[group.attrib["name"]] = np.unique(members)
    return points, {kind: np.array(listed) for kind, listed in elements.items()}, sets, cell_sets


def _points(mesh: ET.Element) -> tuple[NDArray[Any], dict[int, int]]:
    """The places of the nodes, and their indices by number."""
    nodes = [node for block in mesh.iter("Nodes") for node in block.iter("node")]
    if not nodes:
        raise VisceraError("its <Mesh> holds no <Nodes>")
    index: dict[int, int] = {}
    for i, node in enumerate(nodes):
        number = int(node.attrib["id"])
        if index.setdefault(number, i) != i:
            raise VisceraError(f"two nodes have the number {number}; {APART}")
    return np.array([_numbers(node, float) for node in nodes]), index


def _require_one_in_place(mesh: ET.Element) -> None:
    """Refuses instances that move the nodes of their part, or show it again."""
    parts: set[str] = set()
    for instance in mesh.iter("Instance"):
        part = instance.get("part", "")
        if part in parts:
            raise VisceraError(
                f"{_called(instance)} is the second of the part {part!r}, which is not read; write it out"
            )
        parts.add(part)
        moves = [way for way in instance.iter() if set(_numbers(way, float)) - {UNMOVED.get(way.tag)}]
        if moves:
            raise VisceraError(
                f"{_called(instance)} moves the nodes of its part by <{moves[0].tag}>, which is not read; write the "
                "nodes where they are to stand"
            )


def write(
    points: NDArray[np.float64],
    cells: NDArray[np.uint32],
    sets: Mapping[str, NDArray[Any]],
    cell_sets: Mapping[str, NDArray[Any]],
) -> bytes:
    """The mesh as a FEBio 4 model without material or steps, numbered from 1."""
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<febio_spec version="4.0">', "<Mesh>", '<Nodes name="nodes">']
    lines += [f'<node id="{i}">{x!r},{y!r},{z!r}</node>' for i, (x, y, z) in enumerate(points.tolist(), start=1)]
    lines += ["</Nodes>", f'<Elements type="tet4" name="{WHOLE}">']
    lines += [f'<elem id="{i}">{_joined(cell)}</elem>' for i, cell in enumerate((cells + 1).tolist(), start=1)]
    lines.append("</Elements>")
    for name, nodes in sets.items():
        lines.append(f"<NodeSet name={quoteattr(name)}>{_joined((nodes + 1).tolist())}</NodeSet>")
    for name, chosen in cell_sets.items():
        lines.append(f"<ElementSet name={quoteattr(name)}>{_joined((chosen + 1).tolist())}</ElementSet>")
    lines += ["</Mesh>", "</febio_spec>", ""]
    return "\n".join(lines).encode()


def _joined(numbers: list[int]) -> str:
    return ",".join(map(str, numbers))


def _numbers(element: ET.Element, kind: type) -> list[Any]:
    """The numbers that an element's text lists."""
    found = []
    for word in filter(None, re.split(r"[\s,]+", element.text or "")):
        try:
            found.append(kind(word))
        except ValueError:
            raise VisceraError(
                f"{_called(element)} holds {brief(word)}, and only numbers are read there, such as `1, 2, 3`: no "
                "ranges, and no names of other sets; list each number"
            ) from None
    return found


def _called(element: ET.Element) -> str:
    """An element by its name, or by its number."""
    key = "name" if "name" in element.attrib else "id"
    return f"<{element.tag} {key}={element.get(key, '?')!r}>"


def _nodes(element: ET.Element, number: dict[int, int]) -> list[int]:
    """The nodes an element's text lists, or the one its `id` names where it has no text."""
    listed = _numbers(element, int)
    if not listed and element.tag in ("node", "n"):
        listed = [int(element.attrib["id"])]
    unknown = [i for i in listed if i not in number]
    if unknown:
        raise VisceraError(f"{_called(element)} names node {unknown[0]}, which is not in <Nodes>")
    return [number[i] for i in listed]
