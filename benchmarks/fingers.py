"""Two fingers on the liver: superposition, the Galerkin model and full Newton; what it does for one; and its times.

    python benchmarks/fingers.py [MODEL or ELEMENT] [PAIRS TOUCHES]      (default: reduce the liver of "P1"; 40 20)

Neo-Hookean, E = 0.17 MPa, nu = 0.48, patches of a tenth of the diagonal. Places and directions are
random and unseen; pairs are drawn in equal parts from four ranges of distance. Errors are relative to the norm of the
full solution over all nodes, those of the force over all contacts. Where Newton finds no equilibrium there is nothing
to compare with; where it passed an instability there may be several, and such answers are counted apart.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path
from time import perf_counter, sleep
from typing import NamedTuple

import numpy as np
from machine import describe

import viscera as vs
from viscera.reduced.check import PATIENCE, surface_points, unit_vectors
from viscera.reduced.galerkin import Galerkin, HyperReducedModel
from viscera.supported import ELEMENTS

Array = np.ndarray

PAIR_DEPTHS, TOUCH_DEPTHS = (0.05, 0.10), (0.05, 0.10, 0.15)
BANDS = (1.0, 2.0, 3.0, 4.5, np.inf)  # distances of two fingers, in patch radii
TOLERANCES = (0.05, 0.02, 0.01, 0.005)  # of sampling
SNAPSHOTS = 160  # at most
BUDGET = 0.8e-3  # of the searches of a hand that must not be late [s]
TICKS = 400  # of a moving hand, a millisecond each
SPEED = 0.1  # of the hand [m/s]


class Truth(NamedTuple):
    """A full solution."""

    field: Array
    forces: Array
    is_stable: bool


class Score(NamedTuple):
    """One answer to one case: errors relative to the full solution."""

    kind: str
    depth: float
    band: int
    field: float
    force: float
    is_stable: bool


@dataclass(frozen=True)
class Case:
    """Contacts at points (k, 3), displaced along unit directions (k, 3), and the full solutions by depth."""

    points: Array
    directions: Array
    truths: dict[float, Truth]
    band: int


def pairs(touch: vs.Touch, count: int, seed: int) -> list[tuple[Array, Array, int]]:
    """Points and directions of pairs, the bands of distance in turn."""
    random, found = np.random.default_rng(seed), []
    while len(found) < count:
        points, directions = surface_points(touch, 2, random), unit_vectors(2, random)
        band = len(found) % (len(BANDS) - 1)
        if BANDS[band] <= np.linalg.norm(points[0] - points[1]) / touch.radius < BANDS[band + 1]:
            found.append((points, directions, band))
    return found


def singles(touch: vs.Touch, count: int, seed: int) -> list[tuple[Array, Array, int]]:
    """Points and directions of single touches."""
    random = np.random.default_rng(seed)
    points, directions = surface_points(touch, count, random), unit_vectors(count, random)
    return [(points[k : k + 1], directions[k : k + 1], 0) for k in range(count)]


def solved(touch: vs.Touch, asked: list[tuple[Array, Array, int]], depths: tuple[float, ...]) -> list[Case]:
    """The full solutions, each going on from the shallower one."""
    organ = touch.organ()

    def solve(points: Array, directions: Array, band: int) -> Case:
        patches, state, truths = [touch.patch(point) for point in points], None, {}
        for depth in depths:
            pushes = depth * touch.mesh.diagonal * directions
            moved = dict(zip(patches, pushes, strict=True))
            state = organ.solve(displacement=moved, start=state, settings=PATIENCE)
            if not state.is_converged:
                break
            forces = np.array([state.reaction(patch) for patch in patches])
            truths[depth] = Truth(state.displacement, forces, "instability" not in state.status)
        return Case(points, directions, truths, band)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        cases = list(pool.map(solve, *zip(*asked, strict=True)))
    counts = (f"{sum(depth in case.truths for case in cases)} at {100 * depth:.0f} %" for depth in depths)
    print(f"\nNewton converged for {', '.join(counts)} of {len(cases)} cases", flush=True)
    return cases


def superposition(touch: vs.Touch, points: Array, pushes: Array) -> tuple[Array, Array]:
    """What the single touches do, added up."""
    answers = [touch(point, push) for point, push in zip(points, pushes, strict=True)]
    return np.sum([answer.displacement for answer in answers], axis=0), np.array([a.force for a in answers])


def relative(value: Array, truth: Array) -> float:
    return float(np.linalg.norm(value - truth) / np.linalg.norm(truth))


def scores(
    touch: vs.Touch, grasps: list[HyperReducedModel], cases: list[Case], name: str = "Galerkin"
) -> tuple[list[Score], list[tuple[float, float]]]:
    """The Galerkin model's answers, and of the trusted ones error over estimate, of field and force."""
    found: list[Score] = []
    ratios: list[tuple[float, float]] = []
    for grasp, case in zip(grasps, cases, strict=True):
        for depth, truth in case.truths.items():
            held = grasp.solve(depth * touch.mesh.diagonal * case.directions, stiffness=False)
            error = relative(held.displacement, truth.field), relative(held.force, truth.forces)
            kinds = [name] + [f"{name}, trusted"] * held.is_trusted
            found += [Score(kind, depth, case.band, *error, truth.is_stable) for kind in kinds]
            ratio = error[0] / held.shape_error_estimate, error[1] / held.error_estimate
            ratios += [ratio] * held.is_trusted
    return found, ratios


def superposed(touch: vs.Touch, cases: list[Case]) -> list[Score]:
    """The sum of the single touches."""
    found = []
    for case in cases:
        for depth, truth in case.truths.items():
            field, force = superposition(touch, case.points, depth * touch.mesh.diagonal * case.directions)
            error = relative(field, truth.field), relative(force, truth.forces)
            found.append(Score("superposition", depth, case.band, *error, truth.is_stable))
    return found


def table(title: str, found: Iterable[Score]) -> None:
    """Errors of field and force by kind of answer, in per cent: median, 90 % and worst."""
    rows: dict[str, list[Score]] = {}
    for score in found:
        rows.setdefault(score.kind if score.is_stable else f"{score.kind}, past an instability", []).append(score)
    print(f"\n{title:52s} cases   field: median     90 %    worst   force: median     90 %    worst")
    for name, scored in rows.items():
        errors = (np.quantile([s[k] for s in scored], [0.5, 0.9, 1.0]) for k in (3, 4))
        columns = "  ".join("     " + " ".join(f"{100 * error:8.2f}" for error in three) for three in errors)
        print(f"  {name:50s} {len(scored):5d}  {columns}", flush=True)


def compare(touch: vs.Touch, grasps: dict[str, list[HyperReducedModel]], cases: list[Case]) -> None:
    """Superposition and the Galerkin models against Newton, by depth and by distance."""
    found, ratios = superposed(touch, cases), []
    for name, some in grasps.items():
        own, of_trusted = scores(touch, some, cases, name)
        found, ratios = found + own, ratios + of_trusted
    for depth in PAIR_DEPTHS:
        table(f"two fingers, {100 * depth:.0f} % of the diagonal", (s for s in found if s.depth == depth))
        for band, (low, high) in enumerate(pairwise(BANDS)):
            title = f"  apart by {low:g} to {high:g} patch radii"
            table(title, (s for s in found if (s.depth, s.band) == (depth, band) and "trusted" not in s.kind))
    if ratios:
        fields, forces = 100 * np.mean(np.array(ratios) <= 1, axis=0)
        counts = f"{fields:.0f} % are nearer than estimated, of their forces {forces:.0f} %"
        print(f"\nof {len(ratios)} trusted fields {counts}")


def compare_one(fingers: Galerkin, cases: list[Case]) -> None:
    """One finger: the series alone and the Galerkin model."""
    grasps = [fingers.grasp(case.points) for case in cases]
    found = superposed(fingers.touch, cases) + scores(fingers.touch, grasps, cases)[0]
    for depth in TOUCH_DEPTHS:
        named = (s._replace(kind="series") if s.kind == "superposition" else s for s in found if s.depth == depth)
        table(f"one finger, {100 * depth:.0f} % of the diagonal", named)


def sampled(touch: vs.Touch, cases: list[Case]) -> None:
    """What cells cost and bring."""
    for tolerance in TOLERANCES:
        fingers = touch.galerkin(tolerance=tolerance)
        grasps = [fingers.grasp(case.points) for case in cases[:20]]
        cells, seconds = (np.median([getattr(grasp, what) for grasp in grasps]) for what in ("cells", "seconds"))
        tick = np.median(moving(touch, grasps[:5], np.random.default_rng(5), stiffness=True))
        name = f"{cells:.0f} cells, hold {seconds:.2f} s, tick {1e3 * tick:.2f} ms"
        found, _ = scores(touch, grasps, cases[:20], name)
        for depth in PAIR_DEPTHS:
            chosen = (s for s in found if s.depth == depth and s.is_stable and "trusted" not in s.kind)
            table(f"sampling to {tolerance:g}: two fingers, {100 * depth:.0f} %", chosen)


def times(touch: vs.Touch, grasps: list[HyperReducedModel], name: str) -> None:
    """Milliseconds of taking hold, of single solutions, and of every tick of a hand that moves."""
    random = np.random.default_rng(5)
    size = (f"{np.median([getattr(grasp, what) for grasp in grasps]):.0f}" for what in ("snapshots", "modes", "cells"))
    print(f"\n{name}: {{}} snapshots, {{}} modes on {{}} of {len(touch.mesh.cells)} cells (medians); ms".format(*size))
    print(f"{'':48s}      p50      p99    worst   within 1 ms")
    report("taking hold", [grasp.seconds for grasp in grasps])
    for depth in PAIR_DEPTHS:
        pushes = depth * touch.mesh.diagonal * np.array([unit_vectors(2, random) for _ in range(20)])
        cold = [grasp.solve(push, stiffness=False).seconds for grasp in grasps for push in pushes]
        report(f"anew, {100 * depth:.0f} % of the diagonal, forces", cold)
    for name, stiffness in (("forces", False), ("forces and stiffness", True)):
        report(f"a tick of a moving hand, {name}", moving(touch, grasps, random, stiffness))
    report(f"the same, forces, budget of {1e3 * BUDGET:g} ms", moving(touch, grasps, random, False, BUDGET))


def report(name: str, seconds: list[float]) -> None:
    p50, p99, worst = 1e3 * np.quantile(seconds, [0.5, 0.99, 1.0])
    within = 100 * np.mean(np.array(seconds) <= 1e-3)
    print(f"  {name:46s} {p50:8.3f} {p99:8.3f} {worst:8.3f} {within:10.1f} %", flush=True)


def moving(
    touch: vs.Touch,
    grasps: list[HyperReducedModel],
    random: np.random.Generator,
    stiffness: bool,
    budget: float | None = None,
) -> list[float]:
    """Seconds of every tick of a hand."""
    hands = (hand(touch, random) for _ in grasps)
    return [
        grasp.solve(at, from_last=True, stiffness=stiffness, budget=budget).seconds
        for grasp, places in zip(grasps, hands, strict=True)
        for at in islice(places, TICKS)
    ]


def hand(touch: vs.Touch, random: np.random.Generator) -> Iterator[Array]:
    """Displacements (2, 3) of two fingers that wander at `SPEED` within the ball of 5 % of the diagonal, every ms."""
    reach, at, heading = 0.05 * touch.mesh.diagonal, np.zeros((2, 3)), unit_vectors(2, random)
    while True:
        heading += 0.1 * random.standard_normal((2, 3)) - 0.05 * at / reach
        heading /= np.linalg.norm(heading, axis=1, keepdims=True)
        at = at + 1e-3 * SPEED * heading
        at *= np.minimum(1.0, reach / np.maximum(np.linalg.norm(at, axis=1, keepdims=True), 1e-12))
        yield at


def learning(fingers: Galerkin, cases: list[Case]) -> None:
    """Hands that do not wait for snapshots: first answer, end of training, and the ticks meanwhile."""
    random, first, over, ticks = np.random.default_rng(5), [], [], []
    for case in cases:
        began = perf_counter()
        grasp, places = fingers.grasp(case.points, wait=False), hand(fingers.touch, random)
        grasp.solve(next(places), stiffness=False)
        first.append(perf_counter() - began)
        while grasp.is_training:
            now = perf_counter()
            ticks.append(grasp.solve(next(places), from_last=True, stiffness=False).seconds)
            sleep(max(0.0, now + 1e-3 - perf_counter()))
        over.append(grasp.seconds)
    print(f"\nwithout waiting for snapshots: {len(cases)} hands of one tick a millisecond; ms")
    print(f"{'':48s}      p50      p99    worst   within 1 ms")
    report("from taking hold to the first answer", first)
    report("from taking hold to the end of training", over)
    report("a tick meanwhile, forces", ticks)


def timed(what: str, make: Callable[[], vs.Touch | Galerkin]) -> vs.Touch | Galerkin:
    began = perf_counter()
    made = make()
    print(f"{what}: {perf_counter() - began:.2f} s", flush=True)
    return made


def main() -> None:
    """Reduce, take hold, solve, compare."""
    words = sys.argv[1:]
    what = words.pop(0) if words and not words[0].isdigit() else "P1"
    n_pairs, n_touches = (int(word) for word in words or ("40", "20"))
    print(describe())
    if what in ELEMENTS:
        law = vs.NeoHookean(young=0.17e6, poisson=0.48)
        organ = vs.Organ(vs.organs.liver(), law, fixed="hilum", element=what)
        touch = timed(f"series of all positions, {what}", lambda: organ.reduce("anterior"))
        print(touch)
    else:
        touch = vs.load(what)
        print(f"series of all positions, read from a file of {1e-6 * Path(what).stat().st_size:.0f} MB: {touch}")
    fingers = timed("what several touches need beyond the series, off-line", touch.galerkin)
    cases = solved(touch, pairs(touch, n_pairs, seed=1), PAIR_DEPTHS)
    taught = touch.galerkin(snapshots=SNAPSHOTS)
    grasps = {
        "Galerkin": [fingers.grasp(case.points) for case in cases],
        "Galerkin, snapshots": [taught.grasp(case.points) for case in cases],
    }
    for name, some in grasps.items():
        times(touch, some[:20], name)
    learning(taught, cases[:6])
    compare(touch, grasps, cases)
    sampled(touch, cases)
    compare_one(fingers, solved(touch, singles(touch, n_touches, seed=2), TOUCH_DEPTHS))


if __name__ == "__main__":
    main()
