"""Forceps: two rigid jaws with friction that close on the tissue between them, with one pose and one opening."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from viscera.contact.instrument import Instrument
from viscera.contact.posed import Posed
from viscera.contact.shapes import Box, Capsule, Sphere
from viscera.contact.tool import Contact
from viscera.errors import VisceraError
from viscera.mesh import Floats
from viscera.quantity import Number, refused, vector
from viscera.rotation import rotation_matrix
from viscera.sealed import Sealed, read_only
from viscera.select import length_in_space

if TYPE_CHECKING:
    from viscera.stepping.stepper import Stepper

EXACT = 0.01
"""Part of a grip force by which it may be missed before the jaws move."""
TELLING = 0.1
"""Part of the largest step of a squeeze that shows the stiffness of what is gripped."""
CAUTION = 0.7
"""Part of the step that the last stiffness suggests: tissue stiffens as it is squeezed."""
PATIENCE = 6
"""Frames in a row that have not settled after which jaws close on, if they are far from their force."""
FAR = 0.5
"""Part of a grip force that is missing where they are far from it."""
CLOSER = 0.1
"""Part of the largest step of a squeeze by which they then close."""


@dataclass(frozen=True, eq=False)
class JawForces(Sealed):
    """What forceps did in a frame: force (3,) [N] and torque (3,) [N m] about the origin on the organ, the force [N]
    with which the jaws press the tissue between them, and their opening [m]; whether the frame has settled."""

    force: Floats
    torque: Floats
    grip: float
    opening: float
    is_settled: bool


class Forceps(Posed):
    """Two jaws that face each other across an opening: made by `Stepper.forceps`, ended by `remove`.

    The jaws lie along the z axis of the forceps and close along its x axis, in the middle of which is its origin. They
    hold tissue by friction, so between flat jaws it slips if it is pulled by more than the coefficient times the forces
    of both, which is twice the grip unless something pushes the forceps aside. The jaws do not feel each other; with
    nothing between them they stop at an opening of zero, and the grip is zero. The pose is read-only, as that of an
    `Instrument`; a whole `position`, `rotation` or `opening` may be assigned.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> stepper = beam.stepper(iterations=20)
    >>> jaw = vs.Box((0.05, 0.1, 0.1), rounding=0.01)
    >>> forceps = stepper.forceps(jaw, (0.9, 0.1, 0.1), (0, 0, 1.5708), opening=0.21, friction=0.5)
    >>> forceps.squeeze(20.0, by=0.004)
    >>> for _ in range(12):
    ...     frame = stepper.frame()
    >>> frame.is_settled, f"{forceps.grip:.0f} N", f"{1e3 * forceps.opening:.0f} mm"
    (True, '20 N', '199 mm')
    """

    _WHAT = "forceps"

    def __init__(
        self,
        stepper: Stepper,
        jaw: Sphere | Capsule | Box,
        position: ArrayLike,
        rotation: ArrayLike | None,
        *,
        opening: float | str,
        friction: float | str,
    ) -> None:
        self._stepper = stepper
        self._half = half_thickness(jaw)
        self._position = read_only(vector(position, "the position of forceps", "m"))
        self._rotation = read_only(rotation_matrix(rotation, "the rotation of forceps"))
        self._opening = _opening(opening)
        self._squeeze: tuple[float, float] | None = None
        self._stiffness = 0.0
        self._told: JawForces | None = None
        self._answered: JawForces | None = None
        self._waited = 0
        self._is_there = True
        made: list[Instrument] = []
        try:
            for centre in self._centres(self.position, self.rotation, self.opening):
                made.append(stepper.tool(jaw, centre, self.rotation, friction=friction))
        except VisceraError:
            for jaw_made in made:
                jaw_made.remove()
            raise
        self.jaws: tuple[Instrument, Instrument] = (made[0], made[1])
        """The jaws on the sides of negative and positive x: tools, as for `Frame.contact`."""

    @property
    def opening(self) -> float:
        """Distance [m] between the jaws for the next frame; assigning one ends a squeeze."""
        return self._opening

    @opening.setter
    def opening(self, value: float | str) -> None:
        self._set(self.position, self.rotation, _opening(value))
        self._squeeze = None

    @property
    def grip(self) -> float:
        """Force [N] with which the jaws pressed the tissue between them in the last frame: the smaller of both.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=20)
        >>> forceps = stepper.forceps(vs.Sphere(0.05), (0.9, 0.1, 0.1), (0, 0, 1.5708), opening=0.21, friction=0.5)
        >>> frame = stepper.frame()
        >>> forceps.grip
        0.0
        """
        if self._told is None:
            raise VisceraError("the grip of forceps is that of the last frame; there is none since they were made")
        return self._told.grip

    def move(self, by: ArrayLike) -> None:
        """Move both jaws on by (x, y, z) [m] with the next frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> forceps = stepper.forceps(vs.Sphere(0.05), (0.9, 0.1, 0.1), (0, 0, 1.5708), opening=0.3)
        >>> forceps.move((0.02, 0, 0))
        >>> forceps.position.round(3).tolist()
        [0.92, 0.1, 0.1]
        """
        self.place(self.position + vector(by, "the motion of forceps", "m"))

    def turn(self, by: ArrayLike) -> None:
        """Turn both jaws on about the origin by a rotation vector (3,) [rad], in axes of the world, in the next frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> forceps = stepper.forceps(vs.Sphere(0.05), (0.9, 0.1, 0.1), (0, 0, 1.5708), opening=0.3)
        >>> forceps.turn((0, 0, 1.5708))
        >>> forceps.rotation.round(3).diagonal().tolist()
        [-1.0, -1.0, 1.0]
        """
        self.place(rotation=self._turned_by(by))

    def place(self, position: ArrayLike | None = None, rotation: ArrayLike | None = None) -> None:
        """Set the pose for the next frame: a position (3,) [m], a rotation matrix (3, 3) or vector (3,) [rad].

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> forceps = stepper.forceps(vs.Sphere(0.05), (0.9, 0.1, 0.1), (0, 0, 1.5708), opening=0.3)
        >>> forceps.place((0.8, 0.1, 0.1), rotation=(0, 0, 1.5707963267948966))
        >>> [jaw.position.round(3).tolist() for jaw in forceps.jaws]
        [[0.8, -0.1, 0.1], [0.8, 0.3, 0.1]]
        """
        self._set(self._placed(position), self._turned(rotation), self.opening)

    def open(self, by: float | str) -> None:
        """Open by a length [m], or in words such as "2 mm", with the next frame; ends a squeeze.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> forceps = stepper.forceps(vs.Sphere(0.05), (0.9, 0.1, 0.1), (0, 0, 1.5708), opening=0.3)
        >>> forceps.open("1 cm")
        >>> round(forceps.opening, 3)
        0.31
        """
        self.opening += _step(by, "forceps open by")

    def close(self, by: float | str) -> None:
        """Close by a length [m], or in words such as "2 mm", with the next frame, until the jaws meet; ends a squeeze.

        The jaws close however large their force becomes. To limit it, use `squeeze`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> forceps = stepper.forceps(vs.Sphere(0.05), position=(1.2, 0.1, 0.1), opening=0.01)
        >>> forceps.close("1 cm")
        >>> forceps.close("1 cm")  # nothing is left to close
        >>> forceps.opening
        0.0
        """
        self.opening = max(self.opening - _step(by, "forceps close by"), 0.0)

    def squeeze(self, force: float, by: float | str) -> None:
        """Close by at most `by` [m] a frame until the jaws press with a force [N], and keep this force, until `open` or
        `close`.

        Between frames the opening follows the force, by the stiffness that the last frames have shown, towards
        `|grip - force| <= 0.01 force`. The first frames of contact may press by as much more as `by` adds. A frame that
        has not settled changes nothing; after six in a row, with less than half the force, the jaws close by a tenth of
        `by`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=20)
        >>> forceps = stepper.forceps(vs.Sphere(0.05), (0.9, 0.1, 0.1), (0, 0, 1.5708), opening=0.21, friction=0.5)
        >>> forceps.squeeze(5.0, by="3 mm")
        >>> for _ in range(12):
        ...     frame = stepper.frame()
        >>> f"{frame.grip(forceps):.1f} N"
        '5.0 N'
        """
        self._must_be_there()
        what = "the largest step of a squeeze"
        step = Number("m", above=0.0)(length_in_space(by, what), what)
        self._squeeze = Number("N", above=0.0)(force, "the force of a squeeze"), step

    def remove(self) -> None:
        """Remove both jaws with the next frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> forceps = stepper.forceps(vs.Sphere(0.05), (0.9, 0.1, 0.1), (0, 0, 1.5708), opening=0.3)
        >>> forceps.remove()
        >>> frame = stepper.frame()
        """
        self._must_be_there()
        self._is_there = False
        for jaw in self.jaws:
            jaw.remove()
        self._stepper._forceps = [forceps for forceps in self._stepper._forceps if forceps is not self]

    def _must_be_there(self) -> None:
        if not self._is_there:
            raise VisceraError("these forceps were removed; make new ones by Stepper.forceps")

    def _centres(self, position: Floats, rotation: Floats, opening: float) -> tuple[Floats, Floats]:
        """Origins of the jaws (3,) [m]."""
        aside = (0.5 * opening + self._half) * rotation[:, 0]
        return position - aside, position + aside

    def _set(self, position: Floats, rotation: Floats, opening: float) -> None:
        self._must_be_there()
        self._must_be_whole()
        for jaw, centre in zip(self.jaws, self._centres(position, rotation, opening), strict=True):
            jaw.place(centre, rotation)
        self._position, self._rotation, self._opening = read_only(position), read_only(rotation), opening

    def _must_be_whole(self) -> None:
        if not all(jaw in self._stepper._tools for jaw in self.jaws):
            raise VisceraError("a jaw of forceps was removed by itself; call remove() of the forceps")

    def _adjust(self) -> None:
        """Before a frame: the opening that brings the grip nearer to the force asked for."""
        # Once for each grip that was told: a frame that broke off has told nothing, and the jaws have moved already.
        if self._squeeze is None or self._told is None or self._told is self._answered:
            return
        force, by = self._squeeze
        missing = force - self._told.grip
        if abs(missing) <= EXACT * force:
            return
        step = by if missing > 0.0 else -by
        if not self._told.is_settled:
            # Flat jaws that just touch may rub without end where they are; a little closer they do not.
            if self._waited < PATIENCE or missing < FAR * force:
                return
            step = CLOSER * by
        elif self._stiffness > 0.0:
            step = float(np.clip(CAUTION * missing / self._stiffness, -by, by))
        self._answered, self._waited = self._told, 0
        self._set(self.position, self.rotation, max(self.opening - step, 0.0))

    def _learn(self, last: JawForces) -> None:
        """The stiffness [N/m] of what is gripped, from two frames that differ enough in their opening."""
        now = self._told
        if self._squeeze is None or now is None or not (now.is_settled and last.is_settled and now.grip > 0.0):
            return
        closed = last.opening - now.opening
        if abs(closed) >= TELLING * self._squeeze[1]:
            self._stiffness = max((now.grip - last.grip) / closed, 0.5 * self._stiffness)

    def _feel(self, felt: list[Contact], is_settled: bool) -> JawForces:
        """What the jaws did together."""
        axis = self.rotation[:, 0]
        arms = [jaw.position - self.position for jaw in self.jaws]
        torques = [one.torque + np.cross(arm, one.force) for one, arm in zip(felt, arms, strict=True)]
        pressed = min(float(felt[0].force @ axis), float(-felt[1].force @ axis))
        last = self._told
        self._waited = 0 if is_settled else self._waited + 1
        force, torque = felt[0].force + felt[1].force, torques[0] + torques[1]
        self._told = JawForces(force, torque, max(pressed, 0.0), self.opening, is_settled)
        if last is not None:
            self._learn(last)
        return self._told


def half_thickness(jaw: Sphere | Capsule | Box) -> float:
    """Half the extent [m] of a jaw along x; refuses shapes that are no jaws."""
    if isinstance(jaw, Box):
        return 0.5 * jaw.sides[0]
    if isinstance(jaw, Sphere | Capsule):
        return jaw.radius
    raise refused("the jaw of forceps", "a Sphere, Capsule or Box", jaw)


def _opening(value: float | str) -> float:
    return Number("m", low=0.0)(length_in_space(value, "the opening of forceps"), "the opening of forceps")


def _step(by: float | str, what: str) -> float:
    return Number("m", low=0.0)(length_in_space(by, what), what)
