"""How far a target within an organ moves: how often the band around the reduced model's answer holds the truth.

    python benchmarks/targets.py [CONTACTS]

Random contacts of the bodies of benchmarks/trust.py, CONTACTS of each, 50 by default, pushed in any direction to its
four depths: 200 touches of each body, less those at which Newton fails. Five targets in each body, as far from each
other as can be: the eight cells around a place. A touch holds a target where the mean displacement of the target's
surface in the full solution lies within the band of `Answer.target` around that of the model. The bands are to hold 95
of 100 of what the model trusts; they were chosen on other bodies, the `tuning` ones.
"""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from machine import describe
from trust import DEPTHS, Case, study

import viscera as vs
from viscera.mesh import Floats, Indices
from viscera.reduced.check import Full, surface_points, unit_vectors
from viscera.reduced.parts import boundary, centroid_weights

TARGETS, CELLS = 5, 8
CONTACTS = 50
BODIES = ("corner", "bar", "hook")
"""The first case of each."""


@dataclass(frozen=True)
class Asked:
    """A target in a touch."""

    target: int
    distance: float
    band: float
    error: float
    """From the mean displacement of the full solution [m]."""
    is_trusted: bool

    @property
    def is_held(self) -> bool:
        """Whether the full solution lies within the band."""
        return self.error <= self.band


def targets(touch: vs.Touch) -> list[Indices]:
    """The cells around places that are far from each other, the first being the body's middle; none is held."""
    mesh = touch.mesh
    is_held = np.zeros(len(mesh.points), dtype=bool)
    is_held[touch.organ().fixed] = True
    places = mesh.centroids
    free = np.flatnonzero(~is_held[mesh.cells].any(axis=1))
    gap = np.linalg.norm(places - places.mean(axis=0), axis=1)
    chosen = [int(free[gap[free].argmin()])]
    while len(chosen) < TARGETS:
        nearest = np.min([np.linalg.norm(places[free] - places[c], axis=1) for c in chosen], axis=0)
        chosen.append(int(free[nearest.argmax()]))
    return [free[np.linalg.norm(places[free] - places[c], axis=1).argsort()[:CELLS]] for c in chosen]


def ask(touch: vs.Touch, contacts: int, seed: int = 0) -> list[Asked]:
    """Random contacts, each at all depths, from the shallowest to the one at which Newton gives up."""
    random = np.random.default_rng(seed)
    places, directions = surface_points(touch, contacts, random), unit_vectors(contacts, random)
    full, cells = Full(touch), targets(touch)
    surfaces = [centroid_weights(touch.mesh.points, boundary(touch.mesh, each)) for each in cells]

    def one(point: Floats, direction: Floats) -> list[Asked]:
        patch, state, rows = touch.patch(point), None, []
        for depth in DEPTHS:
            push = depth * touch.mesh.diagonal * direction
            state = full.solve(patch, push, state)
            if not state.is_converged:
                break
            answer, truth = touch(point, push), full.added(state)
            for number, (chosen, (nodes, weights)) in enumerate(zip(cells, surfaces, strict=True)):
                found = answer.target(chosen)
                error = float(np.linalg.norm(weights @ truth[nodes] - found.displacement))
                is_trusted = found.is_trusted and state.status == "converged"
                rows.append(Asked(number, found.distance, found.band, error, is_trusted))
        return rows

    with ThreadPoolExecutor(2) as pool:
        return [row for rows in pool.map(one, places, directions) for row in rows]


def share(rows: list[Asked]) -> float:
    """Of targets whose band holds the full solution; 1 of none."""
    return sum(row.is_held for row in rows) / len(rows) if rows else 1.0


def line(name: str, rows: list[Asked]) -> str:
    """One line of the table."""
    trusted = [row for row in rows if row.is_trusted]
    each = "".join(f"{100 * share([row for row in trusted if row.target == k]):5.0f}" for k in range(TARGETS))
    width = np.median([row.band / row.distance for row in trusted if row.distance > 0.0]) if trusted else np.nan
    return (
        f"{name:59s}{len(rows) // TARGETS:8d}{len(trusted) // TARGETS:9d}{each}{100 * share(trusted):7.1f} %"
        f"{100 * share(rows):7.1f} %{100 * width:9.1f} %"
    )


def cases() -> list[Case]:
    """The first case of each body."""
    known = {case.body: case for case in reversed(study())}
    return [known[body] for body in BODIES]


def main() -> None:
    """The table."""
    contacts = int(sys.argv[1]) if len(sys.argv) > 1 else CONTACTS
    print(describe())
    print("held: share of targets whose band holds the full solution, of the touches that the model trusts")
    print(f"{'':59s} touches  trusted held, by target [%]      all  not trusted too  band/distance")
    everything: list[Asked] = []
    for case in cases():
        rows = ask(case.reduce(), contacts)
        everything += rows
        print(line(str(case), rows), flush=True)
    print(line("all", everything))


if __name__ == "__main__":
    main()
