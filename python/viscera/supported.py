"""What every computation with an organ begins from: a mesh, a law, and what holds them."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from viscera import _core, defaults
from viscera.boundary.holding import Holding
from viscera.boundary.support import fixed_nodes, require_held, supports_of
from viscera.boundary.ties import Tied, joined
from viscera.contact.tool import Tool
from viscera.display import Pictured
from viscera.errors import VisceraError
from viscera.immutable import Immutable
from viscera.law import Law, Several
from viscera.mesh import Floats, Indices, Mesh, Where
from viscera.quantity import Choice, refused
from viscera.select import Lengths, size
from viscera.select import point as point_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from viscera.organ import Organ

log = logging.getLogger("viscera")
ELEMENTS = tuple(name for name, _ in _core.elements())
NO_DOFS: Indices = np.empty(0, dtype=np.uint32)
ROUNDING = 1e-9
"""Rounding allowed in Poisson's ratio, which a law computes from other parameters: 0.45 must count as 0.45."""
NARROW = 0.5
"""Radius of a contact over the mean edge of the surface, below which every patch is a node or a triangle's corners."""


class Supported(Immutable, Pictured):
    """A mesh with its law, its element and its supports; `Organ` says what its arguments are."""

    _others: ClassVar[Mapping[str, str]] = {
        "law": "with_law(...) gives the same with another law",
        "mesh": "with_mesh(...) gives the same in another shape",
    }

    def __init__(
        self,
        mesh: Mesh,
        law: Law | Mapping[Any, Law],
        fixed: Where | None = None,
        *,
        element: str | None = None,
        supports: Sequence[Tied] = (),
    ) -> None:
        if not isinstance(mesh, Mesh):
            raise refused("the mesh", "a viscera.Mesh, as read(path) or mesh(points, cells) gives it", mesh)
        if isinstance(law, Mapping):
            law = Several(mesh, law)
        if not isinstance(law, Law):
            raise refused("the law", "one of viscera.laws, such as NeoHookean, or a table of them by place", law)
        rows = len(law.parameters)
        if rows not in {1, len(mesh.cells)}:
            raise VisceraError(f"the law has parameters for {rows} cells, the mesh has {len(mesh.cells)} cells")
        self.element: Final = _element(element, law)
        """Name of the element."""
        self._chosen_element = element
        """None if it was left to the law."""
        self.mesh: Final = mesh.quadratic() if self.element == "P2" else mesh.linear()
        """The mesh with the nodes of the element."""
        self.law: Final = law
        self.supports: Final = supports_of(supports)
        """Elastic supports."""
        self._bodies: list[Tool] = []
        self._tied = [support.ties(self.mesh) for support in self.supports]
        self._ties = joined(self._tied)
        self._contact_pairs = [each for each, ties in zip(self.supports, self._tied, strict=True) if ties.surfaces]
        self.fixed: Final = fixed_nodes(self.mesh, fixed)
        """Indices (k,) of the fixed nodes."""
        corners = self.mesh.points[: self.mesh.n_corners]
        self._body = _core.Body(corners, mesh.cells, law.core(), self.fixed, self.element, self._ties.core)
        self._narrow: set[float] = set()  # radii of contacts that were warned of

    def _require_held(self, holding: Holding, dofs: Indices = NO_DOFS, patches: Sequence[_core.Patch] = ()) -> None:
        """Raise `VisceraError` if a part can still move rigidly, where degrees of freedom `dofs` (k,), 3 * node +
        component, and means of patches are prescribed. holding: what may hold it where it is asked for."""
        require_held(self.mesh, self.fixed, dofs, patches, holding, self._ties, self._name_of)

    def _name_of(self, node: int) -> str:
        """What an error calls a node."""
        return f"node {node}"

    def _require_linear_ties(self) -> None:
        """Raise `VisceraError` for what a series cannot expand."""
        unknown = {
            "the rigid bodies of the scene; leave them out": self._bodies,
            "springs and cables; leave them out": self._ties.links,
            "surfaces that touch; leave the contact pairs out": self._ties.surfaces,
        }
        for what, present in unknown.items():
            if present:
                raise VisceraError(f"a series does not know {what}, or solve in load steps")

    def _named(self, message: str) -> str:
        """What the core says, with names in place of its numbers; an organ alone has none."""
        return message

    def _doubt_of_bonds(self, displacement: Floats) -> str:
        """What bonds do not do at a displacement, in words; an organ alone has none."""
        return ""

    def __repr__(self) -> str:
        size = f"{len(self.mesh.points)} points, {len(self.mesh.cells)} cells"
        held = [f"{len(self.fixed)} fixed nodes"] if len(self.fixed) or not self.supports else []
        held += [f"{len(self.supports)} elastic supports"] if self.supports else []
        return f"Organ({size}, {type(self.law).__name__}, {self.element}, {', '.join(held)})"

    def patch(self, point: Lengths, radius: float | str) -> _core.Patch:
        """The contact patch around a surface point (3,) [m]: smooth weights of sum 1 within `radius` [m].

        Both may be given in words: `organ.patch("(100, 50, 80) mm", "12 mm")`.
        In `solve` a patch can take the place of a node set: to prescribe its mean displacement, or to spread a force
        over it. A radius below half the mean edge of the surface there is taken with a warning: such a patch is a node
        or the corners of a triangle, and its force depends on the mesh. It is said once for each radius.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> patch = beam.patch("(100%, 50%, 100%)", "5 cm")
        >>> state = beam.solve(displacement={patch: (0, 0, -0.01)})
        >>> state.reaction(patch)[2].round(3).item()
        -0.789
        """
        metres = self._length("radius", radius)
        patch = self._body.patch(point_of(point, self.mesh, "contact point"), metres)
        if len(patch.nodes) <= 3:  # else it is wide enough, and no surface need be looked at
            self._warn_if_narrow(metres, patch.nodes)
        return patch

    def touchable(self, where: Where | None = None, radius: float | str | None = None) -> Indices:
        """The free surface nodes of a place; by default all that are farther than `radius` [m] from fixed nodes.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> len(beam.touchable()), len(beam.touchable("top and x > 50%"))
        (297, 50)
        """
        if where is not None:
            return self._free_surface(where, "the touchable set")
        nodes = np.setdiff1d(self.mesh.surface_nodes, self.fixed)
        reach = defaults.RADIUS_FRACTION * self.mesh.diagonal if radius is None else self._length("radius", radius)
        if len(self.fixed):
            nodes = nodes[_distances(self.mesh.points[nodes], self.mesh.points[self.fixed]) > reach]
        if not self._has_triangle(nodes):
            raise VisceraError(
                f"no surface triangle is farther than {reach:g} m from the fixed nodes; lower the radius"
            )
        return nodes

    def _free_surface(self, where: Where, what: str) -> Indices:
        """The free surface nodes of a place, which errors call `what`."""
        nodes = np.intersect1d(np.setdiff1d(self.mesh.surface_nodes, self.fixed), self.mesh.nodes(where))
        if not self._has_triangle(nodes):
            raise VisceraError(f"{what} holds no whole free triangle of the surface; choose a larger one")
        return nodes

    def _has_triangle(self, nodes: Indices) -> bool:
        return bool(np.isin(self.mesh.surface, nodes).all(axis=1).any())

    def plot(self, path: str | os.PathLike[str] | None = None, *, title: str = "") -> Figure:
        """Draw the organ at rest, with fixed nodes as dots and cell sets as wireframes. `path`: write a PNG file there.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> figure = beam.plot("beam.png")
        """
        from viscera.output.picture import draw_rest

        mesh = self.mesh
        parts = {name: _core.surface(mesh.points, mesh.cells[cells]) for name, cells in mesh.cell_sets.items()}
        return draw_rest(mesh.points, mesh.surface, fixed=self.fixed, parts=parts, title=title, path=path)

    def _warn_if_narrow(self, radius: float, nodes: Indices) -> None:
        """A warning if contacts at these nodes of the surface are narrower than the mesh can show, once for a radius: a
        loop may take hold in every frame."""
        if radius in self._narrow:
            return
        surface, points = self.mesh.surface, self.mesh.points
        near = surface[np.isin(surface, nodes).any(axis=1)]
        edge = float(np.linalg.norm(points[near] - points[np.roll(near, 1, axis=1)], axis=2).mean())
        if radius < NARROW * edge:
            self._narrow.add(radius)
            log.warning(
                "the radius of the contact is %.3g mm, and edges of the surface are %.3g mm long in the mean: the "
                "contact is at single nodes, and its force depends on the mesh; enlarge the radius, or refine the mesh",
                1e3 * radius,
                1e3 * edge,
            )

    def _length(self, name: str, value: float | str) -> float:
        return size(value, self.mesh.diagonal, name)

    @property
    def _organ(self) -> Organ:
        """Itself: all that is held is an organ."""
        return self  # type: ignore[return-value]


def _element(name: str | None, law: Law) -> str:
    """The element of this name; without a name, the one that suits the law."""
    if name is None:
        locks = law.poisson.max() > defaults.LOCKING_POISSON * (1.0 + ROUNDING)
        return defaults.LOCKING_FREE_ELEMENT if locks else defaults.ELEMENT
    return Choice(ELEMENTS)(name, "the element")


def _distances(points: Floats, others: Floats) -> Floats:
    """Distance of each point (k, 3) to the nearest of `others` (l, 3)."""
    return np.array([np.sqrt(((others - point) ** 2).sum(axis=1).min()) for point in points])
