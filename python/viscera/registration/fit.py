"""The most probable rigid motion and forces, given what was measured: Gauss-Newton with closest points renewed.

With x = X + u(a) the equilibrium of the organ under forces a, and T its rigid motion, it minimises

    sum_i w_i rho(n_i . (T^-1 y_i - p_i)) / sigma^2 + sum_l |T^-1 y_l - x_l|^2 / sigma_l^2 + sum_g a_g . P_g a_g / s_g^2
        + |r|^2 / s_r^2

Responses to forces have their rigid parts taken out, since T has these: what s_g measures is deformation. How far the
forces turn the organ against its fixed nodes, r, would else cost little, and no camera sees these nodes. The cloud is
averaged in cubes; beside its noise, a smooth error of the model along the normals is an unknown of every iteration.

y_i: points of the cloud; p_i: the closest point of x and n_i the normal there; rho: Tukey's biweight; y_l: landmarks.
P_g: the smoothness of the forces on the boundary and the size of that on the volume, in units in which s_g is the
root-mean-square displacement [m] that they are expected to cause. Stiffness drops out of P_g / s_g^2, so that only its
distribution matters, not its size. The strain energy as P_g would hardly resist forces of short wavelength, and would
resist those that move the whole organ, whereas what moves organs is smooth.

Smooth forces and the tangent at rest (smooth.py) say which start is the best. From there the fit looks for one cause
beside small smooth forces, under forces that turn with the organ (onecause.py). If that finds no equilibrium, the fit
with smooth forces alone is the answer; its forces keep their directions. Other poses that fit as well are told too
(rivals.py).
"""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices
from viscera.registration.equations import Equations, Iterate
from viscera.registration.forces import Forces
from viscera.registration.observed import Observed
from viscera.registration.onecause import STEPS, OneCause
from viscera.registration.registered import LINEARISED, Registered, band_of, wrong_by_model
from viscera.registration.residuals import Left, left
from viscera.registration.rigid import TUKEY, Rigid, Shape, levers, spread, starts
from viscera.registration.rivals import Rivals
from viscera.registration.smooth import Smooth

if TYPE_CHECKING:
    from viscera.organ import Organ
    from viscera.progress import Progress

NEARLY = 1e-6
"""Residual of an equilibrium that is near enough."""


def register(
    organ: Organ,
    seen: Observed,
    visible: Indices,
    loaded: Indices,
    start: Rigid | None,
    progress: Progress | None = None,
) -> Registered:
    """Fit the organ; visible (t, 3): triangles that may have been seen; loaded (k,): nodes where forces may act."""
    began = perf_counter()
    counted = seen.counted()
    motions = starts(Shape(organ.mesh.points, visible), counted, start)
    equations = Equations(organ, counted, visible, Forces(organ, loaded))
    try:
        responses = equations.forces.responses(np.zeros_like(organ.mesh.points))
    except VisceraError as error:
        raise VisceraError(f"the organ at rest has no stable tangent to register with: {error}") from error
    steps, done = len(motions) + STEPS, 0

    def tell() -> None:
        nonlocal done
        done = min(done + 1, steps)
        if progress:
            progress(done, steps, "registration")

    smooth, found = Smooth(equations, responses), []
    for motion in motions:
        found.append(smooth.begun(motion))
        tell()
    found.sort(key=lambda iterate: iterate.cost)
    one_cause = OneCause(equations, smooth.metrics)

    def follow(begun: Iterate) -> tuple[Iterate, str]:
        end, message = one_cause.followed(begun.motion, tell)
        if not end.is_lost:
            one_cause.tell(end)
            return end, message
        end, message = smooth.followed(begun, tell)
        smooth.tell(end)
        return end, message

    end, message = follow(found[0])
    result = _Result(equations, seen)
    rivals: list[Iterate] = []
    is_searched = start is None and not counted.fixes_motion
    if is_searched and not message:
        band, observed, _ = result.told(end)
        end, rivals = Rivals(smooth, one_cause, follow).told_apart(end, found, band, observed)
    return result.of(end, rivals, message, perf_counter() - began)


class _Result:
    """What a fit says of the organ."""

    def __init__(self, equations: Equations, seen: Observed) -> None:
        """seen: with the points of weight 0, whose residuals are told too."""
        self.equations, self.organ, self.seen = equations, equations.organ, seen
        self.visible = equations.visible

    def told(self, at: Iterate) -> tuple[Floats, NDArray[np.bool_], Floats]:
        """Band (n,) [m], whether a node is observed (n,), and the covariance (n, 3, 3) [m^2] in the organ's axes."""
        points = self.organ.mesh.points
        covariance = self._covariance(at, points + at.displacement)
        prior = np.einsum("nim,mk,nik->n", at.responses, np.linalg.inv(at.prior), at.responses, optimize=True)
        band = band_of(LINEARISED**2 * covariance, wrong_by_model(points, at.displacement))
        return band, np.trace(covariance, axis1=1, axis2=2) < 0.25 * (prior + 1e-30), covariance

    def of(self, at: Iterate, rivals: list[Iterate], message: str, seconds: float) -> Registered:
        """rivals: other poses that fit as well."""
        mesh, motion = self.organ.mesh, at.motion
        force = self.equations.forces.nodal(at.amplitudes)
        state = self.organ.solve(force=force, start=at.displacement, settings={"tolerance": NEARLY})
        x = mesh.points + at.displacement
        shape = Shape(x, self.visible)
        residual, inside, coverage = np.empty(0), np.empty(0, dtype=bool), 0.0
        rest: Left | None = None
        if len(self.seen.surface):
            z = motion.back(self.seen.surface)
            triangles, _, _, p, normal = shape.closest(z)
            residual = np.copysign(np.linalg.norm(z - p, axis=1), np.einsum("ki,ki->k", normal, z - p))
            inside = np.abs(residual) < TUKEY * max(spread(residual, self.seen.weights), 1e-6)
            coverage = self._coverage(triangles[inside], self.seen.weights[inside])
            counts = inside & (self.seen.weights > 0.0)
            rest = left(residual[counts], p[counts], self.seen.weights[counts], self.seen.noise, self.seen.size)
        pairs: dict[str, float] = {}
        if self.seen.members:
            gaps = np.linalg.norm(motion.back(self.seen.measured) - self.equations.means(x), axis=1)
            pairs = dict(zip(self.seen.labels, gaps.tolist(), strict=True))
        band, observed, covariance = self.told(at)
        return Registered(
            self.organ,
            state,
            motion,
            residual=residual,
            inliers=inside,
            pair_residual=pairs,
            pair_noise=self.seen.pair_noise,
            covariance=np.einsum("ij,njk,lk->nil", motion.rotation, covariance, motion.rotation, optimize=True),
            band=band,
            observed=observed,
            rivals=[other.motion(mesh.points + other.displacement) - mesh.points for other in rivals],
            coverage=coverage,
            left=rest,
            nodal_force=force,
            iterations=at.iterations,
            is_settled=not message,
            message=message,
            seconds=seconds,
        )

    def _covariance(self, at: Iterate, x: Floats) -> Floats:
        """Of each node's place (n, 3, 3) [m^2], in the organ's axes."""
        root = np.linalg.cholesky(0.5 * (at.covariance + at.covariance.T))
        lever = levers(x - self.equations.centre)
        ones = np.broadcast_to(np.eye(3), lever.shape)
        rows = np.concatenate([lever, ones, at.responses], axis=2) @ root
        return np.asarray(rows @ rows.transpose(0, 2, 1))

    def _coverage(self, triangles: NDArray[np.int64], weights: Floats) -> float:
        """Share of the surface with points (k,) on it; few beside many are taken for scatter past its edge."""
        mesh = self.organ.mesh
        hits = np.bincount(triangles, weights, minlength=len(self.visible))
        is_hit = hits > 0.25 * np.median(hits[hits > 0]) if hits.any() else hits > 0
        return float(_areas(mesh.points, self.visible)[is_hit].sum() / _areas(mesh.points, mesh.surface).sum())


def _areas(points: Floats, triangles: Indices) -> Floats:
    x = points[triangles]
    return np.asarray(0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1))
