"""Stress against closed forms: a thick tube under pressure, little and much; and the pressure of Cook's membrane.

The tube of radii a and b, in plane strain. Little pressure p, linear law: sigma = p a^2 / (b^2 - a^2) (1 -+ b^2 / r^2)
(Lame). Blown up, incompressible neo-Hookean, r^2 = R^2 + c:
    sigma_r = -mu (ln(B r / (R b)) + c/2 (1/r^2 - 1/b^2)),   sigma_t - sigma_r = mu (r^2/R^2 - R^2/r^2),
here with nu = 0.4999. Errors are those of the means at the nodes, of all nodes together, relative.
"""

from __future__ import annotations

from typing import Any

import locking
import numpy as np
from numpy.typing import NDArray

import viscera as vs

Floats = NDArray[np.float64]

INNER, OUTER = 0.01, 0.016  # [m]
MU, NU = 1e4, 0.4999
BLOWN_UP = 1.5
SIZES = {"P1": (4, 8), "P1 mean volume": (4, 8), "P2": (2, 4)}
CLAMP = 0.012
"""Length at the clamped end of the membrane that is left out, for stress is infinite in its corners [m]."""


def tube(n: int) -> vs.Mesh:
    """A ring of the tube around z, one layer high, of n by 12 n bricks; its set `lumen`."""
    unit, cells = locking.bricks((n, 12 * n, 1))
    number = np.arange(len(unit)).reshape(n + 1, 12 * n + 1, 2)
    number[:, -1] = number[:, 0]
    kept, place = np.unique(number.ravel()[cells], return_inverse=True)
    part, turn, z = unit[kept].T
    r, angle = INNER + (OUTER - INNER) * part, 2 * np.pi * turn
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle), OUTER / 12 / n * z])
    return vs.mesh(points, place.reshape(cells.shape), {"lumen": np.flatnonzero(part == 0.0)})


def inflated(mesh: vs.Mesh, law: vs.laws.Law, pressure: float, element: str) -> tuple[Floats, Floats, Floats]:
    """Radius of the nodes of the deformed tube (k,) [m], their radial and their hoop stress (k,) [Pa].

    One node of the lumen is fixed, and one held sideways, which bear nothing.
    """
    lumen = mesh.nodes("lumen")
    far = int(lumen[np.argmin(np.abs(mesh.points[lumen] - [-INNER, 0.0, 0.0]).sum(axis=1))])
    corner = int(lumen[np.argmin(np.abs(mesh.points[lumen] - [INNER, 0.0, 0.0]).sum(axis=1))])
    organ = vs.Organ(mesh, law, fixed=[corner], element=element)
    held: dict[Any, Any] = {tuple(range(len(organ.mesh.points))): (None, None, 0.0), (far,): (None, 0.0, None)}
    state = organ.solve(displacement=held, pressure={"lumen": pressure}, steps=4, throw=True)
    x, stress = organ.mesh.points + state.displacement, state.stress("cauchy", "nodes")
    axis = _axis(x[organ.mesh.nodes("lumen")])
    out = x[:, :2] - axis
    radius = np.linalg.norm(out, axis=1)
    e = out / radius[:, None]
    t = np.column_stack([-e[:, 1], e[:, 0]])
    radial, hoop = (np.einsum("ki,kij,kj->k", v, stress[:, :2, :2], v) for v in (e, t))
    return radius, radial, hoop


def _axis(ring: Floats) -> Floats:
    """Centre (2,) of nodes on a circle, by least squares: the tube grows about the node that is fixed."""
    A = np.column_stack([2 * ring[:, :2], np.ones(len(ring))])
    return np.asarray(np.linalg.lstsq(A, (ring[:, :2] ** 2).sum(axis=1), rcond=None)[0][:2])


def lame(element: str, poisson: float, n: int) -> tuple[float, float]:
    """Errors of radial and hoop stress under little pressure."""
    r, radial, hoop = inflated(tube(n), vs.Linear(young=1e5, poisson=poisson), 1.0, element)
    factor = INNER**2 / (OUTER**2 - INNER**2)
    return off(radial, factor * (1 - OUTER**2 / r**2)), off(hoop, factor * (1 + OUTER**2 / r**2))


def blown_up(element: str, n: int) -> tuple[float, float]:
    """Errors of radial and hoop stress where the lumen has grown to `BLOWN_UP` times its radius."""
    c = INNER**2 * (BLOWN_UP**2 - 1)
    b = np.sqrt(OUTER**2 + c)

    def closed(r: Floats) -> tuple[Floats, Floats]:
        R = np.sqrt(r**2 - c)
        radial = -MU * (np.log(OUTER * r / (R * b)) + 0.5 * c * (1 / r**2 - 1 / b**2))
        return radial, radial + MU * (r**2 / R**2 - R**2 / r**2)

    law = vs.NeoHookean(mu=MU, lam=2 * MU * NU / (1 - 2 * NU))
    pressure = -float(closed(np.array([BLOWN_UP * INNER]))[0][0])
    r, radial, hoop = inflated(tube(n), law, pressure, element)
    exact = closed(r)
    return off(radial, exact[0]), off(hoop, exact[1])


def off(found: Floats, exact: Floats) -> float:
    """Relative error over all nodes."""
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def membrane_pressure(element: str, n: int, places: Floats | None = None) -> tuple[Floats, Floats]:
    """Places (k, 3) of nodes and the pressure at them [Pa], of Cook's membrane under a fifth of its load."""
    law = vs.NeoHookean(young=2 * locking.MU * (1 + NU), poisson=NU)
    organ = vs.Organ(locking.membrane(n), law, fixed="left", element=element)
    flat: dict[Any, Any] = {tuple(range(len(organ.mesh.points))): (None, None, 0.0)}
    lift: dict[Any, Any] = {"right": (0, 0.2 * locking.FORCE * np.ptp(organ.mesh.points[:, 2]), 0)}
    state = organ.solve(displacement=flat, force=lift, throw=True)
    points, pressure = organ.mesh.points[: organ.mesh.n_corners], state.pressure("nodes")[: organ.mesh.n_corners]
    if places is None:
        chosen = np.flatnonzero((points[:, 0] > CLAMP) & (points[:, 2] == 0))
    else:
        chosen = np.array([np.argmin(np.linalg.norm(points[:, :2] - x[:2], axis=1)) for x in places])
    return points[chosen], pressure[chosen]


if __name__ == "__main__":
    print("thick tube: error of the radial and the hoop stress at nodes")
    print("element           cells   Lame, nu = 0.3   Lame, nu = 0.49   blown up by half, nu = 0.4999")
    for element, sizes in SIZES.items():
        for n in sizes:
            errors = [lame(element, 0.3, n), lame(element, 0.49, n), blown_up(element, n)]
            words = [f"{100 * radial:6.2f} {100 * hoop:6.2f} %" for radial, hoop in errors]
            print(f"{element:15s}{72 * n * n:8d}  {words[0]}  {words[1]}  {words[2]}")
    print("\nCook's membrane, nu = 0.4999: pressure at nodes, difference from that of 384 quadratic cells")
    places, quadratic = membrane_pressure("P2", 8)
    for element in ("P1 mean volume", "P1"):
        for n in (8, 16):
            _, pressure = membrane_pressure(element, n, places)
            print(f"{element:15s}{6 * n * n:8d}{100 * off(pressure, quadratic):9.2f} %")
