"""The reduced touch model against four other ways to answer a touch, at equal training time and like on-line cost.

    python benchmarks/surrogates.py [ORGAN SET FACTOR ...]      (default: beam tip 1 4)

Training time is processor time, all threads together: what `Organ.reduce` takes, times each FACTOR, is given to each of
the others, who spend it on full Newton solutions at random touches (the network a part of it on its own training). All
predict field and force of the same unseen touches; errors are relative to the norm of the full solution. The
data-driven ones learn u / |d|, a kindness to them: the field then vanishes with the push by construction.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter, process_time

import numpy as np
from machine import describe

import viscera as vs
from viscera.reduced.check import PATIENCE, surface_points, unit_vectors

Array = np.ndarray
Predict = Callable[[Array, Array], tuple[Array, Array]]

MODES = 100  # of the bases from snapshots; 100 modes cost on-line what the reduced model's field does
TOUCHES, DEPTHS = 40, (0.05, 0.10)
LAYERS, RATE, BATCH, SHARE = 64, 2e-3, 32, 0.4  # of the network; SHARE of the time goes into its training


@dataclass(frozen=True)
class Snapshots:
    """Full solutions at random touches: points (k, 3), pushes (k, 3), fields (k, 3 n), forces (k, 3)."""

    points: Array
    pushes: Array
    fields: Array
    forces: Array
    seconds: float

    def first(self, share: float) -> Snapshots:
        """Those that a part of the time gave."""
        k = max(int(share * len(self.points)), 1)
        parts = (part[:k] for part in (self.points, self.pushes, self.fields, self.forces))
        return Snapshots(*parts, share * self.seconds)


def full(touch: vs.Touch, organ: vs.Organ, point: Array, push: Array) -> tuple[Array, Array] | None:
    """Field and contact force by Newton's method, or None where it does not converge."""
    patch = touch.patch(point)
    state = organ.solve(displacement={patch: push}, settings=PATIENCE)
    return (state.displacement.ravel(), state.reaction(patch)) if state.is_converged else None


def snapshots(touch: vs.Touch, organ: vs.Organ, seconds: float) -> Snapshots:
    """As many as the time allows: places, directions and depths at random."""
    random = np.random.default_rng(1)
    rows, began = [], process_time()
    while process_time() - began < seconds:
        point = surface_points(touch, 1, random)[0]
        push = touch.depth * random.uniform(0.05, 1.0) * unit_vectors(1, random)[0]
        found = full(touch, organ, point, push)
        if found is not None:
            rows.append((point, push, *found))
    return Snapshots(*(np.array(column) for column in zip(*rows, strict=True)), process_time() - began)


def inputs(touch: vs.Touch, points: Array, pushes: Array) -> Array:
    """What the surrogates see of a touch (k, 7): place in patch radii, direction, depth in full depths."""
    depth = np.linalg.norm(pushes, axis=1, keepdims=True)
    return np.concatenate([points / touch.radius, pushes / depth, depth / touch.depth], axis=1)


def basis(data: Snapshots) -> Array:
    """The leading modes (3 n, m) of the snapshots per unit push."""
    scaled = data.fields / np.linalg.norm(data.pushes, axis=1, keepdims=True)
    return np.linalg.svd(scaled.T, full_matrices=False)[0][:, :MODES]


def targets(data: Snapshots, modes: Array) -> Array:
    """Coefficients of the modes and the force, per unit push (k, m + 3)."""
    depth = np.linalg.norm(data.pushes, axis=1, keepdims=True)
    return np.concatenate([data.fields @ modes, data.forces], axis=1) / depth


def from_coefficients(modes: Array, evaluate: Callable[[Array], Array], touch: vs.Touch) -> Predict:
    def predict(point: Array, push: Array) -> tuple[Array, Array]:
        y = np.linalg.norm(push) * evaluate(inputs(touch, point[None], push[None])[0])
        return modes @ y[: modes.shape[1]], y[modes.shape[1] :]

    return predict


def nearest(touch: vs.Touch, data: Snapshots) -> Predict:
    """Inverse-distance interpolation of the eight nearest snapshots."""
    modes = basis(data)
    x, y = inputs(touch, data.points, data.pushes), targets(data, modes)

    def evaluate(at: Array) -> Array:
        distance = np.linalg.norm(x - at, axis=1)
        near = np.argpartition(distance, 8)[:8]
        weight = 1.0 / np.maximum(distance[near], 1e-12) ** 2
        return np.asarray(weight @ y[near] / weight.sum())

    return from_coefficients(modes, evaluate, touch)


def radial(touch: vs.Touch, data: Snapshots) -> Predict:
    """Cubic radial basis functions with a linear part, through every snapshot."""
    modes = basis(data)
    x, y = inputs(touch, data.points, data.pushes), targets(data, modes)
    k, linear = len(x), np.concatenate([np.ones((len(x), 1)), x], axis=1)
    cubes = np.linalg.norm(x[:, None] - x[None], axis=2) ** 3
    system = np.block([[cubes, linear], [linear.T, np.zeros((linear.shape[1],) * 2)]])
    weights = np.linalg.lstsq(system, np.concatenate([y, np.zeros((linear.shape[1], y.shape[1]))]), rcond=None)[0]

    def evaluate(at: Array) -> Array:
        kernel = np.linalg.norm(x - at, axis=1) ** 3
        return np.asarray(kernel @ weights[:k] + np.concatenate([[1.0], at]) @ weights[k:])

    return from_coefficients(modes, evaluate, touch)


def network(touch: vs.Touch, data: Snapshots, seconds: float) -> Predict:
    """Two hidden layers of tanh, trained by Adam on the scaled coefficients until the time is spent."""
    modes = basis(data)
    x, y = inputs(touch, data.points, data.pushes), targets(data, modes)
    shift, scale = x.mean(axis=0), x.std(axis=0) + 1e-12
    units = np.concatenate([np.full(modes.shape[1], y[:, : modes.shape[1]].std()), np.full(3, y[:, -3:].std())])
    x, y = (x - shift) / scale, y / units
    random, sizes = np.random.default_rng(2), (x.shape[1], LAYERS, LAYERS, y.shape[1])
    layers = [[random.normal(0.0, 1.0 / np.sqrt(a), (a, b)), np.zeros(b)] for a, b in pairwise(sizes)]
    moments = [[(np.zeros_like(p), np.zeros_like(p)) for p in layer] for layer in layers]
    began, step = process_time(), 0
    while process_time() - began < seconds:
        rate = RATE * 0.5 * (1.0 + np.cos(np.pi * min((process_time() - began) / seconds, 1.0)))
        for batch in np.array_split(random.permutation(len(x)), max(len(x) // BATCH, 1)):
            step += 1
            values = [x[batch]]
            for w, b in layers:
                values.append(values[-1] @ w + b if w is layers[-1][0] else np.tanh(values[-1] @ w + b))
            slope = (values[-1] - y[batch]) / len(batch)
            for layer, moment, value, out in reversed(list(zip(layers, moments, values, values[1:], strict=False))):
                if layer is not layers[-1]:
                    slope = slope * (1.0 - out**2)
                gradients = (value.T @ slope, slope.sum(axis=0))
                slope = slope @ layer[0].T
                for k, g in enumerate(gradients):
                    m, v = moment[k]
                    m += 0.1 * (g - m)
                    v += 0.001 * (g**2 - v)
                    layer[k] -= rate * (m / (1 - 0.9**step)) / (np.sqrt(v / (1 - 0.999**step)) + 1e-8)

    def evaluate(at: Array) -> Array:
        h = (at - shift) / scale
        for w, b in layers[:-1]:
            h = np.tanh(h @ w + b)
        return np.asarray((h @ layers[-1][0] + layers[-1][1]) * units)

    return from_coefficients(modes, evaluate, touch)


def galerkin(touch: vs.Touch, organ: vs.Organ, data: Snapshots) -> Predict:
    """Equilibrium in the span of the modes under the prescribed mean: BFGS from the rest stiffness, whole assembly."""
    modes = basis(data)
    n, step = len(organ.mesh.points), 1e-6 * organ.mesh.diagonal

    def reduced_force(q: Array) -> Array:
        return np.asarray(modes.T @ organ._body.internal_force((modes @ q).reshape(n, 3)).ravel())

    unit = np.eye(modes.shape[1])
    rest = np.array([(reduced_force(step * e) - reduced_force(-step * e)) / (2.0 * step) for e in unit])
    rest = 0.5 * (rest + rest.T)

    def predict(point: Array, push: Array) -> tuple[Array, Array]:
        patch = touch.patch(point)
        mean = np.einsum("a,aim->im", patch.weights, modes.reshape(n, 3, -1)[patch.nodes])
        m = len(unit)
        q, force, K = np.zeros(m), np.zeros(3), rest.copy()
        gradient = reduced_force(q)
        for iteration in range(60):
            target = min(1.0, (iteration + 1) / 5.0) * push
            system = np.block([[K, mean.T], [mean, np.zeros((3, 3))]])
            solution = np.linalg.solve(system, np.concatenate([-gradient, target - mean @ q]))
            change, force = solution[:m], -solution[m:]
            fresh = reduced_force(q + change)
            if not np.isfinite(fresh).all():
                break
            q, difference, gradient = q + change, fresh - gradient, fresh
            curvature = difference @ change
            if curvature > 0.0:
                Ks = K @ change
                K += np.outer(difference, difference) / curvature - np.outer(Ks, Ks) / (change @ Ks)
            if iteration >= 5 and np.linalg.norm(gradient - mean.T @ force) < 1e-4 * np.linalg.norm(gradient):
                break
        return modes @ q, force

    return predict


def main() -> None:
    """Train everything, then ask everybody the same."""
    name, where, *words = sys.argv[1:] or ("beam", "tip", "1", "4")
    factors = [float(word) for word in words]
    held = {"liver": "hilum", "beam": "clamp", "artery": "bottom"}[name]
    organ = vs.Organ(getattr(vs.organs, name)(), vs.NeoHookean(young=0.17e6, poisson=0.48), fixed=held)
    print(describe())
    began = process_time()
    touch = organ.reduce(where)
    budget = process_time() - began
    print(f"{name}, {where}: {len(organ.mesh.points)} nodes; neo-Hookean, nu = 0.48; {touch!r}", flush=True)
    every = snapshots(touch, organ, max(factors) * budget)

    def reduced(point: Array, push: Array) -> tuple[Array, Array]:
        answer = touch(point, push)
        return answer.displacement.ravel(), answer.force

    questions = {depth: ask(touch, organ, depth) for depth in DEPTHS}
    print(f"errors in per cent, median / worst of {TOUCHES} unseen touches; time of field and force, median")
    print("depth   method                       displacement           force       ms")
    for depth, asked in questions.items():
        compare(depth, "reduced touch model", reduced, asked)
        trusted = [(point, push, truth) for point, push, truth in asked if touch(point, push).is_shape_trusted]
        compare(depth, f"  the {len(trusted)} it trusts", reduced, trusted)
        print(f"        {len(asked)} of {TOUCHES} full solutions converged")
    for factor in factors:
        data = every.first(factor / max(factors))
        print(f"trained {factor:g} x {budget:.0f} s of processor time, {len(data.points)} Newton solutions")
        methods = {
            "interpolated snapshots": nearest(touch, data),
            "radial basis functions": radial(touch, data),
            "neural network": network(touch, data.first(1.0 - SHARE), SHARE * factor * budget),
            "POD-Galerkin": galerkin(touch, organ, data),
        }
        modes = basis(data)
        for depth, asked in questions.items():
            for method, predict in methods.items():
                compare(depth, method, predict, asked)
            best = [np.linalg.norm(u - modes @ (modes.T @ u)) / np.linalg.norm(u) for _, _, (u, _) in asked]
            print(f"{100 * depth:4.0f} %  {f'  best of {modes.shape[1]} modes':26s}{spread(best)}", flush=True)


def ask(touch: vs.Touch, organ: vs.Organ, depth: float) -> list[tuple[Array, Array, tuple[Array, Array]]]:
    """Unseen touches with their full solutions, where these converge."""
    random = np.random.default_rng(0)
    points, directions = surface_points(touch, TOUCHES, random), unit_vectors(TOUCHES, random)
    pushes = depth * organ.mesh.diagonal * directions
    truths = [full(touch, organ, point, push) for point, push in zip(points, pushes, strict=True)]
    return [(p, d, t) for p, d, t in zip(points, pushes, truths, strict=True) if t is not None]


def compare(depth: float, name: str, predict: Predict, asked: list[tuple[Array, Array, tuple[Array, Array]]]) -> None:
    """One row: median and worst error of field and force, and the time of one answer."""
    fields, forces, times = [], [], []
    for point, push, (u, f) in asked:
        clock = perf_counter()
        field, force = predict(point, push)
        times.append(1e3 * (perf_counter() - clock))
        fields.append(float(np.linalg.norm(field - u) / np.linalg.norm(u)))
        forces.append(float(np.linalg.norm(force - f) / np.linalg.norm(f)))
    if asked:
        print(f"{100 * depth:4.0f} %  {name:26s}{spread(fields)} {spread(forces)}{np.median(times):9.3f}", flush=True)


def spread(errors: list[float]) -> str:
    return f"{100 * np.median(errors):8.3f} /{100 * max(errors):9.3f}"


if __name__ == "__main__":
    main()
