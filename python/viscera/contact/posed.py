"""What is moved and turned from frame to frame: tools, forceps and hands have a place and a rotation."""

from __future__ import annotations

from abc import ABC, abstractmethod

from numpy.typing import ArrayLike

from viscera.mesh import Floats
from viscera.quantity import vector
from viscera.rotation import rotation_matrix


class Posed(ABC):
    """A pose for the next frame: a position and a rotation, which subclasses take to the stepper in `place`."""

    _WHAT: str
    """What it is, in messages."""
    _position: Floats
    _rotation: Floats

    @property
    def position(self) -> Floats:
        """Position (3,) [m] for the next frame; assigning one is `place`."""
        return self._position

    @position.setter
    def position(self, value: ArrayLike) -> None:
        self.place(position=vector(value, f"the position of {self._WHAT}", "m"))

    @property
    def rotation(self) -> Floats:
        """Rotation matrix (3, 3) for the next frame; assigning one is `place`."""
        return self._rotation

    @rotation.setter
    def rotation(self, value: ArrayLike | None) -> None:
        self.place(rotation=rotation_matrix(value, f"the rotation of {self._WHAT}"))

    @abstractmethod
    def place(self, position: ArrayLike | None = None, rotation: ArrayLike | None = None) -> None:
        """Set the pose for the next frame."""

    def _placed(self, position: ArrayLike | None) -> Floats:
        """The position that is asked for, or that of now."""
        return self._position if position is None else vector(position, f"the position of {self._WHAT}", "m")

    def _turned(self, rotation: ArrayLike | None) -> Floats:
        """The rotation that is asked for, or that of now."""
        return self._rotation if rotation is None else rotation_matrix(rotation, f"the rotation of {self._WHAT}")

    def _turned_by(self, turn: ArrayLike) -> Floats:
        """The rotation of now, turned on by a rotation vector (3,) [rad] in axes of the world."""
        return rotation_matrix(vector(turn, f"the turn of {self._WHAT}", "rad")) @ self._rotation
