"""The fit with smooth forces alone, which keep their directions: Gauss-Newton with one tangent after another.

The data choose how large forces of a kind are: MacKay's re-estimation (Neural Computation 4 (1992) 415).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from viscera.mesh import Floats
from viscera.registration.equations import (
    CALMER,
    FARTHEST,
    REACH,
    SETTLED,
    STILL,
    SURE,
    TRUST,
    Equations,
    Iterate,
)
from viscera.registration.rigid import Rigid, aligned, rigid_parts, vector_of, without_rigid

TANGENTS = 10
"""At most."""
FIRST, LATER = 20, 8
"""Closest points renewed at most so often with a tangent."""
HALVINGS, NEWTON = 4, 12
"""Of a step at most; iterations of Newton's method before it is halved."""
EXPECTED = 0.02
"""Root-mean-square displacement by forces of a kind, rigid motion apart, to begin with and at most."""
SMALLEST = (0.015, 0.003)
"""And at least: where nobody looks, forces on the boundary may act that moved nothing elsewhere."""
GROWTH = 2.0
"""Largest factor on it in an iteration."""
SWING = 0.2
"""Standard deviation of the organ's turn about each axis by forces, against its fixed nodes [rad]."""
DAMPING = 400.0
"""Cost of a step that moves the surface by `REACH`: along the organ's surface the data hardly hold it."""
FAR = 0.03
"""Residuals that belong to the organ for certain before it has deformed."""


class Smooth:
    """Smooth forces of estimated size."""

    def __init__(self, equations: Equations, responses: Floats) -> None:
        """responses (n, 3, m): of the organ at rest."""
        self.equations, self.organ, self.forces = equations, equations.organ, equations.forces
        self.size, self.rest = equations.size, responses
        self.metrics = self.forces.metrics(without_rigid(responses, self.organ.mesh.points))
        """Priors of the forces at rest."""

    def begun(self, motion: Rigid) -> Iterate:
        """What the tangent at rest says, from a rigid motion."""
        found, before = self.at_rest(motion), self.at_rest(motion)
        self._improve(found, before, self.rest, FIRST, FAR * self.size)
        return found

    def at_rest(self, motion: Rigid) -> Iterate:
        """Moved rigidly, under no forces."""
        rest = np.zeros_like(self.organ.mesh.points)
        expected = np.full(2, EXPECTED * self.size)
        return Iterate(motion, np.zeros(len(self.forces)), rest, expected, trust=TRUST * self.size)

    def followed(self, at: Iterate, tell: Callable[[], None]) -> tuple[Iterate, str]:
        """The equilibrium that tangents lead to, and what went wrong in words; `at`: what that at rest says."""
        best = replace(at, expected=at.expected.copy())
        message = self._balance(best, self.at_rest(best.motion))
        for _ in range(TANGENTS - 1):
            if message or (self.is_settled(best, 1.0) and best.doubt <= SURE):
                break
            further = replace(best, expected=best.expected.copy(), doubt=max(SURE, best.doubt / CALMER))
            self._improve(further, best, self.forces.responses(best.displacement), LATER, 0.0)
            message = self._balance(further, best)
            if not message:
                best = further
                tell()
        if not message and best.is_cut:
            message = f"{TANGENTS} tangents are not enough: the last step was still shortened"
        elif not message and not self.is_settled(best):
            message = f"{TANGENTS} tangents leave a node {1e3 * best.change:.1f} mm from equilibrium"
        return best, message

    def tell(self, at: Iterate) -> None:
        """What is known where the fit ended, by what of the cloud says where along the organ it lies (normals.py)."""
        further = replace(at, expected=at.expected.copy())
        self._improve(further, at, self.forces.responses(at.displacement), 1, 0.0, is_faced=True)
        at.covariance, at.responses, at.prior = further.covariance, further.responses, further.prior

    def is_settled(self, at: Iterate, factor: float = 3.0) -> bool:
        """Whether the tangent was good enough, and its step not shortened, by so many times `SETTLED`."""
        return not at.is_cut and at.change < factor * SETTLED * self.size

    def _improve(
        self, at: Iterate, before: Iterate, responses: Floats, count: int, far: float, *, is_faced: bool = False
    ) -> None:
        """Gauss-Newton with the equilibrium before linearised, u + U (a' - a), U without rigid motions: T has those.

        far: residuals [m] that belong to the organ for certain; is_faced: as `Equations.at` takes it.
        """
        equations, begin_u, begin_a = self.equations, before.displacement, before.amplitudes
        x = self.organ.mesh.points + begin_u
        turns, responses = rigid_parts(responses, x)[:3], without_rigid(responses, x)
        metrics = self.forces.metrics(responses)
        known, motions = equations.n_known, equations.motions(responses, x)
        begin_turn = vector_of(aligned(self.organ.mesh.points, x, np.ones(len(x))).rotation)
        scale = max(far, 2.0 * equations.seen.noise)
        for _ in range(count):
            rows, residual, weight, scatter = equations.at(at, responses, scale, is_faced=is_faced)
            held = equations.held(turns, begin_turn + turns @ (at.amplitudes - begin_a), SWING)
            rows, residual, weight = map(np.concatenate, zip((rows, residual, weight), held, strict=True))
            prior, unknowns = equations.prior(metrics, at.expected), equations.unknowns(at)
            hessian, right = (rows * weight[:, None]).T @ rows + prior, rows.T @ (weight * residual)
            at.covariance = _inverse(hessian)[:known, :known]
            damping = motions.T @ motions * (DAMPING * 3.0 / (len(motions) * (REACH * self.size) ** 2))
            step = _inverse(hessian + damping) @ (right - prior @ unknowns)
            largest = equations.advance(at, step, motions)
            at.displacement = begin_u + responses @ (at.amplitudes - begin_a)
            at.prior, at.responses = prior[6:known, 6:known], responses
            at.cost = float(weight @ residual**2 + unknowns @ prior @ unknowns + equations.missed(weight, at.doubt))
            self._expect(at, metrics)
            scale = equations.narrowed(scale, scatter)
            if largest < STILL * self.size:
                break
        moved = float(np.linalg.norm(at.displacement - begin_u, axis=1).max())
        cut = min(1.0, at.trust / max(moved, 1e-12))
        at.is_cut, at.left = cut < 1.0, moved
        at.amplitudes = begin_a + cut * (at.amplitudes - begin_a)
        at.displacement = begin_u + responses @ (at.amplitudes - begin_a)

    def _balance(self, at: Iterate, before: Iterate) -> str:
        """The equilibrium under the forces found, by Newton's method; what went wrong in words.

        The step from the equilibrium before is halved until its tangent predicts the next one.
        """
        points = self.organ.mesh.points
        forward, moved = at.amplitudes - before.amplitudes, at.displacement - before.displacement
        farthest = float(np.linalg.norm(moved, axis=1).max())
        for part in 0.5 ** np.arange(HALVINGS + 1):
            amplitudes, predicted = before.amplitudes + part * forward, points + before.displacement + part * moved
            u, is_found = self._equilibrium(amplitudes, before.displacement)
            back = aligned(points + u, predicted, np.ones(len(points)))
            at.change = float(np.linalg.norm(back(points + u) - predicted, axis=1).max())
            if is_found and at.change < FARTHEST * self.size:
                at.step_to(u, amplitudes, back)
                at.left -= part * farthest
                at.is_cut = at.is_cut or part < 1.0
                at.believe(part, farthest, self.size)
                return ""
        at.displacement, at.amplitudes = before.displacement, before.amplitudes
        return "no equilibrium was found under the forces of the next step, however short; the last one is kept"

    def _equilibrium(self, amplitudes: Floats, start: Floats) -> tuple[Floats, bool]:
        """Under forces that keep their directions: displacement (n, 3), and whether it was found."""
        settings = {"smallest_step": 1.0, "max_iterations": NEWTON}
        state = self.organ.solve(force=self.forces.nodal(amplitudes), start=start, settings=settings)
        return state.displacement, state.is_converged

    def _expect(self, at: Iterate, metrics: list[Floats]) -> None:
        """MacKay's update: s^2 = a . P a / (number of amplitudes that the data determine)."""
        for g, (group, metric) in enumerate(zip(self.equations.groups, metrics, strict=True)):
            a = at.amplitudes[group]
            where = slice(6 + group.start, 6 + group.stop)
            left = float(np.sum(metric * at.covariance[where, where])) / at.expected[g] ** 2
            determined = max(len(a) - left, 0.05)
            size = np.sqrt(a @ metric @ a / determined)
            size = np.clip(size, at.expected[g] / GROWTH, at.expected[g] * GROWTH)
            at.expected[g] = float(np.clip(size, SMALLEST[g] * self.size, EXPECTED * self.size))


def _inverse(matrix: Floats) -> Floats:
    """Of a symmetric positive definite matrix whose rows have different units."""
    scale = 1.0 / np.sqrt(np.diag(matrix))
    return np.asarray(scale[:, None] * np.linalg.inv(matrix * scale[:, None] * scale) * scale)
