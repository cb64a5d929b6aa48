"""The most probable rigid motion and forces, given what was measured: Gauss-Newton with closest points renewed.

With x = X + u(a) the equilibrium of the organ under forces a, and T its rigid motion, it minimises

    sum_i w_i rho(n_i . (T^-1 y_i - p_i)) / sigma^2 + sum_l |T^-1 y_l - x_l|^2 / sigma_l^2 + sum_g a_g . P_g a_g / s_g^2
        + |r|^2 / s_r^2

Responses to forces have their rigid parts taken out, since T has these: what s_g measures is deformation. How far the
forces turn the organ against its fixed nodes, r, would else cost little, and no camera sees these nodes. The cloud is
averaged in cubes; beside its noise, a smooth error of the model along the normals is an unknown of every iteration.

y_i: points of the cloud; p_i: the closest point of x and n_i the normal there; rho: Tukey's biweight; y_l: landmarks.
P_g: the smoothness of the forces on the boundary and the size of that on the volume, in units in which s_g is the
root-mean-square displacement [m] that they are expected to cause. The data choose s_g: MacKay's re-estimation (Neural
Computation 4 (1992) 415). Stiffness drops out of P_g / s_g^2, so that only its distribution matters, not its size.
The strain energy as P_g would hardly resist forces of short wavelength, and would resist those that move the whole
organ, whereas what moves organs is smooth.

The tangent at rest says where the organ is about. If asked, the fit is tried from there with one cause beside small
smooth forces (causes.py), under forces that turn with the organ. If it does not settle, the fit with smooth forces
alone is the answer; its forces keep their directions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices
from viscera.registration.causes import SIZES, SMALL, SMALL_VOLUME, Causes, believed
from viscera.registration.forces import Forces
from viscera.registration.observed import Observed
from viscera.registration.registered import Registered, band_of
from viscera.registration.rigid import (
    TUKEY,
    Rigid,
    Shape,
    aligned,
    levers,
    rigid_parts,
    spaced,
    spread,
    starts,
    tukey,
    vector_of,
    without_rigid,
)

if TYPE_CHECKING:
    from viscera.organ import Organ
    from viscera.progress import Progress

CUBE = 0.025
"""Edge of the cubes in each of which the points of the cloud are averaged; this and other lengths in diagonals."""
TANGENTS = 10
"""At most."""
FIRST, LATER = 20, 8
"""Closest points renewed at most so often with a tangent."""
SETTLED = 3e-3
"""Change of a node's place at which a tangent is good enough."""
FARTHEST = 0.05
"""Such a change says that a tangent was of no use; the equilibrium before it is kept."""
DOUBT, SURE, CALMER = 50.0, 4.0, 4.0
"""Factors on the variance of the noise with the first tangent, at last, and from one tangent to the next."""
STILL = 1e-3
"""Largest motion of a node in the last iteration with one tangent."""
NEARLY = 1e-6
"""Residual of an equilibrium that is near enough."""
HALVINGS, FEW, NEWTON = 4, 2, 12
"""Of a step at most, and where another fit is left to try; iterations of Newton's method before it is halved."""
TRUST = 0.1
"""Largest motion of a node with one tangent."""
WRONG, SMOOTH = 1e-3, 0.1
"""Standard deviation along the normal of what law, mesh and forces get wrong, and the distance over which it varies."""
N_WRONG = 60
"""Places that carry it."""
EXPECTED = 0.02
"""Root-mean-square displacement by forces of a kind, rigid motion apart, to begin with and at most."""
SWING, FREE_SWING = 0.2, 0.5
"""Standard deviation of the organ's turn about each axis by forces, against its fixed nodes [rad]: by forces that keep
their directions, and by such as turn with the organ."""
TURN = 0.3
"""Largest such turn with one tangent, where forces turn with the organ."""
SMALLEST = (0.015, 0.003)
"""And at least: where nobody looks, forces on the boundary may act that moved nothing elsewhere."""
GROWTH = 2.0
"""Largest factor on it in an iteration."""
REACH = 0.05
"""Largest motion of a node in an iteration."""
DAMPING = 400.0
"""Cost of a step that moves the surface by `REACH`: along the organ's surface the data hardly hold it."""
FAR = 0.03
"""Residuals that belong to the organ for certain before it has deformed."""


@dataclass
class Iterate:
    """Where the fit is."""

    motion: Rigid
    amplitudes: Floats
    displacement: Floats
    expected: Floats
    covariance: Floats = field(default_factory=lambda: np.empty((0, 0)))
    responses: Floats = field(default_factory=lambda: np.empty((0, 3, 0)))
    prior: Floats = field(default_factory=lambda: np.empty((0, 0)))
    change: float = np.inf
    """Largest distance of a node [m] between the equilibrium and what the tangent had said."""
    cost: float = np.inf
    trust: float = np.inf
    """Largest motion of a node [m] for which a tangent is believed."""
    is_cut: bool = False
    """Whether the last step was shortened to it."""
    left: float = np.inf
    """Largest motion of a node [m] that the last step would have been longer by."""
    whole: Floats = field(default_factory=lambda: np.empty((0, 3)))
    """Displacement as the tangent says, the turn against the fixed nodes included."""
    doubt: float = DOUBT
    """Factor on the variance of the noise."""
    iterations: int = 0


def register(
    organ: Organ,
    seen: Observed,
    visible: Indices,
    loaded: Indices,
    start: Rigid | None,
    progress: Progress | None = None,
    *,
    one_cause: bool = False,
) -> Registered:
    """Fit the organ; visible (t, 3): triangles that may have been seen; loaded (k,): nodes where forces may act."""
    began = perf_counter()
    rest = np.zeros_like(organ.mesh.points)
    shape = Shape(organ.mesh.points, visible)
    motions = starts(shape, seen, start)
    forces = Forces(organ, loaded)
    fit = _Fit(organ, seen, visible, forces)
    try:
        responses = forces.responses(rest)
    except VisceraError as error:
        raise VisceraError(f"the organ at rest has no stable tangent to register with: {error}") from error
    steps, done = len(motions) + (1 + one_cause) * (TANGENTS - 1), 0

    def tell() -> None:
        nonlocal done
        done += 1
        if progress:
            progress(done, steps, "registration")

    found = []
    for motion in motions:
        found.append(fit.at_rest(motion))
        fit.improve(found[-1], fit.at_rest(motion), responses, FIRST, first=True)
        tell()
    best = min(found, key=lambda iterate: iterate.cost)
    if one_cause:
        one, message = fit.followed(fit.begun(best, responses), tell, by_cause=True)
    if not one_cause or message or not fit.is_settled(one):
        one, message = fit.followed(best, tell, by_cause=False)
    return fit.result(one, message, perf_counter() - began)


class _Fit:
    """What does not change from one iterate to the next."""

    def __init__(self, organ: Organ, seen: Observed, visible: Indices, forces: Forces) -> None:
        self.organ, self.seen, self.visible, self.forces = organ, seen, visible, forces
        self.size = organ.mesh.diagonal
        self.cloud, self.weights = averaged(seen.surface, seen.weights, CUBE * self.size)
        self.sample = organ.mesh.surface_nodes[:: max(1, len(organ.mesh.surface_nodes) // 100)]
        self.centre = organ.mesh.points.mean(axis=0)
        self.wrong = self._wrong()
        self.at_rest_metrics: list[Floats] = []
        self.groups = (slice(0, len(forces) - 3), slice(len(forces) - 3, len(forces)))

    def at_rest(self, motion: Rigid) -> Iterate:
        """Moved rigidly, under no forces."""
        rest = np.zeros_like(self.organ.mesh.points)
        expected = np.full(2, EXPECTED * self.size)
        return Iterate(motion, np.zeros(len(self.forces)), rest, expected, trust=TRUST * self.size)

    def begun(self, at: Iterate, responses: Floats) -> Iterate:
        """What the tangent at rest says if one thing happened."""
        begun = replace(at, expected=at.expected.copy(), doubt=DOUBT / CALMER)
        self.improve(begun, self.at_rest(at.motion), responses, LATER, first=False, by_cause=True)
        return begun

    def followed(self, at: Iterate, tell: Callable[[], None], *, by_cause: bool) -> tuple[Iterate, str]:
        """The equilibrium that tangents lead to, and what went wrong in words; `at`: what that at rest says."""
        best = replace(at, expected=at.expected.copy())
        message = self.balance(best, self.at_rest(best.motion), follow=by_cause)
        for _ in range(TANGENTS - 1):
            if message or (self.is_settled(best, 1.0) and best.doubt <= SURE):
                break
            further = replace(best, expected=best.expected.copy(), doubt=max(SURE, best.doubt / CALMER))
            responses = self.forces.responses(best.displacement)
            self.improve(further, best, responses, LATER, first=False, by_cause=by_cause)
            message = self.balance(further, best, follow=by_cause)
            if not message:
                best = further
                tell()
        return best, message

    def is_settled(self, at: Iterate, factor: float = 3.0) -> bool:
        """Whether the tangent was good enough, and its step not shortened, by so many times `SETTLED`."""
        return not at.is_cut and at.change < factor * SETTLED * self.size

    def improve(
        self, at: Iterate, before: Iterate, responses: Floats, count: int, *, first: bool, by_cause: bool = False
    ) -> None:
        """Gauss-Newton with the equilibrium before linearised, u + U (a' - a), U without rigid motions: T has those."""
        points, begin_u, begin_a = self.organ.mesh.points, before.displacement, before.amplitudes
        x = points + begin_u
        whole = self.forces.following(responses, begin_a, rigid_parts(responses, x)[:3]) if by_cause else responses
        turns, responses = rigid_parts(whole, x)[:3], without_rigid(whole, x)
        if by_cause:
            metrics, kinds = self.at_rest_metrics, Causes(self.forces, self.forces.loaded).at(x, responses)
        else:
            metrics = self.forces.metrics(responses)
            if first:
                self.at_rest_metrics = metrics
        known = 6 + len(self.forces)
        motions = np.pad(self._motions(responses, x[self.sample]), ((0, 0), (0, self.wrong.shape[1])))
        begin_turn = vector_of(aligned(points, x, np.ones(len(points))).rotation)
        swing = np.pad(turns, ((0, 0), (6, self.wrong.shape[1])))
        scale = max(FAR * self.size if first else 0.0, 2.0 * self.seen.noise)
        for _ in range(count):
            rows, residual, weight, scatter = self.equations(at, responses, scale)
            turn = begin_turn + turns @ (at.amplitudes - begin_a)
            rows, residual = np.concatenate([rows, swing]), np.concatenate([residual, -turn])
            weight = np.concatenate([weight, np.full(3, (FREE_SWING if by_cause else SWING) ** -2.0)])
            prior = self._prior(metrics, at.expected)
            amplitudes = np.concatenate([np.zeros(6), at.amplitudes, np.zeros(len(prior) - known)])
            data, right = (rows * weight[:, None]).T @ rows, rows.T @ (weight * residual)
            if by_cause:
                priors = [self._prior(metrics, np.array([small, SMALL_VOLUME]) * self.size) for small in SMALL]
                sizes = [size * self.size for size in SIZES]
                mean, covariance = believed(data, right + data @ amplitudes, priors, kinds, sizes)
                at.covariance, step = covariance[:known, :known], mean - amplitudes
            else:
                hessian = data + prior
                at.covariance = _inverse(hessian)[:known, :known]
                damping = motions.T @ motions * (DAMPING * 3.0 / (len(motions) * (REACH * self.size) ** 2))
                step = _inverse(hessian + damping) @ (right - prior @ amplitudes)
            largest = float(np.linalg.norm((motions @ step).reshape(-1, 3), axis=1).max())
            step *= min(1.0, REACH * self.size / max(largest, 1e-12))
            at.motion = at.motion.turned(step[:3], step[3:6], self.centre)
            at.amplitudes = at.amplitudes + step[6:known]
            at.displacement = begin_u + responses @ (at.amplitudes - begin_a)
            at.prior, at.responses = prior[6:known, 6:known], responses
            at.cost = float(weight @ residual**2 + amplitudes @ prior @ amplitudes + self._missed(weight, at.doubt))
            at.iterations += 1
            self._expect(at, metrics)
            scale = max(min(scale, 2.0 * scatter), 1.2 * self.seen.noise)
            if largest < STILL * self.size:
                break
        moved = float(np.linalg.norm(at.displacement - begin_u, axis=1).max())
        turned = float(np.linalg.norm(turns @ (at.amplitudes - begin_a)))
        cut = min(1.0, at.trust / max(moved, 1e-12), TURN / max(turned, 1e-12) if by_cause else 1.0)
        at.is_cut, at.left = cut < 1.0, moved
        forward = cut * (at.amplitudes - begin_a)
        at.amplitudes, at.displacement = begin_a + forward, begin_u + responses @ forward
        at.whole = begin_u + whole @ forward

    def _prior(self, metrics: list[Floats], sizes: Floats) -> Floats:
        """Of all unknowns (p, p): none on the rigid motion; forces of these sizes; unit errors of the model."""
        prior = np.eye(6 + len(self.forces) + self.wrong.shape[1])
        prior[:6, :6] = 0.0
        for group, metric, size in zip(self.groups, metrics, sizes, strict=True):
            where = slice(6 + group.start, 6 + group.stop)
            prior[where, where] = metric / size**2
        return prior

    def balance(self, at: Iterate, before: Iterate, *, follow: bool) -> str:
        """The equilibrium under the forces found, by Newton's method; what went wrong in words.

        The step from the equilibrium before is halved until its tangent predicts the next one.
        """
        points = self.organ.mesh.points
        forward, moved = at.amplitudes - before.amplitudes, at.displacement - before.displacement
        farthest = float(np.linalg.norm(moved, axis=1).max())
        for part in 0.5 ** np.arange((FEW if follow else HALVINGS) + 1):
            amplitudes, predicted = before.amplitudes + part * forward, points + before.displacement + part * moved
            if follow:
                start = before.displacement + part * (at.whole - before.displacement)
                u, amplitudes, is_found = self.forces.equilibrium(amplitudes, start, before.displacement)
            else:
                u, is_found = self._equilibrium(amplitudes, before.displacement)
            x = points + u
            back = aligned(x, predicted, np.ones(len(points)))
            at.change = float(np.linalg.norm(back(x) - predicted, axis=1).max())
            if is_found and at.change < FARTHEST * self.size:
                at.motion = Rigid(at.motion.rotation @ back.rotation, at.motion(back.translation))
                at.displacement, at.amplitudes = u, amplitudes
                at.left -= part * farthest
                at.is_cut = (at.is_cut or part < 1.0) and (not follow or at.left > 3.0 * SETTLED * self.size)
                is_right = part == 1.0 and at.change < 0.25 * farthest
                trust = 2.0 * at.trust if is_right else max(part * farthest, SETTLED * self.size)
                at.trust = min(TRUST * self.size, trust)
                return ""
        at.displacement, at.amplitudes = before.displacement, before.amplitudes
        return "no equilibrium was found under the forces of the next step, however short; the last one is kept"

    def _equilibrium(self, amplitudes: Floats, start: Floats) -> tuple[Floats, bool]:
        """Under forces that keep their directions: displacement (n, 3), and whether it was found."""
        settings = {"smallest_step": 1.0, "max_iterations": NEWTON}
        state = self.organ.solve(force=self.forces.nodal(amplitudes), start=start, settings=settings)
        return state.displacement, state.is_converged

    def _wrong(self) -> Floats:
        """How smooth unit errors of the model (q,) move the cloud (k, q) [m] along normals, by Nystroem's method."""
        if not len(self.cloud):
            return np.empty((0, 0))
        places = self.cloud[spaced(self.cloud, N_WRONG)]
        kernel, own = (
            np.exp(-0.5 * (np.linalg.norm(x[:, None] - places, axis=2) / (SMOOTH * self.size)) ** 2)
            for x in (self.cloud, places)
        )
        values, vectors = np.linalg.eigh(own + 1e-6 * np.eye(len(own)))
        return np.asarray(WRONG * self.size * kernel @ (vectors / np.sqrt(values)))

    def equations(self, at: Iterate, responses: Floats, scale: float) -> tuple[Floats, Floats, Floats, float]:
        """Rows (k, 6 + m) of turn, shift and amplitudes, residuals (k,) [m], weights (k,) [1/m^2], scatter [m]."""
        flat = responses.reshape(-1, responses.shape[2])
        rows, residuals, weights, scatter = [], [], [], self.seen.noise
        if len(self.cloud):
            shape = Shape(self.organ.mesh.points + at.displacement, self.visible)
            z = at.motion.back(self.cloud)
            _, corners, shares, p, normal = shape.closest(z)
            residual = np.einsum("ki,ki->k", normal, z - p)
            beside = np.maximum(np.linalg.norm(z - p, axis=1) - 3.0 * scale, 0.0)
            scatter = spread(residual, self.weights)
            moved = _along(flat, corners, shares, normal)
            rows.append(np.concatenate([np.cross(z - self.centre, normal), normal, moved, self.wrong], axis=1))
            residuals.append(residual)
            weights.append(
                self.weights * tukey(residual, scale) * tukey(beside, scale) / (at.doubt * self.seen.noise**2)
            )
        if self.seen.members:
            x = self._means(self.organ.mesh.points + at.displacement)
            z = at.motion.back(self.seen.measured)
            lever = levers(z - self.centre)
            moved = self._means(responses)
            ones = np.broadcast_to(np.eye(3), lever.shape)
            pairs = np.concatenate([lever, ones, moved], axis=2).reshape(-1, 6 + len(self.forces))
            rows.append(np.pad(pairs, ((0, 0), (0, self.wrong.shape[1]))))
            residuals.append((z - x).ravel())
            weights.append(np.repeat(self.seen.pair_noise**-2.0, 3))
        return np.concatenate(rows), np.concatenate(residuals), np.concatenate(weights), scatter

    def _means(self, field: Floats) -> Floats:
        """A field (n, 3, ...) at landmarks and points (l, 3, ...)."""
        return np.stack([np.tensordot(weights, field[nodes], axes=1) for nodes, weights in self.seen.members])

    def _expect(self, at: Iterate, metrics: list[Floats]) -> None:
        """MacKay's update: s^2 = a . P a / (number of amplitudes that the data determine)."""
        for g, (group, metric) in enumerate(zip(self.groups, metrics, strict=True)):
            a = at.amplitudes[group]
            where = slice(6 + group.start, 6 + group.stop)
            left = float(np.sum(metric * at.covariance[where, where])) / at.expected[g] ** 2
            determined = max(len(a) - left, 0.05)
            size = np.sqrt(a @ metric @ a / determined)
            size = np.clip(size, at.expected[g] / GROWTH, at.expected[g] * GROWTH)
            at.expected[g] = float(np.clip(size, SMALLEST[g] * self.size, EXPECTED * self.size))

    def _missed(self, weight: Floats, doubt: float) -> float:
        """The cost of what was left out as an outlier: as if at the biweight's end, so that starts can be compared."""
        count = len(self.cloud)
        full = self.weights / (doubt * self.seen.noise**2)
        return float((full - weight[:count]).sum() * (TUKEY * 2.0 * self.seen.noise) ** 2) if count else 0.0

    def result(self, at: Iterate, message: str, seconds: float) -> Registered:
        mesh, motion = self.organ.mesh, at.motion
        force = self.forces.nodal(at.amplitudes)
        state = self.organ.solve(force=force, start=at.displacement, settings={"tolerance": NEARLY})
        x = mesh.points + at.displacement
        shape = Shape(x, self.visible)
        residual, inside, coverage = np.empty(0), np.empty(0, dtype=bool), 0.0
        if len(self.seen.surface):
            z = motion.back(self.seen.surface)
            triangles, _, _, p, normal = shape.closest(z)
            residual = np.copysign(np.linalg.norm(z - p, axis=1), np.einsum("ki,ki->k", normal, z - p))
            inside = np.abs(residual) < TUKEY * max(spread(residual), 1e-6)
            coverage = self._coverage(triangles[inside])
        pairs: dict[str, float] = {}
        if self.seen.members:
            gaps = np.linalg.norm(motion.back(self.seen.measured) - self._means(x), axis=1)
            names = [*self.seen.names, *(f"point {k}" for k in range(len(gaps) - len(self.seen.names)))]
            pairs = dict(zip(names, gaps.tolist(), strict=True))
        covariance = self._covariance(at, x)
        deformation = np.linalg.norm(at.displacement, axis=1)
        prior = np.einsum("nim,mk,nik->n", at.responses, np.linalg.inv(at.prior), at.responses, optimize=True)
        known = np.trace(covariance, axis1=1, axis2=2)
        is_settled = not message and self.is_settled(at)
        if not message and at.is_cut:
            message = f"{TANGENTS} tangents are not enough: the last step was still shortened"
        elif not message and not is_settled:
            message = f"{TANGENTS} tangents leave a node {1e3 * at.change:.1f} mm from equilibrium"
        return Registered(
            self.organ,
            state,
            motion,
            residual=residual,
            inliers=inside,
            pair_residual=pairs,
            covariance=np.einsum("ij,njk,lk->nil", motion.rotation, covariance, motion.rotation, optimize=True),
            band=band_of(covariance, deformation),
            observed=known < 0.25 * (prior + 1e-30),
            coverage=coverage,
            nodal_force=force,
            iterations=at.iterations,
            is_settled=is_settled,
            message=message,
            seconds=seconds,
        )

    def _motions(self, responses: Floats, x: Floats) -> Floats:
        """Rows (3 k, 6 + m): how a turn, a shift and amplitudes move some nodes of the surface together."""
        lever = levers(x - self.centre)
        ones = np.broadcast_to(np.eye(3), lever.shape)
        return np.concatenate([lever, ones, responses[self.sample]], axis=2).reshape(-1, 6 + len(self.forces))

    def _covariance(self, at: Iterate, x: Floats) -> Floats:
        """Of each node's place (n, 3, 3) [m^2], in the organ's axes."""
        root = np.linalg.cholesky(0.5 * (at.covariance + at.covariance.T))
        lever = levers(x - self.centre)
        ones = np.broadcast_to(np.eye(3), lever.shape)
        rows = np.concatenate([lever, ones, at.responses], axis=2) @ root
        return np.asarray(rows @ rows.transpose(0, 2, 1))

    def _coverage(self, triangles: NDArray[np.int64]) -> float:
        """Share of the surface with points on it; few beside many are taken for scatter past its edge."""
        mesh = self.organ.mesh
        hits = np.bincount(triangles, minlength=len(self.visible))
        is_hit = hits > 0.25 * np.median(hits[hits > 0]) if hits.any() else hits > 0
        return float(_areas(mesh.points, self.visible)[is_hit].sum() / _areas(mesh.points, mesh.surface).sum())


def averaged(points: Floats, weights: Floats, edge: float) -> tuple[Floats, Floats]:
    """Weighted means (k, 3) of the points in each cube of this edge [m] that holds some, and their weights (k,)."""
    _, cube = np.unique(np.floor(points / edge).astype(np.int64), axis=0, return_inverse=True)
    cube = cube.ravel()
    total = np.bincount(cube, weights)
    means = np.column_stack([np.bincount(cube, weights * points[:, i]) for i in range(3)])
    kept = total > 0.0
    return np.asarray(means[kept] / total[kept, None]), np.asarray(total[kept], dtype=np.float64)


def _areas(points: Floats, triangles: Indices) -> Floats:
    x = points[triangles]
    return np.asarray(0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1))


def _along(flat: Floats, nodes: Indices, shares: Floats, normal: Floats) -> Floats:
    """Responses (k, m) of points in triangles along the normals there."""
    columns = np.zeros((len(nodes), flat.shape[1]))
    for corner in range(3):
        for axis in range(3):
            columns += (shares[:, corner] * normal[:, axis])[:, None] * flat[3 * nodes[:, corner] + axis]
    return columns


def _inverse(matrix: Floats) -> Floats:
    """Of a symmetric positive definite matrix whose rows have different units."""
    scale = 1.0 / np.sqrt(np.diag(matrix))
    return np.asarray(scale[:, None] * np.linalg.inv(matrix * scale[:, None] * scale) * scale)
