"""A spring or a cable between two places, such as a ligament."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.boundary.loads import Where, name_of, shares_of
from viscera.boundary.ties import NONE, Link, Ties
from viscera.errors import VisceraError
from viscera.immutable import Immutable
from viscera.mesh import Mesh
from viscera.quantity import Flag, Number, brief, vector
from viscera.select import length as length_of

STIFFNESS = Number("N/m", above=0)

COINCIDENT = 1e-9
"""Distance of two ends over the diagonal of the mesh below which they are in one place."""


class Spring(Immutable):
    """A spring between the means of two places, or from a place to a point in space: a ligament, a thread.

    With the length l between its ends, its energy is `k (l - l_0)^2 / 2`. Its force is spread over each place as a
    uniform traction.

    first, second: places, or contact patches; in a scene such as "liver/hilum". Either `second` or `point` is given.
    stiffness: k [N/m]. point: (3,) [m] in space.
    length: l_0 [m], or in words such as "5 mm", or "10%" of the mesh's diagonal, among the bonds of a scene of that of
        all its organs; by default the length at rest. A shorter one pulls already at rest.
    cable: whether it bears no compression.

    Springs work in `solve` and in frames; series (`path`, `reduce`) refuse them. A spring holds an organ along its
    direction alone, and a cable is not relied on: other supports must hold the organ.

    >>> import viscera as vs
    >>> ligament = vs.Spring("tip", point=(1.0, 0.1, 0.6), stiffness=100.0, cable=True)
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp", supports=[ligament])
    >>> state = beam.solve(gravity=(0, 0, -9.81), density=100)
    >>> state.is_converged, bool(state.support_force(ligament)[2] > 5.0)
    (True, True)
    """

    def __init__(
        self,
        first: Where,
        second: Where | None = None,
        *,
        stiffness: float,
        point: ArrayLike | None = None,
        length: float | str | None = None,
        cable: bool = False,
    ) -> None:
        if (second is None) == (point is None):
            raise VisceraError(
                "a spring ends at a second place or at a point in space: give one of `second` and `point`"
            )
        self.first: Final = first
        self.second: Final = second
        self.point: Final = None if point is None else vector(point, "the point of a spring", "m")
        self.stiffness: Final = STIFFNESS(stiffness, "the stiffness of a spring")
        self.length: Final = length
        self._metres(1.0)  # refused here, although it takes a mesh to tell how long it is
        self.cable: Final = Flag()(cable, "cable")
        self._first: Spring = self

    def __repr__(self) -> str:
        end = f"point={self.point.tolist()}" if self.point is not None else name_of(self.second)  # type: ignore[arg-type]
        kind = ", cable" if self.cable else ""
        return f"Spring({name_of(self.first)}, {end}, stiffness={self.stiffness:g}{kind})"

    def is_same(self, other: object) -> bool:
        """Whether it is this spring, on whatever mesh.

        >>> import viscera as vs
        >>> spring = vs.Spring("tip", "clamp", stiffness=1.0)
        >>> spring.is_same(spring.on(vs.organs.beam()))
        True
        """
        return isinstance(other, Spring) and other._first is self._first

    def on(self, mesh: Mesh) -> Spring:
        """The same spring at these nodes, also where the organ takes another shape.

        >>> import viscera as vs
        >>> vs.Spring("tip", "clamp", stiffness=1.0).on(vs.organs.beam())
        Spring(a set of 25 nodes, a set of 25 nodes, stiffness=1)
        """
        ends = [
            each if each is None or isinstance(each, _core.Patch) else mesh.nodes(each)
            for each in (self.first, self.second)
        ]
        length = self._metres(mesh.diagonal)
        told = {"stiffness": self.stiffness, "point": self.point, "length": length, "cable": self.cable}
        there = Spring(ends[0], ends[1], **told)  # type: ignore[arg-type]
        there._first = self._first
        return there

    def ties(self, mesh: Mesh) -> Ties:
        """Its link on a mesh.

        >>> import viscera as vs
        >>> (link,) = vs.Spring("tip", "clamp", stiffness=1.0).ties(vs.organs.beam()).links
        >>> link.rest.round(6).tolist(), f"{link.length:g} m"
        ([1.0, 0.0, 0.0], '1 m')
        """
        nodes, weights = shares_of(mesh, self.first)
        ends = list(zip(nodes.tolist(), weights.tolist(), strict=True))
        rest = weights @ mesh.points[nodes]
        if self.point is not None:
            rest = rest - self.point
        elif self.second is not None:
            nodes, weights = shares_of(mesh, self.second)
            ends += zip(nodes.tolist(), (-weights).tolist(), strict=True)
            rest = rest - weights @ mesh.points[nodes]
        given = self._metres(mesh.diagonal)
        length = float(np.linalg.norm(rest)) if given is None else given
        near = COINCIDENT * mesh.diagonal
        if length > near and not self.cable and np.linalg.norm(rest) <= near:
            raise VisceraError(
                f"{self!r} pushes its ends apart, and they are in one place at rest, so it has no direction; "
                "move an end, or give length=0"
            )
        link = Link(tuple(ends), np.asarray(rest), self.stiffness, length, self.cable)
        return Ties(*NONE.arrays, links=(link,))

    def _metres(self, diagonal: float) -> float | None:
        """l_0 [m] on a mesh with this diagonal [m]; None for the length at rest."""
        metres = None if self.length is None else length_of(self.length, diagonal, "the length of a spring")
        if metres is not None and metres < 0.0:
            raise VisceraError(f"the length of a spring is {brief(self.length)}; it must not be negative")
        return metres
