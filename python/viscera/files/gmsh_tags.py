"""The tags of the nodes in Gmsh's files of versions 2 and 4: meshio makes room for the largest, however few there are.

After Gmsh's reference manual, "MSH file format": a node of version 2 is a line `tag x y z`. From version 4.1 on, the
nodes stand in blocks, all tags of one before its coordinates.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from viscera.errors import VisceraError

FORMAT = re.compile(rb"^\$MeshFormat\s+(\d+)(\.\d+)?\s+([01])\s+(\d+)\s", re.MULTILINE)
NODES = re.compile(rb"^\$Nodes\s*\n(.*?)^\$EndNodes", re.MULTILINE | re.DOTALL)
ROOM = 100_000_000
"""Tags up to this take meshio a gigabyte."""


def require_room(data: bytes) -> None:
    """Raises `VisceraError` for a file whose largest node tag would take all memory, or is not the one it states."""
    found = FORMAT.search(data)
    if found is None:
        return
    version, is_binary, size = found[1] + (found[2] or b""), found[3] == b"1", int(found[4])
    if not is_binary:
        section = NODES.search(data)
        try:
            tags = _tags(section[1].splitlines(), version) if section else []
        except (ValueError, IndexError):  # what is malformed is refused by meshio
            return
        _require_dense(max(tags, default=0), len(tags))
    elif version.startswith(b"4") and version != b"4.0" and size in (4, 8):
        _require_stated(data, size)


def _tags(lines: list[bytes], version: bytes) -> list[int]:
    """The tags of all nodes, from the lines of the section."""
    if version.startswith(b"2"):
        return _first_numbers(lines[1:])
    tags, at, apart = [], 1, version != b"4.0"
    for _ in range(min(int(lines[0].split()[0]), len(lines))):
        count = int(lines[at].split()[3])
        tags += _first_numbers(lines[at + 1 : at + 1 + count])
        at += 1 + (2 * count if apart else count)
    return tags


def _first_numbers(lines: Iterable[bytes]) -> list[int]:
    return [int(line.split(None, 1)[0]) for line in lines if line.strip()]


def _require_dense(largest: int, count: int) -> None:
    if largest > ROOM:
        raise VisceraError(
            f"a node has the tag {largest}, far beyond its {count} nodes: it is damaged, or numbered with gaps; "
            "renumber its nodes, in Gmsh by gmsh.model.mesh.renumberNodes()"
        )


def _require_stated(data: bytes, size: int) -> None:
    """Refuses a binary file of version 4.1 with damaged node tags, or such large ones."""
    nodes = data.partition(b"$Nodes\n")[2]
    unsigned = np.dtype(f"u{size}")
    if not nodes:
        return
    n_blocks, declared, _, largest = np.frombuffer(nodes, unsigned, 4).tolist()
    at, held = 4 * size, 0
    for _ in range(n_blocks):
        if np.frombuffer(nodes, np.int32, 3, at)[2]:  # parameters follow the coordinates, which meshio refuses
            return
        (count,) = np.frombuffer(nodes, unsigned, 1, at + 12).tolist()
        at += 12 + size
        tag = int(np.frombuffer(nodes, unsigned, count, at).max(initial=0))
        # Some programs state the largest tag wrongly; one below the size of the file takes little memory.
        if tag > max(largest, len(data)):
            raise VisceraError(f"damaged: a node has the tag {tag}, and its header states {largest} as the largest")
        _require_dense(tag, declared)
        at += count * (size + 24)
        held += count
    if held != declared:
        raise VisceraError(f"damaged: its header declares {declared} nodes, and its blocks hold {held}")
