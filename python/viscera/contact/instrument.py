"""Tools at work in a stepper."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from viscera.contact.posed import Posed
from viscera.contact.shapes import AnyShape
from viscera.contact.tool import Tool
from viscera.errors import VisceraError
from viscera.quantity import vector
from viscera.sealed import read_only

if TYPE_CHECKING:
    from viscera.stepping.stepper import Stepper


HALF_TURN = np.pi * (1.0 - 1e-9)
"""What is farther looks like a turn the other way [rad]."""


class Instrument(Posed):
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

    _WHAT = "a tool"

    def __init__(self, stepper: Stepper, tool: Tool, number: int) -> None:
        self._stepper = stepper
        self._number = number
        self._tool, self._shape = tool, tool.shape
        self._position, self._rotation = read_only(tool.position.copy()), read_only(tool.rotation.copy())
        self._is_there = True

    def __repr__(self) -> str:
        x, y, z = self.position
        return (
            f"Instrument({self.shape!r}, position=({x:.4g}, {y:.4g}, {z:.4g}){'' if self._is_there else ', removed'})"
        )

    @property
    def shape(self) -> AnyShape:
        """Its shape."""
        return self._shape

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
        placed, turned = self._placed(position), self._turned(rotation)
        if not self._is_there:
            raise VisceraError("this tool was removed; make a new one by Stepper.tool")
        self._stepper._core.place_tool(self._number, turned.tolist(), placed.tolist())
        self._position, self._rotation = read_only(placed), read_only(turned)

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

        A frame knows where a tool is to be, not how it came there: one with friction turns by less than half a full
        turn a frame, the shorter way, and more is refused.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
        >>> tool.turn((0, 3.141592653589793, 0))
        >>> tool.rotation.round(3).diagonal().tolist()
        [-1.0, 1.0, -1.0]
        """
        angle = float(np.linalg.norm(vector(by, "the turn of a tool", "rad")))
        if self._tool.friction != 0.0 and angle >= HALF_TURN:
            raise VisceraError(
                f"a tool with friction turns by less than 180 degrees a frame, got {np.degrees(angle):.4g} degrees, of "
                "which a frame would know only where it ends; turn it in several frames"
            )
        self.place(rotation=self._turned_by(by))

    def remove(self) -> None:
        """Remove the tool with the next frame; once removed, it stays so.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
        >>> tool.move((0, 0, -0.01))
        >>> frame = stepper.frame()
        >>> tool.remove()
        >>> frame = stepper.frame()
        """
        self._is_there = False
        self._stepper._core.remove_tool(self._number)
        self._stepper._tools = [tool for tool in self._stepper._tools if tool is not self]
