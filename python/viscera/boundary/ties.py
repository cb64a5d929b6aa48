"""Linear elastic ties as the core sums them: samples of a surface that are tied to the ground, or to another surface.

With the displacement `j = sum_a w_a u_a` at a sample, or the difference of two, the energy is the sum of `1/2 j . k j`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from viscera import _core
from viscera.mesh import Floats, Indices, Mesh
from viscera.sealed import Sealed

SAME = 1e-9
"""Relative difference of the weights and stiffnesses of two samples that is rounding."""


@dataclass(frozen=True, eq=False)
class Damping(Sealed):
    """Rayleigh's damping by stiffness as it acted in a frame: nodal forces `-beta K(u) v`, with the tangent `K`."""

    beta: float
    """[s]."""
    velocity: Floats
    """`v` (n, 3) [m/s]: that of the rule in time."""
    displacement: Floats
    """`u` (n, 3) [m] where the tangent was taken."""
    is_convex: bool
    """Whether the tangent was left without its negative part."""


@dataclass(frozen=True, eq=False)
class Link:
    """A spring or a cable between two ends."""

    ends: tuple[tuple[int, float], ...]
    """Nodes and weights: those of the first end add up to 1, those of the second, unless it is in space, to -1."""
    rest: Floats
    """Vector (3,) from the second end to the first at rest [m]."""
    stiffness: float
    """[N/m]."""
    length: float
    """Length without force [m]."""
    is_cable: bool

    @property
    def share(self) -> float:
        """Part of its force on the first end that is left of those on both: 0 unless the second is in space."""
        return sum(weight for _, weight in self.ends)

    def offset(self, displacement: Floats) -> Floats:
        """What of a field (n, 3) lies between its ends (3,)."""
        nodes, weights = zip(*self.ends, strict=True)
        return np.asarray(np.array(weights) @ displacement[list(nodes)])

    def force(self, displacement: Floats) -> Floats:
        """Force (3,) [N] on its first end."""
        between = self.rest + self.offset(displacement)
        now = float(np.linalg.norm(between))
        stretch = now - self.length
        if now == 0.0 or (self.is_cable and stretch <= 0.0):
            return np.zeros(3)
        return -self.stiffness * stretch / now * between

    def damping_force(self, damping: Damping) -> Floats:
        """Force (3,) [N] on its first end of the damping by its tangent.

        `-beta (k n n + k (l - l_0) / l (1 - n n)) v`, with the direction `n` from the second end to the first, the
        length `l` and what `v` of the velocity lies between the ends. The tangent is the core's: without its negative
        part if it is convex, `k` in all directions at no length, none of a slack cable.
        """
        between = self.rest + self.offset(damping.displacement)
        now = float(np.linalg.norm(between))
        stretch = now - self.length
        if self.is_cable and stretch <= 0.0:
            return np.zeros(3)
        across = self.stiffness * (stretch / now if now > 0.0 else 1.0)
        across = max(across, 0.0) if damping.is_convex else across
        rate = self.offset(damping.velocity)
        along = between / now * (between @ rate / now) if now > 0.0 else np.zeros(3)
        return np.asarray(-damping.beta * (self.stiffness * along + across * (rate - along)))


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Two surfaces that may touch, or one that may touch itself; their forces are those of contact."""

    first: Indices
    """Triangles (t, 3)."""
    second: Indices | None
    """Those of the other; None if the first may touch itself."""
    reach: float
    """How near they are looked at [m]."""
    stiffness: float
    """Of the layer between them, in units of that of a tool."""
    friction: float
    """Coulomb's coefficient."""


@dataclass(frozen=True, eq=False)
class Ties:
    """Samples of ties, in compressed rows."""

    start: Indices
    """(s + 1,) where the nodes of each sample begin, and where the last ones end."""
    nodes: Indices
    weights: Floats
    """Of the nodes; their sum over a sample is 1 at a support, 0 between two surfaces."""
    stiffness: Floats
    """(s, 9) symmetric positive semidefinite `k`, row by row [N/m]."""
    links: tuple[Link, ...] = ()
    """Springs and cables."""
    surfaces: tuple[Surfaces, ...] = ()
    """Contact pairs."""

    def __len__(self) -> int:
        return len(self.stiffness)

    def __repr__(self) -> str:
        return f"Ties({len(self)} samples)"

    @property
    def counts(self) -> Indices:
        """(s,) how many nodes each sample has."""
        return self.start[1:] - self.start[:-1]

    @property
    def arrays(self) -> tuple[Indices, Indices, Floats, Floats]:
        """Its samples as the core takes them."""
        return self.start, self.nodes, self.weights, self.stiffness

    @property
    def core(self) -> _core.Ties:
        """As the core takes them."""
        links = [
            (list(link.ends), link.rest.tolist(), link.stiffness, link.length, link.is_cable) for link in self.links
        ]
        pairs = [(pair.first, pair.second, pair.reach, pair.stiffness, pair.friction) for pair in self.surfaces]
        return *self.arrays, links, pairs

    def force(self, displacement: Floats, damping: Damping | None = None) -> Floats:
        """Total force (3,) [N] on the first of what they tie, at a displacement (n, 3) [m], with that of damping.

        That is what the positive weights belong to: the organ that a support holds, the first organ of a bond.
        """
        pulls, of_links = self._pulls_damped(displacement, damping)
        return np.asarray(sum(of_links, pulls.sum(axis=0)))

    def force_on_all(self, displacement: Floats, damping: Damping | None = None) -> Floats:
        """Total force (3,) [N] on all nodes, at a displacement (n, 3) [m], with that of damping.

        Each sample counts by the sum of its weights: what pulls two surfaces together adds nothing.
        """
        pulls, of_links = self._pulls_damped(displacement, damping)
        sums = np.add.reduceat(self.weights, self._begins) if len(self) else np.zeros(0)
        held = sum((link.share * force for link, force in zip(self.links, of_links, strict=True)), np.zeros(3))
        return np.asarray(held + sums @ pulls)

    def on_nodes(self, displacement: Floats) -> Floats:
        """Force (n, 3) [N] of the samples on each node, at a displacement (n, 3) [m]."""
        found = np.zeros_like(displacement)
        pulls = np.repeat(self._pulls(displacement), self.counts, axis=0)
        np.add.at(found, self.nodes, self.weights[:, None] * pulls)
        return found

    def stiffness_at_nodes(self, count: int) -> Floats:
        """(count,) [N/m]: the largest entry of the stiffness of each sample, times its weights, summed at the nodes."""
        found = np.zeros(count)
        of_sample = np.repeat(np.abs(self.stiffness).max(axis=1, initial=0.0), self.counts)
        np.add.at(found, self.nodes, np.abs(self.weights) * of_sample)
        return found

    def sides(self) -> list[tuple[Indices, float]]:
        """The nodes of the first of what they tie, with 1; those of the second, unless it is the ground, with -1."""
        sides = [(np.unique(self.nodes[sign * self.weights > 0.0]), sign) for sign in (1.0, -1.0)]
        return [(nodes, sign) for nodes, sign in sides if len(nodes)]

    def grounded(self) -> Ties:
        """Those of its samples that pull on the ground: the supports without the bonds."""
        if not len(self):
            return self
        is_grounded = np.abs(np.add.reduceat(self.weights, self._begins)) > SAME
        counts = self.counts[is_grounded]
        chosen = np.repeat(is_grounded, self.counts)
        start = np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)
        return Ties(start, self.nodes[chosen], self.weights[chosen], self.stiffness[is_grounded])

    def nodes_beside(self, other: Ties) -> Indices:
        """The nodes of those of its samples that another has not."""
        near, its = SAME * np.abs(self.stiffness).max(initial=0.0), other._by_nodes()
        beside = [nodes for nodes, own in self._by_nodes().items() if not _are_alike(own, its.get(nodes, []), near)]
        return np.unique(np.frombuffer(b"".join(beside), dtype=self.nodes.dtype))

    @property
    def _begins(self) -> NDArray[np.int64]:
        """(s,) where the nodes of each sample begin."""
        return self.start[:-1].astype(np.int64)

    def _pulls(self, displacement: Floats) -> Floats:
        """Force (s, 3) [N] of each sample on what its positive weights belong to."""
        if not len(self):
            return np.zeros((0, 3))
        stretch = np.add.reduceat(self.weights[:, None] * displacement[self.nodes], self._begins)
        return np.asarray(-np.einsum("sij,sj->si", self.stiffness.reshape(-1, 3, 3), stretch))

    def _pulls_damped(self, displacement: Floats, damping: Damping | None) -> tuple[Floats, list[Floats]]:
        """Forces [N] of the samples (s, 3) and of each link (3,), with those of damping."""
        of_links = [link.force(displacement) for link in self.links]
        if damping is None:
            return self._pulls(displacement), of_links
        of_links = [force + link.damping_force(damping) for link, force in zip(self.links, of_links, strict=True)]
        return self._pulls(displacement + damping.beta * damping.velocity), of_links  # the samples are linear

    def holds(self, other: Ties) -> bool:
        """Whether all samples of another are among these, as those of one support are among those of all.

        Weights and stiffness count as equal within rounding: the points of a preloaded model are computed back. Of
        samples at the same nodes, also the sum of `w k` may agree, and with it their force: between two faces rounding
        decides how a bond cuts their common piece into triangles.
        """
        if other.links or other.surfaces:
            return False
        near = SAME * np.abs(self.stiffness).max(initial=0.0)
        own = self._by_nodes()
        return all(_are_among(samples, own.get(nodes, []), near) for nodes, samples in other._by_nodes().items())

    def _by_nodes(self) -> dict[bytes, list[tuple[Floats, Floats]]]:
        """Weights and stiffness of the samples at the same nodes."""
        found = dict[bytes, list[tuple[Floats, Floats]]]()
        if not len(self):
            return found
        nodes, weights = (np.split(each, self._begins[1:]) for each in (self.nodes, self.weights))
        for at, *sample in zip(nodes, weights, self.stiffness, strict=True):
            found.setdefault(at.tobytes(), []).append((sample[0], sample[1]))
        return found

    def ties(self, mesh: Mesh) -> Ties:
        """These, whatever the mesh: ties that a model file keeps are among the supports of its organ."""
        return self

    def on(self, mesh: Mesh) -> Ties:
        return self

    def is_same(self, other: object) -> bool:
        return other is self


@runtime_checkable
class Tied(Protocol):
    """What ties the nodes of a mesh: an elastic support, a bond."""

    def ties(self, mesh: Mesh) -> Ties:
        """Its samples on a mesh."""

    def on(self, mesh: Mesh) -> Tied:
        """The same at the nodes it has on this mesh, also where the organ takes another shape."""

    def is_same(self, other: object) -> bool:
        """Whether it is this one, on whatever mesh."""


def _are_alike(its: Sequence[tuple[Floats, Floats]], own: Sequence[tuple[Floats, Floats]], near: float) -> bool:
    """Whether samples at the same nodes have the same sum of `w k`, which is what they do together."""
    felt = sum(np.outer(weights, k) for weights, k in its) - sum(np.outer(weights, k) for weights, k in own)
    return bool(np.abs(felt).max() <= near)


def _are_among(its: Sequence[tuple[Floats, Floats]], own: Sequence[tuple[Floats, Floats]], near: float) -> bool:
    """Whether samples are among others at the same nodes, or have the same sum; near: rounding of a stiffness [N/m]."""
    return _are_alike(its, own, near) or all(
        any(np.abs(weights - w).max() <= SAME and np.abs(stiffness - k).max() <= near for w, k in own)
        for weights, stiffness in its
    )


NONE = Ties(np.zeros(1, dtype=np.uint32), np.empty(0, dtype=np.uint32), np.empty(0), np.empty((0, 9)))


def carried(support: object, its: Sequence[Ties], displacement: Floats, damping: Damping | None = None) -> Floats:
    """Force (3,) [N] of the samples of a support or a bond, as `Ties.force` counts it.

    If the support is the ties of a model together, of which bonds pull on both of their organs, that on all nodes.
    """
    force = Ties.force_on_all if isinstance(support, Ties) else Ties.force
    return np.asarray(sum(force(ties, displacement, damping) for ties in its))


def joined(parts: Sequence[Ties]) -> Ties:
    """The samples of several, one after the other."""
    if not parts:
        return NONE
    shifts = np.cumsum([0, *(len(part.nodes) for part in parts)])[:-1]
    starts = [part.start[:-1] + shift for part, shift in zip(parts, shifts, strict=True)]
    nodes = np.concatenate([part.nodes for part in parts])
    return Ties(
        np.append(np.concatenate(starts), len(nodes)).astype(np.uint32),
        nodes.astype(np.uint32),
        np.concatenate([part.weights for part in parts]),
        np.concatenate([part.stiffness for part in parts]),
        tuple(link for part in parts for link in part.links),
        tuple(pair for part in parts for pair in part.surfaces),
    )


def rows(nodes: Indices, weights: Floats, stiffness: Floats) -> Ties:
    """Samples of equally many nodes (s, k) with weights (s, k) and stiffnesses (s, 3, 3) [N/m]."""
    start = np.arange(len(nodes) + 1, dtype=np.uint32) * nodes.shape[1]
    return Ties(
        start.astype(np.uint32),
        np.ascontiguousarray(nodes, dtype=np.uint32).ravel(),
        np.ascontiguousarray(weights, dtype=float).ravel(),
        np.ascontiguousarray(stiffness, dtype=float).reshape(-1, 9),
    )
