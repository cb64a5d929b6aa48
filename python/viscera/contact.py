"""Rigid tools that press, slide and let go: their shapes, their pose, their friction, and what they do to an organ."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh
from viscera.quantity import Number, numbers_of, refused, vector
from viscera.rotation import rotation_matrix
from viscera.select import Lengths, length_in_space

if TYPE_CHECKING:
    from viscera.stepper import Stepper

BONDED = "bonded"
STIFFNESS = 30.0
"""Stiffness factor of the layer between tool and organ, as in `crates/solid/src/contact/layer.rs`."""


class _Compiled:
    """A shape with its compiled form `_core`; all else that it holds is what it was made of, in that order."""

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle and copy: the compiled form is made again."""
        return type(self), tuple(value for name, value in vars(self).items() if name != "_core")


class Sphere(_Compiled):
    """A sphere around the tool's origin; radius [m], or in words such as "8 mm".

    >>> import viscera as vs
    >>> vs.Sphere("8 mm")
    Sphere(radius=0.008)
    """

    def __init__(self, radius: float | str) -> None:
        self.radius = _positive(radius, "the radius of a sphere")
        self._core = _core.Shape.rounded((0.0, 0.0, 0.0), self.radius)

    def __repr__(self) -> str:
        return f"Sphere(radius={self.radius:g})"


class Capsule(_Compiled):
    """A cylinder along the tool's z axis with round ends: all points within `radius` of a segment of `length` [m].

    >>> import viscera as vs
    >>> vs.Capsule("5 mm", "60 mm")
    Capsule(radius=0.005, length=0.06)
    """

    def __init__(self, radius: float | str, length: float | str) -> None:
        self.radius = _positive(radius, "the radius of a capsule")
        self.length = _positive(length, "the length of a capsule")
        self._core = _core.Shape.rounded((0.0, 0.0, 0.5 * self.length), self.radius)

    def __repr__(self) -> str:
        return f"Capsule(radius={self.radius:g}, length={self.length:g})"


class Box(_Compiled):
    """A box around the tool's origin with these sides (3,) [m], its edges rounded by `rounding` [m] within them.

    >>> import viscera as vs
    >>> vs.Box(("20 mm", "20 mm", "5 mm"), rounding="1 mm")
    Box(sides=(0.02, 0.02, 0.005), rounding=0.001)
    """

    def __init__(self, sides: Lengths, rounding: float | str = 0.0) -> None:
        given = [sides] * 3 if isinstance(sides, str | int | float) else list(np.asarray(sides, dtype=object).ravel())
        if len(given) != 3:
            raise refused("the sides of a box", "three lengths [m]", sides)
        self.sides = tuple(_positive(side, "a side of a box") for side in given)
        self.rounding = length_in_space(rounding, "the rounding of a box")
        half = [0.5 * side - self.rounding for side in self.sides]
        if self.rounding < 0.0 or min(half) < 0.0:
            raise VisceraError(
                f"the rounding of a box is {self.rounding:g} m; it must be from 0 to half the smallest side, "
                f"{0.5 * min(self.sides):g} m"
            )
        self._core = _core.Shape.rounded((half[0], half[1], half[2]), self.rounding)

    def __repr__(self) -> str:
        return f"Box(sides={self.sides}, rounding={self.rounding:g})"


class HalfSpace(_Compiled):
    """Everything below z = 0 in the axes of the tool: a table, or the flat face of a large plate.

    >>> import viscera as vs
    >>> plate = vs.Tool(vs.HalfSpace(), position=(0, 0, 0.2), rotation=(3.141592653589793, 0, 0))  # all above z = 0.2
    """

    def __init__(self) -> None:
        self._core = _core.Shape.half_space()

    def __repr__(self) -> str:
        return "HalfSpace()"


class Shape(_Compiled):
    """The inside of a closed surface, by its signed distance (Baerentzen and Aanaes 2005), built once.

    surface: a `Mesh`, of which the surface is taken, or points (n, 3) [m] and triangles (t, 3) seen anticlockwise from
    outside. Raises `VisceraError` if the surface is open or inside out, or if some triangles are turned.

    >>> import viscera as vs
    >>> vs.Shape(vs.organs.beam())
    Shape(704 triangles)
    """

    def __init__(self, surface: Mesh | tuple[ArrayLike, ArrayLike]) -> None:
        if isinstance(surface, Mesh):
            points, triangles = surface.points, surface.surface
        elif isinstance(surface, tuple) and len(surface) == 2:
            given = [numbers_of(each) for each in surface]
            if any(each is None or each.ndim != 2 or each.shape[1] != 3 for each in given):
                raise refused("a shape", "points (n, 3) [m] and triangles (t, 3)", surface)
            points, triangles = given  # type: ignore[assignment]
        else:
            raise refused("a shape", "a viscera.Mesh, or a pair of points (n, 3) [m] and triangles (t, 3)", surface)
        if not len(triangles):
            raise VisceraError("a shape is what a closed surface encloses, and this one has no triangles; give them")
        if triangles.min() < 0 or (triangles != np.floor(triangles)).any():
            raise VisceraError("the triangles of a shape must be indices of its points")
        if triangles.max() >= len(points):
            raise VisceraError(f"a triangle of the shape uses point {triangles.max():g}; it has {len(points)} points")
        used, renumbered = np.unique(triangles.astype(np.uint32), return_inverse=True)
        self.surface: tuple[Floats, Indices] = points[used], renumbered.reshape(-1, 3).astype(np.uint32)
        """Points (n, 3) [m] and triangles (t, 3) of the surface, in axes of the tool."""
        self._core = _core.Shape.solid(*self.surface)

    def __repr__(self) -> str:
        return f"Shape({len(self.surface[1])} triangles)"


AnyShape: TypeAlias = Sphere | Capsule | Box | HalfSpace | Shape
SHAPES = (Sphere, Capsule, Box, HalfSpace, Shape)


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
        """The tool at the end of its motion, for a solve that continues from there.

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


@dataclass(frozen=True)
class Contact:
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
    """Area of contact [m^2], of the surface at rest."""
    gap: float
    """Smallest distance [m] of the tool from the surface; negative if the tool has entered the layer. Infinite if a
    bonded tool holds the whole surface."""
    energy: float
    """Energy [J] stored in the layer and in the springs of friction."""
    dissipation: float
    """Energy [J] dissipated by friction in the last step."""
    touching: int
    """Number of samples of the surface that touch the tool."""
    sliding: int
    """Number of these that slide."""
    is_inside: bool
    """Whether the tool is inside the organ, too thin or too fast for the samples of the surface to notice; then none of
    these numbers holds, and the frame has not settled. `Organ.solve` ends before that."""
    pressures: Floats
    """Pressure (n,) at nodes [Pa], per area at rest: the mean of the samples around that touch; negative only where
    bonded."""


class Instrument:
    """A tool at work in a stepper: made by `Stepper.tool`, moved from frame to frame, ended by `remove`.

    Its pose is read-only; to change it, call `move`, `turn` or `place`, or assign a whole `position` or `rotation`.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> stepper = beam.stepper(iterations=10)
    >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
    >>> tool.move((0, 0, -0.01))
    >>> frame = stepper.frame()
    >>> frame.is_settled, bool(frame.force(tool)[2] < 0.0)
    (True, True)
    """

    def __init__(self, stepper: Stepper, tool: Tool, number: int) -> None:
        self._stepper = stepper
        self._number = number
        self._tool, self._shape = tool, tool.shape
        self._position, self._rotation = kept(tool.position.copy()), kept(tool.rotation.copy())

    @property
    def shape(self) -> AnyShape:
        """Its shape."""
        return self._shape

    @property
    def position(self) -> Floats:
        """Position of its origin for the next frame (3,) [m]."""
        return self._position

    @position.setter
    def position(self, value: ArrayLike) -> None:
        self.place(vector(value, "the position of a tool", "m"))

    @property
    def rotation(self) -> Floats:
        """Rotation matrix for the next frame (3, 3)."""
        return self._rotation

    @rotation.setter
    def rotation(self, value: ArrayLike | None) -> None:
        self.place(rotation=rotation_matrix(value))

    def place(self, position: ArrayLike | None = None, rotation: ArrayLike | None = None) -> None:
        """Set the pose for the next frame: a position (3,) [m], a rotation matrix (3, 3) or vector (3,) [rad].

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
        >>> tool.place((0.5, 0.1, 0.4))
        >>> stepper.frame().contact(tool).touching
        0
        """
        placed = self.position if position is None else vector(position, "the position of a tool", "m")
        turned = self.rotation if rotation is None else rotation_matrix(rotation)
        self._stepper._core.place_tool(self._number, turned.tolist(), placed.tolist())
        self._position, self._rotation = kept(placed), kept(turned)

    def move(self, by: ArrayLike) -> None:
        """Move on by (x, y, z) [m] with the next frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
        >>> tool.move((0, 0, -0.01))
        >>> frame = stepper.frame()
        >>> tool.position.round(3).tolist()
        [0.9, 0.1, 0.29]
        """
        self.place(self.position + vector(by, "the motion of a tool", "m"))

    def turn(self, by: ArrayLike) -> None:
        """Turn on about its origin by a rotation vector (3,) [rad], in axes of the world, with the next frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
        >>> tool.turn((0, 3.141592653589793, 0))
        >>> tool.rotation.round(3).diagonal().tolist()
        [-1.0, 1.0, -1.0]
        """
        self.place(rotation=rotation_matrix(vector(by, "the turn of a tool", "")) @ self.rotation)

    def remove(self) -> None:
        """Remove the tool with the next frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
        >>> tool.move((0, 0, -0.01))
        >>> frame = stepper.frame()
        >>> tool.remove()
        >>> frame = stepper.frame()
        """
        self._stepper._core.remove_tool(self._number)
        self._stepper._tools = [tool for tool in self._stepper._tools if tool is not self]


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


def refuse_twice(given: Sequence[object], where: str) -> None:
    """Raise `VisceraError` if the same thing is named twice: it would act twice, and its report tell a half."""
    for number, each in enumerate(given):
        if any(each is other for other in given[:number]):
            raise VisceraError(f"{where}: {each!r} is named twice and would act twice; name it once")


def contacts(reports: list[dict[str, Any]]) -> list[Contact]:
    """The contacts of all tools, from the core's result."""
    return [Contact(**report) for report in reports]


def kept(array: Floats) -> Floats:
    """The array, read-only from now on: a pose that is changed in place would not reach the stepper."""
    array.flags.writeable = False
    return array


FRICTION = Number(low=0.0, high=1e3)


def _positive(value: Any, what: str) -> float:
    metres = length_in_space(value, what)
    if metres <= 0.0:
        raise refused(what, "a length above 0 [m]", value)
    return float(metres)


def _shape(value: Any) -> AnyShape:
    if not isinstance(value, SHAPES):
        raise refused("the shape of a tool", "a Sphere, Capsule, Box, HalfSpace or Shape", value)
    return value


def _friction(value: Any) -> float | str:
    is_bonded = isinstance(value, str) and value == BONDED
    return BONDED if is_bonded else FRICTION(value, "the friction of a tool")


CHECKS: dict[str, Callable[[Any], Any]] = {
    "shape": _shape,
    "position": lambda value: vector(value, "the position of a tool", "m"),
    "rotation": rotation_matrix,
    "friction": _friction,
    "displacement": lambda value: vector(value, "the displacement of a tool", "m"),
    "turn": lambda value: vector(value, "the turn of a tool", ""),
    "stiffness": lambda value: Number(above=0)(value, "the stiffness of a tool"),
}
"""What each attribute of a tool must be; returns it as the tool keeps it."""
