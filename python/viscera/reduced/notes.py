"""What the package keeps under `user` of a model file: sets and parts of the mesh at rest, and what its shape is."""

from __future__ import annotations

import base64
import binascii
import zlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera.errors import VisceraError
from viscera.mesh import Indices, Mesh
from viscera.quantity import brief

if TYPE_CHECKING:
    from viscera.state import State

AXES = ("", "RAS", "LPS")
FLAGS = ("is_unloaded", "starts_as_scanned")


def notes(mesh: Mesh, start: State | None) -> dict[str, Any]:
    """What a model file keeps under `user` of the mesh at rest: sets as bits, one for each corner or cell, the world
    axes, and whether it is without the loads of its scan; of the state that touches start from, if that is the one
    under these loads."""
    kept: dict[str, Any] = {}
    sets = {name: mesh.nodes(name) for name in mesh.sets}
    corners = {name: nodes[nodes < mesh.n_corners] for name, nodes in sets.items()}
    if corners:
        kept["sets"] = {name: _packed(nodes, mesh.n_corners) for name, nodes in corners.items()}
    if mesh.cell_sets:
        kept["cell_sets"] = {name: _packed(mesh.cells_in(name), len(mesh.cells)) for name in mesh.cell_sets}
    if mesh.axes:
        kept["axes"] = mesh.axes
    if mesh.is_unloaded:
        kept["is_unloaded"] = True
    if start is not None and start._is_as_scanned:
        kept["starts_as_scanned"] = True
    return kept


def require_own(user: Mapping[str, Any]) -> None:
    """Raises `VisceraError` if what another program wrote stands where the package keeps axes and flags."""
    if user.get("axes", "") not in AXES:
        raise _refused("axes", 'is none of "RAS" and "LPS"', user["axes"])
    for name in FLAGS:
        if not isinstance(user.get(name, False), bool):
            raise _refused(name, "is neither true nor false", user[name])


def cell_sets(user: Mapping[str, Any], cells: int) -> dict[str, Indices]:
    """The cell sets of such notes, of a mesh with so many cells; raises `VisceraError` for what is no set."""
    return _unpacked(user, "cell_sets", cells)


def node_sets(user: Mapping[str, Any], corners: int) -> dict[str, Indices]:
    """The node sets of such notes, none in files of earlier versions; raises `VisceraError` for what is no set."""
    return _unpacked(user, "sets", corners)


def _packed(members: Indices, count: int) -> str:
    is_member = np.zeros(count, dtype=bool)
    is_member[members] = True
    return base64.b64encode(zlib.compress(np.packbits(is_member).tobytes(), 9)).decode()


def _unpacked(user: Mapping[str, Any], key: str, count: int) -> dict[str, Indices]:
    texts = user.get(key, {})
    if not isinstance(texts, dict):
        raise _refused(key, "is no object with a text for each name", texts)
    return {name: _members(f"{key}.{name}", text, count) for name, text in texts.items()}


def _members(key: str, text: Any, count: int) -> Indices:
    """The places of the bits that are set among so many."""
    size = -(-count // 8)
    stream = zlib.decompressobj()
    try:
        # One byte more than there may be: the end of the stream, with its checksum, is read then, and no more inflated.
        bits = stream.decompress(base64.b64decode(text), size + 1)
    except (TypeError, ValueError, binascii.Error, zlib.error):
        bits = b""
    if len(bits) != size or not stream.eof:
        raise _refused(key, f"is not the base64 text of a zlib stream of {count} bits", text)
    return np.flatnonzero(np.unpackbits(np.frombuffer(bits, dtype=np.uint8), count=count)).astype(np.uint32)


def _refused(key: str, what: str, value: Any) -> VisceraError:
    return VisceraError(
        f"its `user.{key[:80]}` {what}: {brief(value)}; the package keeps its own there, so write it under another key"
    )
