"""Two rigid probes on one reduced model against true contact of both, on paths that neither has seen.

    python benchmarks/probes.py [PAIRS]          # 60 pairs, and microseconds of a tick
    python benchmarks/probes.py PAIRS tuning     # other pairs: what the term of the estimate is fitted to

The organ, its model and the paths are those of benchmarks/probe.py, two paths at a time whose places are far enough
apart for both spheres. True contact is two tools of one `Stepper` on the whole mesh, settled at every pose. Beside the
error of probes that feel each other stands that of probes that do not. An interrupted study goes on where it stopped:
its rows are kept in out/probes-*, to be deleted for a new one.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from time import perf_counter_ns

os.environ.setdefault("RAYON_NUM_THREADS", "1")

import numpy as np
from machine import ROOT, describe
from probe import DRAGS, PRESSES, Route, asked, opened, paths

import viscera as vs
from viscera.mesh import Floats

SEED = {"study": 23, "tuning": 97}
APART = 2.2
"""Least distance of the places, in units of the radius of the patch."""
PARTS = (0.25, 0.5, 0.75, 1.0)
"""A tick is a small step of a path."""


@dataclass(frozen=True)
class Row:
    """One probe of a pair at a pose: what it says, with and without the other, and what true contact says."""

    friction: float
    distance: float
    """Between the places, in units of the radius of the patch."""
    force: float
    force_error: float
    alone_error: float
    field_error: float
    estimate: float
    estimate_alone: float
    carried: float
    """How far the other has moved the surface, over how far the probe has entered it."""
    is_trusted: bool


def start(route: Route) -> Floats:
    return route[2]


def pair(touch: vs.Touch, number: int, seed: int) -> tuple[Route, Route]:
    """Two paths with one friction."""
    several = paths(touch, 1000, 0, seed + 1000 * number)
    one = next(several)
    for other in several:
        if other[1] == one[1] and np.linalg.norm(start(other) - start(one)) > APART * touch.radius:
            return one, other
    raise AssertionError("no second place")


def compared(touch: vs.Touch, number: int, seed: int) -> Iterator[Row]:
    """The rows of a pair. Poses at which true contact does not settle are left out."""
    routes = pair(touch, number, seed)
    friction = routes[0][1]
    distance = float(np.linalg.norm(start(routes[1]) - start(routes[0])) / touch.radius)
    stepper = touch.organ().stepper(iterations=12, solver="cg")
    try:
        tools = [stepper.tool(vs.Sphere(route[0]), position=start(route), friction=friction) for route in routes]
    except vs.VisceraError:
        return  # the place is in a hollow: the sphere touches elsewhere first
    hands, alone = ([touch.probe(route[0], friction=friction) for route in routes] for _ in range(2))
    together, last = vs.Probes(hands), np.array([start(route) for route in routes])
    together.place(last)
    for probe, center in zip(alone, last, strict=True):
        probe.place(center)
    for k in range(PRESSES + DRAGS):
        centers = np.array([route[3][k][1] for route in routes])
        for part in PARTS:
            here = last + part * (centers - last)
            felt = together.place(here)
            lone = [probe.place(center) for probe, center in zip(alone, here, strict=True)]
        last = centers
        for tool, center in zip(tools, centers, strict=True):
            tool.place(center)
        frames = (stepper.frame() for _ in range(6))
        frame = next((frame for frame in frames if frame.is_settled), None)
        if frame is None:
            continue
        moved = frame.displacement
        field_error = np.linalg.norm(together.displacement - moved) / np.linalg.norm(moved)
        for tool, probe, single in zip(tools, felt, lone, strict=True):
            force, size = frame.force(tool), np.linalg.norm(frame.force(tool))
            if size == 0.0 or not probe.is_touching or not single.is_touching:
                continue
            yield Row(
                friction,
                distance,
                float(size),
                float(np.linalg.norm(probe.force - force) / size),
                float(np.linalg.norm(single.force - force) / size),
                float(field_error),
                probe.error_estimate,
                single.error_estimate,
                abs(probe.gap - single.gap) / -probe.gap,
                probe.is_trusted,
            )


def kept(touch: vs.Touch, n: int, kind: str) -> list[Row]:
    """The rows of the first pairs; those that an earlier run has compared are read."""
    path = ROOT / "out" / f"probes-{kind}.jsonl"
    done = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    with path.open("a") as file:
        for number in range(len(done), n):
            rows = [asdict(row) for row in compared(touch, number, SEED[kind])]
            file.write(json.dumps(rows) + "\n")
            file.flush()
            done.append(rows)
    return [Row(**row) for rows in done[:n] for row in rows]


def table(rows: list[Row], n: int) -> str:
    """Errors of the force with and without the other probe, and how many the estimate covers."""
    lines = [
        f"{len(rows)} forces of {n} pairs; errors relative to the norm",
        f"{'':20}{'forces':>7}  {'together: median':>17} {'90 %':>7} {'95 %':>7}  {'alone: median':>14} {'90 %':>7}"
        f" {'95 %':>7}  {'field':>6}  {'trusted':>8} {'covered':>8} {'of trusted':>10}",
    ]
    sort = {
        "all": rows,
        "without friction": [row for row in rows if row.friction == 0.0],
        "friction 0.3": [row for row in rows if row.friction > 0.0],
        "closer than 3 radii": [row for row in rows if row.distance < 3.0],
        "farther": [row for row in rows if row.distance >= 3.0],
    }
    for name, some in sort.items():
        if not some:
            continue
        errors, alone = (np.array([getattr(row, key) for row in some]) for key in ("force_error", "alone_error"))
        field = np.median([row.field_error for row in some])
        is_covered = np.array([row.force_error <= row.estimate for row in some])
        is_trusted = np.array([row.is_trusted for row in some])
        of_trusted = f"{is_covered[is_trusted].mean():10.1%}" if is_trusted.any() else f"{'':>10}"
        f, a = (np.quantile(all_of, (0.5, 0.9, 0.95)) for all_of in (errors, alone))
        lines.append(
            f"{name:20}{len(some):7}  {f[0]:17.1%} {f[1]:7.1%} {f[2]:7.1%}  {a[0]:14.1%} {a[1]:7.1%} {a[2]:7.1%}"
            f"  {field:6.1%}  {is_trusted.mean():8.0%} {is_covered.mean():8.1%} {of_trusted}"
        )
    return "\n".join(lines)


def ticks(touch: vs.Touch, friction: float, n: int = 3_000, runs: int = 5) -> str:
    """Microseconds of a tick of both probes, each of which follows a device that wanders, called from Python.

    The devices go the same way several times; what a tick takes is the least of them.
    """
    random = np.random.default_rng(SEED["study"])
    routes = pair(touch, 0, SEED["study"])
    homes = np.array([route[3][PRESSES - 1][1] for route in routes])
    above = np.array([start(route) for route in routes])
    way, device, devices = np.zeros((2, 3)), above, []
    for _ in range(n):
        way = 0.98 * way + 1e-4 * random.normal(size=(2, 3)) + 2e-4 * (homes - device)
        device = device + way
        devices.append(device)
    spent, are_touching = np.empty((runs, n)), np.empty(n, dtype=bool)
    for run in range(runs):
        hands = vs.Probes([touch.probe(friction=friction, stiffness=500.0, damping=2.0) for _ in range(2)])
        for k, device in enumerate(devices):
            begin = perf_counter_ns()
            felt = hands.follow(device, 1e-3)
            spent[run, k] = 1e-3 * (perf_counter_ns() - begin)
            are_touching[k] = all(each.is_touching for each in felt)
    least = spent.min(axis=0)[are_touching]
    median, high, worst = np.quantile(least, (0.5, 0.99, 1.0))
    late = (spent[:, are_touching] > 1e3).mean()
    return (
        f"tick of two, both in touch, friction {friction:.1f}: {median:.0f} us in the median, 99 % {high:.0f}, worst"
        f" {worst:.0f} ({len(least)} of {n} ticks, least of {runs} runs); {late:.2%} of all took more than 1 ms"
    )


def main() -> None:
    """Print the study, or the times."""
    print(describe(), flush=True)
    touch, (n, kind) = opened(), asked(60)
    print(f"{touch}, patch {1e3 * touch.radius:.1f} mm")
    for friction in (0.0, 0.3):
        print(ticks(touch, friction), flush=True)
    print(table(kept(touch, n, kind), n))


if __name__ == "__main__":
    main()
