"""An elastic support: springs spread over a piece of surface, so much stiffness per area."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from viscera.boundary import ties
from viscera.boundary.loads import faces_within, name_of
from viscera.boundary.ties import Ties
from viscera.errors import VisceraError
from viscera.immutable import Immutable
from viscera.mesh import Floats, Mesh, Where
from viscera.quantity import Number

STIFFNESS = Number("N/m^3", above=0)
TANGENTIAL = Number("N/m^3", low=0)

LINEAR = (np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6.0, np.full(3, 1 / 3))
"""Barycentric points and weights of a rule of second degree: exact for products of linear functions."""
A, B = 0.445948490915965, 0.091576213509771
QUADRATIC = (
    np.array([np.roll([1 - 2 * x, x, x], k) for x in (A, B) for k in range(3)]),
    np.repeat([0.223381589678011, 0.109951743655322], 3),
)
"""The rule of fourth degree with six points (Dunavant 1985): exact for products of quadratic functions."""


class ElasticSupport(Immutable):
    """Springs spread over the surface of a place, a Winkler foundation: fat, a ligament's broad base, a bed.

    The force per area at rest is `-k_n n (n . u) - k_t (u - n (n . u))`, where u is the displacement from rest and n
    the normal of the surface at rest.

    where: a place of the surface, as in `Mesh.nodes`; all triangles with every corner in it are supported.
    stiffness: k_n [N/m^3], force per area and displacement along the normal.
    tangential: k_t [N/m^3], the same along the surface; by default equal to `stiffness`. 0 lets the surface slide.
    Raises `VisceraError` if a stiffness is out of range. `Organ` raises it for a place without a whole triangle.

    >>> import viscera as vs
    >>> bed = vs.ElasticSupport("z < 1%", stiffness=1e6)
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), supports=[bed])
    >>> state = beam.solve(gravity=(0, 0, -9.81), density=1000)
    >>> state.is_converged, state.support_force(bed).round(3).tolist()[2]
    (True, 392.4)
    """

    def __init__(self, where: Where, stiffness: float, tangential: float | None = None) -> None:
        self.where: Final = where
        self.stiffness: Final = STIFFNESS(stiffness, "the stiffness of an elastic support")
        given = self.stiffness if tangential is None else tangential
        self.tangential: Final = TANGENTIAL(given, "the tangential stiffness of an elastic support")
        self._first: ElasticSupport = self

    def __repr__(self) -> str:
        return f"ElasticSupport({name_of(self.where)}, stiffness={self.stiffness:g}, tangential={self.tangential:g})"

    def is_same(self, other: object) -> bool:
        """Whether it is this support, on whatever mesh.

        >>> import viscera as vs
        >>> bed = vs.ElasticSupport("z < 1%", stiffness=1e6)
        >>> bed.is_same(bed.on(vs.organs.beam())), bed.is_same(vs.ElasticSupport("z < 1%", stiffness=1e6))
        (True, False)
        """
        return isinstance(other, ElasticSupport) and other._first is self._first

    def on(self, mesh: Mesh) -> ElasticSupport:
        """The same support at these nodes, also where the organ takes another shape.

        >>> import viscera as vs
        >>> len(vs.ElasticSupport("z < 1%", stiffness=1e6).on(vs.organs.beam()).where)
        105
        """
        there = ElasticSupport(mesh.nodes(self.where), self.stiffness, self.tangential)
        there._first = self._first
        return there

    def ties(self, mesh: Mesh) -> Ties:
        """Its samples: the points of a rule that is exact for the mass matrix of the surface.

        >>> import viscera as vs
        >>> len(vs.ElasticSupport("clamp", stiffness=1e6).ties(vs.organs.beam()))
        96
        """
        try:
            faces = faces_within(mesh, mesh.nodes(self.where))
        except VisceraError as error:
            raise VisceraError(f"the elastic support of {name_of(self.where)}: {error}") from error
        if len(faces) == 0:
            raise VisceraError(
                f"{name_of(self.where)} holds no whole triangle of the surface, so an elastic support has nothing to "
                "act on; take a set with the nodes of a piece of surface"
            )
        points, shares = QUADRATIC if faces.shape[1] == 6 else LINEAR
        shapes = quadratic_shapes(points) if faces.shape[1] == 6 else points
        areas, normals = areas_and_normals(mesh.points, faces)
        across = np.einsum("fi,fj->fij", normals, normals)
        per_area = self.tangential * np.eye(3) + (self.stiffness - self.tangential) * across
        stiffness = (areas[:, None] * shares)[:, :, None, None] * per_area[:, None]
        count = len(shares)
        nodes = np.repeat(faces, count, axis=0)
        return ties.rows(nodes, np.tile(shapes, (len(faces), 1)), stiffness.reshape(-1, 3, 3))


def quadratic_shapes(points: Floats) -> Floats:
    """Shape functions (..., 6) of a quadratic triangle at barycentric points (..., 3): corners, then midpoints
    of the edges that follow them."""
    corners = points * (2.0 * points - 1.0)
    return np.concatenate([corners, 4.0 * points * np.roll(points, -1, axis=-1)], axis=-1)


def areas_and_normals(points: Floats, faces: Any) -> tuple[Floats, Floats]:
    """Areas (f,) [m^2] and unit normals (f, 3) of faces by their corners."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    doubled = np.cross(b - a, c - a)
    sizes = np.linalg.norm(doubled, axis=1)
    return 0.5 * sizes, doubled / sizes[:, None]
