"""What tissue that relaxes still remembers of how it came to its shape: as long as that fades, its forces change."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viscera.mesh import Floats


class Memory:
    """Displacements that the terms of a `Prony` remember, fields h (n, 3) [m], one for each g, tau.

    With x = time_step / tau, a frame that ends at the displacement u takes them to
        h <- exp(-x) h + (1 - exp(-x)) / x (u - u before),
    as the stepper takes the stresses in its cells (docs/real-time.md): exactly so for stresses that are linear in u. Of
    what a shape takes to hold, sum g h / (1 - sum g) in the place of u is what still fades.
    """

    def __init__(self, g: Sequence[float], tau: Sequence[float], time_step: float, displacement: Floats) -> None:
        """Of tissue that has just come to a displacement (n, 3) [m], in frames of a time step [s]."""
        self._g = np.asarray(g, float)
        x = time_step / np.asarray(tau, float)
        self._decay, self._mean = np.exp(-x), -np.expm1(-x) / x
        self._last = displacement
        self._fields = np.tile(displacement, (len(self._g), 1, 1))

    def note(self, displacement: Floats) -> None:
        """Takes account of a frame by its displacement (n, 3) [m]."""
        change = displacement - self._last
        self._fields = self._decay[:, None, None] * self._fields + self._mean[:, None, None] * change
        self._last = displacement

    @property
    def size(self) -> float:
        """Norm of the displacement [m] whose force still fades, beside that of the present one."""
        return float(np.linalg.norm(np.tensordot(self._g, self._fields, 1))) / (1.0 - float(self._g.sum()))
