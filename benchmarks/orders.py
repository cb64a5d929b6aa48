"""What one point of expansion can give: exact series, nothing compressed or interpolated, against Newton.

    python benchmarks/orders.py [TOUCHES]

The touches are those of depth.py over all of the anterior face: the built-in liver, neo-Hookean, E = 0.17 MPa,
nu = 0.48, linear cells. Orders are summed in their Padé form. What is left here no model with one point of expansion
takes away.
"""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from depth import DEPTHS, _gap
from machine import describe
from rings import orders, pade

import viscera as vs
from viscera.reduced.check import Full, surface_points, unit_vectors

ORDERS = (4, 5, 6, 7)

Row = tuple[float, bool, list[tuple[float, float]]]


def main(touches: int) -> None:
    """One row for each depth and order."""
    liver = vs.organs.liver()
    organ = vs.Organ(liver, vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element="P1")
    # For its patches and what it is compared with, not for its answers.
    touch = organ.reduce("anterior", depth=max(DEPTHS) * liver.diagonal, order=2)
    random = np.random.default_rng(0)
    points, directions = surface_points(touch, touches, random), unit_vectors(touches, random)
    full, rest = Full(touch), np.zeros_like(liver.points)

    def ask(k: int) -> list[Row]:
        patch, state, rows = touch.patch(points[k]), None, []
        fields, forces = orders(organ, patch, rest, liver.diagonal * directions[k], max(ORDERS))
        for depth in DEPTHS:
            state = full.solve(patch, depth * liver.diagonal * directions[k], state)
            if not state.is_converged:
                break
            field, force, errors = full.added(state).ravel(), state.reaction(patch), []
            for order in ORDERS:
                powers = depth ** np.arange(1, order + 1)[:, None]
                weight = pade(powers * fields[:order])
                answer, tool = weight @ (powers * fields[:order]), weight @ (powers * forces[:order])
                errors.append((_gap(answer, field), _gap(tool, force)))
            rows.append((depth, state.status == "converged", errors))
        return rows

    with ThreadPoolExecutor(2) as pool:
        rows = [row for some in pool.map(ask, range(touches)) for row in some]
    print(describe())
    print("depth   touches          order    field median / 90 % / worst      force median / 90 % / worst")
    for depth in DEPTHS:
        at = [row for row in rows if row[0] == depth]
        for words, some in (("all", at), ("stable", [row for row in at if row[1]])):
            table = np.array([row[2] for row in some])
            for column, order in enumerate(ORDERS):
                cells = [
                    f"{100 * np.median(e):8.3f} /{100 * np.quantile(e, 0.9):7.2f} /{100 * e.max():8.2f} %"
                    for e in table[:, column].T
                ]
                print(f"{depth:5.0%}{len(some):6d} of {touches} {words:8s}{order:4d}   {'  '.join(cells)}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
