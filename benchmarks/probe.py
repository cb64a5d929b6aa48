"""A rigid probe on a reduced model against true contact, on paths that neither has seen.

    python benchmarks/probe.py [PATHS]          # 200 paths, and microseconds of a tick
    python benchmarks/probe.py PATHS tuning     # other paths: what the term of the estimate is fitted to

On a path a sphere of 0.8 to 1.25 times the radius of the patch presses the built-in liver along the normal of a random
touchable place, and is dragged along the surface. True contact is `Stepper.tool(Sphere)` on the whole mesh, settled at
every pose; the probe is put at the same poses. Friction is 0 or 0.3. An interrupted study goes on where it stopped: its
model and its rows are kept in out/probe*, to be deleted for a new one.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from time import perf_counter_ns

import numpy as np
from machine import ROOT, describe

import viscera as vs
from viscera.mesh import Floats
from viscera.reduced.probe import CONTACT_ERROR

SEED = {"study": 19, "tuning": 91}
REACH = 0.06
"""Radius [m] of the touchable part around the highest point of the liver."""
PRESSES, DRAGS = 3, 3


@dataclass(frozen=True)
class Row:
    """A pose: what the probe says and what true contact says."""

    friction: float
    phase: str
    entered: float
    force: float
    force_error: float
    field_error: float
    estimate: float
    is_trusted: bool
    patch: float
    """Force of the patch, moved as far as the sphere has entered [N]."""


Route = tuple[float, float, Floats, list[tuple[str, Floats]]]


def model(reach: float = REACH) -> vs.Touch:
    """The model of the upper side of the built-in liver."""
    liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=5e3, poisson=0.45), fixed="hilum")
    x = liver.mesh.points
    top = x[x[:, 2].argmax()]
    return liver.reduce(lambda p: np.linalg.norm(p - top, axis=1) < reach)


def paths(touch: vs.Touch, n: int, first: int, seed: int) -> Iterator[Route]:
    """Radius, friction, start and named poses of the sphere's centre."""
    x, triangles = touch.mesh.points, touch.touchable_triangles
    for number in range(first, first + n):
        random = np.random.default_rng([seed, number])
        corners = x[triangles[random.integers(len(triangles))]]
        at = random.dirichlet((1, 1, 1)) @ corners
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        normal /= np.linalg.norm(normal)
        radius = touch.radius * random.uniform(0.8, 1.25)
        friction = float(random.choice((0.0, 0.3)))
        deep = touch.mesh.diagonal * random.uniform(0.01, 0.07)
        way = np.cross(normal, random.normal(size=3))
        way *= random.uniform(0.2, 0.6) * touch.radius / np.linalg.norm(way)
        poses = [("press", at + normal * (radius - deep * k / PRESSES)) for k in range(1, PRESSES + 1)]
        poses += [("drag", poses[-1][1] + way * k / DRAGS) for k in range(1, DRAGS + 1)]
        yield radius, friction, at + normal * (radius + 2e-4), poses


def compared(touch: vs.Touch, n: int, first: int, seed: int) -> Iterator[Row]:
    """The rows of some paths. Poses at which true contact does not settle are left out."""
    organ = touch.organ()
    for radius, friction, start, poses in paths(touch, n, first, seed):
        stepper = organ.stepper(iterations=12, solver="cg")
        try:
            tool = stepper.tool(vs.Sphere(radius), position=start, friction=friction)
        except vs.VisceraError:
            continue  # the place is in a hollow: the sphere touches elsewhere first
        probe = touch.probe(radius, friction=friction)
        probe.place(start)
        last = start
        for phase, center in poses:
            for part in (0.25, 0.5, 0.75, 1.0):  # a tick is a small step
                felt = probe.place(last + part * (center - last))
            last = center
            tool.place(center)
            for _ in range(6):
                frame = stepper.frame()
                if frame.is_settled:
                    break
            force, size = frame.force(tool), np.linalg.norm(frame.force(tool))
            if not frame.is_settled or size == 0.0 or not felt.is_touching:
                continue
            moved = frame.displacement
            yield Row(
                friction,
                phase,
                -felt.gap,
                float(size),
                float(np.linalg.norm(felt.force - force) / size),
                float(np.linalg.norm(felt.displacement - moved) / np.linalg.norm(moved)),
                felt.error_estimate,
                felt.is_trusted,
                float(np.linalg.norm(touch(felt.contact_point, -felt.gap * inward(felt)).force)),
            )


def inward(felt: vs.Felt) -> Floats:
    """The direction (3,) in which a probe is pressed."""
    into = felt.contact_point - felt.center
    return into / np.linalg.norm(into)


def kept(touch: vs.Touch, n: int, kind: str) -> list[Row]:
    """The rows of the first paths; those that an earlier run has compared are read."""
    path = ROOT / "out" / f"probe-{kind}.jsonl"
    done = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    with path.open("a") as file:
        for number in range(len(done), n):
            rows = [asdict(row) for row in compared(touch, 1, number, SEED[kind])]
            file.write(json.dumps(rows) + "\n")
            file.flush()
            done.append(rows)
    return [Row(**row) for rows in done[:n] for row in rows]


def table(rows: list[Row], n: int) -> str:
    """Errors of force and field, and how many the estimate covers."""
    lines = [
        f"{len(rows)} poses of {n} paths; errors relative to the norm",
        f"{'':24}{'poses':>6}  {'force: median':>14} {'90 %':>7} {'95 %':>7} {'worst':>7}"
        f"  {'field: median':>14} {'90 %':>7}  {'trusted':>8} {'covered':>8} {'of trusted':>10}",
    ]
    sort = {
        "all": rows,
        "pressed": [row for row in rows if row.phase == "press"],
        "dragged": [row for row in rows if row.phase == "drag"],
        "without friction": [row for row in rows if row.friction == 0.0],
        "friction 0.3": [row for row in rows if row.friction > 0.0],
        "entered below 5 mm": [row for row in rows if row.entered < 0.005],
        "5 to 10 mm": [row for row in rows if 0.005 <= row.entered < 0.010],
        "deeper": [row for row in rows if row.entered >= 0.010],
    }
    for name, some in sort.items():
        if not some:
            continue
        force = np.array([row.force_error for row in some])
        field = np.array([row.field_error for row in some])
        is_covered = np.array([row.force_error <= row.estimate for row in some])
        is_trusted = np.array([row.is_trusted for row in some])
        of_trusted = f"{is_covered[is_trusted].mean():10.1%}" if is_trusted.any() else f"{'':>10}"
        f, q = np.quantile(force, (0.5, 0.9, 0.95)), np.quantile(field, (0.5, 0.9))
        lines.append(
            f"{name:24}{len(some):6}  {f[0]:14.1%} {f[1]:7.1%} {f[2]:7.1%} {force.max():7.1%}"
            f"  {q[0]:14.1%} {q[1]:7.1%}  {is_trusted.mean():8.0%} {is_covered.mean():8.1%} {of_trusted}"
        )
    return "\n".join(lines)


def ticks(touch: vs.Touch, friction: float, n: int = 5_000, runs: int = 5) -> str:
    """Microseconds of a tick: the probe follows a device that wanders over the organ, called from Python.

    The device goes the same way several times. What a tick takes is the least of them: other work on the machine does
    not delay the same tick every time.
    """
    random = np.random.default_rng(SEED["study"])
    x = touch.mesh.points[touch.touchable_triangles].mean(axis=1)
    top = x[x[:, 2].argmax()]
    home, above = (top + np.array((0.0, 0.0, touch.radius + z)) for z in (-0.008, 0.001))
    way, device, devices = np.zeros(3), above, []
    for _ in range(n):
        way = 0.98 * way + 1e-4 * random.normal(size=3) + 2e-4 * (home - device)
        device = device + way
        devices.append(device)
    spent, is_touching = np.empty((runs, n)), np.empty(n, dtype=bool)
    for run in range(runs):
        probe = touch.probe(friction=friction, stiffness=500.0, damping=2.0)
        for k, device in enumerate(devices):
            begin = perf_counter_ns()
            felt = probe.follow(device, 1e-3)
            spent[run, k] = 1e-3 * (perf_counter_ns() - begin)
            is_touching[k] = felt.is_touching
    least = spent.min(axis=0)[is_touching]
    median, high, worst = np.quantile(least, (0.5, 0.99, 1.0))
    return (
        f"tick in touch, friction {friction:.1f}: {median:.0f} us in the median, 99 % {high:.0f}, worst {worst:.0f}"
        f" ({len(least)} of {n} ticks, least of {runs} runs)"
    )


def opened() -> vs.Touch:
    """The model, made if none is kept."""
    path = ROOT / "out" / "probe.viscera"
    path.parent.mkdir(exist_ok=True)
    if not path.exists():
        model().save(path)
    return vs.load(path)


def asked(default: int) -> tuple[int, str]:
    """How many paths, and of which kind, by the words of the command."""
    words = sys.argv[1:]
    return int(words[0]) if words else default, words[1] if words[1:] else "study"


def main() -> None:
    """Print the study, or the times."""
    print(describe(), flush=True)
    touch, (n, kind) = opened(), asked(200)
    print(f"{touch}, patch {1e3 * touch.radius:.1f} mm, contact term of the estimate {CONTACT_ERROR:.0%}")
    for friction in (0.0, 0.3):
        print(ticks(touch, friction), flush=True)
    print(table(kept(touch, n, kind), n))


if __name__ == "__main__":
    main()
