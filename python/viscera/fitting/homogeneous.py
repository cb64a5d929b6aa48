"""Nominal stress of a law along a measured curve, incompressible or with the law's own bulk modulus.

An incompressible solid adds a pressure p to the law's stress, P - p cof F with det F = 1; what is free of stress
determines it. So a law's bulk modulus does not enter, and the stress is linear in every coefficient that the energy is
linear in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viscera.curves import MODES, curve, state_at
from viscera.errors import VisceraError
from viscera.fitting.materialtest import MaterialTest
from viscera.law import Law
from viscera.mesh import Floats


def gradients(mode: str, parameter: Floats) -> Floats:
    """Deformation gradients (k, 3, 3) of an incompressible solid in a homogeneous deformation."""
    one = np.ones_like(parameter)
    if mode == "simple shear":
        F = np.tile(np.eye(3), (len(parameter), 1, 1))
        F[:, 0, 1] = parameter
        return F
    across = {
        "uniaxial": (parameter**-0.5, parameter**-0.5),
        "equibiaxial": (parameter, parameter**-2.0),
        "pure shear": (one, parameter**-1.0),
    }[mode]
    F = np.zeros((len(parameter), 3, 3))
    F[:, 0, 0], F[:, 1, 1], F[:, 2, 2] = parameter, *across
    return F


def incompressible_stress(law: Law, test: MaterialTest) -> Floats:
    """Nominal stress (k,) [Pa] with det F = 1; the pressure is that of the third axis, which nothing loads."""
    F = gradients(test.mode, test.stretch)
    P = law.stress(F)
    cofactor = np.linalg.inv(F).transpose(0, 2, 1)
    pressure = P[:, 2, 2] / cofactor[:, 2, 2]
    row, column = MODES[test.mode].component
    return np.asarray(P[:, row, column] - pressure * cofactor[:, row, column])


def compressible_stress(law: Law, test: MaterialTest) -> Floats:
    """Nominal stress (k,) [Pa] of the law with its own bulk modulus, points taken outwards from rest."""
    kind = MODES[test.mode]
    stress = np.empty(test.n_points)
    for side in (test.stretch >= kind.at_rest, test.stretch < kind.at_rest):
        points = np.flatnonzero(side)
        F = np.eye(3)
        for point in points[np.argsort(np.abs(test.stretch[points] - kind.at_rest), kind="stable")]:
            state = state_at(law, kind, float(test.stretch[point]), F, 0)
            if state is None:
                raise VisceraError(
                    f"{test.name}: {type(law).__name__} has no state at {kind.parameter} {test.stretch[point]:g}; "
                    "fit a shorter range, or another law"
                )
            F = state
            stress[point] = law.stress(F[None])[0][kind.component]
    return stress


def compressibility_error(law: Law, mode: str, low: float, high: float) -> float:
    """Largest difference [Pa] between the law's stress with its own bulk modulus and that with det F = 1.

    Over a range around rest, as far as the compressible law has a state there.
    """
    parameter, stress = curve(law, mode, (low, high))
    if len(parameter) < 2:
        return 0.0
    return float(np.abs(stress - incompressible_stress(law, MaterialTest(mode, parameter, stress))).max())


def drucker_range(law: Law, mode: str, low: float, high: float, points: int = 60) -> tuple[float, float]:
    """The part of a range around rest in which an incompressible law is stable after Drucker.

    Stable: the logarithmic stiffness d2W / d(ln l_i) d(ln l_j), i, j = 1, 2, l_3 = 1 / (l_1 l_2), is positive definite.
    """
    rest = MODES[mode].at_rest

    def is_stable(parameter: Floats) -> NDArray[np.bool_]:
        stretches = np.linalg.svd(gradients(mode, parameter), compute_uv=False)
        return np.asarray(_stiffness(law, np.log(stretches)) > 0.0)

    ends = []
    for end in (low, high):
        grid = np.linspace(rest, end, points)[1:] if end != rest else np.empty(0)
        stable = is_stable(grid) if len(grid) else np.empty(0, dtype=bool)
        ends.append(end if stable.all() else (rest if not stable[0] else float(grid[int(np.argmin(stable)) - 1])))
    return ends[0], ends[1]


def _stiffness(law: Law, logs: Floats, step: float = 1e-4) -> Floats:
    """The smaller eigenvalue (k,) of d2W / d(ln l_i) d(ln l_j), by differences of the exact stress; logs (k, 3)."""

    def stress(e: Floats) -> Floats:
        stretches = np.exp(np.column_stack([e, -e.sum(axis=1)]))
        P = law.stress(stretches[:, :, None] * np.eye(3))
        kirchhoff = np.einsum("kii->ki", P) * stretches
        return np.asarray(kirchhoff[:, :2] - kirchhoff[:, 2:])

    e = logs[:, :2]
    sides = [(stress(e + step * unit) - stress(e - step * unit)) / (2.0 * step) for unit in np.eye(2)]
    H = np.stack(sides, axis=1)
    return np.asarray(np.linalg.eigvalsh(0.5 * (H + H.transpose(0, 2, 1)))[:, 0])
