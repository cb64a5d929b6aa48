"""Buckling: a column that shortens under its load until, at Euler's load, it gives way sideways.

          | P
      ____v____
     |         |      1 m high, 60 x 90 mm, clamped at the foot, free at the top,
     |         |      pushed across its thin side by a ten-thousandth of P
     |         |
    _|_________|_     Euler: P = pi^2 E I / (2 L)^2

Above that load a perfect column has several equilibria. A small sideways force selects one of them, and the path bends
where that of the perfect column branches. It is followed in its arc length, one power series after the other. Beyond
Euler's load the exact shape is the elastica, whose load and deflection are elliptic integrals.
"""

from itertools import permutations

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

SIZE, YOUNG = np.array([0.06, 0.09, 1.0]), 1e6  # m, Pa
LENGTH = SIZE[2]
EULER = np.pi**2 * YOUNG * SIZE[1] * SIZE[0] ** 3 / 12 / (2 * LENGTH) ** 2
COUNTS = np.array([1, 1, 12])  # bricks of six quadratic tetrahedra

corners = np.stack(np.meshgrid(*(np.arange(k) for k in COUNTS), indexing="ij"), -1).reshape(-1, 3)
points = np.stack(np.meshgrid(*(np.arange(k + 1) for k in COUNTS), indexing="ij"), -1).reshape(-1, 3)
stride = np.array([(COUNTS[1] + 1) * (COUNTS[2] + 1), COUNTS[2] + 1, 1])
walks = np.cumsum([[0, *stride[list(axes)]] for axes in permutations(range(3))], axis=1)
cells = ((corners @ stride)[:, None, None] + walks).reshape(-1, 4)
mesh = vs.mesh(points * SIZE / COUNTS, cells)

column = vs.Organ(mesh, vs.NeoHookean(young=YOUNG, poisson=0.3), fixed="z < 1%", element="P2")
load = np.array([1e-4, 0.0, -1.0]) * EULER / (SIZE[0] * SIZE[1])  # a traction that adds up to Euler's load
path = column.path(traction={"z > 99%": load}, parameter="arc length", until=1.1, max_expansions=40)
factor, displacement = path.curve()
top = column.mesh.points[:, 2] > LENGTH - 1e-9
sideways = displacement[:, top, 0].mean(axis=1) / LENGTH


def elastica(modulus: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Load over Euler's and deflection over length, of the sine of half the angle at the top; K by Gauss's mean."""
    a, b = np.ones_like(modulus), np.sqrt(1 - modulus**2)
    for _ in range(6):
        a, b = (a + b) / 2, np.sqrt(a * b)
    return 1 / a**2, 4 * modulus * a / np.pi  # K = pi / 2a


exact_load, exact_sideways = elastica(np.linspace(0.0, 0.3, 100))
bent = np.interp(0.2, sideways, factor) / np.interp(0.2, exact_sideways, exact_load)
early = np.interp(0.95, factor, sideways)
print(f"{len(path.expansions)} expansions; at 95 % of Euler's load the top is off by {early:.2%} of the length")
print(f"bent by a fifth of its length it carries {bent:.3f} times the elastica's load")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
axes.plot(100 * sideways, factor, color="#0b4f6c", label="tetrahedra")
axes.plot(100 * exact_sideways, exact_load, "--", color="#a31f3a", label="elastica")
axes.set(xlabel="deflection of the top [% of the length]", ylabel="load over Euler's load", xlim=(0, 35))
axes.legend(frameon=False)
assert early < 0.005
assert abs(bent - 1) < 0.02
