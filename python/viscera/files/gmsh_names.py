"""Names of the physical groups in Gmsh's files of versions 2 and 4: one for each dimension and tag.

meshio keeps them by name alone, where the last of two groups of one name wins.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

Names = Mapping[tuple[int, int], str]
"""Names by dimension and tag."""
SECTION = re.compile(rb"^\$PhysicalNames\s.*?^\$EndPhysicalNames[^\n]*\n?", re.MULTILINE | re.DOTALL)
ENTRY = re.compile(r'^\s*(\d+)\s+(-?\d+)\s+"(.*)"\s*$', re.MULTILINE)


def read(path: Path) -> Names:
    """The names in a file; none if it has no section of them."""
    section = SECTION.search(path.read_bytes())
    text = section[0].decode(errors="replace") if section else ""
    return {(int(dim), int(tag)): name for dim, tag, name in ENTRY.findall(text)}


def keys(names: Names) -> dict[str, str]:
    """Names by keys of their own, under which meshio reads them; none where the names differ as they are."""
    repeats = max(Counter(names.values()).values(), default=0) > 1
    return {_key(group): name for group, name in names.items()} if repeats else {}


@contextmanager
def with_distinct_names(path: Path, names: Names) -> Iterator[Path]:
    """A file in which no two groups have one name: this one, or a copy with `keys` in place of names."""
    if not keys(names):
        yield path
        return
    apart = section({group: _key(group) for group in names})
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "copy.msh"
        copy.write_bytes(SECTION.sub(lambda _: apart, path.read_bytes(), count=1))
        yield copy


def add(path: Path, names: Names) -> None:
    """Puts names into a file that has none."""
    head, nodes, rest = path.read_bytes().partition(b"$Nodes\n")
    path.write_bytes(head + section(names) + nodes + rest)


def section(names: Names) -> bytes:
    """The names as they stand in a file."""
    lines = [f'{dim} {tag} "{name}"' for (dim, tag), name in sorted(names.items())]
    return "\n".join(["$PhysicalNames", str(len(lines)), *lines, "$EndPhysicalNames", ""]).encode()


def _key(group: tuple[int, int]) -> str:
    return "{} {}".format(*group)
