"""What trust is worth: answers of reduced models against Newton, over many bodies, laws and elements.

    python benchmarks/trust.py [POINTS [tuning]]

Random contacts between nodes, displacements in any direction, each pushed to four depths; POINTS of them for each
case, 12 by default: 6,240 touches, less those at which Newton fails. The cases are crossed, so that no law is judged
by the body it happened to get: ten bodies, each under every law and, nearly incompressible, with "P1 mean volume". A
body is touched on a part of its surface. An answer's error is that of its force or of its shape, whichever is larger.
It is trusted where the model trusts both, and right where the error is within the allowance and the full organ is
stable. With `tuning` other bodies and seeds are taken: what the estimate is fitted to, of which the study has none.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import exp, factorial
from typing import Any

import numpy as np
from machine import describe
from numpy.typing import NDArray

import viscera as vs
from viscera.law import Law
from viscera.mesh import Floats
from viscera.reduced.check import Full, surface_points, unit_vectors
from viscera.study.case import middle

Condition = Callable[[Floats], NDArray[np.bool_]]

DEPTHS = (0.025, 0.05, 0.075, 0.10)
"""Of a touch, in units of the diagonal."""


@dataclass(frozen=True)
class Case:
    """A model: an organ and where it is touched."""

    body: str
    mesh: Callable[[], vs.Mesh]
    law: Law
    fixed: str = "held"
    element: str = "P1"
    touchable: Any = None
    order: int = 4
    reach: float = 1.0
    """Of the touchable nodes around their middle, in units of the diagonal."""

    def reduce(self) -> vs.Touch:
        """The reduced model."""
        organ = vs.Organ(self.mesh(), self.law, fixed=self.fixed, element=self.element)
        mesh = organ.mesh
        nodes = organ.touchable(self.touchable)
        near = mesh.near(mesh.points[middle(mesh, nodes)], self.reach * mesh.diagonal)
        return organ.reduce(np.intersect1d(nodes, near), order=self.order)

    def __str__(self) -> str:
        return f"{self.body:22s}{type(self.law).__name__:22s}{self.element:15s}"


def bricks(
    counts: tuple[int, int, int],
    size: tuple[float, float, float],
    *,
    keep: Condition = lambda x: np.full(len(x), True),
    shape: Callable[[Floats], Floats] = lambda x: x,
    held: Condition = lambda x: x[:, 2] == 0.0,
    jitter: float = 0.0,
) -> vs.Mesh:
    """A box at the origin cut into bricks of six tetrahedra: those whose middle is to `keep`, brought into a `shape`.

    Set `held`: by the coordinates in the box. Jitter: of the nodes inside, in units of a brick.
    """
    steps = np.array(counts)
    grid = np.stack(np.meshgrid(*(np.arange(n + 1) for n in counts), indexing="ij"), axis=-1).reshape(-1, 3)
    box = grid * (np.array(size) / steps)
    stride = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    corners = np.flatnonzero((grid < steps).all(axis=1))
    corners = corners[keep(box[corners] + 0.5 * np.array(size) / steps)]
    cells = []
    for path in itertools.permutations(range(3)):
        tet = np.cumsum([0, *stride[list(path)]])
        odd = np.linalg.det(np.eye(3)[list(path)]) < 0
        cells.append(corners[:, None] + (tet[[0, 2, 1, 3]] if odd else tet))
    used, numbers = np.unique(np.concatenate(cells), return_inverse=True)
    box, inside = box[used], ((grid > 0) & (grid < steps)).all(axis=1)[used]
    random = np.random.default_rng(1)
    moved = shape(box + jitter * inside[:, None] * random.uniform(-0.5, 0.5, box.shape) * np.array(size) / steps)
    return vs.mesh(moved, numbers.reshape(-1, 4), {"held": np.flatnonzero(held(box))})


def without_hole(size: tuple[float, float, float], radius: float, axis: int) -> Condition:
    """All but a hole through the middle along an axis."""
    across = [i for i in range(3) if i != axis]
    return lambda x: np.linalg.norm((x - 0.5 * np.array(size))[:, across], axis=1) > radius


def ball(size: float) -> Callable[[Floats], Floats]:
    """A cube of that size blown up to a ball."""

    def shape(x: Floats) -> Floats:
        y = 2.0 * x / size - 1.0
        largest, norm = np.abs(y).max(axis=1, keepdims=True), np.linalg.norm(y, axis=1, keepdims=True)
        return np.asarray(0.5 * size * y * np.divide(largest, norm, out=np.ones_like(norm), where=norm > 0))

    return shape


def bent(length: float, angle: float) -> Callable[[Floats], Floats]:
    """A bar along x bent in x and z by that angle over its length."""

    def shape(x: Floats) -> Floats:
        radius = length / angle
        turn = x[:, 0] / radius
        return np.stack(
            [(radius - x[:, 2]) * np.sin(turn), x[:, 1], radius - (radius - x[:, 2]) * np.cos(turn)], axis=1
        )

    return shape


def laws() -> list[Law]:
    """Of soft tissue: each law that can be reduced, once."""
    return [
        vs.NeoHookean(young=5e3, poisson=0.45),
        vs.SaintVenantKirchhoff(young=5e3, poisson=0.4),
        vs.MooneyRivlin(c1=600.0, c2=200.0, kappa=15e3, volumetric="ln J"),
        vs.Yeoh(c10=800.0, c20=300.0, c30=50.0, poisson=0.45),
        vs.Ogden(mu=[500.0, -100.0], alpha=[3.0, -4.0], poisson=0.45),
        vs.HolzapfelGasserOgden(
            2e3, 1e3, 0.5, fibres=[(1, 0, 0), (0, 1, 1)], dispersion=0.1, poisson=0.45, bear_compression=True
        ),
        vs.StableNeoHookean(young=3e3, poisson=0.45),
        vs.ArrudaBoyce(1e3, 1.3, poisson=0.45),
        vs.VerondaWestmann(c1=2e3, c2=0.5, poisson=0.45),
        vs.Fung(mu=1e3, b=1.0, poisson=0.45),
        vs.Corotated(young=5e3, poisson=0.4),
        vs.Linear(young=5e3, poisson=0.4),
    ]


def bodies() -> list[Case]:
    """Ten bodies, nearly incompressible, and where each is touched: the liver at two places."""
    law, element = vs.NeoHookean(young=5e3, poisson=0.499), "P1 mean volume"

    def root(x: Floats) -> NDArray[np.bool_]:
        return np.asarray(x[:, 0] == 0.0)

    def tunnel() -> vs.Mesh:
        size = (0.09, 0.07, 0.06)
        return bricks((12, 9, 8), size, keep=without_hole(size, 0.015, 1), jitter=0.3)

    def corner() -> vs.Mesh:
        return bricks((9, 6, 9), (0.09, 0.05, 0.09), keep=lambda x: (x[:, 0] < 0.04) | (x[:, 2] < 0.04))

    def bar() -> vs.Mesh:
        return bricks((16, 4, 4), (0.2, 0.04, 0.04), held=root, jitter=0.2)

    def plate() -> vs.Mesh:
        return bricks((12, 12, 3), (0.1, 0.1, 0.02), held=lambda x: (x[:, 0] == 0.0) | (x[:, 0] == 0.1))

    def sphere() -> vs.Mesh:
        return bricks((8, 8, 8), (0.06, 0.06, 0.06), shape=ball(0.06))

    def hook() -> vs.Mesh:
        return bricks((15, 4, 5), (0.15, 0.04, 0.04), shape=bent(0.15, 1.6), held=root)

    def coarse() -> vs.Mesh:
        return bricks((7, 5, 4), (0.07, 0.06, 0.05), jitter=0.2)

    return [
        Case("liver, anterior face", vs.organs.liver, law, "hilum", element, touchable="anterior", reach=0.07),
        Case("liver, left lobe", vs.organs.liver, law, "hilum", element, touchable="tip", reach=0.1),
        Case("artery", vs.organs.artery, law, "bottom", element, touchable="z > 34 mm"),
        Case("beam", vs.organs.beam, law, "clamp", element, touchable="tip"),
        Case("block with a tunnel", tunnel, law, element=element, touchable="z > 59 mm"),
        Case("corner", corner, law, element=element, touchable="z > 8 cm"),
        Case("bar", bar, law, element=element, touchable="x > 12 cm"),
        Case("plate", plate, law, element=element, touchable="z > 19 mm"),
        Case("ball", sphere, law, element=element, touchable="z > 0"),
        Case("hook", hook, law, element=element, touchable=lambda x: x[:, 0] > 0.08),
        Case("coarse block", coarse, law, element=element, touchable="z > 49 mm"),
    ]


def study() -> list[Case]:
    """Each body nearly incompressible, and under each law, touched within a fifth of its diagonal."""
    once = [replace(body, reach=min(body.reach, 0.2)) for body in bodies() if body.body != "liver, left lobe"]
    return [case for body in once for case in (body, *(replace(body, law=law, element="P1") for law in laws()))]


def tuning() -> list[Case]:
    """Other bodies."""
    soft = vs.NeoHookean(young=3e3, poisson=0.45)
    sheath = vs.HolzapfelGasserOgden(
        1e4, 5e3, 0.8, fibres=[(1, 0, 1), (0, 1, 1)], dispersion=0.2, poisson=0.45, bear_compression=True
    )
    size = (0.1, 0.08, 0.06)

    def holed() -> vs.Mesh:
        return bricks((13, 10, 8), size, keep=without_hole(size, 0.012, 2))

    def coarse() -> vs.Mesh:
        return bricks((8, 6, 4), (0.08, 0.06, 0.04))

    def arm() -> vs.Mesh:
        return bricks((14, 5, 4), (0.16, 0.05, 0.04), held=lambda x: x[:, 0] == 0.0, jitter=0.3)

    def step() -> vs.Mesh:
        return bricks((10, 6, 8), (0.1, 0.06, 0.07), keep=lambda x: (x[:, 0] < 0.05) | (x[:, 2] < 0.035), jitter=0.2)

    def egg() -> vs.Mesh:
        return bricks((7, 7, 7), (0.05, 0.05, 0.05), shape=lambda x: ball(0.05)(x) * np.array([1.0, 0.7, 0.8]))

    def fine() -> vs.Mesh:
        return bricks((18, 14, 7), (0.1, 0.08, 0.04), jitter=0.3)

    def cube() -> vs.Mesh:
        return bricks((6, 6, 6), (0.05, 0.05, 0.05), jitter=0.2)

    def small() -> vs.Mesh:
        return bricks((4, 4, 4), (0.05, 0.05, 0.05))

    def tube() -> vs.Mesh:
        return bricks(
            (10, 10, 7),
            (0.03, 0.03, 0.05),
            keep=lambda x: np.abs(x[:, :2] - 0.015).max(axis=1) > 0.009,
            held=lambda x: (x[:, 2] == 0.0) | (x[:, 2] == 0.05),
        )

    def strip() -> vs.Mesh:
        return bricks((12, 5, 3), (0.12, 0.05, 0.02), held=lambda x: x[:, 2] == 0.0, jitter=0.2)

    def legs() -> vs.Mesh:
        return bricks(
            (11, 5, 8), (0.11, 0.05, 0.08), keep=lambda x: (np.abs(x[:, 0] - 0.055) > 0.02) | (x[:, 2] > 0.04)
        )

    def shelf() -> vs.Mesh:
        return bricks((11, 10, 3), (0.11, 0.09, 0.018), held=lambda x: (x[:, 0] == 0.0) | (x[:, 1] == 0.0), jitter=0.2)

    def lid() -> vs.Mesh:
        edge = (0.0, 0.12)
        return bricks((12, 9, 2), (0.12, 0.08, 0.02), held=lambda x: np.isin(x[:, 0], edge) | (x[:, 1] == 0.08))

    def pebble() -> vs.Mesh:
        return bricks((8, 7, 7), (0.05, 0.05, 0.05), shape=lambda x: ball(0.05)(x) * np.array([1.1, 1.0, 0.9]))

    return [
        Case("block with a hole", holed, soft),
        Case("block with a hole", holed, vs.Yeoh(c10=500.0, c20=200.0, poisson=0.45)),
        Case("coarse block", coarse, soft),
        Case("coarse block", coarse, vs.SaintVenantKirchhoff(young=3e3, poisson=0.35)),
        Case("coarse block", coarse, vs.NeoHookean(young=3e3, poisson=0.4999), element="P1 mean volume"),
        Case("arm", arm, vs.NeoHookean(young=3e3, poisson=0.3)),
        Case("arm", arm, vs.MooneyRivlin(c1=600.0, c2=200.0, kappa=15e3)),
        Case("step", step, soft),
        Case("step", step, vs.Ogden(mu=[400.0], alpha=[4.0], poisson=0.4)),
        Case("egg", egg, vs.NeoHookean(young=3e3, poisson=0.48)),
        Case("egg", egg, vs.Corotated(young=3e3, poisson=0.4)),
        Case("fine block", fine, soft, touchable=lambda x: (x[:, 2] == 0.04) & (x[:, 0] > 0.05)),
        Case("cube, order 3", cube, soft, order=3),
        Case("cube, order 6", cube, soft, order=6),
        Case("tube", tube, vs.NeoHookean(young=1e5, poisson=0.48)),
        Case("tube", tube, sheath),
        Case("strip", strip, vs.Yeoh(c10=500.0, c20=100.0, poisson=0.48), element="P1 mean volume"),
        Case("strip", strip, vs.SaintVenantKirchhoff(young=3e3, poisson=0.3)),
        Case("pair of legs", legs, vs.NeoHookean(young=3e3, poisson=0.4)),
        Case("cube, P2", small, vs.NeoHookean(young=3e3, poisson=0.49), element="P2"),
        Case("shelf", shelf, soft, touchable="z > 17 mm"),
        Case("shelf", shelf, vs.ArrudaBoyce(2e3, 1.4, poisson=0.45), touchable="z > 17 mm"),
        Case("shelf", shelf, vs.Yeoh(c10=600.0, c20=200.0, c30=30.0, poisson=0.45), touchable="z > 17 mm"),
        Case("lid", lid, vs.ArrudaBoyce(1e3, 1.2, poisson=0.4), touchable="z > 19 mm"),
        Case("lid", lid, vs.NeoHookean(young=2e3, poisson=0.4), touchable="z > 19 mm"),
        Case("lid", lid, vs.SaintVenantKirchhoff(young=3e3, poisson=0.4), touchable="z > 19 mm"),
        Case("pebble", pebble, vs.VerondaWestmann(c1=1e3, c2=0.8, poisson=0.45), touchable="z > 0"),
        Case("pebble", pebble, vs.SaintVenantKirchhoff(young=4e3, poisson=0.35), touchable="z > 0"),
        Case("pebble", pebble, vs.Yeoh(c10=700.0, c20=300.0, c30=50.0, poisson=0.45), touchable="z > 0"),
        Case("arm", arm, vs.Fung(mu=2e3, b=2.0, poisson=0.45), touchable=lambda x: x[:, 0] > 0.06),
        Case("step", step, vs.Fung(mu=1e3, b=1.5, poisson=0.4)),
        Case("step", step, vs.SaintVenantKirchhoff(young=3e3, poisson=0.4)),
        Case("coarse block", coarse, vs.Corotated(young=3e3, poisson=0.35)),
        Case("coarse block", coarse, vs.VerondaWestmann(c1=1e3, c2=0.6, poisson=0.45)),
        Case("legs", legs, vs.Corotated(young=3e3, poisson=0.4)),
    ]


@dataclass(frozen=True)
class Touched:
    """A touch whose full solution converged."""

    depth: float
    """In units of the diagonal."""
    error: float
    estimate: float
    is_trusted: bool
    is_stable: bool

    @property
    def excess(self) -> float:
        """The error in units of what a trusted answer may be off at this depth."""
        return self.error / (0.01 + 0.04 * min(max((self.depth - 0.05) / 0.05, 0.0), 1.0))

    @property
    def is_right(self) -> bool:
        """Whether it should be trusted."""
        return self.is_stable and self.excess <= 1.0


def ask(touch: vs.Touch, points: int, seed: int) -> list[Touched]:
    """Random touches, each at all depths, from the shallowest to the one at which Newton gives up."""
    random = np.random.default_rng(seed)
    places, directions = surface_points(touch, points, random), unit_vectors(points, random)
    full = Full(touch)

    def one(point: Floats, direction: Floats) -> list[Touched]:
        patch, state, rows = touch.patch(point), None, []
        for depth in DEPTHS:
            push = depth * touch.mesh.diagonal * direction
            state = full.solve(patch, push, state)
            if not state.is_converged:
                break
            answer = touch(point, push)
            error = max(_gap(answer.force, state.reaction(patch)), _gap(answer.displacement, full.added(state)))
            estimate = max(answer.error_estimate, answer.shape_error_estimate)
            is_trusted = answer.is_trusted and answer.is_shape_trusted
            rows.append(Touched(depth, error, estimate, is_trusted, state.status == "converged"))
        return rows

    with ThreadPoolExecutor(2) as pool:
        return [row for rows in pool.map(one, places, directions) for row in rows]


def _gap(value: Floats, truth: Floats) -> float:
    return float(np.linalg.norm(value - truth) / np.linalg.norm(truth))


def bound(count: int, of: int) -> float:
    """The share that is not exceeded with a confidence of 95 %, `count` of so many having been found (Poisson)."""
    low, high = 0.0, float(of)
    for _ in range(60):
        mean = 0.5 * (low + high)
        chance = exp(-mean) * sum(mean**k / factorial(k) for k in range(count + 1))
        low, high = (mean, high) if chance > 0.05 else (low, mean)
    return high / max(of, 1)


def line(name: str, rows: list[Touched]) -> str:
    """One line of the table."""
    trusted, right = [row for row in rows if row.is_trusted], [row for row in rows if row.is_right]
    beyond = sum(row.excess > 1.0 for row in trusted)
    missed = sum(not row.is_trusted for row in right)
    ratios = [row.estimate / row.error for row in rows if row.error > 0.0]
    return (
        f"{name:59s}{len(rows):7d}{len(trusted):9d}{beyond:8d}{max((row.excess for row in trusted), default=0.0):8.2f}"
        f"{100 * len(right) / max(len(rows), 1):8.0f} %{100 * missed / max(len(right), 1):9.0f} %"
        f"{np.median(ratios) if ratios else 0.0:11.1f}"
    )


def main(points: int, cases: list[Case], seed: int) -> None:
    """A line for each case, then for all, for each law, each body and each depth."""
    print(describe())
    print(f"{'':59s}touches  trusted  beyond   worst     right  not trusted  estimate/error", flush=True)
    found: list[tuple[Case, list[Touched]]] = []
    for k, case in enumerate(cases):
        rows = ask(case.reduce(), points, seed + k)
        found.append((case, rows))
        print(line(str(case), rows), flush=True)
    every = [row for _, rows in found for row in rows]
    print(line("all", every))
    for law in dict.fromkeys(type(case.law).__name__ for case in cases):
        print(line(law, [row for case, rows in found if type(case.law).__name__ == law for row in rows]))
    for body in dict.fromkeys(case.body for case in cases):
        print(line(body, [row for case, rows in found if case.body == body for row in rows]))
    for depth in DEPTHS:
        print(line(f"{100 * depth:g} % deep", [row for row in every if row.depth == depth]))
    trusted = [row for row in every if row.is_trusted]
    for times in (1, 2):
        count = sum(row.excess > times for row in trusted)
        print(
            f"{count} of {len(trusted)} trusted answers beyond {'twice ' if times == 2 else ''}the allowance: "
            f"with a confidence of 95 % at most {1000 * bound(count, len(trusted)):.2f} in 1,000"
        )


if __name__ == "__main__":
    words = sys.argv[1:]
    is_tuning = "tuning" in words
    points = int(words[0]) if words else 12
    main(points, *((tuning(), 1000) if is_tuning else (study(), 5000)))
