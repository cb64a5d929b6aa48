"""A scene: several organs, each with its own mesh, law and supports, joined as one body, with bonds and contact."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from viscera import _core
from viscera import law as laws
from viscera.boundary.bond import TURNED, Bond, Pieces
from viscera.boundary.spring import Spring
from viscera.boundary.ties import Tied, Ties
from viscera.contact.pair import ContactPair, refuse_overlap, refuse_same
from viscera.contact.shapes import AnyShape
from viscera.contact.tool import Tool, tools_of
from viscera.errors import VisceraError
from viscera.joined import (
    diagonal_of,
    joined_law,
    joined_mesh,
    law_of,
    numbers_of,
    pieces_of,
    renumbered,
    require_organ,
    sides_of,
)
from viscera.mesh import Floats, Indices, Mesh, Where
from viscera.organ import Organ, require_same_cells
from viscera.quantity import refuse_twice, refused
from viscera.select import Lengths, length
from viscera.select import point as point_of

if TYPE_CHECKING:
    from viscera.cases.scene_case import SceneCase

LEAST_REACH = 1e-3
"""Smallest reach of a contact pair, over the diagonal of its smaller organ."""
LISTED = 5
"""How many nodes an error lists."""


class Scene(Organ):
    """Several organs, rigid bodies, and bonds between the organs, solved and stepped together.

    A scene is an organ whose parts are the organs: `solve`, `path`, `stepper`, `reduce` and what they return work as
    for one organ. `state["liver"]`, or the same of a frame, is the part of one organ.

    organs: `{name: Organ}`, all of one element. Each keeps its mesh, law, fixed nodes and elastic supports. The sets of
        the scene's mesh are `"liver"` for all nodes or cells of an organ and `"liver/hilum"` for its sets;
        `Scene.place` gives any other place.
    bodies: rigid bodies, as the tools of `Organ.solve(contact=)`: a table, a retractor. They act in every solve and in
        every stepper, where they stand still: a stepper refuses a body with a motion. They touch all organs.
    bonds: what holds organs together: `Bond` of two surfaces, `Spring` between places, such as "liver/hilum".
    contacts: what may touch: each a `ContactPair` of two organs, of two places of one, or of one with itself.
    Raises `VisceraError` for organs of several elements, for names that are unknown, for what is named twice, for a
    bond of surfaces that do not lie on each other, and for a contact pair of organs that overlap or of places that have
    a node in common.

    >>> import viscera as vs
    >>> beam = vs.organs.beam()
    >>> above = vs.mesh(beam.points + [0.0, 0.0, 0.2], beam.cells)
    >>> lower = vs.Organ(beam, vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> upper = vs.Organ(above, vs.NeoHookean(young=2e4, poisson=0.3))  # held by its bond
    >>> scene = vs.Scene({"lower": lower, "upper": upper}, bonds=[vs.Bond("lower", "upper")])
    >>> state = scene.solve(force={"lower/tip": (0, 0, -10.0)})
    >>> state.is_converged, f"{1e3 * state['upper'].displacement[:, 2].min():.0f} mm"
    (True, '-122 mm')
    """

    def __init__(
        self,
        organs: Mapping[str, Organ],
        bodies: Sequence[Tool | AnyShape] = (),
        bonds: Sequence[Bond | Spring] = (),
        contacts: Sequence[ContactPair] = (),
    ) -> None:
        self.organs: Final[Mapping[str, Organ]] = MappingProxyType(_checked(organs))
        """The organs by name."""
        given_bonds = _list_of(bonds, "bonds", "Bond and Spring, such as [Bond('liver', 'gallbladder')]")
        given_contacts = _list_of(contacts, "contacts", "ContactPair, such as [ContactPair('liver', 'stomach')]")
        self.bonds: Final[tuple[Bond | Spring, ...]] = _origins(given_bonds)
        """The bonds."""
        self.contacts: Final[tuple[ContactPair, ...]] = _origins(given_contacts)
        """The contact pairs."""
        bodies = _list_of(bodies, "bodies", "tools and shapes, such as [Tool(HalfSpace())]")
        for body in bodies:
            if not isinstance(body, Tool | AnyShape):
                raise refused("a body of a scene", "a Tool or a shape; contact pairs are named in contacts", body)
        first = next(iter(self.organs.values()))
        self._meshes = {name: organ.mesh for name, organ in self.organs.items()}
        self._numbers = numbers_of(self._meshes)
        refuse_same([joint for joint in (*given_bonds, *given_contacts) if isinstance(joint, Bond | ContactPair)])
        mesh, law = joined_mesh(self.organs), joined_law(self.organs)
        nodal = mesh.quadratic() if first.element == "P2" else mesh
        fixed = np.concatenate([self._numbers[name][organ.fixed] for name, organ in self.organs.items()])
        held: list[Tied] = [
            Placed(support, renumbered(ties, self._numbers[name]))
            for name, organ in self.organs.items()
            for support, ties in zip(organ.supports, organ._tied, strict=True)
        ]
        held += [bond if isinstance(bond, Spring) else self._bonded(bond, nodal, law) for bond in given_bonds]
        held += [self._touching(pair) for pair in given_contacts]
        try:
            super().__init__(mesh, law, fixed=fixed, element=first.element, supports=held)
        except VisceraError as error:
            raise VisceraError(self._named(str(error))) from error
        for pair in given_contacts:
            if not isinstance(pair, Placed):
                refuse_overlap(pair, self._meshes)
        self._bodies = tools_of(list(bodies))
        self._joined = given_bonds, given_contacts

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle and copy: the organs are joined again."""
        return Scene, (dict(self.organs), self._bodies, *self._joined)

    def with_law(self, law: laws.Law | Mapping[Any, laws.Law]) -> Scene:
        """The same scene with another law in all organs, or with laws by place; bonds are as stiff as it asks for.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> vs.Scene({"beam": beam}).with_law(vs.Corotated(young=1e5, poisson=0.3)).organ("beam").law
        Corotated(mu=38461.5, lam=57692.3)
        """
        whole = laws.Several(self.mesh, law) if isinstance(law, Mapping) else law
        of_cell = self.of_cell
        cells = {name: np.flatnonzero(of_cell == number) for number, name in enumerate(self.organs)}
        organs = {name: organ.with_law(law_of(whole, cells[name])) for name, organ in self.organs.items()}
        return Scene(organs, self._bodies, *self._joined)

    def with_mesh(self, mesh: Mesh) -> Scene:
        """The same scene where its organs have another shape: that of a mesh with the same cells, as for an `Organ`.

        Bonds join what they join here, and are without stress there. Their normals, areas and stiffness, and lengths in
        per cent such as the reach of a contact pair, are those of the new shape.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> scene = vs.Scene({"beam": beam})
        >>> longer = vs.mesh(2 * scene.mesh.points, scene.mesh.cells, scene.mesh.sets)
        >>> scene.with_mesh(longer).organ("beam").mesh.diagonal / beam.mesh.diagonal
        2.0
        """
        require_same_cells(self.mesh, mesh)
        organs = {}
        for name, organ in self.organs.items():
            points = mesh.points[self._numbers[name][: organ.mesh.n_corners]]
            points.flags.writeable = False
            organs[name] = organ.with_mesh(replace(organ.mesh.linear(), points=points, is_unloaded=mesh.is_unloaded))
        bonds = [self._kept(bond) for bond in self.bonds]
        return Scene(organs, self._bodies, bonds, [self._kept(pair) for pair in self.contacts])

    def _locking_free(self) -> Scene:
        organs = {name: organ._locking_free() for name, organ in self.organs.items()}
        return Scene(organs, self._bodies, *self._joined)

    def _kept(self, joint: Bond | Spring | ContactPair) -> Any:
        """What joins organs, at the nodes that it joins here."""
        if isinstance(joint, Spring):
            return joint.on(self.mesh)
        return next(held for held in self.supports if isinstance(held, Placed) and held.origin is joint)

    def _refuse_ties(self) -> None:
        if joined := [*self.bonds, *self.contacts]:
            raise VisceraError(
                "a scene with bonds, springs or contact pairs cannot be registered yet, and this one has "
                f"{joined[0]!r}; register an organ by itself, with fixed nodes, such as "
                f"scene.organ({next(iter(self.organs))!r}).register(...)"
            )
        super()._refuse_ties()

    def __repr__(self) -> str:
        words = [f"{name}: {len(organ.mesh.points)} points" for name, organ in self.organs.items()]
        rest = [f"{len(self._bodies)} bodies", f"{len(self.bonds)} bonds"]
        rest += [f"{len(self.contacts)} contact pairs"] if self.contacts else []
        return f"Scene({', '.join([*words, *rest])})"

    @property
    def bodies(self) -> tuple[Tool, ...]:
        """The rigid bodies."""
        return tuple(self._bodies)

    @property
    def of_cell(self) -> Floats:
        """For each cell (m,) the number of its organ, counted from 0."""
        return np.repeat(np.arange(float(len(self.organs))), [len(organ.mesh.cells) for organ in self.organs.values()])

    @property
    def of_node(self) -> Indices:
        """For each node (n,) the number of its organ, counted from 0."""
        owner = np.empty(len(self.mesh.points), dtype=np.uint32)
        for number, nodes in enumerate(self._numbers.values()):
            owner[nodes] = number
        return owner

    def patch(self, point: Lengths, radius: float | str, organ: str | None = None) -> _core.Patch:
        """The contact patch around a surface point, as `Organ.patch`; it lies on one organ.

        organ: the name of that organ, for a point at which several lie on each other; by default the nearest one.

        >>> import viscera as vs
        >>> beam = vs.organs.beam()
        >>> above = vs.mesh(beam.points + [0.0, 0.0, 0.2], beam.cells)
        >>> law = vs.NeoHookean(young=1e5, poisson=0.3)
        >>> organs = {"lower": vs.Organ(beam, law, fixed="clamp"), "upper": vs.Organ(above, law, fixed="x < 1%")}
        >>> scene = vs.Scene(organs, bonds=[vs.Bond("lower", "upper")])
        >>> patch = scene.patch((0.5, 0.1, 0.2), "5 cm", organ="upper")
        >>> set(scene.of_node[patch.nodes].tolist())
        {1}
        """
        if organ is None:
            return super().patch(point, radius)
        found = self.organ(organ).patch(point_of(point, self.mesh, "contact point"), self._length("radius", radius))
        return _core.Patch(self._numbers[organ][found.nodes].astype(np.uint32), found.weights)

    def place(self, organ: str, where: Where) -> tuple[int, ...]:
        """The nodes of a place of an organ in the numbering of the scene, for loads and displacements.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> scene = vs.Scene({"beam": beam})
        >>> len(scene.place("beam", "x > 99%"))
        25
        """
        nodes = self.organ(organ).mesh.nodes(where)
        return tuple(self._numbers[organ][nodes].tolist())

    def organ(self, name: str) -> Organ:
        """An organ of the scene by its name.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> vs.Scene({"beam": beam}).organ("beam") is beam
        True
        """
        require_organ(name, self.organs)
        return self.organs[name]

    def part(self, name: str, field: Floats) -> Floats:
        """The rows of a nodal field (n, 3) that belong to an organ, in the organ's own numbering.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> scene = vs.Scene({"beam": beam})
        >>> scene.part("beam", scene.mesh.points).shape
        (525, 3)
        """
        self.organ(name)
        return np.asarray(field[self._numbers[name]])

    def to_case(  # type: ignore[override]  # a scene has no scan and no reduction in its case
        self,
        path: str | os.PathLike[str],
        *,
        loads: Mapping[str, Any] | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> SceneCase:
        """Write the scene as a case file (docs/case-file.md), its meshes beside it, and read it back.

        loads: as `solve` takes them, such as `{"gravity": (0, 0, -9.81), "density": {"liver": 1060}}`.
        settings: "steps", "solver", and "newton" with a table of its settings. They may stand among the loads too, by
            their names in `solve`, as `loading` of a case gives them.
        `viscera.case(path)` reads the file, `viscera solve` solves it. Raises `VisceraError` for what a case cannot
        express: what `Organ.to_case` names, springs among the supports of an organ, places that span several organs,
        bodies that are a `Shape`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = vs.Scene({"beam": beam}).to_case("scene.toml", loads={"force": {"beam/tip": (0, 0, -10.0)}})
        >>> case.organ().solve(**case.loading()).is_converged
        True
        """
        from viscera.cases import scene_file

        return scene_file.write(self, path, loads=loads, settings=settings)

    def _bonded(self, given: Bond | Placed, mesh: Mesh, law: laws.Law) -> Placed:
        """A bond with its samples; one that is kept joins what it joined, as stiff as this shape and law ask for."""
        bond, pieces = (given.origin, given.pieces) if isinstance(given, Placed) else (given, None)
        if not isinstance(bond, Bond):
            raise refused("a bond of a scene", "a Bond or a Spring, such as Bond('liver', 'gallbladder')", bond)
        if pieces is None:
            pieces = pieces_of(bond, mesh, self._meshes, self._numbers)
        return Placed(bond, bond._samples(mesh, pieces, law), pieces)

    def _name_of(self, node: int) -> str:
        number = int(self.of_node[node])
        name = list(self.organs)[number]
        return f"node {int(np.flatnonzero(self._numbers[name] == node)[0])} of {name!r}"

    def _named(self, message: str) -> str:
        """What the core says of a contact pair, with its name in place of its number."""
        for number, pair in enumerate(self.contacts):
            message = message.replace(f"contact pair {number} ", f"{pair!r} ")
        return message

    def _doubt_of_bonds(self, displacement: Floats) -> str:
        """What sliding bonds do not do for their surfaces have turned, in words; empty if they have not."""
        found = []
        for own in self.supports:
            if isinstance(own, Placed) and own.slides:
                angle = own.slides.turned(self.mesh.points, displacement)
                found += [f"those of {own.origin!r} by {angle:.0f} degrees"] if angle > TURNED else []
        if not found:
            return ""
        return (
            f"the surfaces of sliding bonds have turned, {', '.join(found)}, and these keep the normals of rest: they "
            "give way across the surfaces and hold along them; take a ContactPair, which turns with them but may "
            "open, or a bond that does not slide"
        )

    def _touching(self, given: ContactPair | Placed) -> Placed:
        """A contact pair with its surfaces; one that is kept has those it had, and the reach of this shape."""
        if isinstance(given, Placed) and isinstance(given.origin, ContactPair):
            reach = self._reach(given.origin)
            surfaces = tuple(replace(each, reach=reach) for each in given.found.surfaces)
            return Placed(given.origin, replace(given.found, surfaces=surfaces))
        if not isinstance(given, ContactPair):
            raise refused("a contact of a scene", "a ContactPair, such as ContactPair('liver', 'stomach')", given)
        sides = sides_of(given, self._meshes, self._numbers)
        if given.second is not None and given.first[0] == given.second[0]:
            self._refuse_shared(given, np.intersect1d(sides[0], sides[1]))
        return Placed(given, given._ties(sides, self._reach(given)))

    def _reach(self, pair: ContactPair) -> float:
        """The reach of a contact pair [m] between its organs in this shape."""
        diagonal = diagonal_of(pair, self._meshes)
        reach = length(pair.reach, diagonal, "the reach of a contact pair")
        if reach < LEAST_REACH * diagonal:
            least = f"at least {LEAST_REACH:.1%} of the diagonal of its smaller organ, {LEAST_REACH * diagonal:.3g} m"
            raise refused(f"the reach of {pair!r}", f"a length of {least}; steps are shorter than it", pair.reach)
        return reach

    def _refuse_shared(self, pair: ContactPair, shared: Indices) -> None:
        """Raise `VisceraError` if the sides of a pair of one organ have nodes of the scene in common."""
        name = pair.first[0]
        if any(where is None for _, where in pair.sides):
            raise VisceraError(
                f"{pair!r}: an organ touches itself between two of its places, such as "
                f"ContactPair(({name!r}, 'x < 40%'), ({name!r}, 'x > 60%')), or all over, as ContactPair({name!r})"
            )
        if len(shared):
            own = np.flatnonzero(np.isin(self._numbers[name], shared)).tolist()
            more = f" and {len(own) - LISTED} more" if len(own) > LISTED else ""
            raise VisceraError(
                f"{pair!r}: both places have faces at node {', '.join(map(str, own[:LISTED]))}{more} of {name!r}; an "
                "organ touches itself between places without a common node, so leave such nodes out of one of the two"
            )


def _list_of(given: Any, name: str, what: str) -> tuple[Any, ...]:
    """What a scene holds together, or raise `VisceraError` if it is no list."""
    if not isinstance(given, Iterable) or isinstance(given, str):
        raise refused(f"the {name} of a scene", f"a list of {what}", given)
    found = tuple(given)
    refuse_twice(found, f"the {name} of a scene")
    return found


def _origins(given: tuple[Any, ...]) -> Any:
    return tuple(each.origin if isinstance(each, Placed) else each for each in given)


@dataclass(frozen=True, eq=False, repr=False)
class Placed:
    """A support, a bond or a contact pair in the numbering of a scene."""

    origin: Tied | Bond | ContactPair
    found: Ties
    pieces: Pieces | None = None
    """Those of a bond."""

    def __repr__(self) -> str:
        return repr(self.origin)

    def ties(self, mesh: Mesh) -> Ties:
        """Its samples."""
        return self.found

    @property
    def slides(self) -> Pieces | None:
        """The pieces of a sliding bond."""
        return self.pieces if isinstance(self.origin, Bond) and self.origin.sliding else None

    def on(self, mesh: Mesh) -> Placed:
        """The same: a scene of another shape finds the samples anew, of a bond on the pieces kept."""
        return self

    def is_same(self, other: object) -> bool:
        """Whether it is this support, bond or contact pair."""
        return other is self or other is self.origin or (isinstance(self.origin, Tied) and self.origin.is_same(other))


def _checked(organs: Mapping[str, Organ]) -> dict[str, Organ]:
    if not isinstance(organs, Mapping) or not organs:
        raise refused("the organs of a scene", "a table, such as {'liver': Organ(...)}", organs)
    for name, organ in organs.items():
        if not isinstance(name, str) or not name or "/" in name:
            raise refused("the name of an organ", "words without '/'", name)
        if not isinstance(organ, Organ) or isinstance(organ, Scene):
            raise refused(f"the organ {name!r}", "a viscera.Organ", organ)
    elements = {organ.element for organ in organs.values()}
    if len(elements) > 1:
        raise VisceraError(
            f"the organs of a scene must be of one element, got {', '.join(sorted(elements))}; choose one for all, as "
            "in Organ(..., element='P1 mean volume')"
        )
    return dict(organs)
