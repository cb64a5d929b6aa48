"""What further points of expansion would gain: series about states that are touched already, a ring of them round rest.

    python benchmarks/rings.py [TOUCHES]

Random touches of the built-in liver, 15 % of the diagonal deep: the series about rest, in its Padé form, beside the
series about the same contact touched to 8 % in a direction that differs by an angle. A ring of 14 directions, the faces
and corners of a cube, leaves about 30 degrees to the nearest. Neo-Hookean, E = 0.17 MPa, nu = 0.48, linear cells.
"""

from __future__ import annotations

import sys
from time import perf_counter

import numpy as np
from machine import describe

import viscera as vs
from viscera._core import Patch, touch_series
from viscera.mesh import Floats
from viscera.reduced.check import PATIENCE, unit_vectors

DEPTH, RING, ANGLES, DIRECTIONS = 0.15, 0.08, (0.0, 30.0, 45.0), 14


def orders(organ: vs.Organ, patch: Patch, base: Floats, d: Floats, order: int) -> tuple[Floats, Floats]:
    """Fields (order, 3 n) and forces (order, 3) of the orders of a touch about a state."""
    fields, forces = touch_series(organ._body, [patch], base, order)[0]
    alpha = np.array(
        [(i, j, n - i - j) for n in range(1, order + 1) for i in range(n, -1, -1) for j in range(n - i, -1, -1)]
    )
    terms, degree = np.prod(d**alpha, axis=1), alpha.sum(axis=1)
    by_order = [(degree == n) * terms for n in range(1, order + 1)]
    return np.array([np.tensordot(t, fields, 1).ravel() for t in by_order]), np.array([t @ forces for t in by_order])


def pade(fields: Floats) -> Floats:
    """How much each order counts in the Padé form (docs/model-file.md)."""
    size = np.linalg.norm(fields, axis=1)
    unit = fields / size[:, None]
    c = np.linalg.solve(unit[:-1] @ unit[:-1].T + 1e-3 * np.eye(len(size) - 1), -unit[:-1] @ unit[-1])
    sums = np.cumsum([1.0, *(c * size[-1] / size[:-1])[::-1]])
    return np.asarray(sums[::-1] / sums[-1])


def main(touches: int) -> None:
    """One row for each way to answer."""
    liver = vs.organs.liver()
    organ = vs.Organ(liver, vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element="P1")
    random = np.random.default_rng(2)
    face = organ.touchable("anterior")
    nodes, directions = random.choice(face, touches, replace=False), unit_vectors(touches, random)
    found: dict[str, list[float]] = {}
    seconds: list[float] = []
    unstable = 0

    def note(name: str, u: Floats, f: Floats, exact: vs.State, patch: Patch) -> None:
        field = np.linalg.norm(u - exact.displacement.ravel()) / np.linalg.norm(exact.displacement)
        force = np.linalg.norm(f - exact.reaction(patch)) / np.linalg.norm(exact.reaction(patch))
        found.setdefault(name, []).append(float(max(field, force)))

    for node, n in zip(nodes, directions, strict=True):
        patch, d = organ.patch(liver.points[node], 0.1 * liver.diagonal), DEPTH * liver.diagonal * n
        exact = organ.solve(displacement={patch: d}, settings=PATIENCE)
        if exact.status != "converged":
            continue
        for order in (4, 6):
            fields, forces = orders(organ, patch, np.zeros_like(liver.points), d, order)
            note(f"rest, order {order}, polynomial", fields.sum(axis=0), forces.sum(axis=0), exact, patch)
            w = pade(fields)
            note(f"rest, order {order}, Padé", w @ fields, w @ forces, exact, patch)
        aside = np.cross(n, unit_vectors(1, random)[0])
        for angle in np.deg2rad(ANGLES):
            centre = RING * liver.diagonal * (np.cos(angle) * n + np.sin(angle) * aside / np.linalg.norm(aside))
            began = perf_counter()
            state = organ.solve(displacement={patch: centre}, settings=PATIENCE)
            if not state.is_converged:
                continue
            try:
                for order in (3, 4):
                    fields, forces = orders(organ, patch, state.displacement, d - centre, order)
                    u, f = state.displacement.ravel() + fields.sum(axis=0), state.reaction(patch) + forces.sum(axis=0)
                    note(f"ring, {np.rad2deg(angle):2.0f} degrees off, order {order}", u, f, exact, patch)
                    if order == 3:
                        seconds.append(perf_counter() - began)
            except ValueError:  # without the hold of the tool the organ would leave this state
                unstable += 1
    print(describe())
    print(f"{touches} touches {DEPTH:.0%} deep; error of field or force, whichever is larger")
    for name, errors in found.items():
        e = 100 * np.array(errors)
        print(
            f"{name:32s} {len(e):3d}  median {np.median(e):7.2f} %  90 % {np.quantile(e, 0.9):8.2f} %"
            f"  worst {e.max():8.2f} %"
        )
    print(f"{unstable} centres have no stable tangent of their own")
    cost = float(np.median(seconds))
    total = DIRECTIONS * len(face) * cost / 3600.0
    print(
        f"{cost:.1f} s a centre of order 3, one core: {total:.1f} h for {DIRECTIONS} centres at {len(face)} positions"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
