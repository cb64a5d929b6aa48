"""Is an organ held? Each connected part must be kept from all six rigid motions, or its stiffness is singular."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viscera import _core
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh, Where


def fixed_nodes(mesh: Mesh, where: Where) -> Indices:
    """The fixed nodes; raises `VisceraError` where nothing is fixed, everything is, or a connected part is not."""
    if not isinstance(where, str) and not callable(where) and np.size(where) == 0:
        raise VisceraError("nothing is fixed: the organ would float away; fix a node set, indices or a predicate")
    try:
        fixed = mesh.nodes(where)
    except VisceraError as error:
        raise VisceraError(f"fixed: {error}") from error
    if len(fixed) == len(mesh.points):
        raise VisceraError("every node is fixed: nothing is left to move; fix a smaller set")
    part = _parts(mesh)
    loose = np.setdiff1d(part, part[fixed])
    if len(loose):
        nodes = np.flatnonzero(part == loose[0])
        raise VisceraError(
            f"{len(loose)} of the mesh's {part.max() + 1} disconnected parts have no fixed node, the first with "
            f"{len(nodes)} nodes (node {nodes[0]} among them); fix nodes of every part, or remove the loose ones"
        )
    return fixed


def require_held(mesh: Mesh, fixed: Indices, dofs: Indices, patches: list[_core.Patch]) -> None:
    """Raise `VisceraError` where a part can still move rigidly.

    fixed: node indices; dofs (k,): prescribed degrees of freedom 3 * node + component; patches: prescribed means.
    """
    part = _parts(mesh)
    held = np.concatenate([(3 * fixed[:, None].astype(np.int64) + np.arange(3)).ravel(), dofs.astype(np.int64)])
    for label in range(part.max() + 1):
        points = mesh.points[part == label]
        centre, size = points.mean(axis=0), np.ptp(points, axis=0).max()
        mine = held[part[held // 3] == label]
        arms = (mesh.points[mine // 3] - centre) / size
        rows = [_rigid_motions(arms)[np.arange(len(mine)), mine % 3]]
        for patch in patches:
            if part[patch.nodes[0]] == label:
                arm = patch.weights @ (mesh.points[patch.nodes] - centre) / size
                rows.append(_rigid_motions(arm[None, :])[0])
        rank = np.linalg.matrix_rank(np.concatenate(rows), tol=1e-6)
        if rank < 6:
            raise VisceraError(
                f"the part with node {np.flatnonzero(part == label)[0]} can still move rigidly ({6 - rank} of its 6 "
                "rigid motions are free); fix at least three nodes that are not on one line"
            )


def _parts(mesh: Mesh) -> NDArray[np.int64]:
    part = np.asarray(_core.inspect(mesh.points, mesh.cells)["part"], dtype=np.int64)
    part[mesh.n_corners :] = part[mesh.edges[:, 0]]
    return part


def _rigid_motions(arms: Floats) -> Floats:
    """Displacement (k, 3, 6) of points at `arms` (k, 3) under three translations and three rotations."""
    x, y, z = arms.T
    o, e = np.zeros_like(x), np.ones_like(x)
    return np.stack(
        [
            np.stack([e, o, o, o, z, -y], axis=-1),
            np.stack([o, e, o, -z, o, x], axis=-1),
            np.stack([o, o, e, y, -x, o], axis=-1),
        ],
        axis=1,
    )
