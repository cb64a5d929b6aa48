"""Named parts within an organ, such as a tumour or vessels, and how far a touch moves them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viscera import _core
from viscera.mesh import Floats, Indices, Mesh
from viscera.sealed import Sealed


@dataclass(frozen=True, eq=False)
class Target(Sealed):
    """How far a touch moves a part of the organ."""

    displacement: Floats
    """Mean displacement (3,) [m] of the surface of the part, weighted by area at rest."""
    band: float
    """Half width [m] of the band around it: in 95 of 100 touches the full solution lies within.

    `E sqrt(|u|^2 + U^2)` with the estimated error of the shape E, the mean displacement u of the place and the root
    mean square U of the displacement over the organ's surface nodes. Where the organ hardly moves, an error is as large
    as elsewhere: E is relative to the whole field. benchmarks/targets.py checks how often it holds.
    """
    is_trusted: bool
    """Whether the model trusts the shape; if not, the band says nothing."""

    @property
    def distance(self) -> float:
        """Length of the mean displacement [m]."""
        return float(np.linalg.norm(self.displacement))

    def __str__(self) -> str:
        words = with_band(1e3 * self.distance, 1e3 * self.band)
        return f"{words} mm" if self.is_trusted else f"{words} mm, not trusted"


FINEST = 6
"""Decimals of a length in millimetres at the most: what is smaller is rounding."""


def with_band(distance: float, band: float) -> str:
    """A distance and the band around it, both in millimetres: "6.21 ± 0.29", which holds all that the band holds.

    The band has two digits, and the distance as many decimals, but no more than four digits where it is known better.
    The band is rounded up, with what the rounding of the distance takes from it. The page does the same
    (viewer/src/stage/inside.ts).
    """
    sizes = [(size, digits) for size, digits in ((band, 2), (distance, 4)) if 0.0 < size < np.inf]
    places = [digits - 1 - int(np.floor(np.log10(size))) for size, digits in sizes]
    decimals = max(min([*places, FINEST]), 0) if places else 1
    rounded = round(distance, decimals)
    # A product that floating point puts just above a whole number is not rounded up to the next one.
    units = np.ceil((band + abs(rounded - distance)) * 10.0**decimals * (1.0 - 1e-9))
    return f"{rounded:.{decimals}f} ± {units / 10.0**decimals:.{decimals}f}"


def target(
    mesh: Mesh, cells: Indices, displacement: Floats, surface_nodes: Indices, estimate: float, is_trusted: bool
) -> Target:
    """The motion of some cells of a mesh under a displacement (n, 3) [m] with an estimated relative error."""
    nodes, weights = centroid_weights(mesh.points, boundary(mesh, cells))
    mean = weights @ displacement[nodes]
    typical = float(np.sqrt((displacement[surface_nodes] ** 2).sum(axis=1).mean()))
    return Target(mean, estimate * float(np.hypot(np.linalg.norm(mean), typical)), is_trusted)


def boundary(mesh: Mesh, cells: Indices) -> Indices:
    """Outward triangles (t, 3) around some cells."""
    triangles: Indices = _core.surface(mesh.points[: mesh.n_corners], mesh.cells[cells])
    return triangles


def centroid_weights(points: Floats, triangles: Indices) -> tuple[Indices, Floats]:
    """The nodes of a surface, and weights that add up to 1 and give its centroid."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    nodes, rows = np.unique(triangles, return_inverse=True)
    weights = np.bincount(rows.ravel(), np.repeat(areas, 3), len(nodes))
    return nodes.astype(np.uint32), weights / weights.sum()


def inner_parts(mesh: Mesh) -> dict[str, Indices]:
    """Surfaces (t, 3) of what lies within: the cell sets that make up less than half of the organ."""
    corners = mesh.points[mesh.cells[:, :4]]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    half = 0.5 * volumes.sum()
    return {name: boundary(mesh, cells) for name, cells in mesh.cell_sets.items() if 0.0 < volumes[cells].sum() < half}
