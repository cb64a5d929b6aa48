"""The tags of the nodes in Gmsh's files of version 2: meshio makes room for the largest, however few there are.

After Gmsh's reference manual, "MSH file format version 2": a node is a line `tag x y z`. In binary files meshio takes
tags from 1 on without gaps alone.
"""

from __future__ import annotations

import re

from viscera.errors import VisceraError

NODES = re.compile(rb"^\$Nodes\s*\n(.*?)^\$EndNodes", re.MULTILINE | re.DOTALL)
ROOM = 100_000_000
"""Tags up to this take meshio a gigabyte."""


def require_room(data: bytes) -> None:
    """Raises `VisceraError` for a file of numbers in ASCII whose largest node tag would take all memory."""
    section = NODES.search(data)
    try:
        tags = [int(line.split(None, 1)[0]) for line in section[1].splitlines()[1:] if line.strip()] if section else []
    except ValueError:  # binary, or malformed and refused by meshio
        return
    largest = max(tags, default=0)
    if largest > ROOM:
        raise VisceraError(
            f"a node has the tag {largest}, far beyond its {len(tags)} nodes: it is damaged, or numbered with gaps; "
            "renumber its nodes, in Gmsh by gmsh.model.mesh.renumberNodes()"
        )
