"""From loads as a user gives them to the core's arrays: displacements, forces, tractions, pressures and gravity."""

from __future__ import annotations

import logging
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.members import words_of
from viscera.mesh import Floats, Indices, Mesh
from viscera.mesh import Where as Nodes
from viscera.quantity import LARGEST, Number, check_nodal, numbers_of, refuse_masked, refused, vector
from viscera.select import AXES, FREE, Lengths, offset

log = logging.getLogger("viscera")

Where: TypeAlias = Nodes | _core.Patch
"""A place: the name of a node set, conditions, a list of both, a predicate on points, indices, or a contact patch."""

Displacements: TypeAlias = Mapping[Any, Lengths] | Sequence[tuple[Any, Any]]
"""Components are numbers [m], words, None or "free"."""
Forces: TypeAlias = Mapping[Any, ArrayLike] | Sequence[tuple[Any, ArrayLike]] | ArrayLike
Tractions: TypeAlias = Mapping[Any, ArrayLike] | Sequence[tuple[Any, ArrayLike]]
Pressures: TypeAlias = Mapping[Any, float] | Sequence[tuple[Any, float]]
"""`{where: value}`, or pairs `[(where, value)]`, since an array of indices can be no key."""

Density: TypeAlias = ArrayLike | Mapping[Any, float]
"""One number, one per cell, or `{where: value}` of the cells of places [kg/m^3]."""

PRESSURE = Number("Pa")
DENSITY = Number("kg/m^3", above=0)
ROUNDING = 1e-12
"""Of the mesh's diagonal: places that share nodes may move them as differently as this."""
LIGHT = 100.0
"""Density [kg/m^3] below which it was most likely given in another unit; an inflated lung has 260."""


@dataclass(frozen=True, eq=False)
class Prescribed:
    """Prescribed displacements: single components of nodes, and weighted means over patches."""

    dofs: Indices
    """(k,) degrees of freedom 3 * node + component; none of a fixed node."""
    values: Floats
    """(k,) their displacement [m]."""
    patches: list[tuple[_core.Patch, Floats]]
    """Contact patches with their mean displacement (3,) [m]."""


def by_place(given: Any, what: str) -> dict[Any, Any]:
    """`{where: value}` of a mapping or of pairs, indices as tuples; `{}` of None. Raises `VisceraError` for anything
    else."""
    if given is None:
        return {}
    pairs = list(given.items()) if isinstance(given, Mapping) else given
    if not are_pairs(pairs):
        raise refused(what, "{where: value}, or pairs [(where, value)]", given)
    found: dict[Any, Any] = {}
    for where, value in pairs:
        key = _key_of(where)
        if not isinstance(key, Hashable):
            raise refused(f"a place of {what}", "a set's name, a condition, indices, a predicate or a patch", where)
        if key in found:
            raise VisceraError(f"{what} names {name_of(where)} twice")
        found[key] = value
    return found


def _key_of(where: Any) -> Any:
    """A place as the key of a table: lists as tuples."""
    if (words := words_of(where)) is not None:
        return tuple(words)
    refuse_masked(where, "a place", "a list of nodes")
    return tuple(np.asarray(where).ravel().tolist()) if isinstance(where, np.ndarray | list | range) else where


def prescribed(mesh: Mesh, fixed: Indices, displacement: Displacements | None) -> Prescribed:
    """Resolve `{where: (x, y, z)}`; `None` leaves a component free. Places that contradict each other are refused."""
    values = np.zeros((len(mesh.points), 3))
    owner = np.full(values.shape, -1)  # which entry prescribes a component; 0 is the fixed set
    owner[fixed] = 0
    names = ["the fixed set"]
    patches: list[tuple[_core.Patch, Floats]] = []
    for where, target in by_place(displacement, "displacement").items():
        names.append(name_of(where))
        if isinstance(where, _core.Patch):
            patches.append((where, offset(target, mesh, "displacement of a patch (all three components)")))
            continue
        nodes = mesh.nodes(where)
        for axis, wanted in enumerate(_components(target, mesh, len(nodes), names[-1])):
            if wanted is None:
                continue
            previous = owner[nodes, axis]
            clash = (previous >= 0) & (abs(values[nodes, axis] - wanted) > ROUNDING * mesh.diagonal)
            if clash.any():
                node = nodes[clash][0]
                raise VisceraError(
                    f"node {node} is asked to move {values[node, axis]:g} m along {AXES[axis]} by "
                    f"{names[owner[node, axis]]} and {np.broadcast_to(wanted, len(nodes))[clash][0]:g} m by "
                    f"{names[-1]}; let each component be prescribed once"
                )
            values[nodes, axis] = wanted
            owner[nodes, axis] = np.where(previous == 0, 0, len(names) - 1)
    for patch, _ in patches:
        if (owner[patch.nodes] >= 0).all():
            raise VisceraError(f"all {len(patch.nodes)} nodes of a contact patch are prescribed already; move it")
    dofs = np.flatnonzero(owner.ravel() > 0)
    return Prescribed(dofs.astype(np.uint32), values.ravel()[dofs], patches)


def nodal_forces(mesh: Mesh, fixed: Indices, force: Forces) -> Floats:
    """Nodal forces (n, 3) [N] of `{where: total}`, each total spread over its place, or of an (n, 3) array itself."""
    if not (isinstance(force, Mapping) or are_pairs(force)):
        given = numbers_of(force)
        if given is None:
            raise refused("force", "{where: (x, y, z)} [N], or an array (n, 3) of nodal forces", force)
        if given.shape != mesh.points.shape:
            raise VisceraError(f"nodal forces have shape {given.shape}; the mesh needs {mesh.points.shape}")
        check_nodal(given, "the force on node", "N")
        return given
    nodal = np.zeros_like(mesh.points)
    for where, total in by_place(force, "force").items():
        nodes, parts = shares_of(mesh, where)
        if np.isin(nodes, fixed).all():
            raise VisceraError(f"all nodes of {name_of(where)} are fixed: a force there would move nothing")
        nodal[nodes] += parts[:, None] * vector(total, f"force on {name_of(where)}", "N")
    return nodal


def dead_forces(mesh: Mesh, fixed: Indices, force: Forces | None, traction: Tractions | None) -> Floats | None:
    """Nodal forces (n, 3) [N] of forces and dead tractions together; None where neither is given."""
    applied = None if force is None else nodal_forces(mesh, fixed, force)
    if traction is None:
        return applied
    pull = traction_forces(mesh, fixed, traction)
    return pull if applied is None else applied + pull


def traction_forces(mesh: Mesh, fixed: Indices, traction: Tractions) -> Floats:
    """Nodal forces (n, 3) [N] of dead tractions `{where: (x, y, z)}` [Pa] on the surface triangles of each place."""
    nodal = np.zeros_like(mesh.points)
    for where, value in by_place(traction, "traction").items():
        faces = _loaded(mesh, fixed, where, "traction")
        pull = vector(value, f"traction on {name_of(where)}", "Pa")
        nodal += _lumped_areas(mesh, faces)[:, None] * pull
    return nodal


def pressed_faces(
    mesh: Mesh, fixed: Indices, pressure: Pressures | None, known: dict[Any, Indices] | None = None
) -> tuple[Indices, Floats]:
    """Faces (t, 3), in a quadratic mesh (t, 6), and the pressure on each (t,) [Pa]; overlapping places add up.

    known: faces of places from earlier calls; new ones are added to it.
    """
    known = {} if known is None else known
    faces, values = [np.empty((0, 6 if len(mesh.edges) else 3), dtype=np.uint32)], [np.empty(0)]
    for where, value in by_place(pressure, "pressure").items():
        push = PRESSURE(value, f"the pressure on {name_of(where)}")
        if where not in known:
            known[where] = _loaded(mesh, fixed, where, "pressure")
        faces.append(known[where])
        values.append(np.full(len(faces[-1]), push))
    return np.ascontiguousarray(np.concatenate(faces)), np.concatenate(values)


def shares(mesh: Mesh, nodes: Indices) -> Floats:
    """The share (k,) of each node in a total force on them all: that of a uniform traction over the surface triangles
    among them, equal shares where there is none."""
    faces = faces_within(mesh, nodes)
    parts = _lumped_areas(mesh, faces)[nodes] if len(faces) else np.ones(len(nodes))
    return np.asarray(parts / parts.sum())


def density_per_cell(mesh: Mesh, density: Density) -> Floats:
    """Density (1,) or (m,) [kg/m^3], checked; by place, later places count over earlier ones."""
    if isinstance(density, Mapping):
        values = np.full(len(mesh.cells), np.nan)
        for where, value in density.items():
            values[mesh.cells_in(where)] = DENSITY(value, f"the density of {where!r}")
        if np.isnan(values).any():
            cell = int(np.argmax(np.isnan(values)))
            raise VisceraError(f"{np.isnan(values).sum()} cells have no density, the first of them cell {cell}")
        return values
    given = numbers_of(density)
    if given is None or given.ndim == 0:
        given = np.array([DENSITY(density, "density")])
    if given.shape not in {(1,), (len(mesh.cells),)}:
        raise VisceraError(f"density has shape {given.shape}; give one number or one per cell ({len(mesh.cells)})")
    for extreme in (given.min(), given.max()):  # NaN is both
        DENSITY(extreme, "density")
    if given.min() < LIGHT:
        _warn_of(float(given.min()))
    return given


@cache  # a frame that is given its density asks every time
def _warn_of(density: float) -> None:
    log.warning(
        "a density of %g kg/m^3 is %g g/cm^3, lighter than any tissue; soft tissue has about 1000 kg/m^3",
        density,
        density / 1e3,
    )


def name_of(where: Where) -> str:
    """The name of a place in errors."""
    if isinstance(where, str):
        return repr(where)
    if isinstance(where, _core.Patch):
        return "a contact patch"
    if (words := words_of(where)) is not None:
        return " and ".join(map(repr, words))
    return "a predicate" if callable(where) else f"a set of {np.size(where)} nodes"


def are_pairs(given: Any) -> bool:
    """Whether places and their loads are given as `[(where, value)]`."""
    return isinstance(given, list | tuple) and all(isinstance(pair, list | tuple) and len(pair) == 2 for pair in given)


def _components(target: Any, mesh: Mesh, count: int, name: str) -> list[Floats | None]:
    """The three components of a displacement: None if free, else one value for the set or one per node."""
    if isinstance(target, np.ndarray) and target.ndim == 2:
        rows = numbers_of(target)
        if rows is None or rows.shape != (count, 3) or not (np.abs(rows) <= LARGEST["m"]).all():
            raise VisceraError(f"displacements of {name}: expected finite values of shape ({count}, 3) [m]")
        return list(rows.T)
    if not isinstance(target, np.ndarray | list | tuple) or len(target) != 3:
        raise refused(f"displacement of {name}", 'three lengths [m], None or "free" for a free one', target)
    if all(map(is_free, target)):
        raise VisceraError(f"the displacement of {name} leaves all components free; remove it")
    held = [0.0 if is_free(component) else component for component in target]
    filled = offset(held, mesh, f"displacement of {name}")
    return [None if is_free(component) else filled[axis] for axis, component in enumerate(target)]


def is_free(component: object) -> bool:
    """Whether a component of a displacement is left free: None, or the word for it."""
    return component is None or (isinstance(component, str) and component == FREE)


def shares_of(mesh: Mesh, where: Where) -> tuple[Indices, Floats]:
    """The nodes of a place and the share of each in a total force; the weights of a patch."""
    if isinstance(where, _core.Patch):
        return where.nodes, where.weights
    nodes = mesh.nodes(where)
    return nodes, shares(mesh, nodes)


def _loaded(mesh: Mesh, fixed: Indices, where: Any, load: str) -> Indices:
    """The faces of a place under a load of the surface, some of their nodes free."""
    if isinstance(where, _core.Patch):
        raise VisceraError(f"a {load} acts on the surface of a set; a contact patch takes a force")
    faces = faces_within(mesh, mesh.nodes(where))
    if len(faces) == 0:
        raise VisceraError(
            f"{name_of(where)} holds no whole triangle of the surface, so a {load} has nothing to act on; "
            "take a set with the nodes of a piece of surface"
        )
    if np.isin(faces, fixed).all():
        raise VisceraError(f"all nodes of {name_of(where)} are fixed: a {load} there would move nothing")
    return faces


def faces_within(mesh: Mesh, nodes: Indices) -> Indices:
    """The surface triangles (t, 3) all of whose corners are among the nodes; in a quadratic mesh the faces (t, 6),
    corners first, then the midpoints of the edges that follow them."""
    inside = np.isin(mesh.surface, nodes).all(axis=1)
    if not len(mesh.edges):
        return np.asarray(mesh.surface[inside])
    quarters = mesh.surface.reshape(-1, 4, 3)[inside.reshape(-1, 4).all(axis=1)]
    return np.asarray(quarters[:, [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]])


def _lumped_areas(mesh: Mesh, faces: Indices) -> Floats:
    """Area at rest (n,) [m^2] that each node bears of a uniform traction: a third of a triangle at each corner, of a
    quadratic face at each midpoint, whose corners bear nothing."""
    a, b, c = (mesh.points[faces[:, corner]] for corner in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
    lumped = np.zeros(len(mesh.points))
    np.add.at(lumped, faces[:, -3:], areas[:, None] / 3.0)
    return lumped
