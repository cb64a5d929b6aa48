"""What elastic supports and bonds carry under a touch.

The field of a model is known to some thousandths. A spring multiplies that error by its stiffness, and of a stiff one
nothing may be left of the force `-k u`. Tissue is softer. Where nothing else holds the nodes S of a support, or of one
side of a bond, its force is what the tissue leaves unbalanced there,

    F = F_0 + sum_S (f(u) - f(u_0) - load),

with the internal force f of the tissue, the preload u_0, and the force F_0 under it. Where nothing else holds any node
of the organ, S may be all of it. The sum of f is zero then, and F as exact as the force of the touch.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from viscera.boundary.support import body_of_nodes
from viscera.mesh import Floats, Indices

if TYPE_CHECKING:
    from viscera.boundary.ties import Ties
    from viscera.organ import Organ


@dataclass(frozen=True, eq=False)
class Touched:
    """An organ under a touch, as far as a model knows it."""

    organ: Organ
    displacement: Floats
    """From rest (n, 3) [m]."""
    before: Floats
    """The same without the touch."""
    load: Floats
    """Of the touch, at the nodes (n, 3) [N]."""
    errors: tuple[float, float]
    """Relative errors of the force of the touch and of the displacement that it adds."""

    def carried(self, ties: Ties) -> tuple[Floats, float]:
        """Force (3,) [N] of ties on the first of what they tie, and its estimated error [N]: the most certain of those
        that spring and balance tell."""
        found = [(ties.force(self.displacement), self._error_of_spring(ties)), *self._balanced(ties)]
        return min(found, key=lambda each: each[1])

    def _error_of_spring(self, ties: Ties) -> float:
        """That of `-k u`: errors at the nodes, of mean size, which know nothing of each other."""
        of_node = self.errors[1] * _mean_size(self.displacement - self.before)
        size = float(np.abs(ties.stiffness).max(axis=1).sum())
        return of_node * size / float(np.sqrt(len(np.unique(ties.nodes))))

    def _balanced(self, ties: Ties) -> Iterator[tuple[Floats, float]]:
        """Force and error by the balance of each side."""
        held = np.concatenate([self.organ.fixed, self.organ._ties.nodes_beside(ties)])
        body = body_of_nodes(self.organ.mesh)
        change = self._tissue(self.displacement) - self._tissue(self.before) - self.load
        springs = ties.on_nodes(self.displacement) - ties.on_nodes(self.before)
        unbalanced = _mean_size(np.delete(change, np.union1d(held, ties.nodes), axis=0))
        stiff = ties.stiffness_at_nodes(len(change))
        for nodes, sign in ties.sides():
            whole = np.flatnonzero(np.isin(body, body[nodes]))
            others = np.concatenate([held, np.setdiff1d(ties.nodes, nodes)])
            if not np.isin(others, whole).any():
                error = self.errors[0] * float(np.linalg.norm(self.load.sum(axis=0)))
                yield ties.force(self.before) + sign * change[whole].sum(axis=0), error
                continue
            # At nodes that something else holds, too, the spring alone tells.
            shared = np.isin(nodes, others)
            force = sign * (change[nodes[~shared]].sum(axis=0) + springs[nodes[shared]].sum(axis=0))
            share = stiff[nodes[shared]].sum() / stiff[nodes].sum()
            error = unbalanced * np.sqrt(np.count_nonzero(~shared)) + share * self._error_of_spring(ties)
            yield ties.force(self.before) + force, float(error)

    def _tissue(self, displacement: Floats) -> Floats:
        """Internal force (n, 3) [N] of the tissue alone."""
        whole = np.asarray(self.organ._body.internal_force(np.ascontiguousarray(displacement))).reshape(-1, 3)
        return np.asarray(whole + self.organ._ties.on_nodes(displacement))


def _mean_size(vectors: Floats) -> float:
    """Root mean square of the lengths of vectors (k, 3)."""
    return float(np.linalg.norm(vectors) / np.sqrt(max(len(vectors), 1)))


def spread(nodes: Indices, weights: Floats, force: Floats, count: int) -> Floats:
    """Forces (count, 3) [N] at all nodes, of one that a patch spreads."""
    load = np.zeros((count, 3))
    load[nodes] = weights[:, None] * force
    return load
