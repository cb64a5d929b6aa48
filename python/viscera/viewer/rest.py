"""Whether an organ that is stepped with inertia has come to rest: until then its forces are those of its motion."""

from __future__ import annotations

from viscera.stepping.frame import Frame

STILL = 1e-6
"""Kinetic energy of an organ at rest, as part of the strain energy: a vibration of a thousandth of the displacement."""
LULL = 20
"""Frames in a row that must be so still: where a vibration turns, one or a few are, too."""


class Rest:
    """Tells from frame to frame whether an organ is at rest; without inertia it always is."""

    def __init__(self, has_inertia: bool) -> None:
        self.has_inertia = has_inertia
        self._energy = 0.0
        self._frames = 0

    def note(self, frame: Frame, is_held: bool) -> None:
        """Takes account of a frame, in which hands hold the organ or not."""
        if is_held:
            # What nobody holds any more has come to rest by the measure of what it was when it was held.
            self._energy = frame.energy
        self._frames = self._frames + 1 if frame.kinetic_energy <= STILL * self._energy else 0

    @property
    def is_reached(self) -> bool:
        """Whether the organ is at rest after the last frame."""
        return not self.has_inertia or self._frames >= LULL
