"""The answer of a reduced model to one touch: force, stiffness, field, error estimates, and whether it is trusted."""

from __future__ import annotations

import warnings
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera.boundary.ties import Tied, Ties
from viscera.mesh import Floats, Indices, Where
from viscera.reduced.carried import Touched, spread
from viscera.reduced.parts import Target, target
from viscera.reduced.shape import ReducedShape
from viscera.sealed import read_only

if TYPE_CHECKING:
    from viscera.boundary.bond import Bond
    from viscera.reduced.touch import Touch

UNCERTAIN = 0.1
"""Estimated error of the force of a support, relative to it, above which a warning tells it."""


class Answer(ReducedShape):
    """The answer of a reduced model to a touch: force, stiffness, displacement and error estimates.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> touch = beam.reduce("tip", depth="2%", order=2)
    >>> answer = touch((1, 0.1, 0.1), displacement=(0, 0, -0.01))
    >>> answer.is_trusted, answer.force.round(3).tolist()
    (True, [0.242, -0.034, -0.498])
    >>> f"{1e3 * answer.max_displacement:.1f} mm"
    '10.1 mm'
    """

    def __init__(self, model: Touch, point: Floats, displacement: Floats, result: dict[str, Any]) -> None:
        self._model, self._touch = model, (point, displacement)
        self.force: Floats = read_only(result["force"])
        """Force (3,) [N] of the tool on the organ."""
        self.stiffness: Floats = read_only(result["stiffness"])
        """Derivative (3, 3) [N/m] of `force` with respect to the contact displacement.

        It is exact for the model, whose force is nearly that of the organ. Its own error is larger than that of the
        force, and not estimated. Of a Padé form it need not be symmetric; an integrator that needs this takes
        `(stiffness + stiffness.T) / 2`.
        """
        self.error_estimate: float = result["error_estimate"]
        """Estimated error of the force, relative to its norm; at most 1."""
        self.is_trusted: bool = result["is_trusted"]
        """Whether the force may be relied on; the error of the stiffness, its derivative, is not estimated."""
        self.reason: str = result["reason"]
        """Why the force is not trusted; empty if it is."""
        self.shape_error_estimate: float = result["shape_error_estimate"]
        """Estimated error of the displacement field, relative to its norm; at most 1.

        It is at least the error of the force, and includes the loss by compression, which does not affect the force.
        """
        self.is_shape_trusted: bool = result["is_shape_trusted"]
        """Whether the displacement may be relied on."""
        self.shape_reason: str = result["shape_reason"]
        """Why the displacement is not trusted; empty if it is."""
        self.contact_point: Floats = read_only(result["contact_point"])
        """The point (3,) [m] of the touchable surface that is touched."""

    @cached_property
    def displacement(self) -> Floats:
        """Displacement of all nodes (n, 3) [m], evaluated on first access: a haptic loop needs only the force."""
        return read_only(self._model._model.evaluate(*self._touch, True)["displacement"])

    @cached_property
    def energy(self) -> float:
        """Energy [J] that the touch has put into the organ: W = int_0^1 F(t d) . d dt, the work of the tool's force.

        It is stored in the tissue and its elastic supports; under a preload also in the dead load. Its error is of the
        size of that of the force (`error_estimate`).

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> answer = touch((1, 0.1, 0.1), displacement=(0, 0, -0.01))
        >>> stored = answer.energy_density() @ touch.mesh.facts["cell_volumes"]
        >>> f"{1e3 * answer.energy:.2f} mJ, {1e3 * stored:.2f} mJ in the tissue"
        '2.49 mJ, 2.49 mJ in the tissue'
        """
        return self._model._model.energy(*self._touch)

    def _touched(self) -> Indices:
        return self._model.patch(self.contact_point).nodes

    def _solved(self) -> str:
        return "touch.organ().solve(displacement={touch.patch(point): d})"

    def support_force(self, support: Tied | Bond) -> Floats:
        """Total force (3,) [N] of an elastic support on the organ; of a bond, on its first organ.

        By what the spring says of the displacement, or by the balance of what it holds, whichever is the more certain
        (`viscera.reduced.carried`). It is as exact as `force` for what alone holds an organ. Elsewhere a warning tells
        its estimated error, where that is above 10 %.

        >>> import viscera as vs
        >>> base = vs.ElasticSupport("clamp", stiffness=1e9)
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), supports=[base])
        >>> answer = beam.reduce("tip", depth="2%", order=2)((1, 0.1, 0.1), displacement=(0, 0, -0.01))
        >>> bool(abs(answer.support_force(base) + answer.force).max() < 1e-9)
        True
        """
        return super().support_force(support)

    def _carried(self, support: Tied | Bond, its: list[Ties]) -> Floats:
        organ, displacement = self._from_rest()
        if isinstance(support, Ties):  # all of a model, of which bonds add nothing
            its = [ties.grounded() for ties in its]
        patch = self._model.patch(self.contact_point)
        load = spread(patch.nodes, patch.weights, self.force, len(displacement))
        errors = (self.error_estimate, self.shape_error_estimate)
        touched = Touched(organ, displacement, displacement - self.displacement, load, errors)
        carried = [touched.carried(ties) for ties in its if len(ties)]
        force = sum((each for each, _ in carried), np.zeros(3))
        error, size = sum(error for _, error in carried), float(np.linalg.norm(force))
        if error > UNCERTAIN * size:
            told = f"{100.0 * error / size:.0f} %" if error < size else "larger than the force"
            warnings.warn(
                f"the estimated error of the force of {support!r} is {told}: fixed nodes or other supports hold the "
                "same part, and displacements are not known well enough for its stiffness; solve for it, as in "
                f"{self._solved()}",
                stacklevel=4,
            )
        return np.asarray(force)

    def target(self, where: Where) -> Target:
        """How far a part of the organ moves: a cell set by name, such as a tumour, or any cells as in `Mesh.cells_in`.

        It is the mean displacement of the surface of these cells, by area, with a band that contains that of the full
        solution in 95 of 100 touches; see `Target`.

        >>> import viscera as vs
        >>> mesh = vs.organs.beam().with_cell_sets(core="x > 70% and x < 80%")
        >>> beam = vs.Organ(mesh, vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> target = touch((1, 0.1, 0.1), (0, 0, -0.01)).target("core")
        >>> 0 < target.band < 0.01 * target.distance
        True
        """
        mesh, surface = self._model.mesh, self._model.surface_nodes
        trust = (self.shape_error_estimate, self.is_shape_trusted)
        return target(mesh, mesh.cells_in(where), self.displacement, surface, *trust)

    @property
    def max_displacement(self) -> float:
        """Largest displacement of a node [m]."""
        return float(np.linalg.norm(self.displacement, axis=1).max())

    def __repr__(self) -> str:
        if self.is_trusted and not self.is_shape_trusted:
            trust = f"trusted; its shape is not: {self.shape_reason}"
        else:
            trust = "trusted" if self.is_trusted else f"not trusted: {self.reason}"
        return f"Answer(force={np.round(self.force, 4).tolist()} N, {trust})"
