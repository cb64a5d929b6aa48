"""What contact costs on the built-in liver: a Newton iteration and a settled frame with a tool or another organ, beside
those without.

    python benchmarks/contact.py [--write]

A sphere goes 10 mm into the lobe in 20 quasi-static frames of at most 8 Newton iterations; beside it the contact patch
of about its size goes the same way. Then a soft block does, an organ whose back is moved, with the pair of their
surfaces and, as if the liver were not there, without. The patch goes its way once more on a liver that may touch
itself, and does not. Milliseconds are medians of the time of the processor, the least of three runs. `layer` is the
stiffness of the layer between tool and organ in units of the plane strain modulus over the height of a cell, 30 by
default. Whole solutions of the same are timed by each solver beside the one that is chosen automatically.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np
from machine import describe

import viscera as vs

FRAMES, DEPTH, RADIUS, RUNS = 20, 0.010, 0.015, 3


Run = tuple[list[vs.Frame], list[float], float, float]
"""The frames, the seconds of the processor that each takes, the last force down, and the last gap."""


def timed(stepper: vs.Stepper, move: Callable[[], None]) -> tuple[list[vs.Frame], list[float]]:
    """The frames, and the seconds of the processor that each takes."""
    frames, seconds = [], []
    for _ in range(FRAMES):
        move()
        began = process_time()
        frames.append(stepper.frame())
        seconds.append(process_time() - began)
    return frames, seconds


def with_patch(liver: vs.Organ, top: np.ndarray, solver: str) -> Run:
    """A held patch goes down, on an organ or on a scene of it."""
    stepper = liver.stepper(solver=solver, iterations=8)
    hand = stepper.grasp(liver.patch(top, RADIUS))
    frames, seconds = timed(stepper, lambda: hand.move((0, 0, -DEPTH / FRAMES)))
    return frames, seconds, -frames[-1].reaction(hand)[2], 0.0


def with_sphere(liver: vs.Organ, top: np.ndarray, solver: str, stiffness: float, friction: float) -> Run:
    """A sphere goes down."""
    stepper = liver.stepper(solver=solver, iterations=8)
    start = top + np.array((0, 0, RADIUS))
    tool = stepper.tool(vs.Tool(vs.Sphere(RADIUS), start, friction=friction, stiffness=stiffness))
    frames, seconds = timed(stepper, lambda: tool.move((0, 0, -DEPTH / FRAMES)))
    return frames, seconds, -frames[-1].force(tool)[2], frames[-1].contact(tool).gap


def block(below: np.ndarray) -> vs.Mesh:
    """A block of 60 x 60 x 30 mm, the middle of its lower face at a point, and its upper face named `back`."""
    x, y, z = np.linspace(-0.03, 0.03, 7), np.linspace(-0.03, 0.03, 7), np.linspace(0.0, 0.03, 4)
    points = np.array([(a, b, c) for c in z for b in y for a in x])
    corner = np.array([i + 7 * (j + 7 * k) for k in range(3) for j in range(6) for i in range(6)])
    paths = [np.cumsum((0, *order)) for order in itertools.permutations((1, 7, 49))]
    cells = np.vstack([corner[:, None] + path for path in paths])
    return vs.mesh(points + below, cells, {"back": np.flatnonzero(points[:, 2] == 0.03)})


def with_block(liver: vs.Organ, top: np.ndarray, friction: float | None) -> tuple[vs.Scene, vs.ContactPair]:
    """The liver and a soft block on it, whose surfaces may touch each other; without friction given, they do not."""
    weak = vs.ElasticSupport("back", stiffness=1.0)  # nothing beside the hand that holds it
    soft = vs.Organ(block(top), vs.NeoHookean(young=10e3, poisson=0.45), supports=[weak])
    pair = vs.ContactPair("liver", "block", friction=friction or 0.0)
    return vs.Scene({"liver": liver, "block": soft}, contacts=[] if friction is None else [pair]), pair


def with_organ(liver: vs.Organ, top: np.ndarray, solver: str, friction: float | None) -> Run:
    """The block goes down."""
    scene, pair = with_block(liver, top, friction)
    stepper = scene.stepper(solver=solver, iterations=20)
    hand = stepper.grasp("block/back")
    frames, seconds = timed(stepper, lambda: hand.move((0, 0, -DEPTH / FRAMES)))
    if friction is None:
        return frames, seconds, 0.0, 0.0
    return frames, seconds, -frames[-1].force(pair)[2], frames[-1].contact(pair).gap


def row(name: str, runs: list[Run]) -> str:
    """The run whose median frame is the fastest."""
    frames, times, force, gap = min(runs, key=lambda run: float(np.median(run[1])))
    steps = np.array([frame.steps for frame in frames])
    seconds = np.array(times)
    each = 1e3 * np.median(seconds / steps)
    settled = sum(frame.is_settled for frame in frames)
    told = f"{1e6 * gap:.1f}" if gap < 0 else ""
    measured = f"{each:<12.2f}{1e3 * np.median(seconds):<12.2f}{steps.mean():<10.2f}"
    return f"{name:<42}{measured}{settled:>2d} of {len(frames):<10d}{force:<10.3f}{told}"


def solutions(liver: vs.Organ, top: np.ndarray) -> Iterator[str]:
    """Whole solutions by each solver: seconds of the processor, the least of all runs, and Newton iterations."""
    yield f"{'solutions [s]':34}cholesky   cg         auto       iterations  by"
    for friction in (0.0, 0.3):
        start = top + np.array((0, 0, RADIUS))
        tool = vs.Tool(vs.Sphere(RADIUS), start, friction=friction, displacement=(0, 0, -DEPTH))
        scene, _ = with_block(liver, top, friction)
        cases = {
            f"sphere, friction {friction:g}": partial(liver.solve, contact=[tool]),
            f"block, pair, friction {friction:g}": partial(scene.solve, displacement={"block/back": (0, 0, -DEPTH)}),
        }
        for name, solve in cases.items():
            seconds = dict.fromkeys(("cholesky", "cg", "auto"), np.inf)
            for _ in range(RUNS):
                for solver in seconds:
                    began = process_time()
                    state = solve(solver=solver)
                    seconds[solver] = min(seconds[solver], process_time() - began)
            told = "".join(f"{each:<11.2f}" for each in seconds.values())
            yield f"{name:34}{told}{state.iterations:<12d}{state.solver}"


def main() -> None:
    liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=5e3, poisson=0.45), fixed="hilum")
    top = liver.mesh.points[liver.mesh.points[:, 2].argmax()]
    heads = f"{'frames':42}iteration   frame       steps     settled         force [N] depth [um]"
    lines: list[str] = []

    def show(line: str) -> None:
        lines.append(line)
        print(line, flush=True)

    for line in (describe(), "", heads):
        show(line)
    watched = vs.Scene({"liver": liver}, contacts=[vs.ContactPair("liver")])
    for solver in ("cholesky", "cg"):
        cases: dict[str, Callable[[], Run]] = {f"held patch, {solver}": partial(with_patch, liver, top, solver)}
        for stiffness in (30.0, 120.0):
            for friction in (0.0, 0.3):
                name = f"sphere, layer {stiffness:g}, friction {friction:g}, {solver}"
                cases[name] = partial(with_sphere, liver, top, solver, stiffness, friction)
        cases[f"held patch, may touch itself, {solver}"] = partial(with_patch, watched, top, solver)
        cases[f"block, no pair, {solver}"] = partial(with_organ, liver, top, solver, None)
        for friction in (0.0, 0.3):
            cases[f"block, pair, friction {friction:g}, {solver}"] = partial(with_organ, liver, top, solver, friction)
        runs = [{name: run() for name, run in cases.items()} for _ in range(RUNS)]  # in turns
        for name in cases:
            show(row(name, [run[name] for run in runs]))
    show("")
    for line in solutions(liver, top):
        show(line)
    if "--write" in sys.argv:
        path = Path(__file__).parent / "results" / "contact.txt"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
