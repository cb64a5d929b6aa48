"""What holds a place of an organ while a stepper goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from viscera.mesh import Floats
from viscera.select import Lengths, offset

if TYPE_CHECKING:
    from viscera.stepper import Stepper


class Hand:
    """A hand, or a pair of forceps, that holds a place of the organ: made by `Stepper.grasp`, ended by `release`.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> stepper = beam.stepper()
    >>> forceps = stepper.grasp("tip")
    >>> for _ in range(3):
    ...     forceps.move((0, 0, 0.001))
    ...     frame = stepper.frame()
    >>> forceps.release()
    >>> f"{1e3 * frame.displacement[:, 2].max():.1f} mm"
    '3.0 mm'
    """

    def __init__(self, stepper: Stepper, where: Any, displacement: Floats) -> None:
        self._stepper = stepper
        self._where = where
        self.displacement = displacement
        """Displacement from rest of what it holds [m]: (3,) of a patch, (k, 3) node by node; for the next frame."""

    def move(self, by: Lengths) -> None:
        """Move by (x, y, z) [m], or in words such as "2 mm", in the next frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> hand = stepper.grasp("tip")
        >>> hand.move("(0, 0, -1) mm")
        >>> stepper.frame().displacement[beam.mesh.sets["tip"], 2].round(6).min().item()
        -0.001
        """
        self.displacement = self.displacement + offset(by, self._stepper._organ.mesh, "motion of a hand")

    def release(self) -> None:
        """Let go in the next frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> hand = stepper.grasp("tip")
        >>> hand.move((0, 0, -0.001))
        >>> _ = stepper.frame()
        >>> hand.release()
        >>> frame = stepper.frame()
        >>> bool(abs(frame.displacement).max() < 1e-4)  # back at rest, except for the error of one iteration
        True
        """
        self._stepper._hands = [hand for hand in self._stepper._hands if hand is not self]
