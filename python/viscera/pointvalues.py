"""Displacement, stress and strain at points within a deformed organ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from viscera import _core
from viscera.files.mesh import EDGES
from viscera.mesh import Floats, Mesh
from viscera.quantity import Choice
from viscera.sealed import Sealed
from viscera.stress import STRAINS, STRESSES, corner_values

if TYPE_CHECKING:
    from viscera.deformed import Deformed


@dataclass(frozen=True, eq=False)
class PointValues(Sealed):
    """Displacement, stress and strain at k points of a deformed organ.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
    >>> inside = state.at([[0.5, 0.1, 0.2]])
    >>> inside.displacement.shape, inside.stress().shape, inside.strain().shape
    ((1, 3), (1, 3, 3), (1, 3, 3))
    """

    places: Floats
    """The points (k, 3) [m] in the undeformed mesh."""
    displacement: Floats
    """Displacement (k, 3) [m], with the shape functions of the element."""
    cells: NDArray[np.int64]
    """The cell (k,) that contains each point."""
    _weights: Floats
    _of: Deformed

    def stress(self, measure: str = "cauchy") -> Floats:
        """Stress (k, 3, 3) [Pa] of the cell, as in `State.stress`; linear in a quadratic cell, except for the pressure.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> state.at([[0.1, 0.1, 0.19]]).stress()[0, 0, 0].round().item()  # along the beam
        2863.0
        """
        self._of._expect_stress()
        return self._within(self._of._response.even().stress(Choice(STRESSES)(measure, "the stress")))

    def strain(self, measure: str = "green") -> Floats:
        """Strain (k, 3, 3) of the cell, as in `State.strain`; linear in a quadratic cell.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> state.at([[0.1, 0.1, 0.19]]).strain("log")[0, 0, 0].round(4).item()  # along the beam
        0.0296
        """
        return self._within(self._of._response.strain(Choice(STRAINS)(measure, "the strain")))

    def _within(self, values: Floats) -> Floats:
        return np.asarray(np.einsum("ka,ka...->k...", self._weights, corner_values(values[self.cells])))


def interpolated(mesh: Mesh, field: Floats, cells: NDArray[np.int64], weights: Floats) -> Floats:
    """A nodal field (n, 3) at points (k, 3), by the shape functions of the element."""
    if not len(mesh.edges):
        return np.asarray(np.einsum("ka,kai->ki", weights, field[mesh.cells[cells]]))
    nodes = _core.quadratic(mesh.n_corners, mesh.cells)[1][cells]
    edges = [4.0 * weights[:, a] * weights[:, b] for a, b in EDGES]
    shapes = np.column_stack([weights * (2.0 * weights - 1.0), *edges])
    return np.asarray(np.einsum("ka,kai->ki", shapes, field[nodes]))
