"""Is an organ held? Each part must be kept from all six rigid motions, or its stiffness is singular.

Parts that meet at points or edges only, without a common face, turn about these as about hinges.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera import _core
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh, Where


def fixed_nodes(mesh: Mesh, where: Where) -> Indices:
    """The fixed nodes; raises `VisceraError` if nothing is fixed, everything is, or a connected part is not."""
    if not isinstance(where, str) and not callable(where) and np.size(where) == 0:
        raise VisceraError("nothing is fixed: the organ would float away; fix a node set, indices or a predicate")
    try:
        fixed = mesh.nodes(where)
    except VisceraError as error:
        raise VisceraError(f"fixed: {error}") from error
    if len(fixed) == len(mesh.points):
        raise VisceraError("every node is fixed: nothing is left to move; fix a smaller set")
    body = np.array(mesh.facts["body"], dtype=np.int64)
    body[mesh.n_corners :] = body[mesh.edges[:, 0]]
    loose = np.setdiff1d(body, body[fixed])
    if len(loose):
        nodes = np.flatnonzero(body == loose[0])
        raise VisceraError(
            f"{len(loose)} of the mesh's {body.max() + 1} disconnected parts have no fixed node, the first with "
            f"{len(nodes)} nodes (node {nodes[0]} among them); fix nodes of every part, or remove the loose ones"
        )
    return fixed


def require_held(mesh: Mesh, fixed: Indices, dofs: Indices, patches: list[_core.Patch]) -> None:
    """Raise `VisceraError` if a part can still move rigidly.

    fixed: node indices; dofs (k,): prescribed degrees of freedom 3 * node + component; patches: prescribed means.
    """
    parts = _Parts(mesh)
    held = np.concatenate([(3 * fixed[:, None].astype(np.int64) + np.arange(3)).ravel(), dofs.astype(np.int64)])
    for labels in parts.bodies():
        place = {label: k for k, label in enumerate(labels)}
        rows = [np.zeros((1, 6 * len(labels)))]
        for label in labels:
            mine = held[parts.owner[held // 3] == label]
            rows.append(parts.motion(mine // 3, label, place)[np.arange(len(mine)), mine % 3])
        for patch in patches:
            owners = parts.owner[patch.nodes]
            if owners[0] in place:
                moved = [parts.motion(patch.nodes[owners == k], k, place) for k in np.unique(owners).tolist()]
                weights = [patch.weights[owners == k] for k in np.unique(owners).tolist()]
                rows.append(np.einsum("i,ijk->jk", np.concatenate(weights), np.concatenate(moved)))
        for node, first, second in parts.hinges:
            if second in place:
                at = np.array([node])
                rows.append((parts.motion(at, second, place) - parts.motion(at, first, place))[0])
        free = _null_space(np.concatenate(rows))
        for label, k in place.items() if len(free) else ():
            count = int(np.linalg.matrix_rank(free[:, 6 * k : 6 * k + 6], tol=1e-3))
            if count:
                raise VisceraError(parts.loose(label, count))


class _Parts:
    """The parts of a mesh, and where they are hinged to each other."""

    def __init__(self, mesh: Mesh) -> None:
        facts = mesh.facts
        cells = _core.quadratic(mesh.n_corners, mesh.cells)[1] if len(mesh.edges) else mesh.cells
        self.points = mesh.points
        self.body = facts["body"]
        self.owner = np.full(len(mesh.points), -1, dtype=np.int64)
        """The first part that each node belongs to."""
        self.hinges: list[tuple[int, int, int]] = []
        """Nodes that belong to a second part, with the first and the second."""
        self.box: list[tuple[Floats, float]] = []
        self.first_node: list[int] = []
        for label in range(facts["n_parts"]):
            nodes = np.unique(cells[facts["part"] == label])
            is_new = self.owner[nodes] < 0
            self.hinges += [(int(node), int(self.owner[node]), label) for node in nodes[~is_new]]
            self.owner[nodes[is_new]] = label
            self.box.append((mesh.points[nodes].mean(axis=0), float(np.ptp(mesh.points[nodes], axis=0).max())))
            self.first_node.append(int(nodes[is_new][0] if is_new.any() else nodes[0]))

    def bodies(self) -> list[list[int]]:
        """The parts that hang together, however loosely."""
        together: dict[int, list[int]] = {}
        for label, node in enumerate(self.first_node):
            together.setdefault(int(self.body[node]), []).append(label)
        return list(together.values())

    def motion(self, nodes: NDArray[Any], label: int, place: Mapping[int, int]) -> Floats:
        """Displacement (k, 3, 6 parts) of nodes by the rigid motions of a part, whose columns `place` tells."""
        centre, size = self.box[label]
        found = np.zeros((len(nodes), 3, 6 * len(place)))
        found[:, :, 6 * place[label] : 6 * place[label] + 6] = _rigid_motions((self.points[nodes] - centre) / size)
        return found

    def loose(self, label: int, count: int) -> str:
        """The sentence about a part that `count` rigid motions are left to."""
        at = sorted({node for node, *both in self.hinges if label in both})
        where = f"{'node' if len(at) == 1 else 'nodes'} {', '.join(map(str, at[:5]))}{', ...' if len(at) > 5 else ''}"
        hint = f"; it shares {where} with another part, but no face, and turns there as on a hinge" if at else ""
        return (
            f"the part with node {self.first_node[label]} can still move rigidly ({count} of its 6 rigid motions are "
            f"free); fix at least three nodes that are not on one line{hint}"
        )


def _null_space(rows: Floats) -> Floats:
    """Orthonormal vectors (k, n) that all rows (m, n) map to zero."""
    _, sizes, vectors = np.linalg.svd(np.linalg.qr(rows, mode="r"), full_matrices=True)
    return np.asarray(vectors[int(np.count_nonzero(sizes > 1e-6)) :])


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
