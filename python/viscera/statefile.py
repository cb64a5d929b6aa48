"""Files of a solved organ: volumes with every field, or its deformed surface with the fields that the format has.

Volumes hold the points at rest, so that a viewer's "warp by vector" deforms them; surfaces hold the deformed points.
"""

from __future__ import annotations

import base64
import json
import os
import struct
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from viscera import _core
from viscera.atomic import replacing, writable
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh

VOLUMES = (".vtu", ".vtk", ".xdmf", ".msh")
SURFACES = {
    ".ply": "the deformed surface, its fields as properties of the vertices",
    ".glb": "the deformed surface, its fields as attributes of the vertices",
    ".gltf": "the deformed surface, its fields as attributes of the vertices",
    ".obj": "the deformed surface without its fields, which this format cannot hold",
    ".stl": "the deformed surface without its fields, which this format cannot hold",
}
Y_UP = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
"""Quaternion that turns z, which is up here, into y, which is up in glTF."""


def checked(path: str | os.PathLike[str]) -> Path:
    """The path, or an error where its format or its folder cannot take a solution: asked before the work."""
    ending = Path(path).suffix.lower()
    if ending not in VOLUMES and ending not in SURFACES:
        raise VisceraError(
            f"{os.fspath(path)}: a solution cannot be written as {ending or 'a file without an ending'}; use "
            f"{', '.join(VOLUMES)} for the volume with its fields, or {', '.join(SURFACES)} for the deformed surface"
        )
    if ending == ".xdmf" and find_spec("h5py") is None:
        raise VisceraError(
            f"{os.fspath(path)}: writing .xdmf needs the package h5py, which is not installed; or use .vtu"
        )
    return writable(path)


def contents(path: str | os.PathLike[str]) -> str:
    """What a file of this format holds, in words."""
    return SURFACES.get(Path(path).suffix.lower(), "the volume with its fields")


def write(path: str | os.PathLike[str], mesh: Mesh, displacement: Floats, fields: Mapping[str, Floats]) -> None:
    """Writes a solution; fields (n, 3) by name, `displacement` (n, 3) [m] among them."""
    ending = checked(path).suffix.lower()
    with replacing(path) as scratch:
        if ending in VOLUMES:
            _write_volume(scratch, ending, mesh, fields)
        else:
            nodes, corners = np.unique(mesh.surface, return_inverse=True)
            triangles = corners.reshape(-1, 3).astype(np.uint32)
            shown = {name: field[nodes] for name, field in fields.items()}
            _write_surface(scratch, ending, (mesh.points + displacement)[nodes], triangles, shown)


def _write_volume(path: Path, ending: str, mesh: Mesh, fields: Mapping[str, Floats]) -> None:
    import meshio

    is_quadratic = len(mesh.edges) > 0
    cells = _core.quadratic(mesh.n_corners, mesh.cells)[1] if is_quadratic else mesh.cells
    kind = "tetra10" if is_quadratic else "tetra"
    grid = meshio.Mesh(mesh.points, [(kind, cells.astype(np.int64))], point_data=dict(fields))
    if ending == ".vtu":
        meshio.vtu.write(path, grid)
    elif ending == ".vtk":
        meshio.vtk.write(path, grid, fmt_version="4.2")
    elif ending == ".msh":
        meshio.gmsh.write(path, grid, fmt_version="2.2", binary=True)
    else:  # numbers in the file itself: a second file beside it could not be replaced with it
        meshio.xdmf.write(path, grid, data_format="XML")


def _write_surface(path: Path, ending: str, points: Floats, triangles: Indices, fields: Mapping[str, Floats]) -> None:
    if ending in (".glb", ".gltf"):
        path.write_bytes(_gltf(points, triangles, fields, is_binary=ending == ".glb"))
        return
    import meshio

    surface = meshio.Mesh(points, [("triangle", triangles.astype(np.int32))])
    if ending == ".ply":
        axes = ("x", "y", "z")
        columns = {f"{name}_{axis}": field[:, k] for name, field in fields.items() for k, axis in enumerate(axes)}
        surface.point_data = {name: np.ascontiguousarray(values) for name, values in columns.items()}
        meshio.ply.write(path, surface)
    elif ending == ".obj":
        meshio.obj.write(path, surface)
    else:
        meshio.stl.write(path, surface, binary=True)


def _gltf(points: Floats, triangles: Indices, fields: Mapping[str, Floats], *, is_binary: bool) -> bytes:
    """A glTF 2.0 scene of one mesh: `_DISPLACEMENT` and the other fields are attributes of its vertices.

    Khronos Group, glTF 2.0 Specification (2021), sections 3.7 (meshes) and 4.4 (the binary container).
    """
    arrays = {"POSITION": points} | {f"_{name.upper()}": field for name, field in fields.items()}
    blocks = [np.ascontiguousarray(array, dtype="<f4").tobytes() for array in arrays.values()]
    blocks.append(np.ascontiguousarray(triangles, dtype="<u4").tobytes())
    starts = np.cumsum([0, *map(len, blocks)]).tolist()
    data = b"".join(blocks)  # every block is of four-byte numbers, so each begins where glTF wants it
    vectors = {"componentType": 5126, "type": "VEC3", "count": len(points)}
    accessors: list[dict[str, Any]] = [{"bufferView": k, **vectors} for k in range(len(arrays))]
    single = points.astype("<f4")
    accessors[0] |= {"min": single.min(axis=0).tolist(), "max": single.max(axis=0).tolist()}
    accessors.append({"bufferView": len(arrays), "componentType": 5125, "type": "SCALAR", "count": triangles.size})
    attributes = {name: k for k, name in enumerate(arrays)}
    scene: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"viscera {_core.__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "rotation": Y_UP}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": len(arrays)}]}],
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(block)}
            for start, block in zip(starts, blocks, strict=False)
        ],
        "buffers": [{"byteLength": len(data)}],
    }
    if not is_binary:
        inline = base64.b64encode(data).decode("ascii")
        scene["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{inline}"
        return json.dumps(scene).encode()
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
