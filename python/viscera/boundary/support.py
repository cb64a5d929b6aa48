"""Is an organ held? Each part must be kept from all six rigid motions, or its stiffness is singular.

Parts that meet at points or edges only, without a common face, turn about these as about hinges.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera import _core
from viscera.boundary.holding import Holding
from viscera.boundary.ties import NONE, Link, Tied, Ties
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh, Where
from viscera.quantity import refuse_twice, refused


def fixed_nodes(mesh: Mesh, where: Where | None) -> Indices:
    """The fixed nodes, which may be none; raises `VisceraError` for a place that the mesh lacks, or for all nodes."""
    if where is None or (not isinstance(where, str) and not callable(where) and np.size(where) == 0):
        return np.empty(0, dtype=np.uint32)
    try:
        fixed = mesh.nodes(where)
    except VisceraError as error:
        raise VisceraError(f"fixed: {error}") from error
    if len(fixed) == len(mesh.points):
        raise VisceraError("every node is fixed: nothing is left to move; fix a smaller set")
    return fixed


def supports_of(supports: Sequence[Tied]) -> tuple[Tied, ...]:
    """The elastic supports of an organ, checked."""
    if isinstance(supports, Tied) or not isinstance(supports, Sequence) or isinstance(supports, str):
        raise refused("supports", "a list, such as [ElasticSupport('back', stiffness=1e6)]", supports)
    for support in supports:
        if not isinstance(support, Tied):
            raise refused("a support of an organ", "an ElasticSupport", support)
    refuse_twice(supports, "supports")
    return tuple(supports)


def require_held(
    mesh: Mesh,
    fixed: Indices,
    dofs: Indices,
    patches: Sequence[_core.Patch],
    holding: Holding,
    ties: Ties = NONE,
    name: Callable[[int], str] = "node {}".format,
) -> None:
    """Raise `VisceraError` if a part can still move rigidly.

    fixed: node indices; dofs (k,): prescribed degrees of freedom 3 * node + component; patches: prescribed means;
    holding: what an error advises; ties: elastic supports and bonds; name: what an error calls a node.
    """
    linked = np.array([node for link in ties.links for node, _ in link.ends], dtype=np.uint32)
    means = [patch.nodes for patch in patches]
    _refuse_loose(mesh, np.concatenate([fixed, dofs // 3, ties.nodes, linked, *means]).astype(np.int64), holding, name)
    parts = _Parts(mesh)
    held = np.concatenate([(3 * fixed[:, None].astype(np.int64) + np.arange(3)).ravel(), dofs.astype(np.int64)])
    for labels in parts.bodies(ties):
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
        rows.append(parts.stretches(ties, place))
        for node, first, second in parts.hinges:
            if second in place:
                at = np.array([node])
                rows.append((parts.motion(at, second, place) - parts.motion(at, first, place))[0])
        free = _null_space(np.concatenate(rows))
        for label, k in place.items() if len(free) else ():
            count = int(np.linalg.matrix_rank(free[:, 6 * k : 6 * k + 6], tol=1e-3))
            if count:
                raise VisceraError(parts.loose(label, count, name))


def body_of_nodes(mesh: Mesh) -> NDArray[np.int64]:
    """The number (n,) of the disconnected part of each node."""
    body = np.array(mesh.facts["body"], dtype=np.int64)
    body[mesh.n_corners :] = body[mesh.edges[:, 0]]
    return body


def _refuse_loose(mesh: Mesh, held: NDArray[np.int64], holding: Holding, name: Callable[[int], str]) -> None:
    """Raise `VisceraError` if a part has none of the nodes (k,) at which something holds the mesh."""
    if not len(held):
        raise VisceraError(f"nothing is fixed: the organ would float away; hold it by {holding.means}; {holding.hint}")
    body = body_of_nodes(mesh)
    loose = np.setdiff1d(body, body[held])
    if len(loose):
        nodes = np.flatnonzero(body == loose[0])
        raise VisceraError(
            f"{len(loose)} of the mesh's {body.max() + 1} disconnected parts have no fixed node nor support, the first "
            f"with {len(nodes)} nodes ({name(int(nodes[0]))} among them); hold every part, by "
            f"{holding.means}, or remove the loose ones"
        )


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

    def bodies(self, ties: Ties) -> list[list[int]]:
        """The parts that hang together, however loosely."""
        group = np.array(self.body[self.first_node], dtype=np.int64)
        sample = np.repeat(np.arange(len(ties)), ties.counts)
        tied = np.stack([self.owner[ties.nodes[:-1]], self.owner[ties.nodes[1:]]], axis=1)[sample[:-1] == sample[1:]]
        linked = [[self.owner[a], self.owner[b]] for link in ties.links for (a, _), (b, _) in pairwise(link.ends)]
        for first, second in np.unique(np.concatenate([tied, np.array(linked, dtype=np.int64).reshape(-1, 2)]), axis=0):
            group[group == group[second]] = group[first]
        return [np.flatnonzero(group == label).tolist() for label in np.unique(group)]

    def stretches(self, ties: Ties, place: Mapping[int, int]) -> Floats:
        """What ties feel (k, 6 parts) of the rigid motions of some parts, relative to their stiffness."""
        rows = [self._stretch_of(link, place) for link in ties.links if not link.is_cable]
        owner = self.owner[ties.nodes]
        motion = np.zeros((len(owner), 3, 6 * len(place)))
        for label in place:
            mine = owner == label
            motion[mine] = self.motion(ties.nodes[mine], label, place)
        if not len(ties) or not np.isin(owner, list(place)).any():
            return np.array(rows).reshape(-1, 6 * len(place))
        moved = np.add.reduceat(ties.weights[:, None, None] * motion, ties.start[:-1].astype(np.int64))
        scale = np.abs(ties.stiffness).max(axis=1).clip(min=np.finfo(float).tiny)
        felt = np.einsum("sij,sjk->sik", (ties.stiffness / scale[:, None]).reshape(-1, 3, 3), moved)
        return np.concatenate([np.array(rows).reshape(-1, felt.shape[2]), felt.reshape(-1, felt.shape[2])])

    def _stretch_of(self, link: Link, place: Mapping[int, int]) -> Floats:
        """Change (6 parts) of the length of a spring by rigid motions."""
        along = link.rest / max(float(np.linalg.norm(link.rest)), np.finfo(float).tiny)
        change = np.zeros(6 * len(place))
        for node, weight in link.ends:
            label = int(self.owner[node])
            if label in place:
                change += weight * along @ self.motion(np.array([node]), label, place)[0]
        return change

    def motion(self, nodes: NDArray[Any], label: int, place: Mapping[int, int]) -> Floats:
        """Displacement (k, 3, 6 parts) of nodes by the rigid motions of a part, whose columns `place` tells."""
        centre, size = self.box[label]
        found = np.zeros((len(nodes), 3, 6 * len(place)))
        found[:, :, 6 * place[label] : 6 * place[label] + 6] = _rigid_motions((self.points[nodes] - centre) / size)
        return found

    def loose(self, label: int, count: int, name: Callable[[int], str]) -> str:
        """The sentence about a part that `count` rigid motions are left to."""
        at = sorted({node for node, *both in self.hinges if label in both})
        where = f"{'node' if len(at) == 1 else 'nodes'} {', '.join(map(str, at[:5]))}{', ...' if len(at) > 5 else ''}"
        hint = f"; it shares {where} with another part, but no face, and turns there as on a hinge" if at else ""
        return (
            f"the part with {name(self.first_node[label])} can still move rigidly ({count} of its 6 rigid motions are "
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
