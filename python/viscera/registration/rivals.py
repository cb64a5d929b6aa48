"""Other poses in which an organ fits what was measured as well: an organ that looks alike from several sides.

A fit ends in the pose nearest to its start, and its covariance knows no other. So the fit with the tangent at rest is
begun from other poses, and followed to the end where it explains the points about as well. The evidence of both ends
(causes.py) says whether the data tell them apart.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from viscera.mesh import Floats
from viscera.registration.equations import Iterate
from viscera.registration.onecause import OneCause
from viscera.registration.rigid import Rigid, Shape, aligned, turned
from viscera.registration.smooth import Smooth

N_BEGUN, N_FOLLOWED = 4, 2
"""Poses that are tried with the tangent at rest, and that are followed; at most."""
NEAR = 1.25
"""Cost with the tangent at rest, over that of the pose that was followed, up to which another is followed too."""
CERTAIN = 3.0
"""Difference of log evidence from which data tell two poses apart: the other one has 5 % of the probability."""


class Rivals:
    """The poses beside that in which a fit has ended."""

    def __init__(self, smooth: Smooth, one_cause: OneCause, follow: Callable[[Iterate], tuple[Iterate, str]]) -> None:
        """follow: a fit with the tangent at rest to its end, and what went wrong in words."""
        self.smooth, self.one_cause, self.follow = smooth, one_cause, follow
        self.equations = smooth.equations
        self.points = self.equations.organ.mesh.points

    def told_apart(
        self, end: Iterate, begun: list[Iterate], band: Floats, observed: NDArray[np.bool_]
    ) -> tuple[Iterate, list[Iterate]]:
        """The pose to believe, and those that fit as well: of all, the one that turns the organ least is believed.

        end: of the fit, with its band (n,) [m] and what is observed (n,); begun: the fits with the tangent at rest of
        which it was the first.
        """
        others, first = self._others(end, begun), self.place(begun[0])
        ends, doubted = [end], ~observed
        for _ in range(N_FOLLOWED):
            is_far = [(_gap(self.place(other), first) > band) & ~doubted for other in others]
            if not any(far.any() for far in is_far):
                break
            other, message = self.follow(others.pop(int(np.argmax([far.sum() for far in is_far]))))
            if not message:
                ends.append(other)
                doubted |= _gap(self.place(other), self.place(end)) > band
        if len(ends) == 1:
            return end, []
        logs = np.array([self.one_cause.evidence(other) for other in ends])
        alike = [ends[k] for k in np.flatnonzero(logs > logs.max() - CERTAIN)]
        best = max(alike, key=lambda other: float(np.trace(self._rigid(other).rotation)))
        return best, [other for other in alike if other is not best]

    def place(self, at: Iterate) -> Floats:
        """Nodes (n, 3) [m] in the axes of the measured points."""
        return at.motion(self.points + at.displacement)

    def _others(self, end: Iterate, begun: list[Iterate]) -> list[Iterate]:
        """Fits with the tangent at rest from other poses, which explain the points about as well as the first."""
        shape = Shape(self.points, self.equations.visible)
        motions = turned(shape, self.equations.seen, self._rigid(end))[:N_BEGUN]
        every, most = (*begun[1:], *map(self.smooth.begun, motions)), NEAR * self._cost(begun[0])
        return [other for other in every if self._cost(other) < most]

    def _cost(self, at: Iterate) -> float:
        """By one measure for all: `at.cost` tells outliers by a width that depends on how soon a fit has ended."""
        _, residual, weight, _ = self.equations.at(at, at.responses, 2.0 * self.equations.seen.noise)
        forces = float(at.amplitudes @ at.prior @ at.amplitudes)
        return float(weight @ residual**2) + forces + self.equations.missed(weight, at.doubt)

    def _rigid(self, at: Iterate) -> Rigid:
        return aligned(self.points, self.place(at), np.ones(len(self.points)))


def _gap(one: Floats, other: Floats) -> Floats:
    return np.asarray(np.linalg.norm(one - other, axis=1))
