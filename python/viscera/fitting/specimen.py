"""Tests whose specimen is in no homogeneous state, such as a cylinder that sticks to its plates: fitted through its own
finite-element model.

The plates move by `d` along an axis; W(d, p) is the energy of the specimen in equilibrium, with the law's parameters p.
The force of the plate is `R = dW/dd`. Its derivative in a parameter needs no derivative of the equilibrium: the tangent
is symmetric, so `dR/dp = v . df/dp`, where `v = du/dd` is how the specimen follows the plate and `df/dp` is the
derivative of the internal forces at a fixed displacement. They are linear in the coefficients of a law.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.fitting.descent import NO_ERROR, least
from viscera.fitting.materialtest import MaterialTest
from viscera.fitting.optional import scipy
from viscera.fitting.problem import FAILED, N_SEARCHES, Problem
from viscera.law import Law
from viscera.mesh import Floats, Indices, Mesh, Where, mesh
from viscera.organ import Organ
from viscera.quantity import vector
from viscera.state import State

N_SOLVED = 12
"""Positions of the plate at which the specimen is solved; between them the force is a cubic spline."""
TOLERANCE = 1e-10
BESIDE = 1e-4
"""Part of its travel by which the plate is moved for `du/dd`."""
PASSES = 1e-3
"""Part of the length by which a node may be beyond the plane of an end."""
FLAT = 1e-3
"""Part of the squared error that a step from a minimum may still promise."""
SMALLEST = 1e-3
"""Factor of the coefficients of a start, at least."""


class SpecimenTest(MaterialTest):
    """A measured curve of a specimen with its own mesh, held at one place and moved at another.

    specimen: its mesh. fixed, moved: places whose nodes are held, and moved as one along `axis`.
    travel (k,) [m]: displacement of `moved` along the axis. force (k,) [N] along the axis on the specimen there;
        negative in compression.
    element: by default "P1 mean volume", which does not lock.

    `stretch` and `stress` are nominal: one plus the travel over the distance of both places, and the force over the
    area of the moved one at rest. Raises `VisceraError` as `MaterialTest` does, and for places that are no faces.

    >>> import viscera as vs
    >>> test = vs.SpecimenTest.cylinder(0.025, 0.03, [-0.0015, -0.003, -0.0045], [-5.1, -11.0, -18.0], name="disc")
    >>> test
    SpecimenTest('disc': uniaxial, 3 points, stretch 0.85 to 0.95)
    """

    def __init__(
        self,
        specimen: Mesh,
        travel: ArrayLike,
        force: ArrayLike,
        *,
        fixed: Where,
        moved: Where,
        axis: ArrayLike = (0.0, 0.0, 1.0),
        element: str = "P1 mean volume",
        name: str = "specimen",
    ) -> None:
        along = vector(axis, "the axis of a specimen", "")
        if not np.linalg.norm(along) > 0.0:
            raise VisceraError(f"{name}: the axis of a specimen is {along.tolist()}; it must not be zero")
        along = along / np.linalg.norm(along)
        ends = [specimen.nodes(place) for place in (fixed, moved)]
        areas = [_area(specimen, nodes) for nodes in ends]
        for what, area in zip(("fixed", "moved"), areas, strict=True):
            if not area > 0.0:
                raise VisceraError(f"{name}: the {what} place of the specimen holds no triangle of its surface")
        length = float((specimen.points[ends[1]].mean(axis=0) - specimen.points[ends[0]].mean(axis=0)) @ along)
        if not length > 0.0:
            raise VisceraError(
                f"{name}: along its axis the moved place is {length:g} m from the fixed one; turn the axis"
            )
        measured = MaterialTest.from_force("uniaxial", travel, force, length=length, area=areas[1], name=name)
        super().__init__("uniaxial", measured.stretch, measured.stress, name)
        facts = {"specimen": specimen, "fixed": ends[0], "moved": ends[1], "axis": along, "element": element}
        for what, value in {**facts, "length": length, "area": areas[1]}.items():
            object.__setattr__(self, what, value)

    specimen: Mesh
    fixed: Indices
    moved: Indices
    axis: Floats
    element: str
    length: float
    """Distance of the places along the axis [m]."""
    area: float
    """Of the moved place [m^2]."""

    @classmethod
    def cylinder(
        cls,
        radius: float,
        height: float,
        travel: ArrayLike,
        force: ArrayLike,
        *,
        bricks: tuple[int, int] = (6, 4),
        name: str = "cylinder",
    ) -> SpecimenTest:
        """A cylinder between plates to which it sticks; `bricks` across and up, of six cells each.

        >>> import viscera as vs
        >>> travel = [-0.002, -0.004, -0.006]
        >>> test = vs.SpecimenTest.cylinder(0.025, 0.03, travel, [-10.5, -23.5, -40.0])
        >>> found = vs.fit(vs.NeoHookean, test)
        >>> slipping = vs.fit(vs.NeoHookean, vs.MaterialTest("uniaxial", test.stretch, test.stress))
        >>> bool(found.parameters["mu"] < 0.75 * slipping.parameters["mu"])  # the plates make it stiffer than its law
        True
        """
        body = cylinder(radius, height, bricks)
        return cls(body, travel, force, fixed="bottom", moved="top", name=name)

    def _responses(self, law: Law) -> Iterator[tuple[float, State, Floats]]:
        """At positions of the plate [m], nearest first: the equilibrium, and `du/dd` (n, 3).

        Raises `VisceraError` at a position without equilibrium.
        """
        organ = self._organ(law)
        for side in (self.positions[self.positions > 0.0], self.positions[self.positions < 0.0][::-1]):
            state: State | None = None
            for travel in side:
                state = self._solved(organ, float(travel), state)
                step = BESIDE * float(np.abs(self.positions).max())
                beside = self._solved(organ, float(travel) + step, state)
                yield float(travel), state, (beside.displacement - state.displacement) / step

    @property
    def positions(self) -> Floats:
        """Where the plate stands when the specimen is solved [m], in even steps from rest."""
        low, high = (float(end) * self.length for end in (self.stretch.min() - 1.0, self.stretch.max() - 1.0))
        ends = [end for end, is_there in ((low, low < 0.0), (high, high > 0.0)) if is_there]
        return np.sort(np.concatenate([end * np.arange(1, N_SOLVED + 1) / N_SOLVED for end in ends]))

    def _organ(self, law: Law) -> Organ:
        return Organ(self.specimen, law, fixed=self.fixed, element=self.element)

    def _body(self, law: Law) -> _core.Body:
        return self._organ(law)._body

    def _solved(self, organ: Organ, travel: float, start: State | None) -> State:
        held = {tuple(self.moved.tolist()): tuple(travel * self.axis)}
        settings = {"tolerance": TOLERANCE}
        state = organ.solve(displacement=held, start=start, settings=settings)
        if not state.is_converged:
            raise VisceraError(
                f"{self.name}: {organ.law!r} has no equilibrium at a stretch of {1.0 + travel / self.length:.3g} "
                f"({state.message}); fit a shorter range, or another law"
            )
        if self._passes_its_ends(state, travel):
            raise VisceraError(
                f"{self.name}: at a stretch of {1.0 + travel / self.length:.3g} its side bulges beyond the plane of an "
                "end, and would touch the plate; fit a shorter range"
            )
        return state

    def _passes_its_ends(self, state: State, travel: float) -> bool:
        """Whether a node is beyond the planes of both ends, if at rest all are between them."""
        along = self.specimen.points @ self.axis
        low, high = (float(along[nodes].mean()) for nodes in (self.fixed, self.moved))
        slack = PASSES * self.length
        if along.min() < low - slack or along.max() > high + slack:
            return False
        now = along + state.displacement[: len(along)] @ self.axis
        return bool(now.min() < low - slack or now.max() > high + travel + slack)

    def _derivatives(self, law: Law, pairs: list[tuple[Law, Law, float]]) -> tuple[Floats, Floats]:
        """Nominal stress (k,) at the measured points, and its derivatives (k, p) [per unit of each parameter].

        pairs: two laws on either side of `law`, and how far the parameter is from one to the other.
        """
        others = [[self._body(side) for side in pair[:2]] for pair in pairs]
        rows = {0.0: np.zeros(1 + len(pairs))}
        body = self._body(law)
        for travel, state, v in self._responses(law):
            force = [float((body.internal_force(state.displacement)[self.moved] @ self.axis).sum())]
            for (plus, minus), (_, _, apart) in zip(others, pairs, strict=True):
                change = plus.internal_force(state.displacement) - minus.internal_force(state.displacement)
                force.append(float((change * v).sum()) / apart)
            rows[travel] = np.array(force) / self.area
        at = sorted(rows)
        spline = scipy("interpolate").CubicSpline(at, np.array([rows[travel] for travel in at]))
        curve = spline((self.stretch - 1.0) * self.length)
        return curve[:, 0], curve[:, 1:]

    def __repr__(self) -> str:
        return f"Specimen{super().__repr__().removeprefix('Material')}"


class SpecimenProblem(Problem):
    """Least squares in which specimens are solved anew for every trial: nonlinear in all parameters."""

    def best(self) -> Floats:
        """The values with the least error, searched from those of homogeneous states with several exponents."""
        scaled = map(self._scaled, self._starts())
        starts = sorted(scaled, key=lambda values: float(np.square(self._residual(values)[0]).sum()))
        runs = [self._search(values) for values in starts[:N_SEARCHES]]
        coefficients, exponents = self.split(min(runs, key=lambda run: run[0])[1])
        values = np.concatenate([coefficients, self.kind.settled(exponents)])
        self.derivatives(values)  # raises where there is no equilibrium
        return values

    def _starts(self) -> Iterator[Floats]:
        """Values fitted to the curves as if all states were homogeneous."""
        plain = tuple(MaterialTest(test.mode, test.stretch, test.stress, test.name) for test in self.tests)
        alike = Problem(self.kind, plain, self.roots, self.poisson, True)
        best = alike.best()
        yield best
        if self.kind.admits is not None:  # it may have no equilibrium beyond its bounds
            yield np.clip(best, *self._bounds)
        if self.kind.exponents:
            for exponents in map(np.array, self.kind.starts):
                yield np.concatenate([alike.coefficients(exponents), exponents])

    def _scaled(self, values: Floats) -> Floats:
        """The multiple of the coefficients with the least error: the stress is in proportion to all of them."""
        n = len(self.kind.coefficients)
        try:
            stress = self.weight * self.derivatives(values)[0]
        except VisceraError:
            return values
        factor = float(stress @ (self.weight * self.target) / (stress @ stress))
        return np.concatenate([max(factor, SMALLEST) * values[:n], values[n:]])

    def _search(self, start: Floats) -> tuple[float, Floats]:
        """The squared error at a minimum, and the values there."""
        values = self._beyond_bounds(start)
        if values is None:
            values = least(self._residual, start, *self._bounds)
        return float(np.square(self._residual(values)[0]).sum()), values

    def _beyond_bounds(self, start: Floats) -> Floats | None:
        """A minimum at which coefficients may be beyond their bounds, if the law takes them.

        None where the search ends beside laws that are refused or have no equilibrium: there it still goes down.
        """
        if self.kind.admits is None:
            return None
        open_end = np.where(np.arange(len(start)) < len(self.kind.coefficients), np.inf, 0.0)
        low, high = self._bounds
        values = least(self._residual, start, low - open_end, high + open_end)
        error, derivatives = self._residual(values)
        rest = error - derivatives @ np.linalg.lstsq(derivatives, error, rcond=None)[0]
        is_least = derivatives.any() and float(error @ error) <= (1.0 + FLAT) * float(rest @ rest) + NO_ERROR
        return values if is_least and self.kind.admits(self.split(values)[0]) else None

    @property
    def _bounds(self) -> tuple[Floats, Floats]:
        """The least and the largest of all values (p,)."""
        low, high = np.array([*self.kind.coefficient_bounds, *self.kind.exponent_bounds]).T
        return low, high

    def _residual(self, values: Floats) -> tuple[Floats, Floats]:
        """Weighted errors [largest stress] and their derivatives, of a trial."""
        try:
            stress, columns = self.derivatives(values)
        except VisceraError:
            return np.full(len(self.target), FAILED), np.zeros((len(self.target), len(values)))
        weight = self.weight / self.scale
        return weight * (stress - self.target), weight[:, None] * columns

    def derivatives(self, values: Floats) -> tuple[Floats, Floats]:
        """Stress and its derivatives: of specimens through their models, of the other tests in closed form."""
        key = values.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, *self._derivatives(values)
        return self._last[1], self._last[2]

    _last: tuple[bytes, Floats, Floats] | None = None

    def _derivatives(self, values: Floats) -> tuple[Floats, Floats]:
        stresses, columns = [], []
        law, pairs = self.law(values), [*self._coefficient_pairs(values), *self.exponent_pairs(values)]
        for test in self.tests:
            if isinstance(test, SpecimenTest):
                stress, derivative = test._derivatives(law, pairs)
            else:
                stress = self.stress_of(law, test)
                sides = [
                    (self.stress_of(plus, test) - self.stress_of(minus, test)) / apart for plus, minus, apart in pairs
                ]
                derivative = np.column_stack(sides)
            stresses.append(stress)
            columns.append(derivative)
        return np.concatenate(stresses), np.concatenate(columns)

    def _coefficient_pairs(self, values: Floats) -> Iterator[tuple[Law, Law, float]]:
        """For each coefficient the law itself and one with more of it: stresses are linear in it."""
        coefficients, exponents = self.split(values)
        more = float(np.abs(coefficients).max())
        law = self.law(values)
        for step in more * np.eye(len(coefficients)):
            yield self.kind.make(coefficients + step, exponents, self.poisson), law, more


def cylinder(radius: float, height: float, bricks: tuple[int, int] = (6, 4)) -> Mesh:
    """A cylinder on z = 0 with the sets `bottom` and `top`: bricks of six cells, their square sections mapped to discs.

    bricks: across a diameter, and up. Raises `VisceraError` for sizes that are not positive.
    """
    for what, value in (("radius", radius), ("height", height)):
        if isinstance(value, bool) or not np.isfinite(value) or not value > 0.0:
            raise VisceraError(f"the {what} of a cylinder is {value}; it must be positive [m]")
    across, up = bricks
    if min(across, up) < 1:
        raise VisceraError(f"a cylinder takes at least one brick across and one up, got {bricks}")
    grid = np.linspace(-1.0, 1.0, across + 1)
    x, y, z = np.meshgrid(grid, grid, np.linspace(0.0, height, up + 1), indexing="ij")
    disc_x, disc_y = x * np.sqrt(1.0 - 0.5 * y**2), y * np.sqrt(1.0 - 0.5 * x**2)
    points = np.column_stack([radius * disc_x.ravel(), radius * disc_y.ravel(), z.ravel()])
    number = np.arange(len(points)).reshape(x.shape)
    corners = [number[i : i + across, j : j + across, k : k + up].ravel() for i, j, k in np.ndindex(2, 2, 2)]
    paths = ((0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7))
    cells = np.concatenate([np.column_stack([corners[b] for b in path]) for path in paths])
    ends = {"bottom": np.flatnonzero(z.ravel() == 0.0), "top": np.flatnonzero(z.ravel() == height)}
    return mesh(points, cells, ends)


def _area(specimen: Mesh, nodes: Indices) -> float:
    """Area [m^2] of the surface triangles whose corners all belong to the nodes."""
    triangles = specimen.surface[np.isin(specimen.surface, nodes).all(axis=1)]
    a, b, c = (specimen.points[triangles[:, k]] for k in range(3))
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
