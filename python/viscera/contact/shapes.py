"""Shapes of rigid tools and of what organs lie on."""

from __future__ import annotations

from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.immutable import Immutable
from viscera.mesh import Floats, Indices, Mesh
from viscera.quantity import numbers_of, refused
from viscera.select import Lengths, length_in_space


class _Compiled(Immutable):
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
        self.radius: Final = _positive(radius, "the radius of a sphere")
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
        self.radius: Final = _positive(radius, "the radius of a capsule")
        self.length: Final = _positive(length, "the length of a capsule")
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
        self.sides: Final = tuple(_positive(side, "a side of a box") for side in given)
        self.rounding: Final = length_in_space(rounding, "the rounding of a box")
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
        corners, faces = points[used], renumbered.reshape(-1, 3).astype(np.uint32)
        corners.flags.writeable = faces.flags.writeable = False
        self.surface: Final[tuple[Floats, Indices]] = corners, faces
        """Points (n, 3) [m] and triangles (t, 3) of the surface, in axes of the tool."""
        self._core = _core.Shape.solid(*self.surface)

    def __repr__(self) -> str:
        return f"Shape({len(self.surface[1])} triangles)"


AnyShape: TypeAlias = Sphere | Capsule | Box | HalfSpace | Shape
SHAPES = (Sphere, Capsule, Box, HalfSpace, Shape)


def _positive(value: Any, what: str) -> float:
    metres = length_in_space(value, what)
    if metres <= 0.0:
        raise refused(what, "a length above 0 [m]", value)
    return float(metres)
