"""Rigid tools that press, slide and let go: their pose, their friction, and what they do to an organ."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.contact.shapes import SHAPES, AnyShape
from viscera.errors import VisceraError
from viscera.mesh import Floats
from viscera.quantity import Number, refuse_twice, refused, vector
from viscera.rotation import rotation_matrix
from viscera.sealed import Sealed

BONDED = "bonded"
STIFFNESS = 30.0
"""Stiffness factor of the layer between tool and organ, as in `crates/solid/src/contact/layer.rs`."""


class Tool:
    """A rigid tool: a shape with a pose, friction and a motion.

    shape: `Sphere`, `Capsule`, `Box`, `HalfSpace` or `Shape`.
    position: (3,) [m] of the shape's origin; rotation: a matrix (3, 3) from the shape's axes to the world's, or a
        rotation vector (3,) [rad].
    friction: Coulomb's coefficient, 0 for none, or "bonded": tissue that has touched the tool sticks to it, also under
        tension.
    displacement: (3,) [m], turn: a rotation vector (3,) [rad] about its origin. `Organ.solve` moves it by these.
    stiffness: of the layer between tool and organ, in units of E / (1 - nu^2) / h, with the moduli and the height h of
        the cell behind, at most 1.5 % of the organ's diagonal. A pressure p presses the tool by about
        p h (1 - nu^2) / (E stiffness) into the surface. A higher stiffness lets the tool enter less, and takes more
        iterations.

    All of these may be assigned later, too, and are checked then; the next solve takes them.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> tool = vs.Tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3), displacement=(0, 0, -0.01))
    >>> state = beam.solve(contact=[tool])
    >>> bool(state.force(tool)[2] < 0.0)
    True
    """

    shape: AnyShape
    position: Floats
    rotation: Floats
    friction: float | str
    displacement: Floats
    turn: Floats
    stiffness: float

    def __init__(
        self,
        shape: AnyShape,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | None = None,
        *,
        friction: float | str = 0.0,
        displacement: ArrayLike = (0.0, 0.0, 0.0),
        turn: ArrayLike = (0.0, 0.0, 0.0),
        stiffness: float = STIFFNESS,
    ) -> None:
        given = {"shape": shape, "position": position, "rotation": rotation, "friction": friction}
        for name, value in {**given, "displacement": displacement, "turn": turn, "stiffness": stiffness}.items():
            setattr(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        """Takes a value if it is what the constructor takes."""
        check = CHECKS.get(name)
        super().__setattr__(name, value if check is None else check(value))

    def __repr__(self) -> str:
        return f"Tool({self.shape!r}, position={self.position.tolist()}, friction={self.friction!r})"

    def arrived(self) -> Tool:
        """The tool at the end of its motion, for a solve that continues from there: tissue goes on sticking to it.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> tool = vs.Tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3), displacement=(0, 0, -0.01))
        >>> state = beam.solve(contact=[tool])
        >>> back = tool.arrived()
        >>> back.displacement = -tool.displacement
        >>> state = beam.solve(contact=[back], start=state)
        >>> bool(abs(state.force(back)[2]) < 0.01)
        True
        """
        return self._at(1.0)

    @property
    def _moves(self) -> bool:
        return bool(self.displacement.any() or self.turn.any())

    def _is_same(self, other: Tool) -> bool:
        """Whether it is this tool, or its shape in the same pose with the same motion: a shape alone is a new tool."""
        pose = ("position", "rotation", "displacement", "turn")
        alike = all(np.array_equal(getattr(self, each), getattr(other, each)) for each in pose)
        return self is other or (self.shape is other.shape and alike)

    def _at(self, load: float) -> Tool:
        """The tool after a part of its motion."""
        rotation = rotation_matrix(load * self.turn) @ self.rotation
        kept: dict[str, Any] = {"friction": self.friction, "stiffness": self.stiffness}
        return Tool(self.shape, self.position + load * self.displacement, rotation, **kept)

    def _spec(self) -> _core.Tool:
        friction = None if isinstance(self.friction, str) else self.friction
        rows = self.rotation.tolist()
        places = (self.position.tolist(), self.displacement.tolist(), self.turn.tolist())
        return self.shape._core, friction, self.stiffness, rows, *places


@dataclass(frozen=True, eq=False)
class Contact(Sealed):
    """Forces between a tool and the organ, and the state of the contact.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> tool = vs.Tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3), displacement=(0, 0, -0.01))
    >>> state = beam.solve(contact=[tool])
    >>> contact = state.contact(tool)
    >>> contact.touching > 0, contact.sliding, bool(-1e-3 * beam.mesh.diagonal < contact.gap < 0.0)
    (True, 0, True)
    """

    force: Floats
    """Force (3,) of the tool on the organ [N]."""
    torque: Floats
    """Torque (3,) on the organ about the tool's origin [N m]."""
    area: float
    """Area of contact [m^2], of the surface at rest. Of a tool `(sum_i A_i sqrt(p_i))^2 / sum_i A_i p_i`, with the
    shares `A_i` of the surface that nodes have and their pressures: exact for a uniform pressure, 0.96 of Hertz's area
    on fine meshes, and too large where only a few nodes carry the tool; docs/contact.md. Of a contact pair the area of
    the samples that touch."""
    gap: float
    """Smallest distance [m] of the tool from the surface, also of what a bonded tool holds; negative if the tool has
    entered the layer."""
    energy: float
    """Energy [J] stored in the layer and in the springs of friction."""
    dissipation: float
    """Energy [J] dissipated by friction in the last load step or frame. A frame of a contact pair that goes on with one
    which has not settled tells what it adds to that, or takes from it."""
    touching: int
    """Number of samples of the surface that touch the tool."""
    sliding: int
    """Number of these that slide."""
    is_inside: bool
    """Whether the tool is inside the organ or has come through it, too thin or too fast for the samples of the surface
    to notice; then none of these numbers holds, and the frame has not settled. `Organ.solve` ends before that.
    Of a contact pair: whether the sampled surface is deeper in the other than half a cell of that, or has gone through
    it and is not back. A surface that may touch itself is not followed."""
    pressures: Floats
    """Pressure (n,) at nodes [Pa], per area at rest: the normal force on a node over its share of the surface, so that
    it adds up to the force across the surface; smeared over a cell at the rim. Negative only where bonded."""


def tools_of(contact: Sequence[Tool | AnyShape] | None, bodies: Sequence[Tool] = ()) -> list[Tool]:
    """The tools of a solve in which bodies act already. A shape becomes a tool at the origin, without friction."""
    if contact is None:
        return []
    if isinstance(contact, Tool | AnyShape) or not isinstance(contact, Sequence):
        raise refused("contact", "a list of tools, such as [Tool(Sphere(0.01), position=(0, 0, 0.1))]", contact)
    for each in contact:
        if not isinstance(each, Tool | AnyShape):
            raise refused("a tool of contact", "a Tool or a shape", each)
    refuse_twice(contact, "contact")
    tools = [each if isinstance(each, Tool) else Tool(each) for each in contact]
    for tool in tools:
        if any(map(tool._is_same, bodies)):
            raise VisceraError(f"{tool!r} is a body of the scene, which acts in every solve; leave it out of contact")
    return tools


def contacts(reports: list[dict[str, Any]]) -> list[Contact]:
    """The contacts of all tools, from the core's result."""
    return [Contact(**report) for report in reports]


FRICTION = Number(low=0.0, high=1e3)


def _shape(value: Any) -> AnyShape:
    if not isinstance(value, SHAPES):
        raise refused("the shape of a tool", "a Sphere, Capsule, Box, HalfSpace or Shape", value)
    return value


class FrictionOrBonded:
    """Coulomb's coefficient, or the word for tissue that sticks."""

    def __call__(self, value: Any, what: str) -> float | str:
        if isinstance(value, str) and value == BONDED:
            return BONDED
        try:
            return FRICTION(value, what)
        except VisceraError:
            raise refused(what, self, value) from None

    def __str__(self) -> str:
        return f'{FRICTION}, or "{BONDED}"'


CHECKS: dict[str, Callable[[Any], Any]] = {
    "shape": _shape,
    "position": lambda value: vector(value, "the position of a tool", "m"),
    "rotation": rotation_matrix,
    "friction": lambda value: FrictionOrBonded()(value, "the friction of a tool"),
    "displacement": lambda value: vector(value, "the displacement of a tool", "m"),
    "turn": lambda value: vector(value, "the turn of a tool", ""),
    "stiffness": lambda value: Number(above=0)(value, "the stiffness of a tool"),
}
"""What each attribute of a tool must be; returns it as the tool keeps it."""
