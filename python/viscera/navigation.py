"""From a scan to another posture: finds the shape of an organ without loads from the shape in which it was scanned.

A patient lies on the table while the mesh is acquired, so the mesh is already deformed by gravity. Here X are the
unknown unloaded positions and x the scanned ones: x = X + u(X), where u is the equilibrium under the loads of the scan.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera import _core
from viscera.boundary.loads import are_pairs, by_place, density_per_cell
from viscera.errors import VisceraError
from viscera.mesh import Floats, Mesh
from viscera.quantity import Number, Whole, refused
from viscera.state import State, refuse_other_points

if TYPE_CHECKING:
    from viscera.organ import Organ
    from viscera.progress import Progress

TIGHT = {"tolerance": 1e-12}  # of the equilibria inside the iteration, in the words of Newton's settings
MEMORY = 5  # earlier iterates that Anderson's acceleration combines
PATIENCE = 15  # iterations in which the error must at least halve
SMALLEST_STEP = 1.0 / 16.0  # of the load, before the search is given up


@dataclass(frozen=True, eq=False)
class Unloaded:
    """An organ without the loads of its scan, or the last iterate of a search that failed.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> rest = beam.unloaded(gravity=(0, 0, -1.0), density=100)
    >>> rest.is_converged, bool(rest.error < 1e-9), f"{1e3 * rest.state.max_displacement:.0f} mm"
    (True, True, '31 mm')
    """

    organ: Organ
    """The organ at its unloaded shape: the same cells, sets, law and fixed nodes."""
    state: State
    """Its equilibrium under the loads of the scan: the scanned shape again."""
    scan: Mesh
    """The mesh as scanned."""
    is_converged: bool
    message: str
    """What went wrong; empty if nothing did."""
    load: float
    """Fraction of the scan's loads for which an unloaded shape was found; 1 if converged."""
    errors: list[float] = field(repr=False)
    """Largest distance of a corner of a cell from its scanned place after each iteration, in units of the diagonal."""
    seconds: float = 0.0
    """Wall time."""

    @property
    def error(self) -> float:
        """Largest distance of a corner of a cell between the scan and the organ loaded again, in diagonals."""
        return float(self._gaps[: self.scan.n_corners].max() / self.scan.diagonal)

    @property
    def midpoint_error(self) -> float:
        """The same of the midpoints of edges, which only "P2" has; 0 without any.

        Without loads the edges are straight, so that the loads bend them: a scan shows corners, and not by how much.

        >>> import viscera as vs
        >>> law = vs.NeoHookean(young=1e5, poisson=0.3)
        >>> beam = vs.Organ(vs.organs.beam(), law, fixed="clamp", element="P2")
        >>> rest = beam.unloaded(gravity=(0, 0, -1.0), density=100)
        >>> bool(rest.error < 1e-9), f"{rest.midpoint_error:.0e}"
        (True, '1e-04')
        """
        return float(self._gaps[self.scan.n_corners :].max(initial=0.0) / self.scan.diagonal)

    @property
    def _gaps(self) -> Floats:
        """Distance (n,) [m] of each node between the scan and the organ loaded again."""
        gap = self.organ.mesh.points + self.state.displacement - self.scan.points
        return np.asarray(np.linalg.norm(gap, axis=1))

    def from_scan(self, state: State) -> State:
        """A state of `organ` with displacement and volume ratio counted from the scanned shape.

        A scan shows corners of cells. Midpoints are counted from where they are under the loads of the scan, which is
        not quite on the straight edge between them. Raises `VisceraError` for a state of an organ of another shape.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> rest = beam.unloaded(gravity=(0, 0, -1.0), density=100)
        >>> bool(rest.from_scan(rest.state).max_displacement < 1e-6)
        True
        """
        if not isinstance(state, State):
            raise refused("the state to count from the scan", "a State of the unloaded organ", state)
        refuse_other_points(
            state.mesh,
            self.organ.mesh,
            "the state to count from the scan is not one of the unloaded organ",
            "solve with `organ` of this result, as in rest.from_scan(rest.organ.solve(...))",
        )
        seen = copy.copy(state)
        seen.mesh = self.scan
        scanned = self.organ.mesh.points + self.state.displacement
        scanned[: self.scan.n_corners] = self.scan.points[: self.scan.n_corners]
        seen.displacement = self.organ.mesh.points + state.displacement - scanned
        seen.volume_ratio = state.volume_ratio * self.organ.mesh.volume / self.scan.volume
        seen._seal()
        return seen


def unloaded(
    organ: Organ,
    loads: Mapping[str, Any],
    tolerance: float,
    max_iterations: int,
    progress: Progress | None = None,
) -> Unloaded:
    """Search for X with X + u(X) = x by the fixed point X <- X + (x - X - u(X)) with Anderson's acceleration.

    Sellier, C. R. Mécanique 339 (2011) 103. The whole load is tried first; if that fails, it is applied in steps.
    """
    _require_loads(organ, loads)
    tolerance = Number(above=0, below=1)(tolerance, "tolerance")
    max_iterations = Whole(1, 100_000)(max_iterations, "max_iterations")
    search = _Search(organ, _of_scan(organ.mesh, loads), tolerance, max_iterations)
    began = perf_counter()
    reached, step, message = 0.0, 1.0, ""
    while reached < 1.0 and step >= SMALLEST_STEP:
        target = min(1.0, reached + step)
        message = search.to(target)
        if message:
            step /= 2.0
        else:
            reached = target
        if progress:
            progress(round(100 * reached), 100, "unloading")
    words = "" if reached >= 1.0 else f"no unloaded shape found beyond {reached:.3g} of the scan's loads: {message}"
    return Unloaded(
        search.organ,
        search.state,
        organ.mesh,
        is_converged=reached >= 1.0,
        message=words,
        load=reached,
        errors=search.errors,
        seconds=perf_counter() - began,
    )


class _Search:
    """The iteration. `organ` and `state` always belong to the last load for which an unloaded shape was found."""

    def __init__(self, organ: Organ, loads: dict[str, Any], tolerance: float, max_iterations: int) -> None:
        self.scanned, self.loads = organ, loads
        self.tolerance, self.max_iterations = tolerance, max_iterations
        self.organ, self.state = organ, organ.solve()
        self.errors: list[float] = []

    def at(self, corners: Floats) -> Organ:
        """The organ with other corners of its cells; without loads its edges are straight."""
        fresh = np.array(corners)
        fresh.flags.writeable = False
        return self.scanned.with_mesh(replace(self.scanned.mesh.linear(), points=fresh, is_unloaded=True))

    def to(self, load: float) -> str:
        """Iterate at a fraction of the loads; returns what went wrong in words, or nothing."""
        loads = _scaled(self.loads, load)
        n, size = self.scanned.mesh.n_corners, self.scanned.mesh.diagonal
        x, X, state = self.scanned.mesh.points[:n], self.organ.mesh.points[:n], self.state
        history: list[tuple[Floats, Floats]] = []
        best = [np.inf]
        for iteration in range(self.max_iterations):
            inverted = _inverted_cell(X, self.scanned.mesh)
            if inverted is not None:
                return f"cell {inverted} would be inverted without the loads"
            try:
                organ = self.at(X)
            except VisceraError as overlap:  # of organs
                return f"without the loads, {str(overlap).partition('. ')[0]}"
            start = state.displacement if np.isfinite(organ._body.energy(state.displacement)) else None
            state = organ.solve(**loads, start=start, settings=TIGHT)
            if not state.is_converged:
                return f"the loads cannot be applied again ({state.message})"
            gap = x - X - state.displacement[:n]
            error = float(np.linalg.norm(gap, axis=1).max() / size)
            self.errors.append(error)
            if error <= self.tolerance:
                state._is_as_scanned = load == 1.0
                self.organ, self.state = organ, state
                return ""
            if error > 2.0 * best[-1]:
                history.clear()
            best.append(min(best[-1], error))
            if iteration >= PATIENCE and best[-1] > 0.5 * best[-1 - PATIENCE]:
                return f"the iteration stalls with a corner {best[-1] * size:.3g} m from its scanned position"
            history = [*history[-MEMORY:], (X, gap)]
            X = _next(history)
        return f"{self.max_iterations} iterations leave a corner {best[-1] * size:.3g} m from its scanned position"


def _next(history: list[tuple[Floats, Floats]]) -> Floats:
    """The next X from earlier ones and their errors x - X - u(X): it would have no error if that were linear in X."""
    X, gap = history[-1]
    if len(history) == 1:
        return X + gap
    steps = np.column_stack([(b[0] - a[0]).ravel() for a, b in pairwise(history)])
    changes = np.column_stack([(b[1] - a[1]).ravel() for a, b in pairwise(history)])
    weights = np.linalg.lstsq(changes, gap.ravel(), rcond=1e-12)[0]
    return X + gap - ((steps + changes) @ weights).reshape(X.shape)


def _inverted_cell(points: Floats, mesh: Mesh) -> int | None:
    volumes = np.asarray(_core.inspect(np.ascontiguousarray(points), mesh.cells)["cell_volumes"])
    return None if (volumes > 0.0).all() else int(np.argmin(volumes))


def _scaled(loads: Mapping[str, Any], share: float) -> dict[str, Any]:
    """A fraction of the loads, densities left as they are."""

    def part(load: Any) -> Any:
        if isinstance(load, Mapping):
            return {where: part(value) for where, value in load.items()}
        if isinstance(load, int | float):
            return share * load
        return None if load is None else share * np.asarray(load, dtype=float)

    return {name: load if name == "density" else part(load) for name, load in loads.items()}


def _of_scan(mesh: Mesh, loads: Mapping[str, Any]) -> dict[str, Any]:
    """The loads by nodes and cells of the scan: in another shape, conditions such as "x > 99%" hold for others."""
    found = dict(loads)
    for name in ("force", "traction", "pressure"):
        given = loads.get(name)
        if isinstance(given, Mapping) or are_pairs(given):
            found[name] = _by_nodes(mesh, by_place(given, name))
    if loads.get("gravity") is not None:
        found["density"] = density_per_cell(mesh, loads["density"])
    return found


def _by_nodes(mesh: Mesh, given: Mapping[Any, Any]) -> dict[Any, Floats]:
    """The same loads by nodes; those of places with the same nodes add up."""
    found: dict[Any, Floats] = {}
    for where, load in given.items():
        key = where if isinstance(where, _core.Patch) else tuple(mesh.nodes(where).tolist())
        found[key] = np.asarray(load, dtype=float) + found.get(key, 0.0)
    return found


def _require_loads(organ: Organ, loads: Mapping[str, Any]) -> None:
    """Raise `VisceraError` for loads that `solve` refuses, before a share of them is taken; and if a scan has no load,
    since its mesh is unloaded already."""
    given = [load for name, load in loads.items() if name != "density" and load is not None]
    if not any(len(load) if isinstance(load, Mapping) else True for load in given):
        raise VisceraError("the scan has no load to remove; give its gravity with the density, or its forces")
    organ._loads(**loads)
