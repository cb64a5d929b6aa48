"""Files of a solved organ: volumes with every field, or its deformed surface with the fields that the format takes.

Volumes hold the points at rest, so that a viewer's "warp by vector" deforms them; surfaces hold the deformed points.
"""

from __future__ import annotations

import base64
import json
import os
import struct
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from viscera import _core
from viscera.errors import VisceraError
from viscera.files.atomic import replacing, writable
from viscera.files.mesh import add_masks, state_axes, stated_axes
from viscera.mesh import Floats, Indices, Mesh, mesh
from viscera.quantity import path_of

REGISTERED = "band"
"""The field at points that registered organs alone have. Their displacement leads from the axes of the scan, in which
the points are, to those of the intervention."""
UNLOADED = "unloaded"
"""The field, 1 at every point, of an organ without the loads of its scan, or under others. Its points do not lie where
the scan shows them."""
NOT_IN_SCAN = {
    REGISTERED: "its displacement leads to the axes of the intervention, in which the scan is not; take the shape "
    "before the rigid motion, which `viscera register --shape shape.vtu` or `found.state.write` writes",
    UNLOADED: "its points are not those under the loads of the scan, so they do not lie where the scan shows the "
    "organ; take the state counted from the scan, which `rest.from_scan(state).write` or `viscera solve` writes",
}
"""Fields of solutions that do not lie where the scan shows the organ, with the reason and the remedy."""
NOT_CONVERGED, NOT_SETTLED = "not_converged", "not_settled"
DOUBTS = {
    NOT_CONVERGED: "the solve of this shape did not converge: it is the last shape that was found, not the one under "
    "all of its loads; `message` of a state and `status` of an answer tell what stopped it",
    NOT_SETTLED: "the frame of this shape had not settled: it may be far from equilibrium; take a frame that "
    "`is_settled`, or solve",
}
"""Fields, 1 at every point, of shapes that are no equilibrium under their loads, and what to say of one."""
REST_OF_AXES = {
    REGISTERED: ", at rest; by the displacement to the axes of the intervention",
    UNLOADED: ", not under the loads of the scan",
}
"""What files with these fields say of their axes."""
VOLUMES = (".vtu", ".vtk", ".xdmf", ".msh")
_BARE = "the deformed surface without its fields, which this format cannot hold"
SURFACES = {
    ".ply": "the deformed surface, its fields as properties of the vertices",
    ".glb": "the deformed surface, its fields as attributes of the vertices",
    ".gltf": "the deformed surface, its fields as attributes of the vertices",
    ".obj": _BARE,
    ".stl": _BARE,
}
Y_UP = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
"""Quaternion that turns z, which is up here, into y, which is up in glTF."""


class Solution(NamedTuple):
    """What a file holds of a solution."""

    mesh: Mesh
    """With the world axes of its scan if the file states them, which `.vtu` does."""
    displacement: Floats
    """Displacement (n, 3) [m]."""
    doubt: str
    """Which of `DOUBTS` is true of it; empty if none is."""


def checked(path: str | os.PathLike[str]) -> Path:
    """The path. It is an error if its format or its folder cannot take a solution; call this before long work."""
    ending = path_of(path, "the file to write").suffix.lower()
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


def is_bare(path: str | os.PathLike[str]) -> bool:
    """Whether this format holds no fields."""
    return contents(path) == _BARE


def contents(path: str | os.PathLike[str]) -> str:
    """What a file of this format holds, in words."""
    return SURFACES.get(Path(path).suffix.lower(), "the volume with its fields")


def write(
    path: str | os.PathLike[str],
    mesh: Mesh,
    displacement: Floats,
    fields: Mapping[str, Floats],
    cell_fields: Mapping[str, Floats] | None = None,
) -> None:
    """Writes a solution; fields (n, 3) or (n,) by name, `displacement` (n, 3) [m] among them.

    Volumes but `.xdmf` keep the sets of the mesh.

    cell_fields: (m,), or (m, 3, 3) as nine columns, row by row; in volumes alone.
    """
    ending = checked(path).suffix.lower()
    if ending in VOLUMES:
        write_volume(path, mesh, fields, cell_fields or {})
        return
    nodes, corners = np.unique(mesh.surface, return_inverse=True)
    triangles = corners.reshape(-1, 3).astype(np.uint32)
    shown = {name: field[nodes] for name, field in fields.items()}
    with replacing(path) as scratch:
        _write_surface(scratch, ending, (mesh.points + displacement)[nodes], triangles, shown)


def read(path: str | os.PathLike[str], *, in_scan: bool = False) -> Solution:
    """The solution in a file of a volume format; raises `VisceraError` if it holds none.

    in_scan: the organ is to lie where the scan shows it, and to move in its axes; one that does not is refused.
    """
    name = str(path_of(path, "the solution"))
    if Path(name).suffix.lower() not in VOLUMES:
        raise VisceraError(f"{name}: is no solution with its volume; those end in {', '.join(VOLUMES)}")
    if not Path(name).is_file():
        raise VisceraError(f"{name}: no such file")
    import meshio

    from viscera.files import vtk  # which imports meshio, too

    try:
        grid = vtk.read(Path(name)) if name.lower().endswith((".vtu", ".vtk")) else meshio.read(name)
    except VisceraError as error:
        raise VisceraError(f"{name}: {error}") from None
    except (Exception, SystemExit) as error:  # the readers of meshio raise whatever their parser meets
        raise VisceraError(f"{name}: not a readable file ({type(error).__name__})") from error
    field = grid.point_data.get("displacement")
    if field is None or field.shape != grid.points.shape or not np.isfinite(field).all():
        raise VisceraError(f"{name}: holds no displacement (n, 3) at its points; write it by `viscera solve -o`")
    elsewhere = next((field for field in NOT_IN_SCAN if field in grid.point_data), None)
    if in_scan and elsewhere is not None:
        raise VisceraError(f"{name}: {NOT_IN_SCAN[elsewhere]}")
    doubt = next((field for field in DOUBTS if field in grid.point_data), "")
    kind = next((kind for kind in ("tetra10", "tetra") if kind in grid.cells_dict), None)
    if kind is None:
        raise VisceraError(f"{name}: holds no tetrahedra")
    cells = grid.cells_dict[kind]
    corners, place = np.unique(cells[:, :4], return_inverse=True)
    linear = mesh(grid.points[corners], place.reshape(-1, 4))
    axes = stated_axes(Path(name)) if name.lower().endswith(".vtu") else ""
    linear = replace(linear, axes=axes, is_unloaded=elsewhere == UNLOADED)
    if linear.messages and kind == "tetra10":
        raise VisceraError(f"{name}: {linear.messages[0]}; quadratic cells must be oriented as Viscera writes them")
    if kind == "tetra":
        return Solution(linear, np.asarray(field[corners], dtype=float), doubt)
    quadratic = linear.quadratic()
    nodes = _core.quadratic(quadratic.n_corners, quadratic.cells)[1]
    displacement = np.zeros_like(quadratic.points)
    displacement[nodes] = field[cells]
    return Solution(quadratic, displacement, doubt)


def write_volume(
    path: str | os.PathLike[str], mesh: Mesh, fields: Mapping[str, Floats], cell_fields: Mapping[str, Floats]
) -> None:
    """Writes the cells at rest in a volume format, with fields as in `write`, the sets and, in `.vtu`, the axes."""
    if mesh.is_unloaded:
        fields = {**fields, UNLOADED: np.ones(len(mesh.points))}
    grid, ending = _grid(mesh, fields, cell_fields), Path(path).suffix.lower()
    if ending != ".xdmf":
        add_masks(grid, ending, mesh.sets, mesh.cell_sets)
    with replacing(path) as scratch:
        _write_grid(scratch, ending, grid)
        if ending == ".vtu" and mesh.axes:
            state_axes(scratch, mesh.axes, next((REST_OF_AXES[field] for field in REST_OF_AXES if field in fields), ""))


def _write_grid(path: Path, ending: str, grid: Any) -> None:
    """Writes a grid of meshio in a volume format."""
    import meshio

    if ending == ".vtu":
        meshio.vtu.write(path, grid)
    elif ending == ".vtk":
        meshio.vtk.write(path, grid, fmt_version="4.2")
    elif ending == ".msh":
        for tag in ("gmsh:physical", "gmsh:geometrical"):  # of no group; meshio adds them too, and prints a warning
            grid.cell_data[tag] = [np.zeros(len(block), dtype=np.int32) for block in grid.cells]
        meshio.gmsh.write(path, grid, fmt_version="2.2", binary=True)
    else:  # numbers in the file itself: a second file beside it could not be replaced with it
        meshio.xdmf.write(path, grid, data_format="XML")


def _grid(mesh: Mesh, fields: Mapping[str, Floats], cell_fields: Mapping[str, Floats]) -> Any:
    """The cells at rest with their fields, as `write` takes them, in the form of meshio."""
    import meshio

    is_quadratic = len(mesh.edges) > 0
    cells = _core.quadratic(mesh.n_corners, mesh.cells)[1] if is_quadratic else mesh.cells
    kind = "tetra10" if is_quadratic else "tetra"
    rows = {name: [field.reshape(len(field), -1) if field.ndim > 1 else field] for name, field in cell_fields.items()}
    return meshio.Mesh(mesh.points, [(kind, cells.astype(np.int64))], point_data=dict(fields), cell_data=rows)


def _write_surface(path: Path, ending: str, points: Floats, triangles: Indices, fields: Mapping[str, Floats]) -> None:
    if ending in (".glb", ".gltf"):
        path.write_bytes(gltf(points, triangles, fields, is_binary=ending == ".glb"))
        return
    import meshio

    surface = meshio.Mesh(points, [("triangle", triangles.astype(np.int32))])
    if ending == ".ply":
        axes = ("x", "y", "z")
        vectors = {name: field for name, field in fields.items() if field.ndim == 2}
        columns = {f"{name}_{axis}": field[:, k] for name, field in vectors.items() for k, axis in enumerate(axes)}
        columns |= {name: field for name, field in fields.items() if name not in vectors}
        surface.point_data = {name: np.ascontiguousarray(values) for name, values in columns.items()}
        meshio.ply.write(path, surface)
    elif ending == ".obj":
        meshio.obj.write(path, surface)
    else:
        meshio.stl.write(path, surface, binary=True)


def gltf(
    points: Floats,
    triangles: Indices,
    fields: Mapping[str, Floats],
    *,
    is_binary: bool,
    motion: tuple[Sequence[float], Sequence[Floats]] | None = None,
) -> bytes:
    """A glTF 2.0 scene of one mesh: `_DISPLACEMENT` and the other fields are attributes of its vertices.

    motion: rising times [s] and the displacement of the points at each, an animation of morph targets that blends from
    one to the next. Times count from the first.
    Khronos Group, glTF 2.0 Specification (2021), sections 3.7 (meshes, morph targets), 3.11 (animations) and 4.4 (the
    binary container).
    """
    times, shapes = motion or ((), ())
    arrays = {"POSITION": points} | {f"_{name.upper()}": field for name, field in fields.items()}
    n_attributes = len(arrays)
    arrays |= {f"shape {k}": shape for k, shape in enumerate(shapes)}
    if motion:
        arrays |= {"times": np.array(times) - times[0], "weights": np.eye(len(shapes)).ravel()}
    blocks = [np.ascontiguousarray(array, dtype="<f4").tobytes() for array in arrays.values()]
    blocks.append(np.ascontiguousarray(triangles, dtype="<u4").tobytes())
    starts = np.cumsum([0, *map(len, blocks)]).tolist()
    data = b"".join(blocks)  # every block is of four-byte numbers, so each begins where glTF wants it
    accessors: list[dict[str, Any]] = [
        {"bufferView": k, "componentType": 5126, "type": "VEC3" if array.ndim == 2 else "SCALAR", "count": len(array)}
        for k, array in enumerate(arrays.values())
    ]
    for k, array in enumerate(arrays.values()):
        single = array.astype("<f4").reshape(len(array), -1)
        accessors[k] |= {"min": single.min(axis=0).tolist(), "max": single.max(axis=0).tolist()}
    accessors.append({"bufferView": len(arrays), "componentType": 5125, "type": "SCALAR", "count": triangles.size})
    attributes = {name: k for k, name in enumerate([*arrays][:n_attributes])}
    primitive: dict[str, Any] = {"attributes": attributes, "indices": len(arrays)}
    surface: dict[str, Any] = {"primitives": [primitive]}
    if motion:
        primitive["targets"] = [{"POSITION": n_attributes + k} for k in range(len(shapes))]
        surface["weights"] = [1.0] + [0.0] * (len(shapes) - 1)
    scene: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"viscera {_core.__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "rotation": Y_UP}],
        "meshes": [surface],
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(block)}
            for start, block in zip(starts, blocks, strict=False)
        ],
        "buffers": [{"byteLength": len(data)}],
    }
    if motion:
        sampler = {"input": len(arrays) - 2, "output": len(arrays) - 1, "interpolation": "LINEAR"}
        channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        scene["animations"] = [{"samplers": [sampler], "channels": [channel]}]
    if not is_binary:
        inline = base64.b64encode(data).decode("ascii")
        scene["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{inline}"
        return json.dumps(scene).encode()
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
