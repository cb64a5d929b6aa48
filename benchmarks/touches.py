"""Touches in statics: how many of them the full organ answers, and what becomes of the others.

    python benchmarks/touches.py [POINTS]

Random touchable nodes of seven of the bodies of trust.py, each body nearly incompressible and under each law, moved in
any direction, each from rest to four depths, as `viscera check` asks the full organ. POINTS contacts for each body and
law, 6 by default: 2,184 touches. One that ends "step too small" is solved again, once with ten times the iterations,
once in eight load steps that become as small as they must. `missed` counts those that then come to an end: they could
have been solved and were not. Of the others, `crushed` counts those that stop with a cell pressed to less than a tenth
of its volume: where a law's energy is finite for a flat cell, there may be no equilibrium beyond. Counts depend on
neither load nor threads.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from machine import describe
from trust import DEPTHS, Case, bodies, laws

import viscera as vs
from viscera import defaults
from viscera.mesh import Floats, Indices
from viscera.reduced.check import PATIENCE, unit_vectors
from viscera.study.case import middle

BODIES = ("liver, left lobe", "artery", "block with a tunnel", "bar", "plate", "ball", "hook")

STATUSES = ("converged", "converged past an instability", "limit point", "step too small")

LONGER: Mapping[str, float] = {**PATIENCE, "max_iterations": 10 * PATIENCE["max_iterations"]}
SMALLER: Mapping[str, float] = {"tolerance": PATIENCE["tolerance"]}

CRUSHED = 0.1
"""Part of its volume at rest below which a cell is crushed."""


@dataclass(frozen=True)
class Pushed:
    """A touch of the full organ."""

    status: str
    iterations: int
    is_missed: bool = False
    """It could have been solved."""
    is_crushed: bool = False


def prepared(case: Case) -> tuple[vs.Organ, Indices]:
    """The organ and the nodes to be touched."""
    organ = vs.Organ(case.mesh(), case.law, fixed=case.fixed, element=case.element)
    mesh, nodes = organ.mesh, organ.touchable(case.touchable)
    near = mesh.near(mesh.points[middle(mesh, nodes)], case.reach * mesh.diagonal)
    return organ, np.intersect1d(nodes, near)


def push(case: Case, points: int, seed: int) -> list[Pushed]:
    """Random touches of an organ, each at all depths and each from rest."""
    random = np.random.default_rng(seed)
    organ, nodes = prepared(case)
    mesh, chosen, directions = organ.mesh, random.choice(nodes, points), unit_vectors(points, random)

    def one(touch: tuple[int, float]) -> Pushed:
        k, depth = touch
        patch = organ.patch(mesh.points[chosen[k]], defaults.RADIUS_FRACTION * mesh.diagonal)
        moved = {patch: depth * mesh.diagonal * directions[k]}
        state = organ.solve(displacement=moved, settings=PATIENCE)
        found = Pushed(state.status, state.iterations)
        if state.status != "step too small":
            return found
        longer = organ.solve(displacement=moved, settings=LONGER)
        smaller = organ.solve(displacement=moved, settings=SMALLER, steps=8)
        is_missed = longer.is_converged or smaller.is_converged
        return replace(found, is_missed=is_missed, is_crushed=not is_missed and least_volume(smaller) < CRUSHED)

    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(one, [(k, depth) for k in range(points) for depth in DEPTHS]))


def least_volume(state: vs.State) -> float:
    """Volume of the cell that is pressed most, over that at rest."""
    mesh = state.mesh

    def volumes(points: Floats) -> Floats:
        a, b, c, d = points[mesh.cells].swapaxes(0, 1)
        return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a))

    return float((volumes(mesh.points + state.displacement) / volumes(mesh.points)).min())


def line(name: str, rows: list[Pushed]) -> str:
    """One line of the table."""
    statuses = Counter(row.status for row in rows)
    counts = [len(rows), *(statuses[status] for status in STATUSES)]
    counts += [sum(row.is_missed for row in rows), sum(row.is_crushed for row in rows)]
    return f"{name:22s}" + "".join(f"{count:11d}" for count in counts) + f"{mean_iterations(rows):12.2f}"


def mean_iterations(rows: list[Pushed]) -> float:
    """Of Newton's method, those of load steps that failed included."""
    return sum(row.iterations for row in rows) / max(len(rows), 1)


def kind(case: Case) -> str:
    """A law, or nearly incompressible."""
    return type(case.law).__name__ if case.element == "P1" else "nearly incompressible"


def main(points: int) -> None:
    """A line for each law, each body and all."""
    print(describe())
    head = ("touches", "converged", "past inst.", "limit pt.", "too small", "missed", "crushed")
    print(f"{'':22s}" + "".join(f"{words:>11s}" for words in head) + "  iterations", flush=True)
    chosen = [body for body in bodies() if body.body in BODIES]
    cases = [c for body in chosen for c in (body, *(replace(body, law=law, element="P1") for law in laws()))]
    found = [(case, push(case, points, 9000 + k)) for k, case in enumerate(cases)]

    def total(name: str, belongs: Callable[[Case], bool]) -> None:
        print(line(name, [row for case, rows in found if belongs(case) for row in rows]))

    for name in dict.fromkeys(map(kind, cases)):
        total(name, lambda case, name=name: kind(case) == name)
    for body in BODIES:
        total(body, lambda case, body=body: case.body == body)
    total("all", lambda _: True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 6)
