"""The fit with one cause beside small smooth forces, under forces that turn with the organ.

Each step linearises about a state near equilibrium: displacement u, amplitudes a, forces r that are left. With U the
responses to forces that turn with the organ, u + K^-1 r + U (a' - a) is the next state for any amplitudes a'. The
measured points say which (causes.py). A few iterations of Newton's method take the curvature out.

An organ that is pressed towards its fixed nodes resists some motions hardly, or falls over: at given forces Newton's
method would go far in these. It is held where the points want it, and the forces change by as little as that takes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from viscera.mesh import Floats
from viscera.registration.causes import SIZES, SMALL, SMALL_VOLUME, Causes, Weighing
from viscera.registration.equations import (
    CALMER,
    DOUBT,
    FARTHEST,
    SETTLED,
    STILL,
    SURE,
    TRUST,
    Equations,
    Iterate,
)
from viscera.registration.rigid import Rigid, aligned, turns_of, vector_of, without_rigid

STEPS = 15
"""At most."""
RENEWED = 4
"""Closest points renewed at most so often in a step."""
PARTS = (1.0, 0.5, 0.25, 0.125)
"""Of a step that are tried."""
FREE_SWING = 0.5
"""Standard deviation of the organ's turn about each axis by forces, against its fixed nodes [rad]."""
TURN = 0.3
"""Largest such turn in a step."""
NEAR_BALANCE, BALANCED, IN_BALANCE = 0.1, 1e-2, 1e-5
"""Forces that are left, over all forces, after a step, where steps end, and in the end; at most."""
POLISH, LEAST = 8, 1e-7
"""Iterations in the end at most, and what they aim at."""
SHORT = 1.0
"""Motion of the surface in the last step at most, over its standard deviation."""
CALM = 2
"""Steps in a row that must be short: the points may say something else once they are trusted."""
STEERED = 12
"""Motions in which the organ is held."""


@dataclass(eq=False)
class Tangent:
    """A state near equilibrium, and what small changes of the amplitudes make of it."""

    displacement: Floats
    amplitudes: Floats
    whole: Floats
    """Responses (n, 3, m) with the turn against the fixed nodes."""
    responses: Floats
    """The same without rigid motions."""
    drift: Floats
    """Motion (n, 3) [m] to equilibrium if no amplitude changes."""
    own_drift: Floats
    """The same without its rigid part."""
    turns: Floats
    """Of the organ (3, m) by unit amplitudes."""
    turn: Floats
    """Of the organ (3,) [rad] after the drift."""
    drifted: Floats
    """The part (3,) of it that the drift is."""


class OneCause:
    """One cause beside small smooth forces, believed by evidence."""

    def __init__(self, equations: Equations, metrics: list[Floats]) -> None:
        """metrics: of the forces on the organ at rest."""
        self.equations, self.forces, self.size = equations, equations.forces, equations.size
        self.points = equations.organ.mesh.points
        self.ones = np.ones(len(self.points))
        self.causes = Causes(self.forces, self.forces.loaded)
        sizes = [np.array([small, SMALL_VOLUME]) * self.size for small in SMALL]
        self.priors = [equations.prior(metrics, size) for size in sizes]

    def followed(self, motion: Rigid, tell: Callable[[], None]) -> tuple[Iterate, str]:
        """The equilibrium that steps from rest lead to, and what went wrong in words."""
        at = Iterate(
            motion,
            np.zeros(len(self.forces)),
            np.zeros_like(self.points),
            np.empty(0),
            trust=TRUST * self.size,
            doubt=DOUBT / CALMER,
        )
        calm = 0
        for _ in range(STEPS):
            tangent = self._tangent(at)
            net = self._step(at, tangent)
            left = self._move(at, tangent, net)
            if left is None:
                at.is_lost = True
                return at, "no equilibrium was found near what the next step says, however short"
            tell()
            calm = calm + 1 if self._is_settled(at, left) else 0
            if calm == CALM:
                return at, self._polish(at)
            at.doubt = max(SURE, at.doubt / CALMER)
        unsettled = f"{STEPS} steps are not enough: the last was longer than what is believed, or shortened"
        return at, self._polish(at) or unsettled

    def _is_settled(self, at: Iterate, left: float) -> bool:
        is_short = at.length < SHORT and not at.is_cut
        return is_short and at.change < SETTLED * self.size and at.doubt <= SURE and left < BALANCED

    def _tangent(self, at: Iterate) -> Tangent:
        u, a = at.displacement, at.amplitudes
        x = self.points + u
        every = self.forces.responses(u, self.forces.left(u, a)[None])
        every = self.forces.following(every, a, turns_of(every, self.points, x))
        turns, own = turns_of(every, self.points, x), without_rigid(every, x)
        before = vector_of(aligned(self.points, x, self.ones).rotation)
        return Tangent(
            u,
            a,
            every[:, :, :-1],
            own[:, :, :-1],
            every[:, :, -1],
            own[:, :, -1],
            turns[:, :-1],
            before + turns[:, -1],
            turns[:, -1],
        )

    def _step(self, at: Iterate, tangent: Tangent) -> Floats:
        """What the points say with this tangent, shortened to where it is believed; the part of it that is left."""
        equations, responses = self.equations, tangent.responses
        x = self.points + tangent.displacement
        known, motions = equations.n_known, equations.motions(responses, x)
        weighing, scale = self._weighing(x, responses), 2.0 * equations.seen.noise
        self._place(at, tangent)
        for _ in range(RENEWED):
            mean, covariance, scatter, _ = self._believed(at, tangent, weighing, scale)
            at.covariance = covariance[:known, :known]
            largest = equations.advance(at, mean - equations.unknowns(at), motions)
            self._place(at, tangent)
            scale = equations.narrowed(scale, scatter)
            if largest < STILL * self.size:
                break
        at.prior, at.responses = self.priors[-1][6:known, 6:known], responses
        root = np.linalg.cholesky(0.5 * (at.covariance + at.covariance.T))
        net = (at.displacement - tangent.displacement)[equations.sample]
        at.length = float(np.linalg.norm(net) / np.linalg.norm(motions[:, :known] @ root))
        return self._shortened(at, tangent)

    def _weighing(self, x: Floats, responses: Floats) -> Weighing:
        return Weighing(self.priors, self.causes.at(x, responses), [size * self.size for size in SIZES])

    def _believed(
        self, at: Iterate, tangent: Tangent, weighing: Weighing, scale: float, *, is_faced: bool = False
    ) -> tuple[Floats, Floats, float, float]:
        """Mean (p,) and covariance (p, p) of all unknowns over the causes, scatter of the cloud [m], log evidence."""
        equations = self.equations
        rows, residual, weight, scatter = equations.at(at, tangent.responses, scale, is_faced=is_faced)
        missed = equations.missed(weight, at.doubt)
        turn = tangent.turn + tangent.turns @ (at.amplitudes - tangent.amplitudes)
        held = equations.held(tangent.turns, turn, FREE_SWING)
        rows, residual, weight = map(np.concatenate, zip((rows, residual, weight), held, strict=True))
        whole = residual + rows @ equations.unknowns(at)
        data, right = (rows * weight[:, None]).T @ rows, rows.T @ (weight * whole)
        mean, covariance, log = weighing.believed(data, right)
        return mean, covariance, scatter, log - 0.5 * (float(weight @ whole**2) + missed)

    def tell(self, at: Iterate) -> None:
        """What is known where the fit ended, by what of the cloud says where along the organ it lies (normals.py)."""
        tangent = self._tangent(at)
        at.covariance, at.responses = self._known(at, tangent, is_faced=True)[0], tangent.responses

    def evidence(self, at: Iterate) -> float:
        """Logarithm of the probability of the data where a fit ended, up to a number that all poses have in common."""
        return self._known(at, self._tangent(at), is_faced=False)[1]

    def _known(self, at: Iterate, tangent: Tangent, *, is_faced: bool) -> tuple[Floats, float]:
        """Covariance of rigid motion and forces, and the log evidence."""
        known, scale = self.equations.n_known, 2.0 * self.equations.seen.noise
        weighing = self._weighing(self.points + at.displacement, tangent.responses)
        _, covariance, _, log = self._believed(at, tangent, weighing, scale, is_faced=is_faced)
        return covariance[:known, :known], log

    def _place(self, at: Iterate, tangent: Tangent) -> None:
        """Where the tangent says that the organ is, rigid motion apart."""
        drifted = tangent.displacement + tangent.own_drift
        at.displacement = drifted + tangent.responses @ (at.amplitudes - tangent.amplitudes)

    def _shortened(self, at: Iterate, tangent: Tangent) -> Floats:
        """Shorten the step to what is trusted; the motion (n, 3) that is left of it, with its turn."""
        forward, net = at.amplitudes - tangent.amplitudes, at.displacement - tangent.displacement
        moved = float(np.linalg.norm(net, axis=1).max())
        turned = float(np.linalg.norm(tangent.drifted + tangent.turns @ forward))
        cut = min(1.0, at.trust / max(moved, 1e-12), TURN / max(turned, 1e-12))
        at.is_cut, at.left = cut < 1.0, moved
        at.amplitudes, at.displacement = tangent.amplitudes + cut * forward, tangent.displacement + cut * net
        return np.asarray(cut * (tangent.drift + tangent.whole @ forward))

    def _move(self, at: Iterate, tangent: Tangent, whole: Floats) -> float | None:
        """A state near equilibrium where the step leads, or a part of it; the forces left, over all forces."""
        forward, net = at.amplitudes - tangent.amplitudes, at.displacement - tangent.displacement
        farthest = float(np.linalg.norm(net, axis=1).max())
        steer = self._steer(at)
        for part in PARTS:
            start, predicted = tangent.displacement + part * whole, self.points + tangent.displacement + part * net
            goal = aligned(predicted, self.points + start, self.ones)(predicted) - self.points
            u, amplitudes, left = self.forces.equilibrium(
                tangent.amplitudes + part * forward, start, tangent.displacement, goal, steer
            )
            back = aligned(self.points + u, predicted, self.ones)
            at.change = float(np.linalg.norm(back(self.points + u) - predicted, axis=1).max())
            if left < NEAR_BALANCE and at.change < FARTHEST * self.size:
                at.step_to(u, amplitudes, back)
                at.is_cut = at.is_cut or part < 1.0
                at.believe(part, farthest, self.size)
                return left
        at.displacement, at.amplitudes = tangent.displacement, tangent.amplitudes
        return None

    def _steer(self, at: Iterate) -> Floats:
        """Amplitudes (m, k) of one standard deviation each that move the organ most, given what was measured."""
        covariance = at.covariance[6:, 6:]
        root = np.linalg.cholesky(covariance + 1e-12 * np.diag(np.diag(covariance)))
        flat = (at.responses @ root).reshape(-1, len(root))
        return np.asarray(root @ np.linalg.eigh(flat.T @ flat)[1][:, -STEERED:])

    def _polish(self, at: Iterate) -> str:
        """The equilibrium itself; what went wrong in words."""
        u = at.displacement
        found, amplitudes, left = self.forces.equilibrium(at.amplitudes, u, u, u, self._steer(at), POLISH, LEAST)
        at.step_to(found, amplitudes, aligned(self.points + found, self.points + u, self.ones))
        return "" if left < IN_BALANCE else "no equilibrium was found where the points say that the organ is"
