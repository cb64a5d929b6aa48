"""A group of measurements of scripts/compare.py, of whatever revision of the package is imported.

    python scripts/compare_rows.py GROUP MODEL

Only public names that no revision has changed, and the meshes beside this script, so that all revisions do the same
work. Prints JSON: the least processor time of each row, or why there is none. `offline` writes its model to MODEL;
`fingers` and the benchmark of touches read it.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np

import viscera as vs

MESHES = Path(__file__).resolve().parent.parent / "python" / "viscera" / "organs"
RUNS, FRAMES, TICKS = 3, 60, 400
ENOUGH = 1.0  # processor time [s] after which nothing is repeated

Row = tuple[str, Callable[[], float]]


def mesh(name: str) -> vs.Mesh:
    return vs.read(MESHES / f"{name}.vtu")


def organ(name: str, fixed: str, element: str) -> vs.Organ:
    return vs.Organ(mesh(name), vs.NeoHookean(young=2e4, poisson=0.45), fixed=fixed, element=element)


def seconds(work: Callable[[], object], scale: float = 1.0) -> float:
    """Least processor time of a few runs, of one if it is long; times a scale."""
    times: list[float] = []
    while len(times) < RUNS and sum(times) < ENOUGH:
        began = process_time()
        work()
        times.append(process_time() - began)
    return scale * min(times)


def solutions(model: str) -> Iterator[Row]:
    """Whole solutions under gravity, from rest [ms]."""
    for name, fixed, element in (
        ("artery", "bottom", "P1"),
        ("liver", "hilum", "P1"),
        ("beam", "clamp", "P1 mean volume"),
    ):
        solve = partial(organ(name, fixed, element).solve, gravity=(0, 0, -1), density=1060, solver="cholesky")
        yield f"solution, {name}, {element} [ms]", partial(seconds, solve, 1e3)


def frames(model: str) -> Iterator[Row]:
    """A frame of a wandering hand, the median [ms]."""
    solvers: dict[str, str | vs.ConjugateGradients] = {
        "cholesky": "cholesky",
        "cg": vs.ConjugateGradients("lagged_cholesky"),
    }
    for name, fixed, hand in (("artery", "bottom", "top"), ("liver", "hilum", "tip")):
        body = organ(name, fixed, "P1")
        for word, solver in solvers.items():
            yield f"frame, {name}, {word} [ms]", partial(walk, body, hand, solver)


def walk(body: vs.Organ, hand: str, solver: str | vs.ConjugateGradients) -> float:
    stepper = body.stepper({hand: (0, 0, 0)}, solver=solver)
    times = []
    for k in range(FRAMES):
        place = 0.03 * body.mesh.diagonal * np.array([np.sin(0.05 * k), 1 - np.cos(0.03 * k), np.sin(0.02 * k)])
        began = process_time()
        stepper.frame({hand: place})
        times.append(process_time() - began)
    return 1e3 * float(np.median(times))


def offline(model: str) -> Iterator[Row]:
    """The off-line stage of a part of a surface [s]."""
    for element in ("P1 mean volume", "P1"):
        beam = organ("beam", "clamp", element)

        def reduce(beam: vs.Organ = beam) -> None:
            beam.reduce("tip", depth=0.1, order=4).save(model)

        yield f"off-line stage, end of the beam, {element} [s]", partial(seconds, reduce)


def fingers(model: str) -> Iterator[Row]:
    """A tick of two fingers that move, the mean [us]."""
    touch, beam = vs.load(model), mesh("beam")
    tip = beam.points[beam.sets["tip"]]
    grasp = touch.galerkin().grasp([tip[0], tip[np.argmax(np.linalg.norm(tip - tip[0], axis=1))]])

    def ticks() -> None:
        for k in range(TICKS):
            push = 0.01 * np.array([np.sin(0.02 * k), np.cos(0.03 * k) - 1, np.sin(0.01 * k)])
            grasp.solve([push, -push], from_last=True, stiffness=False)

    yield "two fingers, a tick [us]", partial(seconds, ticks, 1e6 / TICKS)


GROUPS = {"solutions": solutions, "frames": frames, "offline": offline, "fingers": fingers}


def main(group: str, model: str) -> None:
    """Measure all rows of a group."""
    found: dict[str, float | str] = {}
    for row, measure in GROUPS[group](model):
        try:
            found[row] = measure()
        except Exception as error:  # of any revision: the others still have their rows
            found[row] = f"{type(error).__name__}: {error}"
    print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
