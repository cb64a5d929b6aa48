"""Real time: one Newton iteration a frame, while hands hold, pull and turn the organ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.loads import Displacements, Forces, Where, density_per_cell, nodal_forces, prescribed, vector
from viscera.mesh import Floats
from viscera.support import require_held

if TYPE_CHECKING:
    from viscera.organ import Organ
    from viscera.state import State


@dataclass(frozen=True)
class Frame:
    """The organ after one frame."""

    displacement: Floats
    """Displacement (n, 3) [m]."""
    residual: float
    """Out-of-balance force before the step, relative to all nodal forces: what the frame before had left."""
    taken: float
    """Part of the step taken: below 1 where a cell would have turned inside out; the hands then moved only so far."""
    is_unstable: bool
    """Whether the organ was about to buckle, so that the tangent had to be shifted."""
    _reactions: Floats
    _patches: list[_core.Patch]
    _patch_forces: Floats
    _organ: Organ

    def reaction(self, where: Where) -> Floats:
        """Force (3,) [N] with which a place is held: of a grasped patch, or summed over nodes (at the step's start)."""
        if isinstance(where, _core.Patch):
            for patch, force in zip(self._patches, self._patch_forces, strict=True):
                if patch is where:
                    return np.asarray(force)
            raise VisceraError("this contact patch is not held by the stepper")
        return np.asarray(self._reactions[self._organ.mesh.nodes(where)].sum(axis=0))


class Stepper:
    """An organ that is stepped: what is grasped is chosen once, where it moves comes with every frame.

    Paper B: one Newton iteration per frame from the last state, quasi-static.
    """

    def __init__(self, organ: Organ, grasped: Displacements, start: State | None = None) -> None:
        held = prescribed(organ.mesh, organ.fixed, grasped)
        require_held(organ.mesh, organ.fixed, held.dofs, [patch for patch, _ in held.patches])
        self._organ = organ
        self._held = held
        patches = [patch for patch, _ in held.patches]
        origin = None if start is None else start.displacement
        self._core = _core.Stepper(organ._body, prescribed=held.dofs, patches=patches, start=origin)

    def frame(
        self,
        displacement: Displacements,
        *,
        force: Forces | None = None,
        gravity: ArrayLike | None = None,
        density: ArrayLike | None = None,
    ) -> Frame:
        """Move the grasped places to `{where: (x, y, z)}` [m] from rest, under dead forces [N] and gravity [m/s^2]."""
        organ = self._organ
        moved = prescribed(organ.mesh, organ.fixed, displacement)
        patches = [patch for patch, _ in moved.patches]
        if not np.array_equal(moved.dofs, self._held.dofs) or [id(p) for p in patches] != [
            id(p) for p, _ in self._held.patches
        ]:
            raise VisceraError(
                "a frame moves exactly the places the stepper was made with; make a new stepper to regrasp"
            )
        applied = nodal_forces(organ.mesh, organ.fixed, {} if force is None else force)
        if gravity is not None:
            if density is None:
                raise VisceraError("gravity needs a density [kg/m^3]")
            weight = organ._body.gravity(vector(gravity, "gravity", "m/s^2"), density_per_cell(organ.mesh, density))
            applied = applied + weight
        means = np.array([mean for _, mean in moved.patches], dtype=float).reshape(-1, 3)
        result = self._core.frame(values=moved.values, means=means, force=applied)
        return Frame(
            displacement=result["displacement"],
            residual=result["residual"],
            taken=result["taken"],
            is_unstable=result["is_unstable"],
            _reactions=result["internal_force"] - applied,
            _patches=patches,
            _patch_forces=result["patch_forces"],
            _organ=organ,
        )
