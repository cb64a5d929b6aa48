"""Names of the physical groups in Gmsh's files of versions 2 and 4: one for each dimension and tag.

meshio keeps them by name alone, where the last of two groups of one name wins.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

Group = tuple[int, int]
"""A physical group, by dimension and tag."""
Names = Mapping[Group, str]
SECTION = re.compile(rb"^\$PhysicalNames\s.*?^\$EndPhysicalNames[^\n]*\n?", re.MULTILINE | re.DOTALL)
ENTRY = re.compile(r'^\s*(\d+)\s+(-?\d+)\s+"(.*)"\s*$', re.MULTILINE)
NUMBER = "physical:"


def read(data: bytes) -> Names:
    """The names in a file; none if it has no section of them."""
    section = SECTION.search(data)
    text = section[0].decode(errors="replace") if section else ""
    return {(int(dim), abs(int(tag))): name for dim, tag, name in ENTRY.findall(text)}


def of(group: Group, names: Names) -> str:
    """What a group is called: without a name in the file, by its dimension and tag."""
    return names.get(group, "{}{}:{}".format(NUMBER, *group))


def is_number(name: str) -> bool:
    """Whether a group has this name for want of one in the file."""
    return name.startswith(NUMBER)


def add(path: Path, names: Names) -> None:
    """Puts names into a file that has none."""
    head, nodes, rest = path.read_bytes().partition(b"$Nodes\n")
    lines = [f'{dim} {tag} "{name}"' for (dim, tag), name in sorted(names.items())]
    section = "\n".join(["$PhysicalNames", str(len(lines)), *lines, "$EndPhysicalNames", ""]).encode()
    path.write_bytes(head + section + nodes + rest)
