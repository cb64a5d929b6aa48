"""The shape of an organ as a reduced model answers it, and what its stress is worth."""

from __future__ import annotations

import warnings
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from viscera.deformed import Deformed
from viscera.mesh import Floats, Indices, Mesh

if TYPE_CHECKING:
    from viscera.organ import Organ
    from viscera.reduced.touch import Touch

UNBALANCED = 0.15
"""Part of stress that may be unbalanced."""


class ReducedShape(Deformed):
    """The deformed organ of any answer of a reduced model: of one touch, of several, or of a probe."""

    _model: Touch

    @cached_property
    def displacement(self) -> Floats:
        """Displacement of all nodes (n, 3) [m], evaluated on first access: a haptic loop needs only the force."""
        raise NotImplementedError

    def _touched(self) -> Indices:
        """The nodes whose force the touch carries."""
        raise NotImplementedError

    def _solved(self) -> str:
        """The program that solves the full organ for this answer."""
        raise NotImplementedError

    @cached_property
    def stress_error_estimate(self) -> float:
        """Estimated error of stress and pressure, relative to their norm: what they leave unbalanced; hardly above 1.

        (sum_n |f_n(u) - f_n(u_0)|^2)^1/2 / (sum_c,a |V_c P_c grad N_a|^2)^1/2: the nodal forces of the touch over nodes
        that are neither held nor touched, and those of every cell alone on its corners; u_0 is the preload. In nearly
        incompressible tissue pressure feels errors of the displacement that force, shape and von Mises stress do not.
        Above 0.15 `stress`, `pressure` and `write` warn. Infinite where the law has no stress, as in a cell that is
        inside out.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> answer = beam.reduce("tip", depth="2%", order=2)((1, 0.1, 0.1), displacement=(0, 0, -0.01))
        >>> 0 < answer.stress_error_estimate < 0.1
        True
        """
        organ, displacement = self._from_rest()
        before = displacement - self.displacement
        forces = [organ._body.internal_force(np.ascontiguousarray(u)).reshape(-1, 3) for u in (displacement, before)]
        left = forces[0] - forces[1]
        left[organ.fixed] = 0.0
        left[self._touched()] = 0.0
        size = float(np.linalg.norm(self._response.corner_forces()))
        if not np.isfinite(size) or not np.isfinite(left).all():
            return np.inf
        return float(np.linalg.norm(left)) / size if size > 0.0 else 0.0

    def _expect_stress(self) -> None:
        if self.stress_error_estimate > UNBALANCED:
            warnings.warn(
                f"the stress of this answer is not balanced, by {100 * self.stress_error_estimate:.0f} % of its norm, "
                "so its pressure is not to be relied on: in nearly incompressible tissue it feels errors that force, "
                f"shape and von Mises stress do not; solve for it, as in {self._solved()}",
                stacklevel=3,
            )

    def _expect_deviatoric_stress(self) -> None:
        pass

    def _seen(self) -> tuple[Mesh, Floats]:
        return self._model.mesh, self.displacement

    def _from_rest(self) -> tuple[Organ, Floats]:
        return self._model._whole(self.displacement)
