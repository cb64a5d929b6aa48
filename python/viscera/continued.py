"""What friction remembers from one solve to the next: where the surface sticks to a tool."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from viscera.contact.tool import Tool
from viscera.mesh import Mesh
from viscera.state import State

if TYPE_CHECKING:
    from viscera import _core

PLACED = 1e-12
"""Poses that differ by less, over the diagonal of the organ, are the same: `Tool.arrived` rounds."""


def anchored(tools: Sequence[Tool], start: object, mesh: Mesh) -> list[list[_core.Anchored]]:
    """What sticks to each tool since the solve that ended in `start`, a list for each.

    A list is empty unless `start` is a state on these points and cells, and the tool begins where that solve has left
    it, with the same shape object, friction and stiffness.
    """
    if not isinstance(start, State) or not _is_same(start.mesh, mesh):
        return [[] for _ in tools]
    return [_since(start, tool, PLACED * mesh.diagonal) for tool in tools]


def _is_same(one: Mesh, other: Mesh) -> bool:
    return one is other or (np.array_equal(one.points, other.points) and np.array_equal(one.cells, other.cells))


def _since(start: State, tool: Tool, rounding: float) -> list[_core.Anchored]:
    for (known, _), stuck in zip(start._tools, start._anchored, strict=True):
        left = known._at(start.load)
        kept = ("shape", "friction", "stiffness")
        if all(getattr(left, name) == getattr(tool, name) for name in kept) and _is_at(left, tool, rounding):
            return stuck
    return []


def _is_at(one: Tool, other: Tool, rounding: float) -> bool:
    moved = np.abs(one.position - other.position).max()
    turned = np.abs(one.rotation - other.rotation).max()
    return bool(moved <= rounding and turned <= PLACED)
