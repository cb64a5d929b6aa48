"""Surfaces of a scene that may touch each other or themselves: how they are asked for, and what the core takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from viscera import _core
from viscera.boundary.bond import Bond, Side, side_of
from viscera.boundary.loads import name_of
from viscera.boundary.ties import NONE, Surfaces, Ties
from viscera.contact.tool import BONDED, FRICTION, STIFFNESS
from viscera.errors import VisceraError
from viscera.immutable import Immutable
from viscera.mesh import Indices, Mesh, Where
from viscera.quantity import Number

FACTOR = Number(above=0)
REACH, OWN_REACH = "5%", "2%"
"""How near two surfaces, and one that touches itself, are looked at."""
SHALLOW = 1e-4
"""Depth in another organ that is rounding, over the diagonal of both, as in `crates/solid/src/contact/pair.rs`."""


class ContactPair(Immutable):
    """Two organs, or two places of their surfaces, that press on each other, slide, and part again; or one on itself.

    Both places may be of one organ: lobes that fold onto each other, walls of a vessel that collapses. The layer
    between them is that of a `Tool`, with the softer side's `E / (1 - nu^2) / h`. The surface with the shorter edges is
    sampled on the common pieces of both. Force and torque of the two sides cancel.

    first, second: the name of an organ of the scene, or a pair (name, place of its surface). They must not overlap at
        rest by more than rounding. Contact at the rim of a place does not count. Two places of one organ have no node
        in common, and see each other from outside: the front and the back of a thin part are no pair.
        Without `second`, the first may touch itself: triangles that face each other from outside at rest, however
        close; the front and the back of a part if they are more than four times the reach apart at rest, all others
        if more than twice. Neighbours and the two sides of a sharp crease do not touch. The force of a surface on
        itself is zero; area, gap and pressures tell what touches.
    reach: surfaces that come closer than this are looked at [m], or in words such as "1 cm" or "5%" of the diagonal of
        the smaller organ; by default 5 %, of one surface 2 %. What is farther apart at rest may touch too; the solver
        then analyses its matrix anew. A larger one than things move in a solve makes it harder.
    stiffness: of the layer, as in `Tool`; the diagonal is that of the box around both organs.
    friction: Coulomb's coefficient, 0 for none. In `solve` it is integrated from load step to load step. For surfaces
        that stick to each other take a `Bond`.

    >>> import viscera as vs
    >>> vs.ContactPair(("liver", "bed"), "gallbladder")
    ContactPair(liver at 'bed', gallbladder)
    >>> vs.ContactPair(("liver", "left lobe"), ("liver", "right lobe"), friction=0.1)
    ContactPair(liver at 'left lobe', liver at 'right lobe')
    >>> vs.ContactPair("liver")
    ContactPair(liver)
    """

    def __init__(
        self,
        first: Side,
        second: Side | None = None,
        *,
        reach: float | str | None = None,
        stiffness: float = STIFFNESS,
        friction: float = 0.0,
    ) -> None:
        self.first: Final = side_of(first, "a contact pair")
        """Name and place; the place is None for the whole surface."""
        self.second: Final = None if second is None else side_of(second, "a contact pair")
        """The same of the other side; None for a surface that touches itself."""
        self.reach: Final = reach if reach is not None else OWN_REACH if second is None else REACH
        self.stiffness: Final = FACTOR(stiffness, "the stiffness of a contact pair")
        if isinstance(friction, str) and friction == BONDED:
            raise VisceraError("the friction of a contact pair is a coefficient; where organs stick, take a Bond")
        self.friction: Final = FRICTION(friction, "the friction of a contact pair")

    def __repr__(self) -> str:
        words = [name if where is None else f"{name} at {name_of(where)}" for name, where in self.sides]
        return f"ContactPair({', '.join(words)})"

    @property
    def sides(self) -> tuple[tuple[str, Where | None], ...]:
        """Name and place of both sides, or of the one that there is.

        >>> import viscera as vs
        >>> vs.ContactPair("liver").sides
        (('liver', None),)
        """
        return (self.first,) if self.second is None else (self.first, self.second)

    def _ties(self, faces: Sequence[Indices], reach: float) -> Ties:
        """As the core takes it: faces (f, 3) of its sides in the numbering of the scene, reach [m]."""
        first, *rest = (np.ascontiguousarray(side[:, :3], dtype=np.uint32) for side in faces)
        second = rest[0] if rest else None
        return Ties(*NONE.arrays, surfaces=(Surfaces(first, second, reach, self.stiffness, self.friction),))


def refuse_same(joints: Sequence[Bond | ContactPair]) -> None:
    """Raise `VisceraError` if two bonds or contact pairs are of the same surfaces, and would share the force.

    Where they lie on each other, a bond and the layer of a contact pair are springs side by side.
    """
    for number, joint in enumerate(joints):
        for other in joints[:number]:
            if _named(joint) == _named(other):
                are_alike = type(joint) is type(other)
                remedy = "name them once" if are_alike else "leave the contact pair out, or give it places not bonded"
                raise VisceraError(
                    f"{other!r} and {joint!r} of a scene are of the same surfaces and would share the force; {remedy}"
                )


def _named(joint: Bond | ContactPair) -> set[tuple[str, str | int | None]]:
    """Both sides as they were named, in any order; a place that is no name is the same only if it is one object."""
    return {(name, where if where is None or isinstance(where, str) else id(where)) for name, where in joint.sides}


def refuse_overlap(pair: ContactPair, meshes: Mapping[str, Mesh]) -> None:
    """Raise `VisceraError` if the middle of a cell of one organ of a pair lies in the other."""
    # The core looks for points of one surface in the other organ. Of two organs in one place there is none.
    if pair.second is None or pair.first[0] == pair.second[0]:
        return
    sides = [(meshes[name], where) for name, where in pair.sides]
    corners = np.concatenate([mesh.bounding_box for mesh, _ in sides])
    allowed = SHALLOW * float(np.linalg.norm(np.ptp(corners, axis=0)))
    for one, other in ((0, 1), (1, 0)):
        cell, depth = _deepest(*sides[one], *sides[other])
        if depth > allowed:
            name, its = pair.sides[one][0], pair.sides[other][0]
            at = ", ".join(f"{x:.6f}" for x in sides[one][0].centroids[cell])
            raise VisceraError(
                f"the organs of {pair!r} overlap at rest: the point ({at}) m, the middle of cell {cell} of {name!r}, "
                f"is {depth:.3e} m inside {its!r}; at most {allowed:.1e} m is rounding. Move them apart (by `position` "
                "in a case file), correct the meshes, or name only what faces each other from outside"
            )


def _deepest(mesh: Mesh, where: Where | None, other: Mesh, there: Where | None) -> tuple[int, float]:
    """Of the cells at a place, the one whose middle is deepest in another mesh behind a place of its surface, and its
    depth [m]; 0 if none is in it."""
    is_at = True if where is None else np.isin(mesh.cells, mesh.nodes(where)).sum(axis=1) >= 3
    low, high = other.bounding_box
    cells = np.flatnonzero(((mesh.centroids > low) & (mesh.centroids < high)).all(axis=1) & is_at)
    if len(cells):
        cells = cells[_core.Locator(other.points, other.cells).find(mesh.centroids[cells])[0] >= 0]
    if not len(cells):
        return 0, 0.0
    triangles, weights = _core.Surface(other.points, other.surface).closest_to_each(mesh.centroids[cells])
    corners = other.surface[triangles]
    closest = np.einsum("kc,kcd->kd", weights, other.points[corners])
    depths = np.linalg.norm(mesh.centroids[cells] - closest, axis=1)
    if there is not None:
        depths[~np.isin(corners, other.nodes(there)).all(axis=1)] = 0.0
    return int(cells[depths.argmax()]), float(depths.max())


def unknown_contact(tool: Any, of: str, remedy: str) -> VisceraError:
    """For a tool or a contact pair that a solve or a frame does not know."""
    if isinstance(tool, ContactPair):
        remedy = "take the one in the contacts of its scene; a pickled one is another: pickle the scene with it"
        return VisceraError(f"{tool!r} is no contact pair of this {of}; {remedy}")
    return VisceraError(f"{tool!r} was no tool of this {of}; {remedy}")
