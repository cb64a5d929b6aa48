"""What the hands hold: resolved from a user's words once, moved with every frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from viscera import _core
from viscera.boundary.loads import is_free, name_of, prescribed
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh


class PrescribedMotion:
    """The places of `{where: (x, y, z)}` as degrees of freedom and patches."""

    def __init__(self, mesh: Mesh, fixed: Indices, displacement: Mapping[Any, Any]) -> None:
        is_fixed = np.zeros(len(mesh.points), dtype=bool)
        is_fixed[fixed] = True
        for where in displacement:
            nodes = where.nodes if isinstance(where, _core.Patch) else mesh.nodes(where)
            if is_fixed[nodes].all():
                raise VisceraError(f"all nodes of {name_of(where)} are fixed: a hand cannot move them")
        held = prescribed(mesh, fixed, displacement)
        self.dofs = held.dofs
        self.patches = [patch for patch, _ in held.patches]
        self._mesh = mesh
        self._fixed = fixed
        self._places = _places(displacement)
        # Where each component of each place is among the values; none if places share nodes.
        self._slots: list[tuple[Any, int, Any]] = []
        for where, _, free in self._places:
            if isinstance(where, _core.Patch):
                continue
            nodes = mesh.nodes(where).astype(np.int64)
            moving = ~is_fixed[nodes]
            for axis in (axis for axis in range(3) if axis not in free):
                slots = np.searchsorted(held.dofs, 3 * nodes[moving] + axis)
                self._slots.append((where, axis, (slots, moving)))
        self._is_simple = sum(len(slots) for _, _, (slots, _) in self._slots) == len(held.dofs)
        self._has_fixed = any(not moving.all() for _, _, (_, moving) in self._slots)

    def fits(self, displacement: Mapping[Any, Any]) -> bool:
        """Whether the same components of the same places are named."""
        return self._places == _places(displacement)

    def move(self, displacement: Mapping[Any, Any]) -> tuple[Floats, Floats]:
        """Values (k,) of the degrees of freedom and means (p, 3) of the patches [m]; refuses contradictions."""
        if not self._is_simple or self._has_fixed:
            return self._resolved(displacement)
        values, table = np.empty(len(self.dofs)), np.empty((len(self.patches), 3))
        try:
            for where, axis, (slots, _) in self._slots:
                target: Any = displacement[where]
                values[slots] = target[:, axis] if np.ndim(target) == 2 else target[axis]
            for row, patch in zip(table, self.patches, strict=True):
                mean: Any = displacement[patch]
                row[:] = mean
        except (TypeError, ValueError):
            values[:] = np.nan
        if not (np.isfinite(values).all() and np.isfinite(table).all()):
            return self._resolved(displacement)
        return values, table

    def _resolved(self, displacement: Mapping[Any, Any]) -> tuple[Floats, Floats]:
        """The same for lengths in words and for places that share nodes; says what is wrong where."""
        moved = prescribed(self._mesh, self._fixed, displacement)
        return moved.values, np.array([mean for _, mean in moved.patches], dtype=float).reshape(-1, 3)


def _places(displacement: Mapping[Any, Any]) -> list[tuple[Any, tuple[int, ...], tuple[int, ...]]]:
    """Each place with the shape of its displacement and its free components."""
    places = []
    for where, target in displacement.items():
        components: Any = target
        shape = np.shape(components)
        free = tuple(i for i, part in enumerate(components) if is_free(part)) if len(shape) == 1 else ()
        places.append((where, shape, free))
    return places
