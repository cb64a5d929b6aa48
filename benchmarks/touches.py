"""Touches in statics: how many of them the full organ answers in one load step, and what stops the others.

    python benchmarks/touches.py [POINTS]

Random touchable nodes of seven of the bodies of trust.py under each law, displacements in any direction, each pushed
from rest to four depths, as `viscera check` asks the full organ. POINTS contacts for each body and law, 6 by default:
2,016 touches. A touch that ends "step too small" is solved again with ten times the iterations, and in eight load
steps that may become as small as they must: `mended` counts those that one of the two brings to an end. Such a touch
could have been solved and was not. Counts depend on neither load nor threads.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from machine import describe
from trust import DEPTHS, Case, bodies, laws

import viscera as vs
from viscera import defaults
from viscera.check import PATIENCE, unit_vectors
from viscera.law import Law

BODIES = ("liver, left lobe", "artery", "block with a tunnel", "bar", "plate", "ball", "hook")

STATUSES = ("converged", "converged past an instability", "limit point", "step too small")

PATIENT: Mapping[str, float] = {**PATIENCE, "max_iterations": 10 * PATIENCE["max_iterations"]}
IN_STEPS: Mapping[str, Any] = {"tolerance": PATIENCE["tolerance"]}


@dataclass(frozen=True)
class Pushed:
    """A touch of the full organ."""

    status: str
    iterations: int
    message: str
    with_iterations: str = ""
    """How it ends with more of them, if it ended with a step too small."""
    with_steps: str = ""

    @property
    def is_mended(self) -> bool:
        """Whether a step too small was none to be."""
        return any(status.startswith("converged") for status in (self.with_iterations, self.with_steps))


def organ_of(case: Case) -> tuple[vs.Organ, Any]:
    """The organ and the nodes to be touched, within the reach of the case."""
    from viscera.study.case import middle

    organ = vs.Organ(case.mesh(), case.law, fixed=case.fixed, element=case.element)
    mesh, nodes = organ.mesh, organ.touchable(case.touchable)
    near = mesh.near(mesh.points[middle(mesh, nodes)], case.reach * mesh.diagonal)
    return organ, np.intersect1d(nodes, near)


def push(case: Case, points: int, seed: int) -> list[Pushed]:
    """Random touches of one organ, each at all depths and each from rest."""
    random = np.random.default_rng(seed)
    organ, nodes = organ_of(case)
    diagonal = organ.mesh.diagonal
    chosen, directions = random.choice(nodes, points), unit_vectors(points, random)

    def one(touch: tuple[int, float]) -> Pushed:
        k, depth = touch
        patch = organ.patch(organ.mesh.points[chosen[k]], defaults.RADIUS_FRACTION * diagonal)
        displacement = {patch: depth * diagonal * directions[k]}
        state = organ.solve(displacement=displacement, settings=PATIENCE)
        found = Pushed(state.status, state.iterations, state.message)
        if state.status != "step too small":
            return found
        longer = organ.solve(displacement=displacement, settings=PATIENT)
        smaller = organ.solve(displacement=displacement, settings=IN_STEPS, steps=8)
        if "-v" in sys.argv:
            print(case, k, chosen[k], depth, state.message, [len(r) for r in state.residuals], "|", longer.status, longer.iterations, "|", smaller.status, smaller.iterations, smaller.message, flush=True)
        return replace(found, with_iterations=longer.status, with_steps=smaller.status)

    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(one, [(k, depth) for k in range(points) for depth in DEPTHS]))


def line(name: str, rows: list[Pushed]) -> str:
    """One line of the table."""
    counts = Counter(row.status for row in rows)
    mended = sum(row.is_mended for row in rows)
    iterations = sum(row.iterations for row in rows) / max(len(rows), 1)
    return f"{name:22s}{len(rows):7d}" + "".join(f"{counts[s]:10d}" for s in STATUSES) + f"{mended:8d}{iterations:12.2f}"


def main(points: int) -> None:
    """A line for each law, each body and all."""
    print(describe())
    cases = [replace(body, law=law, element="P1") for body in bodies() if body.body in BODIES for law in laws()]
    found: list[tuple[Case, list[Pushed]]] = []
    for k, case in enumerate(cases):
        found.append((case, push(case, points, 9000 + k)))
        print(line(f"{case.body[:8]} {type(case.law).__name__[:12]}", found[-1][1]), file=sys.stderr, flush=True)
    head = "".join(f"{words:>10s}" for words in ("converged", "past", "limit", "too small"))
    print(f"{'':22s}{'touches':>7s}{head}{'mended':>8s}{'iterations':>12s}")
    kinds: list[type[Law]] = [type(law) for law in laws()]
    for kind in kinds:
        print(line(kind.__name__, [row for case, rows in found if type(case.law) is kind for row in rows]))
    for body in BODIES:
        print(line(body, [row for case, rows in found if case.body == body for row in rows]))
    print(line("all", [row for _, rows in found for row in rows]))


if __name__ == "__main__":
    words = [w for w in sys.argv[1:] if w != "-v"]
    main(int(words[0]) if words else 6)
