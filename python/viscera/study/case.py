"""A case of paper A's studies: an organ under a load normal to its surface, at one position and at all of them.

The paper gives no geometry, mesh, support or load of its examples, so these are the project's own; what is measured
is its claims. Figure numbers are those of Niroomandi et al., IJNME 96 (2013) 129.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from viscera.mesh import Floats, Indices, Mesh
from viscera.organ import Organ
from viscera.output.picture import draw_panels
from viscera.pgd import Pgd

Say = Callable[[str], None]

PGD_ORDER = 4
"""Order of the separated series. The paper draws orders 1 to 4 and judges 4 to 6 to be enough."""
ORDER = 15
"""Order of the one expansion that is truncated for the curves of lower orders."""
RADIUS = 0.5
"""Load factor at which the series of a case ceases to converge. The paper gives no loads; this defines a = 1."""


@dataclass(frozen=True, eq=False)
class Case:
    """An organ with one law, the positions of its separated series, and the position of the curves."""

    key: str
    """Part of file names: svk or neo_hookean."""
    law: str
    organ: Organ
    positions: Indices
    node: int
    load: float
    """Load at a = 1 [N], positive into the organ."""
    view: tuple[float, float]
    radius: float = 0.0
    """Radius [m] of the patch over which the load is spread; 0 for a single node, as in the paper."""

    @property
    def mesh(self) -> Mesh:
        """The organ's mesh."""
        return self.organ.mesh

    @cached_property
    def force(self) -> Floats:
        """Nodal forces (n, 3) [N] of the load at `node` and a = 1."""
        return self.separate(0.5, order=1, max_terms=1).force(self.node)

    @cached_property
    def direction(self) -> Floats:
        """Unit vector (3,) along the load at `node`."""
        total = self.force.sum(axis=0)
        return np.asarray(total / np.linalg.norm(total))

    def separate(self, tolerance: float | None, order: int = PGD_ORDER, **settings: Any) -> Pgd:
        """The separated series of all positions; a tolerance of None solves each of them exactly."""
        load, radius = self.load, self.radius
        return self.organ.pgd(self.positions, load=load, radius=radius, order=order, tolerance=tolerance, **settings)

    def draw_vertical(self, fields: dict[str, Floats], label: str = "vertical displacement [mm]") -> Figure:
        """Panels of the vertical component [mm] of fields (n, 3) [m], each drawn on the deformed organ."""
        return draw_panels(
            self.mesh.points,
            self.mesh.surface,
            {title: 1e3 * u[:, 2] for title, u in fields.items()},
            label=label,
            displacements=fields,
            is_signed=True,
            view=self.view,
        )


def calibrated(case: Case) -> Case:
    """The case with a load at a = 1 that puts the radius of convergence of its series at a = `RADIUS`."""
    series = case.organ.path(force=case.force, order=ORDER, max_expansions=1).expansions[0].displacement
    return replace(case, load=case.load * radius_of_convergence(series) / RADIUS)


def radius_of_convergence(series: Floats) -> float:
    """Radius of convergence, estimated from the ratio of the last terms of a series (order + 1, n, 3)."""
    norms = np.linalg.norm(series.reshape(len(series), -1), axis=1)
    return float((norms[-4] / norms[-1]) ** (1 / 3))


def middle(mesh: Mesh, nodes: Indices) -> int:
    """The node nearest to the centroid of some nodes."""
    points = mesh.points[nodes]
    return int(nodes[np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1))])
