"""Whether the sliding bonds of a scene still do what they are for, looked for while it is stepped."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from viscera.mesh import Floats

if TYPE_CHECKING:
    from viscera.organ import Organ

EVERY = 25
"""Frames from one look to the next: it takes part of a frame."""


class BondWatch:
    """Warns once, when the surfaces of sliding bonds have turned."""

    def __init__(self, organ: Organ) -> None:
        self._organ = organ
        self._frames = 0
        self._has_warned = False

    def look(self, displacement: Floats) -> None:
        """After a frame with this displacement (n, 3) [m]."""
        is_due = self._frames % EVERY == 0 and not self._has_warned
        self._frames += 1
        if is_due and (told := self._organ._doubt_of_bonds(displacement)):
            self._has_warned = True
            warnings.warn(told, stacklevel=3)
