"""Volumetric locking of every element: Cook's membrane with its pressure, and the numerical inf-sup constant.

On bricks of six tetrahedra. The membrane, 48 mm long, 44 mm high on the left and 16 on the right, is that of Simo and
Armero, Int. J. Numer. Meth. Engng 33 (1992) 1413: neo-Hookean, mu = 80.1938 MPa, clamped on the left, sheared on the
right by 100 N to a millimetre of thickness, in plane strain; here a slab of one layer that keeps its thickness.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

import viscera as vs

Floats = NDArray[np.float64]

MM, MU, FORCE = 1e-3, 80.1938e6, 1e5  # [m], [Pa], [N] on a metre of thickness
RATIOS = (0.3, 0.49, 0.4999)
MEMBRANES = {"P1": (8, 16, 32, 64), "P1 mean volume": (8, 16, 32, 64), "P2": (8, 16, 32)}
CUBES = {"P1": (2, 3, 4, 6), "P1 mean volume": (2, 3, 4, 6), "P2": (1, 2, 3)}


def bricks(counts: tuple[int, int, int]) -> tuple[Floats, NDArray[np.intp]]:
    """Points (n, 3) of the unit cube and cells (m, 4), brick after brick, six around the diagonal of each."""
    n = np.array(counts)
    corners = np.stack(np.meshgrid(*(np.arange(k) for k in n), indexing="ij"), -1).reshape(-1, 3)
    points = np.stack(np.meshgrid(*(np.arange(k + 1) for k in n), indexing="ij"), -1).reshape(-1, 3)
    stride = np.array([(n[1] + 1) * (n[2] + 1), n[2] + 1, 1])
    walks = np.cumsum([[0, *stride[list(axes)]] for axes in permutations(range(3))], axis=1)
    return points / n, ((corners @ stride)[:, None, None] + walks).reshape(-1, 4)


def membrane(n: int) -> vs.Mesh:
    """Cook's membrane, n by n bricks in one layer, with the sets `left`, `right` and `corner`."""
    unit, cells = bricks((n, n, 1))
    x, y, z = unit.T
    points = MM * np.column_stack([48 * x, 44 * x + (44 - 28 * x) * y, 48 / n * z])
    places = {"left": x == 0, "right": x == 1, "corner": (x == 1) & (y == 1)}
    return vs.mesh(points, cells, {name: np.flatnonzero(chosen) for name, chosen in places.items()})


def cook(element: str, poisson: float, n: int) -> tuple[float, float]:
    """Rise of the upper right corner [mm], and roughness of the pressure.

    Roughness is the median distance of the pressure of a brick, or of its cells where they have one each, from the mean
    of the four bricks around, over the root mean square.
    """
    law = vs.NeoHookean(young=2 * MU * (1 + poisson), poisson=poisson)
    organ = vs.Organ(membrane(n), law, fixed="left", element=element)
    mesh = organ.mesh
    flat = {tuple(range(len(mesh.points))): (None, None, 0.0)}
    lift = {"right": (0, FORCE * np.ptp(mesh.points[:, 2]), 0)}
    u = organ.solve(displacement=flat, force=lift, steps=4, throw=True).displacement
    rest, moved = (_volumes(mesh, at).reshape(n, n, 6) for at in (0 * u, u))
    if element == "P1 mean volume":  # on this mesh the cells of a brick are those that share
        rest, moved = (volumes.sum(axis=2, keepdims=True) for volumes in (rest, moved))
    pressure = np.log(moved / rest)
    mean = pressure.mean(axis=2, keepdims=True)
    around = (mean[2:, 1:-1] + mean[:-2, 1:-1] + mean[1:-1, 2:] + mean[1:-1, :-2]) / 4
    distance = np.median(np.abs(pressure[1:-1, 1:-1] - around)) / np.sqrt(np.mean(pressure**2))
    return float(u[mesh.nodes("corner"), 1].mean() / MM), float(distance)


def inf_sup(element: str, n: int) -> tuple[int, int, float]:
    """Displacements that are free, demands on the volume and the inf-sup constant, in a cube clamped on one face.

    Chapelle and Bathe, Comput. Struct. 47 (1993) 537: beta^2 is the least eigenvalue but zero of `D v = beta^2 K v`
    with `v K v = int |eps(v)|^2` and `v D v = int (div v)^2`, the change of volume being that which the element sees.
    The demands are the rank of D.
    """
    points, cells = bricks((n, n, n))
    mesh = vs.mesh(points, cells)
    strain = _stiffness(mesh, vs.Linear(mu=0.5, lam=0.0), "P2" if element == "P2" else "P1")
    volume = _stiffness(mesh, vs.Linear(mu=0.5, lam=1.0), element) - strain
    half = np.linalg.inv(np.linalg.cholesky(strain))
    squares = np.linalg.eigvalsh(half @ volume @ half.T)
    seen = squares[squares > 1e-10]
    return len(squares), len(seen), float(np.sqrt(seen[0]))


def _volumes(mesh: vs.Mesh, displacement: Floats) -> Floats:
    """Six times the volumes of the cells."""
    corners = (mesh.points + displacement)[mesh.cells]
    return np.asarray(np.linalg.det(corners[:, 1:] - corners[:, :1]))


def _stiffness(mesh: vs.Mesh, law: vs.Linear, element: str) -> Floats:
    """The matrix of the free degrees of freedom, column by column, of a cube clamped at x = 0."""
    organ = vs.Organ(mesh, law, fixed=lambda x: x[:, 0] == 0, element=element)
    columns = np.eye(organ.mesh.points.size).reshape(-1, *organ.mesh.points.shape)
    free = np.delete(np.arange(len(columns)), (3 * organ.fixed[:, None] + [0, 1, 2]).ravel())
    return np.array([organ._body.internal_force(columns[k]).ravel()[free] for k in free])


if __name__ == "__main__":
    print("Cook's membrane: rise of the corner [mm], and roughness of the pressure at the last nu")
    print("element           cells" + "".join(f"  nu = {ratio:<6g}" for ratio in RATIOS) + "   roughness")
    for element, sizes in MEMBRANES.items():
        for n in sizes:
            found = [cook(element, ratio, n) for ratio in RATIOS]
            rough = "-" if element == "P2" else f"{found[-1][1]:.4f}"
            print(f"{element:15s}{6 * n**2:8d}" + "".join(f"{tip:13.2f}" for tip, _ in found) + f"{rough:>12s}")
    print("\nCube clamped on one face: demands on the volume, and the inf-sup constant")
    print("element           cells  displacements  demands  inf-sup")
    for element, sizes in CUBES.items():
        for n in sizes:
            unknowns, demands, beta = inf_sup(element, n)
            print(f"{element:15s}{6 * n**3:8d}{unknowns:15d}{demands:9d}{beta:9.3f}")
