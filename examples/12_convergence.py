"""How fine a mesh must be: a bent beam, three elements, three meshes, and the order at which each converges.

Halving the edges of linear cells halves the error of stresses and quarters that of displacements; quadratic cells do
one order better. The tip of a cantilever shows what that means in cells. The exact value is extrapolated from two
quadratic meshes (Richardson).
"""

from itertools import permutations

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

LAW = vs.NeoHookean(young=1e5, poisson=0.3)


def bar(n: int) -> vs.Mesh:
    """A bar of 0.4 x 0.1 x 0.1 m in 4 n x n x n bricks of six tetrahedra."""
    counts = np.array([4 * n, n, n])
    corners = np.stack(np.meshgrid(*(np.arange(k) for k in counts), indexing="ij"), -1).reshape(-1, 3)
    points = np.stack(np.meshgrid(*(np.arange(k + 1) for k in counts), indexing="ij"), -1).reshape(-1, 3)
    stride = np.array([(n + 1) ** 2, n + 1, 1])
    walks = np.cumsum([[0, *stride[list(axes)]] for axes in permutations(range(3))], axis=1)
    return vs.mesh(0.1 / n * points, ((corners @ stride)[:, None, None] + walks).reshape(-1, 4))


def tip(n: int, element: str) -> float:
    """Mean deflection of the free end under a transverse load [m]."""
    organ = vs.Organ(bar(n), LAW, fixed="x < 1%", element=element)
    end = organ.mesh.points[:, 0] > 0.4 - 1e-9
    state = organ.solve(traction={"x > 99%": (0, 0, -200.0)}, throw=True)
    return float(-state.displacement[end, 2].mean())


coarse, fine = tip(3, "P2"), tip(5, "P2")
exact = fine + (fine - coarse) / ((5 / 3) ** 3 - 1)
errors = {name: [abs(tip(n, name) / exact - 1) for n in sizes] for name, sizes in
          {"P1": (2, 4, 8), "P1 mean volume": (2, 4, 8), "P2": (1, 2, 3)}.items()}  # fmt: skip
for name, row in errors.items():
    print(f"{name:15s}" + "".join(f"{100 * error:10.2f} %" for error in row))

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
for (name, row), sizes in zip(errors.items(), ((2, 4, 8), (2, 4, 8), (1, 2, 3)), strict=True):
    axes.loglog(sizes, np.array(row) * 100, "o-", label=name)
axes.set(xlabel="cells across the thickness", ylabel="error of the tip [%]")
axes.legend(frameon=False)
assert errors["P1"][2] < errors["P1"][1] / 2.5  # second order in displacements
assert errors["P2"][1] < errors["P1"][2]  # two quadratic cells beat eight linear ones
