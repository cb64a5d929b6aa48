"""Two fingers on the liver: superposition, the Galerkin model and full Newton; and what the model does for one finger.

    python benchmarks/fingers.py [MODEL] [PAIRS TOUCHES]      (default: reduce the liver first; 60 40)

Neo-Hookean, E = 0.17 MPa, nu = 0.48, linear tetrahedra, patches of a tenth of the diagonal. Places and directions are
random and unseen; pairs are drawn in equal parts from four ranges of distance. Errors are relative to the norm of the
full solution over all nodes, those of the force over all contacts; where Newton itself finds no equilibrium there is
nothing to compare with.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from machine import describe

import viscera as vs
from viscera.check import PATIENCE, surface_points, unit_vectors

Array = np.ndarray
Answer = tuple[Array, Array]  # field (n, 3) and forces (k, 3)

PAIR_DEPTHS, TOUCH_DEPTHS = (0.05, 0.10), (0.05, 0.10, 0.15)
BANDS = (1.0, 2.0, 3.0, 4.5, np.inf)  # distances of two fingers, in patch radii
TICKS = 2000  # of the moving hand, a millisecond each
SPEED = 0.1  # of the hand [m/s]


@dataclass(frozen=True)
class Case:
    """Contacts at points (k, 3), displaced along unit directions (k, 3), by which the full solutions are known."""

    points: Array
    directions: Array
    truths: dict[float, Answer]

    @property
    def distance(self) -> float:
        """Between the first and the last contact [m]."""
        return float(np.linalg.norm(self.points[0] - self.points[-1]))


def pairs(touch: vs.Touch, count: int, seed: int) -> list[tuple[Array, Array]]:
    """Points and directions of pairs, the bands of distance in turn."""
    random, found = np.random.default_rng(seed), []
    while len(found) < count:
        points, directions = surface_points(touch, 2, random), unit_vectors(2, random)
        band = len(found) % (len(BANDS) - 1)
        if BANDS[band] <= np.linalg.norm(points[0] - points[1]) / touch.radius < BANDS[band + 1]:
            found.append((points, directions))
    return found


def singles(touch: vs.Touch, count: int, seed: int) -> list[tuple[Array, Array]]:
    """Points and directions of single touches."""
    random = np.random.default_rng(seed)
    points, directions = surface_points(touch, count, random), unit_vectors(count, random)
    return [(points[k : k + 1], directions[k : k + 1]) for k in range(count)]


def solved(touch: vs.Touch, asked: list[tuple[Array, Array]], depths: tuple[float, ...]) -> list[Case]:
    """The full solutions, each going on from the shallower one."""
    organ = touch.organ()

    def solve(points: Array, directions: Array) -> Case:
        patches, state, truths = [touch.patch(point) for point in points], None, {}
        for depth in depths:
            pushes = depth * touch.mesh.diagonal * directions
            moved = dict(zip(patches, pushes, strict=True))
            state = organ.solve(displacement=moved, start=state, settings=PATIENCE)
            if not state.is_converged:
                break
            truths[depth] = state.displacement, np.array([state.reaction(patch) for patch in patches])
        return Case(points, directions, truths)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(solve, *zip(*asked, strict=True)))


def superposition(touch: vs.Touch, points: Array, pushes: Array) -> Answer:
    """What the single touches do, added up."""
    answers = [touch(point, push) for point, push in zip(points, pushes, strict=True)]
    return np.sum([answer.displacement for answer in answers], axis=0), np.array([a.force for a in answers])


def relative(value: Array, truth: Array) -> float:
    return float(np.linalg.norm(value - truth) / np.linalg.norm(truth))


def spread(errors: list[float]) -> str:
    """Median and worst in per cent."""
    return f"{100 * np.median(errors):8.2f} {100 * np.max(errors):8.2f}" if errors else f"{'-':>8s} {'-':>8s}"


def table(title: str, rows: dict[str, list[tuple[float, float]]]) -> None:
    """Errors of field and force by kind of answer."""
    print(f"\n{title:42s}  cases   field: median  worst   force: median  worst")
    for name, errors in rows.items():
        fields, forces = [field for field, _ in errors], [force for _, force in errors]
        print(f"  {name:40s}  {len(errors):5d}       {spread(fields)}       {spread(forces)}")


def compare_pairs(fingers: vs.Galerkin, cases: list[Case]) -> None:
    """Superposition and the Galerkin model against Newton, by depth and by distance."""
    touch = fingers.touch
    errors: dict[tuple[float, int], dict[str, list[tuple[float, float]]]] = {}
    estimates: list[tuple[float, float]] = []
    for case in cases:
        grasp = fingers.grasp(case.points)
        band = int(np.searchsorted(BANDS, case.distance / touch.radius, side="right")) - 1
        for depth, (field, forces) in case.truths.items():
            pushes = depth * touch.mesh.diagonal * case.directions
            held = grasp.solve(pushes)
            found = {"superposition": superposition(touch, case.points, pushes)}
            found["moved, with coupling fields"] = grasp.superposed(pushes), held.force
            found["Galerkin model"] = held.displacement, held.force
            if held.is_trusted:
                found["  where it trusts itself"] = held.displacement, held.force
                estimates.append((held.error_estimate, relative(held.displacement, field)))
            for name, (u, f) in found.items():
                rows = errors.setdefault((depth, band), {}).setdefault(name, [])
                rows.append((relative(u, field), relative(f, forces)))
    for depth in PAIR_DEPTHS:
        every: dict[str, list[tuple[float, float]]] = {}
        for (at, _), rows in errors.items():
            for name, found in rows.items() if at == depth else ():
                every.setdefault(name, []).extend(found)
        table(f"two fingers, {100 * depth:.0f} % of the diagonal", every)
        for band, low in enumerate(BANDS[:-1]):
            high = f"to {BANDS[band + 1]:g}" if np.isfinite(BANDS[band + 1]) else "and more"
            if (depth, band) in errors:
                table(f"  apart by {low:g} {high} patch radii", errors[depth, band])
    below = np.mean([error <= estimate for estimate, error in estimates]) if estimates else 0.0
    print(f"\nerror below its estimate in {100 * below:.0f} % of the {len(estimates)} trusted answers")


def compare_singles(fingers: vs.Galerkin, cases: list[Case]) -> None:
    """One finger: the series alone and the Galerkin model."""
    touch = fingers.touch
    for depth in TOUCH_DEPTHS:
        errors: dict[str, list[tuple[float, float]]] = {}
        for case in cases:
            if depth not in case.truths:
                continue
            (field, force), push = case.truths[depth], depth * touch.mesh.diagonal * case.directions
            answer, held = touch(case.points[0], push[0]), fingers.solve([(case.points[0], push[0])])
            found = {"series": (answer.displacement, answer.force[None], answer.is_trusted)}
            found["Galerkin model"] = held.displacement, held.force, held.is_trusted
            for name, (u, f, is_trusted) in found.items():
                error = relative(u, field), relative(f, force)
                errors.setdefault(name, []).append(error)
                if is_trusted:
                    errors.setdefault(f"  {name}, trusted", []).append(error)
        table(f"one finger, {100 * depth:.0f} % of the diagonal", errors)


def times(fingers: vs.Galerkin, cases: list[Case]) -> None:
    """Milliseconds of taking hold, of single solutions, and of every tick of a hand that moves."""
    touch, random = fingers.touch, np.random.default_rng(5)
    grasps = [fingers.grasp(case.points) for case in cases[:20]]
    print("\nmilliseconds                                       p50      p99    worst")

    def report(name: str, seconds: list[float]) -> None:
        p50, p99, worst = 1e3 * np.quantile(seconds, [0.5, 0.99, 1.0])
        print(f"  {name:44s} {p50:8.3f} {p99:8.3f} {worst:8.3f}")

    report("taking hold", [grasp.seconds for grasp in grasps])
    for depth in PAIR_DEPTHS:
        for name, stiffness in (("forces", False), ("forces and stiffness", True)):
            cold = [
                grasp.solve(depth * touch.mesh.diagonal * unit_vectors(2, random), stiffness=stiffness).seconds
                for grasp in grasps
                for _ in range(50)
            ]
            report(f"from the superposed series, {100 * depth:.0f} %, {name}", cold)
    for name, stiffness in (("forces", False), ("forces and stiffness", True)):
        report(f"a tick of a moving hand, {name}", moving(touch, grasps, random, stiffness))
    modes, cells = (np.median([getattr(grasp, what) for grasp in grasps]) for what in ("modes", "cells"))
    print(f"  {modes:.0f} modes on {cells:.0f} of {len(touch.mesh.cells)} cells (medians)")


def moving(touch: vs.Touch, grasps: list[vs.Grasp], random: np.random.Generator, stiffness: bool) -> list[float]:
    """Both fingers wander at `SPEED` within the ball of 5 % of the diagonal."""
    seconds, reach = [], 0.05 * touch.mesh.diagonal
    for grasp in grasps[:5]:
        at, heading = np.zeros((2, 3)), unit_vectors(2, random)
        for _ in range(TICKS // 5):
            heading += 0.1 * random.standard_normal((2, 3)) - 0.05 * at / reach
            heading /= np.linalg.norm(heading, axis=1, keepdims=True)
            at = at + 1e-3 * SPEED * heading
            at *= np.minimum(1.0, reach / np.maximum(np.linalg.norm(at, axis=1, keepdims=True), 1e-12))
            seconds.append(grasp.solve(at, from_last=True, stiffness=stiffness).seconds)
    return seconds


def timed(what: str, make: Callable[[], vs.Touch | vs.Galerkin]) -> vs.Touch | vs.Galerkin:
    began = perf_counter()
    made = make()
    print(f"{what}: {perf_counter() - began:.1f} s", flush=True)
    return made


def main() -> None:
    """Reduce, sample, solve, compare."""
    words = sys.argv[1:]
    model = words.pop(0) if words and not words[0].isdigit() else None
    n_pairs, n_touches = (int(word) for word in words or ("60", "40"))
    print(describe())
    if model:
        touch = vs.load(model)
    else:
        law = vs.NeoHookean(young=0.17e6, poisson=0.48)
        organ = vs.Organ(vs.organs.liver(), law, fixed="hilum", element="P1")
        touch = timed("series of all positions", lambda: organ.reduce("anterior"))
    print(touch)
    fingers = timed("choosing cells", touch.galerkin)
    cases = solved(touch, pairs(touch, n_pairs, seed=1), PAIR_DEPTHS)
    print("Newton converged for " + ", ".join(_count(cases, depth) for depth in PAIR_DEPTHS))
    times(fingers, cases)
    compare_pairs(fingers, cases)
    cases = solved(touch, singles(touch, n_touches, seed=2), TOUCH_DEPTHS)
    print("\nNewton converged for " + ", ".join(_count(cases, depth) for depth in TOUCH_DEPTHS))
    compare_singles(fingers, cases)


def _count(cases: list[Case], depth: float) -> str:
    return f"{sum(depth in case.truths for case in cases)} of {len(cases)} at {100 * depth:.0f} %"


if __name__ == "__main__":
    main()
