"""A bond between two surfaces whose meshes need not match: how it is asked for, and its samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from viscera import _core
from viscera.boundary import ties
from viscera.boundary.elastic_support import LINEAR, QUADRATIC, areas_and_normals, quadratic_shapes
from viscera.boundary.loads import name_of
from viscera.boundary.ties import Ties
from viscera.errors import VisceraError
from viscera.immutable import Immutable
from viscera.mesh import Floats, Indices, Mesh, Where
from viscera.quantity import Flag, Number, refused
from viscera.select import length

if TYPE_CHECKING:
    from viscera.law import Law

Side: TypeAlias = str | tuple[str, Where]
"""The name of an organ for its whole surface, or the name and a place of its surface."""

DEEPEST = 0.5
"""How deep a surface may be in the other, over the height of the lower of the cells behind them. Deeper, it is the far
side of something thin, seen through both bodies (`DEEPEST` in `pieces.rs`, of contact pairs)."""
TURNED = 15.0
"""Angle [degrees] by which the surfaces of a sliding bond may turn without a word: its force along their normal is a
cosine less, 3 %, and a sine of it is along them."""
STIFFNESS = 100.0
"""Stiffness factor of a bond. An interface under a stress `s` opens by `s / E` of a hundredth of a cell's height."""
FACTOR = Number(above=0)
POSITIVE = Number("m", above=0)


@dataclass(frozen=True, eq=False)
class Pieces:
    """The common pieces of the triangles of two surfaces, by nodes and coordinates that hold in another shape too."""

    sides: tuple[Indices, Indices]
    """Of each piece the face (p, 3) or (p, 6) of the first surface and that of the second."""
    corners: Floats
    """(p, 3, 2, 3) by corner of the piece: its barycentric coordinates in each of the two faces."""
    shares: Floats
    """(p,) area over that of the face of the first surface."""

    def turned(self, points: Floats, displacement: Floats) -> float:
        """Angle [degrees] between the normals of the first surface at rest and deformed, as the root of its mean square
        over the pieces by area."""
        areas, normals = areas_and_normals(points, self.sides[0])
        _, now = areas_and_normals(points + displacement, self.sides[0])
        angles = np.degrees(np.arccos(np.clip(np.einsum("pi,pi->p", normals, now), -1.0, 1.0)))
        return float(np.sqrt(np.average(angles**2, weights=areas * self.shares)))


class Bond(Immutable):
    """Two surfaces that hold together wherever they lie on each other at rest; their meshes need not match.

    The jump `[u]` of the displacement is tied by `k [u]` per area, with `k = stiffness E / (1 - nu^2) / h` of the
    softer side, where h is the height of the cell behind. The integral over the common pieces of the triangles of both
    sides is exact (Puso and Laursen 2004), so a uniform stress passes the interface without error.

    first, second: the name of an organ of the scene, words such as "liver/x < 30%", or a pair (name, place of its
        surface). Triangles that face each other and are at most `reach` apart hold together.
    sliding: whether the surfaces may slide along each other. They do not separate, and slides are small: the samples
        and the normal are those at rest.
    stiffness: see above. reach: above 0 [m], or in words such as "1 mm" or "1%" of the diagonal of the smaller organ.

    >>> import viscera as vs
    >>> vs.Bond(("liver", "bed"), "gallbladder")
    Bond(liver at 'bed', gallbladder)
    """

    def __init__(
        self,
        first: Side,
        second: Side,
        *,
        sliding: bool = False,
        stiffness: float = STIFFNESS,
        reach: float | str = "1%",
    ) -> None:
        self.first: Final = side_of(first, "a bond")
        """Name and place; the place is None for the whole surface."""
        self.second: Final = side_of(second, "a bond")
        """The same of the other side."""
        self.sliding: Final = Flag()(sliding, "sliding")
        self.stiffness: Final = FACTOR(stiffness, "the stiffness of a bond")
        self.reach: Final = reach
        self._reach(1.0)  # its sign and its words, before there are organs

    def __repr__(self) -> str:
        words = [name if where is None else f"{name} at {name_of(where)}" for name, where in self.sides]
        return f"Bond({', '.join(words)}{', sliding' if self.sliding else ''})"

    @property
    def sides(self) -> tuple[tuple[str, Where | None], ...]:
        """Name and place of both sides.

        >>> import viscera as vs
        >>> vs.Bond(("liver", "bed"), "gallbladder").sides
        (('liver', 'bed'), ('gallbladder', None))
        """
        return self.first, self.second

    def _reach(self, diagonal: float) -> float:
        """Its reach [m] where the smaller organ has this diagonal [m]."""
        return length(self.reach, diagonal, "the reach of a bond", POSITIVE)

    def _pieces(self, mesh: Mesh, faces: Sequence[Indices], reach: float) -> Pieces:
        """What the faces (f, 3) or (f, 6) of both sides have in common on the mesh of the scene; reach [m]."""
        triangles = [np.ascontiguousarray(side[:, :3], dtype=np.uint32) for side in faces]
        pairs, corners, areas, depths = _core.overlap(mesh.points, triangles[0], triangles[1], reach)
        heights = [_heights(mesh, side, _behind(mesh, side)) for side in faces]
        is_near = depths <= DEEPEST * np.minimum(heights[0][pairs[:, 0]], heights[1][pairs[:, 1]])
        pairs, corners, areas = pairs[is_near], corners[is_near], areas[is_near]
        if len(pairs) == 0:
            raise VisceraError(
                f"{self!r}: no triangle of the one surface faces one of the other within {1e3 * reach:g} mm; move the "
                "organs together, choose other places, or a larger reach"
            )
        first, second = (face[pair] for face, pair in zip(faces, pairs.T, strict=True))
        whole, _ = areas_and_normals(mesh.points, first)
        return Pieces((first, second), corners.reshape(-1, 3, 2, 3), areas / whole)

    def _samples(self, mesh: Mesh, pieces: Pieces, law: Law) -> Ties:
        """Its samples on pieces: points of a rule that is exact for products of shape functions.

        mesh: of the scene, in the shape whose areas, normals and heights count; law: of the scene.
        """
        sides, modulus = pieces.sides, _plane_strain_modulus(law, len(mesh.cells))
        is_quadratic = sides[0].shape[1] == 6
        points, shares = QUADRATIC if is_quadratic else LINEAR
        inside = np.einsum("qk,pksc->pqsc", points, pieces.corners)
        shapes = [quadratic_shapes(side) if is_quadratic else side for side in np.moveaxis(inside, 2, 0)]
        whole, normals = areas_and_normals(mesh.points, sides[0])
        layers = [_layer(mesh, faces, modulus) for faces in sides]
        per_area = self.stiffness * np.minimum(*layers)[:, None, None] * np.eye(3)
        if self.sliding:
            per_area = per_area @ np.einsum("pi,pj->pij", normals, normals)
        areas = pieces.shares * whole
        stiffness = (areas[:, None] * shares)[:, :, None, None] * per_area[:, None]
        count, width = len(shares), 2 * sides[0].shape[1]
        nodes = np.repeat(np.concatenate(sides, axis=1), count, axis=0)
        weights = np.concatenate([shapes[0], -shapes[1]], axis=2)
        return ties.rows(nodes, weights.reshape(-1, width), stiffness.reshape(-1, 3, 3))


def side_of(side: Any, of: str) -> tuple[str, Where | None]:
    """Name and place of a side of a bond or of a contact pair; the place is None for the whole surface."""
    if isinstance(side, str):
        name, _, where = side.partition("/")
        return name, where or None
    if isinstance(side, tuple) and len(side) == 2 and isinstance(side[0], str):
        return side
    what = "the name of an organ, words such as 'liver/x < 30%', or a pair of a name and a place"
    raise refused(f"a side of {of}", what, side)


def _plane_strain_modulus(law: Law, cells: int) -> Floats:
    """`E / (1 - nu^2)` (m,) [Pa] of so many cells at small strain."""
    shear, bulk = np.broadcast_to(law.core().moduli(), (cells, 2)).T
    return np.asarray(4.0 * shear * (bulk + shear / 3.0) / (bulk + 4.0 / 3.0 * shear))


def _layer(mesh: Mesh, faces: Indices, modulus: Floats) -> Floats:
    """Modulus over height (f,) [Pa/m] of the cells behind faces."""
    cell = _behind(mesh, faces)
    return np.asarray(modulus[cell] / _heights(mesh, faces, cell))


def _heights(mesh: Mesh, faces: Indices, cell: Indices) -> Floats:
    """Heights (f,) [m] of the cells (f,) over their faces."""
    areas, _ = areas_and_normals(mesh.points, faces)
    return np.asarray(3.0 * np.abs(mesh.facts["cell_volumes"][cell]) / areas)


def _behind(mesh: Mesh, faces: Indices) -> Indices:
    """The cells (f,) behind faces of the surface."""
    cells = np.sort(mesh.cells.astype(np.int64), axis=1)
    behind = np.concatenate([np.delete(cells, left_out, axis=1) for left_out in range(4)])
    size = len(mesh.points)
    keys = (behind[:, 0] * size + behind[:, 1]) * size + behind[:, 2]
    order = np.argsort(keys)
    own = np.sort(faces[:, :3].astype(np.int64), axis=1)
    wanted = (own[:, 0] * size + own[:, 1]) * size + own[:, 2]
    return np.asarray(order[np.searchsorted(keys, wanted, sorter=order)] % len(mesh.cells))
