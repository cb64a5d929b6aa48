"""Whether a stepped organ has come to rest: until then its forces are those of its motion, or still relax."""

from __future__ import annotations

import numpy as np

from viscera.stepping.frame import Frame
from viscera.viewer.memory import Memory

FADED = 1e-3
"""Size of the memory of tissue that has relaxed, as part of the displacement."""
STILL = FADED**2
"""Kinetic energy of an organ at rest, as part of the strain energy: a vibration of that part of the displacement."""
LULL = 20
"""Frames in a row that must be so still: where a vibration turns, one or a few are, too."""


class Rest:
    """Tells from frame to frame whether an organ is at rest; without inertia and relaxation it always is."""

    def __init__(self, has_inertia: bool, memory: Memory | None) -> None:
        """Of an organ with inertia or without, and what its tissue remembers; None where it does not relax."""
        self._has_inertia = has_inertia
        self._memory = memory
        self._energy = 0.0
        self._distance = 0.0
        self._frames = 0

    def note(self, frame: Frame, is_held: bool) -> None:
        """Takes account of a frame, in which hands hold the organ or not."""
        distance = float(np.linalg.norm(frame.displacement))
        # What nobody holds any more has come to rest by the measure of what it was when it was held.
        self._energy = frame.energy if is_held else max(self._energy, frame.energy)
        self._distance = distance if is_held else max(self._distance, distance)
        if self._memory is not None:
            self._memory.note(frame.displacement)
        self._frames = self._frames + 1 if frame.kinetic_energy <= STILL * self._energy else 0

    @property
    def takes_time(self) -> bool:
        """Whether frames that have settled may be followed by others."""
        return self._has_inertia or self._memory is not None

    @property
    def is_reached(self) -> bool:
        """Whether the organ is at rest after the last frame."""
        return not (self.moves or self.relaxes)

    @property
    def moves(self) -> bool:
        """Whether an organ with inertia still moves after the last frame."""
        return self._has_inertia and self._frames < LULL

    @property
    def relaxes(self) -> bool:
        """Whether the tissue remembers more after the last frame than rest allows."""
        return self._memory is not None and self._memory.size > FADED * self._distance
