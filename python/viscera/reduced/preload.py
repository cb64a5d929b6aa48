"""The loaded equilibrium that touches start from, such as an organ that hangs in gravity before it is touched.

The load does not change while the organ is touched, so it has to be a dead load. Its nodal forces are the internal
forces of the state; nothing else about it needs to be known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from viscera.errors import VisceraError
from viscera.mesh import Floats
from viscera.state import State

if TYPE_CHECKING:
    from viscera.organ import Organ

SAME = 1e-6
"""Part of the largest nodal force by which two organs may differ and still count as the same."""

HELD = 1e-4
"""Part of the largest nodal force. A node with a larger residual must be held by something else."""


def preload_of(organ: Organ, state: State) -> Floats:
    """The displacement (n, 3) [m] of a state about which the organ can be reduced.

    Raises `VisceraError` if the state did not converge, belongs to another organ, is loaded by a pressure, which
    follows the surface, is pressed by a tool, or is held anywhere but at the organ's fixed nodes.
    """
    if state.displacement.shape != organ.mesh.points.shape:
        raise VisceraError(
            f"the state to reduce about belongs to another mesh: it has {len(state.displacement)} points, "
            f"this one {len(organ.mesh.points)}"
        )
    if not state.is_converged:
        raise VisceraError(f"the state to reduce about is not an equilibrium: {state.message}")
    if state.has_pressure:
        raise VisceraError(
            "the state to reduce about is under pressure, which turns with the surface as it is touched; "
            "a reduced model keeps dead loads only: gravity, forces, tractions"
        )
    if any(contact.touching for _, contact in state._tools):
        raise VisceraError(
            "the state to reduce about is pressed by a tool or a rigid body, whose force follows what moves; a reduced "
            "model keeps dead loads only: gravity, forces, tractions"
        )
    own = organ._body.internal_force(state.displacement)
    size = float(np.abs(own).max())
    if (other := float(np.abs(own - state.internal_force).max())) > SAME * size:
        raise VisceraError(
            f"the state to reduce about belongs to another organ: nodal forces differ by {other:.2g} N; "
            "solve it with this one"
        )
    lacking = np.abs(own - state.external_force).max(axis=1)
    lacking[organ.fixed] = 0.0
    held = np.flatnonzero(lacking > HELD * size)
    if len(held):
        raise VisceraError(
            f"the state to reduce about is held at {len(held)} points besides the fixed ones, such as point {held[0]}: "
            "a displacement or a contact that was prescribed; load it by forces, or fix those points"
        )
    return state.displacement
