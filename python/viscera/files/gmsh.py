"""Gmsh's mesh files of every version: `gmsh1` reads the first, meshio the second, and `gmsh4` the fourth.

A physical group of volumes is a set of cells, any other the set of its nodes. One without a name is called
`physical:DIMENSION:TAG`, and left out where it holds everything.
"""

from __future__ import annotations

import io
from contextlib import redirect_stderr
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.files import gmsh1, gmsh4, gmsh_names, gmsh_tags


def read(path: Path) -> meshio.Mesh:
    """Points, cells by kind, arrays over both, and the physical groups as sets under their names."""
    data = path.read_bytes()
    version = gmsh4.FORMAT.search(data)
    if version is not None and version[1].startswith(b"4"):
        points, blocks, groups = gmsh4.read(data)
        found = meshio.Mesh(points, blocks)
    else:
        found = _in_one_block_of_each_kind(
            gmsh1.read(path) if data.lstrip().startswith(b"$NOD") else _second(data, path)
        )
        groups = _joined(found)
    names = gmsh_names.read(data)
    _add_node_sets(found, groups, names)
    _add_cell_sets(found, groups, names)
    return found


def _second(data: bytes, path: Path) -> meshio.Mesh:
    """A file of version 2, as meshio reads it."""
    gmsh_tags.require_room(data)
    if b"$ParametricNodes" in data:
        raise VisceraError(
            "its nodes have their places on the geometry, too, which is not read in version 2; let Gmsh save it as "
            "version 4.1, or without Mesh.SaveParametric"
        )
    if b"$Elements" in data and b"$EndElements" not in data:  # which meshio takes for whole
        raise VisceraError("cut short: it ends before $EndElements")
    try:
        with redirect_stderr(io.StringIO()):  # where it says that it passes over the partitions of elements
            return meshio.gmsh.read(path)
    except (meshio.ReadError, ValueError):
        version = gmsh4.FORMAT.search(data)
        if version is None or version[2] == b"0":
            raise
        raise VisceraError(
            "damaged, or binary of version 2 with partitions or with gaps between the numbers of its nodes, which is "
            "not read; let Gmsh save it as version 4.1, or in ASCII"
        ) from None


def _in_one_block_of_each_kind(found: meshio.Mesh) -> meshio.Mesh:
    kinds = dict.fromkeys(block.type for block in found.cells)

    def joined(arrays: list[NDArray[Any]]) -> list[NDArray[Any]]:
        each = [[a for a, block in zip(arrays, found.cells, strict=True) if block.type == kind] for kind in kinds]
        return [np.concatenate(same) for same in each]

    blocks = zip(kinds, joined([block.data for block in found.cells]), strict=True)
    arrays = {name: joined(values) for name, values in found.cell_data.items()}
    return meshio.Mesh(found.points, list(blocks), point_data=found.point_data, cell_data=arrays)


def _joined(found: meshio.Mesh) -> gmsh4.Groups:
    """The members of the groups, each element once: versions 1 and 2 list it again for each group that it is in."""
    tags = found.cell_data.pop("gmsh:physical", [])
    found.cell_data.pop("gmsh:geometrical", None)
    groups: gmsh4.Groups = {}
    for k, (block, of_group) in enumerate(zip(found.cells, tags, strict=False)):
        of_group = np.abs(of_group)
        first, number = _copies(block.data, of_group)
        block.data = block.data[first]
        for arrays in found.cell_data.values():
            arrays[k] = arrays[k][first]
        for tag in np.unique(of_group[of_group != 0]).tolist():
            groups.setdefault((block.dim, tag), {})[k] = np.unique(number[of_group == tag])
    return groups


def _copies(nodes: NDArray[Any], tags: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The elements that are no copies of others before them in another group, and which of these each element is."""
    count = len(nodes)
    alone = np.arange(count), np.arange(count)
    if len(np.unique(tags)) < 2:
        return alone
    # In any order of the nodes: a group may have its elements reversed.
    _, first, same = np.unique(np.sort(nodes, axis=1), axis=0, return_index=True, return_inverse=True)
    same = same.reshape(count)
    if len(np.unique(np.stack([same, tags]), axis=1).T) < count:  # twice in one group: damaged, which the mesh tells
        return alone
    number = np.empty(len(first), np.int64)
    number[np.argsort(first)] = np.arange(len(first))
    return np.sort(first), number[same]


def _add_node_sets(found: meshio.Mesh, groups: gmsh4.Groups, names: gmsh_names.Names) -> None:
    members: dict[str, list[NDArray[Any]]] = {}
    for group, held in groups.items():
        if group[0] < 3:  # lines and faces of one name are one set
            nodes = [found.cells[k].data[chosen].ravel() for k, chosen in held.items()]
            members.setdefault(gmsh_names.of(group, names), []).extend(nodes)
    sets = {name: np.unique(np.concatenate(nodes)) for name, nodes in members.items()}
    count = len(found.points)
    found.point_sets = {n: nodes for n, nodes in sets.items() if not gmsh_names.is_number(n) or len(nodes) < count}


def _add_cell_sets(found: meshio.Mesh, groups: gmsh4.Groups, names: gmsh_names.Names) -> None:
    count = sum(len(block) for block in found.cells if block.dim == 3)
    for group, held in groups.items():
        name = gmsh_names.of(group, names)
        is_all = sum(map(len, held.values())) == count
        if group[0] == 3 and not (gmsh_names.is_number(name) and is_all):
            found.cell_sets[name] = [held.get(k, np.empty(0, np.int64)) for k in range(len(found.cells))]
