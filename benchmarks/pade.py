"""What the vector Padé form gains on the touches of the built-in liver, against the polynomial of the reduced model.

A reduced model is a polynomial in the contact displacement d; along one direction it is a series in the depth, whose
orders are recovered here from its values at as many depths. Their Padé form is compared with Newton, at random touches.
Neo-Hookean, E = 0.17 MPa, nu = 0.48, linear cells; a part of the anterior face.

    python benchmarks/pade.py [TOUCHES] [ORDER]
"""

from __future__ import annotations

import sys

import numpy as np
from machine import describe

import viscera as vs
from viscera._core import vector_pade
from viscera.check import PATIENCE, surface_points, unit_vectors
from viscera.mesh import Floats
from viscera.study.case import middle

DEPTHS = (0.05, 0.10, 0.15)


def orders_along(touch: vs.Touch, point: Floats, direction: Floats, depth: float) -> tuple[Floats, Floats]:
    """Fields (P + 1, 3 n) and forces (P + 1, 3) of the orders along a direction, in units of `depth`."""
    order = touch.order
    shares = np.cos(np.pi * (np.arange(order) + 0.5) / order)
    shares[np.abs(shares) < 1e-6] = 0.5 * np.sin(np.pi / order)
    answers = [touch(point, share * depth * direction) for share in shares]
    powers = shares[:, None] ** np.arange(1, order + 1)
    fields = np.linalg.solve(powers, np.array([answer.displacement.ravel() for answer in answers], dtype=float))
    forces = np.linalg.solve(powers, np.array([answer.force for answer in answers]))
    return np.vstack([np.zeros_like(fields[0]), fields]), np.vstack([np.zeros(3), forces])


def main(touches: int, order: int) -> None:
    liver = vs.organs.liver()
    organ = vs.Organ(liver, vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element="P1")
    print(describe())
    face = organ.touchable("anterior")
    near = np.intersect1d(face, liver.near(liver.points[middle(liver, face)], 0.2 * liver.diagonal))
    touch = organ.reduce(near, depth=max(DEPTHS) * liver.diagonal, order=order, tolerance=5e-4)
    print(f"order {order}, {touch.summary()['positions']} positions")
    random = np.random.default_rng(0)
    points, directions = surface_points(touch, touches, random), unit_vectors(touches, random)
    errors: dict[float, list[list[float]]] = {depth: [] for depth in DEPTHS}
    for point, direction in zip(points, directions, strict=True):
        deepest = max(DEPTHS) * liver.diagonal
        fields, forces = orders_along(touch, point, direction, deepest)
        joint = np.hstack([fields, forces * np.linalg.norm(fields[1]) / np.linalg.norm(forces[1])])
        patch, state = touch.patch(point), None
        for depth in DEPTHS:
            a = depth / max(DEPTHS)
            state = organ.solve(
                displacement={patch: depth * liver.diagonal * direction}, start=state, settings=PATIENCE
            )
            if not state.is_converged:
                break
            exact = np.hstack([state.displacement.ravel(), state.reaction(patch)])
            force_scale = np.linalg.norm(fields[1]) / np.linalg.norm(forces[1])
            polynomial = a ** np.arange(order + 1.0) @ joint
            rational, lower = vector_pade(joint, a), vector_pade(joint[:-1], a)
            n = fields.shape[1]
            row = []
            for value in (polynomial, rational):
                row += [_relative(value[:n], exact[:n]), _relative(value[n:] / force_scale, exact[n:])]
            errors[depth].append([*row, _relative(lower[:n], rational[:n])])
    print("depth  touches  polynomial: field median/worst  force median/worst   Padé: field, force   its estimate")
    for depth, rows in errors.items():
        if rows:
            table = np.array(rows)
            cells = [f"{100 * np.median(c):7.3f} /{100 * c.max():8.2f} %" for c in table.T]
            print(f"{depth:5.0%}  {len(rows):7d}  " + "  ".join(cells))


def _relative(value: Floats, exact: Floats) -> float:
    return float(np.linalg.norm(value - exact) / np.linalg.norm(exact))


if __name__ == "__main__":
    main(*(int(word) for word in (sys.argv[1:] + ["20", "4"][len(sys.argv) - 1 :])))
