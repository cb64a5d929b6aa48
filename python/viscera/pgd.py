"""Paper A's model of an organ: a load anywhere on its surface, as a separated series in the load factor.

u(x, s, a) = sum_{p=1}^{N} a^p u_p(x, s),  u_p(x, s) = sum_i F_i^p(x) G_i^p(s)

x: nodes; s: where the load acts; a = 1: the whole load. All orders and positions share the tangent of the rest state.
Niroomandi, Alfaro, González, Cueto and Chinesta, IJNME 96 (2013) 129; crates/pgd.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera import _core
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh
from viscera.progress import Progress
from viscera.quantity import Number, Whole, refused
from viscera.sealed import Sealed
from viscera.select import point as point_of

if TYPE_CHECKING:
    from viscera.law import Law
    from viscera.organ import Organ

FACTOR = Number()
"""Of the load: any finite number."""
PROJECTION = Number(low=0, below=1)
"""Relative error of an order."""
PAIRS = Whole(1, 1_000_000)
"""As many of an order as there are, if more are asked for."""
BOTH = "the order to which both models are summed"

Place = int | np.integer[Any] | ArrayLike
"""Where the load acts: a node among the positions, or a point (3,) [m] of the surface that the positions span."""


@dataclass(frozen=True, eq=False)
class Order(Sealed):
    """One term u_p(x, s) = sum_i F_i(x) G_i(s) of the series."""

    F: Floats
    """Modes in space (k, n, 3), of unit norm; none where nothing is left of the order, as beyond the first of a linear
    law."""
    G: Floats
    """Modes over the load position (k, m) [m]."""
    sizes: Floats = field(default_factory=lambda: np.empty(0))
    """Energy norm [J^1/2] of each pair, from the enrichment; empty without one."""
    iterations: NDArray[np.uint32] = field(default_factory=lambda: np.empty(0, dtype=np.uint32))
    """Fixed-point iterations of each pair; empty without an enrichment."""
    is_cut: bool = False
    """Whether the enrichment ended at the largest number of pairs, before its tolerance was reached."""
    seconds_rhs: float = 0.0
    """Off-line time for the right-hand sides of all positions [s]."""
    seconds_solve: float = 0.0
    """Off-line time for solving and separating [s]."""

    def at(self, position: int) -> Floats:
        """u_p (n, 3) [m] of one position, by its index."""
        return np.asarray(np.tensordot(self.G[:, position], self.F, axes=1))

    def table(self) -> Floats:
        """u_p (m, 3 n) [m] of all positions."""
        return np.asarray(self.G.T @ self._rows)

    @property
    def _rows(self) -> Floats:
        """F (k, 3 n)."""
        k, n, components = self.F.shape
        return self.F.reshape(k, n * components)


@dataclass(frozen=True, eq=False)
class Pgd(Sealed):
    """The separated series of a load at any position of a surface. Made by `Organ.pgd`."""

    mesh: Mesh
    law: Law
    """The law of the organ."""
    load: float
    """The load [N] at a = 1; positive along the inward normal."""
    radius: float
    """Radius [m] of the patch that the load is spread over; 0 for loads on single nodes."""
    positions: Indices
    """The nodes (m,) where the load may act, ascending."""
    weights: Floats
    """Share of each position in the integral over the surface (m,), of mean 1."""
    units: tuple[tuple[Indices, Floats], ...]
    """Degrees of freedom 3 * node + component and forces [N] of the unit load at each position."""
    orders: tuple[Order, ...]
    seconds: float
    """Off-line wall time."""

    def __getstate__(self) -> dict[str, Any]:
        """For copies and pickles: without what was found on the way, such as a surface of the core, which cannot be."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def counts(self) -> list[int]:
        """Number of pairs of each order."""
        return [len(order.F) for order in self.orders]

    def displacement(self, s: Place, a: float = 1.0, *, order: int | None = None, pade: bool = False) -> Floats:
        """Displacement (n, 3) [m] under a times the load at s, summed to an order, or in the vector Padé form (`pade`).

        Between positions the modes G are interpolated linearly over the surface triangle.
        """
        order, a = self._order(order), FACTOR(a, "the load factor a")
        if pade:
            series = self.series(s, order).reshape(order + 1, -1)
            return _core.vector_pade(series, float(a)).reshape(self.mesh.points.shape)
        where, shares = self._locate(s)
        begin, end = self._starts[0], self._starts[order]
        amplitudes = (self._G[begin:end, where] @ shares) * float(a) ** self._powers[begin:end]
        return np.asarray(amplitudes @ self._F[begin:end]).reshape(self.mesh.points.shape)

    def series(self, s: Place, order: int | None = None) -> Floats:
        """u_p (order + 1, n, 3) [m] at a position, u_0 = 0 first."""
        where, shares = self._locate(s)
        terms = [np.tensordot(each.G[:, where] @ shares, each.F, axes=1) for each in self.orders[: self._order(order)]]
        return np.stack([np.zeros_like(self.mesh.points), *terms])

    def force(self, s: Place, a: float = 1.0) -> Floats:
        """The nodal forces (n, 3) [N] of a times the load at s: what `Organ.solve` takes to compare."""
        nodal, a = np.zeros(3 * len(self.mesh.points)), FACTOR(a, "the load factor a")
        for index, share in zip(*self._locate(s), strict=True):
            dofs, unit = self.units[index]
            nodal[dofs] += a * self.load * share * unit
        return nodal.reshape(-1, 3)

    def project(self, tolerance: float) -> Pgd:
        """Projected PGD: each order in as few orthogonal pairs as a relative error allows (QR, then SVD of the core).

        The error is in the norm (sum_s w_s |u_p(., s)|^2)^1/2 of the order; the time is added to `seconds`.
        """
        tolerance = PROJECTION(tolerance, "tolerance")
        began = perf_counter()
        orders = []
        for order in self.orders:
            F, G = _core.compress(order._rows, order.G, self.weights, tolerance)
            orders.append(Order(F, G))
        return replace(self, orders=tuple(orders), seconds=self.seconds + perf_counter() - began)

    def truncated(self, terms: int) -> Pgd:
        """The same with the first pairs of each order only."""
        terms = PAIRS(terms, "the pairs of each order that stay")
        orders = tuple(replace(order, F=order.F[:terms], G=order.G[:terms]) for order in self.orders)
        return replace(self, orders=orders)

    def errors(self, truth: Pgd, a: float = 1.0, order: int | None = None) -> Floats:
        """|u - u_truth| / |u_truth| (m,) of each position, both summed to the same order at load factor a.

        Raises `VisceraError` unless both are models of one load on one organ: of the same mesh, positions and law.
        """
        self._require_same_load(truth)
        order, a = truth._order(self._order(order), BOTH), FACTOR(a, "the load factor a")
        exact, ours = truth._table(a, order), self._table(a, order)
        return np.asarray(np.linalg.norm(ours - exact, axis=1) / np.linalg.norm(exact, axis=1))

    def _require_same_load(self, truth: Pgd) -> None:
        if not isinstance(truth, Pgd):
            raise refused("the model to compare with", "a Pgd, as Organ.pgd returns it", truth)
        pairs = (self.positions, truth.positions), (self.mesh.points, truth.mesh.points)
        if not all(np.array_equal(*pair) for pair in pairs):
            raise VisceraError("the two models are of different meshes or positions")
        for name, mine, other in (("loads", self.load, truth.load), ("radii", self.radius, truth.radius)):
            if mine != other:
                unit = "N" if name == "loads" else "m"
                raise VisceraError(
                    f"the two models are of different {name}, {mine:g} and {other:g} {unit}; make both with one"
                )
        laws = self.law, truth.law
        if laws[0].name != laws[1].name or not np.array_equal(laws[0].parameters, laws[1].parameters):
            raise VisceraError(f"the two models are of different laws, {laws[0]} and {laws[1]}; make both of one organ")

    def write(self, folder: str | Path) -> list[Path]:
        """Write all modes for ParaView: `modes.pvd` and one VTU file per pair, i as its time.

        The folder is made if it is missing, the one that it lies in is not.
        Point data: `F_p` (n, 3) and `G_p` (n,) [m] of each order p that has a pair i; G is 0 off the positions.
        """
        from viscera.output.paraview import Frame, in_folder, write_series

        listing, frames = in_folder(folder, "modes.pvd"), list[Frame]()
        for i in range(max(self.counts)):
            data: dict[str, Floats] = {}
            for p, order in enumerate(self.orders, start=1):
                has_pair = i < len(order.F)
                data[f"F_{p}"] = order.F[i] if has_pair else np.zeros_like(self.mesh.points)
                data[f"G_{p}"] = self.over_nodes(order.G[i]) if has_pair else np.zeros(len(self.mesh.points))
            frames.append((float(i + 1), self.mesh, data, {}))
        return write_series(listing, frames)

    def write_path(self, folder: str | Path, path: Sequence[Place], a: float = 1.0) -> list[Path]:
        """Write the organ under a load that moves along a path of points: `path.pvd` and one VTU file per point.

        folder: as in `write`.
        """
        from viscera.output.paraview import in_folder, write_series

        moved = [{"displacement": self.displacement(s, a)} for s in path]
        frames = [(float(k), self.mesh, points, dict[str, Floats]()) for k, points in enumerate(moved)]
        return write_series(in_folder(folder, "path.pvd"), frames)

    def over_nodes(self, G: Floats) -> Floats:
        """A function of the position (m,) at all nodes (n,); it is 0 at nodes where no load may act."""
        values = np.zeros(len(self.mesh.points))
        values[self.positions] = G
        return values

    def _order(self, order: int | None, what: str = "order") -> int:
        return len(self.orders) if order is None else Whole(1, len(self.orders))(order, what)

    def _table(self, a: float, order: int) -> Floats:
        tables = (a**p * each.table() for p, each in enumerate(self.orders[:order], start=1))
        return np.asarray(sum(tables))

    def _locate(self, s: Place) -> tuple[NDArray[np.intp], Floats]:
        """Indices of positions and their shares."""
        if isinstance(s, int | np.integer):
            found = np.flatnonzero(self.positions == s)
            if len(found) == 0:
                raise VisceraError(f"node {s} is no load position; the positions are nodes of the touchable surface")
            return found, np.ones(1)
        point = point_of(s, self.mesh, "load position")
        triangle, shares, distance = self._surface.closest(point)
        if distance > self._reach:
            raise VisceraError(
                f"the point {point.tolist()} is {distance:.3g} m from the load positions; give one on their surface"
            )
        return np.searchsorted(self.positions, self._triangles[triangle]), np.array(shares)

    @cached_property
    def _triangles(self) -> Indices:
        inside = self.mesh.surface[np.isin(self.mesh.surface, self.positions).all(axis=1)]
        if len(inside) == 0:
            raise VisceraError("the load positions span no triangle of the surface; give a node among them")
        return np.ascontiguousarray(inside)

    @cached_property
    def _surface(self) -> _core.Surface:
        return _core.Surface(self.mesh.points, self._triangles)

    @cached_property
    def _reach(self) -> float:
        """Mean edge length of the surface of positions [m]."""
        corners = self.mesh.points[self._triangles]
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())

    @cached_property
    def _F(self) -> Floats:
        """All modes of all orders (K, 3 n)."""
        return np.concatenate([order._rows for order in self.orders])

    @cached_property
    def _G(self) -> Floats:
        return np.concatenate([order.G for order in self.orders])

    @cached_property
    def _powers(self) -> Floats:
        """Order of each of the K pairs."""
        return np.repeat(np.arange(1.0, len(self.orders) + 1.0), self.counts)

    @cached_property
    def _starts(self) -> list[int]:
        return [0, *np.cumsum(self.counts).tolist()]

    def __repr__(self) -> str:
        pairs = ", ".join(map(str, self.counts))
        return f"Pgd({len(self.positions)} positions, {self.load:g} N, pairs per order: {pairs})"


def separate(
    organ: Organ,
    positions: Indices,
    *,
    load: float,
    radius: float,
    order: int,
    enrichment: dict[str, float] | None,
    progress: Progress | None,
) -> Pgd:
    """Run the off-line stage; see `Organ.pgd`."""
    began = perf_counter()

    def tell(p: int, pairs: int) -> None:
        if progress:
            progress(p - 1, order, f"order {p}, {pairs} pairs" if pairs else f"order {p}")

    result = _core.pgd(
        organ._body,
        positions=positions,
        radius=radius,
        load=load,
        order=order,
        enrichment=enrichment,
        on_progress=tell,
    )
    return Pgd(
        mesh=organ.mesh,
        law=organ.law,
        load=load,
        radius=radius,
        positions=result["positions"],
        weights=result["weights"],
        units=tuple(result["units"]),
        orders=tuple(Order(**each) for each in result["orders"]),
        seconds=perf_counter() - began,
    )


class Model(Protocol):
    """What an error analysis can compare: anything that gives the displacement under a load."""

    def displacement(self, s: Place, a: float = 1.0) -> Floats:
        """Displacement (n, 3) [m] under a times the load at s."""


@dataclass(frozen=True)
class Newton:
    """The full-order model with the interface of a reduced one: each displacement is a solve. Raises `NotConverged`."""

    organ: Organ
    model: Pgd

    def displacement(self, s: Place, a: float = 1.0) -> Floats:
        """Displacement (n, 3) [m] under a times the load at s."""
        return self.organ.solve(force=self.model.force(s, a), throw=True).displacement


def error_analysis(
    model: Pgd,
    truth: Model,
    *,
    terms: Sequence[int] = (1, 2, 5, 10, 20, 50, 100),
    orders: Sequence[int] | None = None,
    loads: Sequence[float] = (1.0,),
    positions: Sequence[Place] | None = None,
) -> dict[str, NDArray[Any]]:
    """Errors over number of pairs, order and load: a table as columns of equal length.

    model: its first `terms` pairs of each order are kept, summed up to each of `orders` (all by default).
    truth: another `Pgd` (such as the direct one), or `Newton` for the full model.
    positions: where to compare, all load positions by default.
    Columns: terms, order, load, and `mean_error` and `worst_error` of |u - u_truth| / |u_truth| over the positions.
    Raises `VisceraError` for terms or orders that are not whole numbers in the range that they may have.
    """
    places: Sequence[Place] = list(model.positions) if positions is None else positions
    last = len(model.orders)
    wanted = range(1, last + 1) if orders is None else _wholes(orders, "orders", Whole(1, last))
    counts = sorted({min(count, max(model.counts)) for count in _wholes(terms, "terms", PAIRS)})
    smaller = {count: model.truncated(count) for count in counts}
    rows = []
    for a in loads:
        exact = [truth.displacement(s, a) for s in places]
        for p in wanted:
            for count, small in smaller.items():
                errors = [_relative(small.displacement(s, a, order=p), u) for s, u in zip(places, exact, strict=True)]
                rows.append((count, p, a, float(np.mean(errors)), float(np.max(errors))))
    names = ("terms", "order", "load", "mean_error", "worst_error")
    return {name: np.array(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}


def _wholes(given: Any, what: str, each: Whole) -> list[int]:
    """Several whole numbers, each in a range."""
    if isinstance(given, str | bytes) or not isinstance(given, Iterable):
        raise refused(what, "several whole numbers, such as (1, 10, 100)", given)
    return [each(number, f"each of {what}") for number in given]


def _relative(value: Floats, truth: Floats) -> float:
    return float(np.linalg.norm(value - truth) / np.linalg.norm(truth))
