"""An organ: a mesh, a law and supports. `solve` and `path` find its equilibria, `reduce` makes its reduced model."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core, defaults, gpu, navigation
from viscera.checkpoint import Batches, Checkpoint, fingerprint
from viscera.contact import AnyShape, Tool, tools_of
from viscera.deformed import Moved
from viscera.display import Pictured
from viscera.dynamics import Integration, Prony
from viscera.errors import NotConverged, VisceraError
from viscera.frame import Frame
from viscera.law import Law, Several, StrainEnergy
from viscera.loads import (
    Density,
    Displacements,
    Forces,
    Pressures,
    Tractions,
    are_pairs,
    by_place,
    density_per_cell,
    nodal_forces,
    prescribed,
    pressed_faces,
    traction_forces,
)
from viscera.mesh import Floats, Indices, Mesh, Where
from viscera.navigation import Unloaded
from viscera.parts import notes
from viscera.path import Expansion, Path
from viscera.pgd import Pgd, separate
from viscera.preload import preload_of
from viscera.progress import shown
from viscera.quantity import Choice, Flag, Number, Whole, numbers_of, refused, vector
from viscera.select import Lengths, length
from viscera.select import point as point_of
from viscera.solver import Solver, core_solver, newton_settings
from viscera.state import State
from viscera.stepper import Stepper, settings_of
from viscera.support import fixed_nodes, require_held, supports_of
from viscera.ties import Tied, joined
from viscera.touch import Touch
from viscera.vary import Vary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from viscera.case import Case
    from viscera.registration import Registered

ELEMENTS = tuple(name for name, _ in _core.elements())
ROUNDING = 1e-9
"""Rounding allowed in Poisson's ratio, which a law computes from other parameters: 0.45 must count as 0.45."""
STEPS = Whole(1, 10_000)
ORDER = Whole(2, 8)
TOLERANCE = Number(above=0, below=1)

NOTHING_ACTS = "nothing acts on the organ: no load, no prescribed displacement other than zero"

Progress = Callable[[int, int, str], None]
"""Called with the steps done, the total of steps, and the name of the stage. An exception that it raises stops all."""


class Organ(Pictured):
    """A soft body at rest: a tetrahedral mesh, its law and its fixed nodes.

    mesh: `viscera.Mesh`; law: one of `viscera.laws`, or several by place, `{"liver": ..., "vein": ...}`, as in
        `viscera.laws.Several`.
    fixed: a node set's name, a condition such as "x < 10%", indices or a predicate on points (n, 3): see `Mesh.nodes`.
    element: "P1" (linear cells), "P1 mean volume" (linear cells in clusters that share one change of volume) or "P2"
        (quadratic cells). By default it is "P1 mean volume" above a Poisson's ratio of 0.45 at rest, where "P1" locks,
        and "P1" below (docs/elements.md). With "P2" the organ's own `mesh` also has the midpoints of edges as points.
    supports: `[ElasticSupport(where, stiffness), Spring(where, ...)]`. An organ that they hold needs no fixed nodes.
    Raises `VisceraError` if nothing holds the organ, or a disconnected part of its mesh.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
    >>> state.is_converged, state.reaction("clamp").round(3).tolist()[2]
    (True, 10.0)
    """

    def __init__(
        self,
        mesh: Mesh,
        law: Law | Mapping[Any, Law],
        fixed: Where | None = None,
        *,
        element: str | None = None,
        supports: Sequence[Tied] = (),
    ) -> None:
        if not isinstance(mesh, Mesh):
            raise refused("the mesh", "a viscera.Mesh, as read(path) or mesh(points, cells) gives it", mesh)
        if isinstance(law, Mapping):
            law = Several(mesh, law)
        if not isinstance(law, Law):
            raise refused("the law", "one of viscera.laws, such as NeoHookean, or a table of them by place", law)
        rows = len(law.parameters)
        if rows not in {1, len(mesh.cells)}:
            raise VisceraError(f"the law has parameters for {rows} cells, the mesh has {len(mesh.cells)} cells")
        self.element = _element(element, law)
        """Name of the element."""
        self.mesh = mesh.quadratic() if self.element == "P2" else mesh.linear()
        """The mesh with the nodes of the element."""
        self.law = law
        self.supports = supports_of(supports)
        """Elastic supports."""
        self._bodies: list[Tool] = []
        self._tied = [support.ties(self.mesh) for support in self.supports]
        self._ties = joined(self._tied)
        self._contact_pairs = [each for each, ties in zip(self.supports, self._tied, strict=True) if ties.surfaces]
        self.fixed = fixed_nodes(self.mesh, fixed, self._ties)
        """Indices (k,) of the fixed nodes."""
        corners = self.mesh.points[: self.mesh.n_corners]
        self._body = _core.Body(corners, mesh.cells, law.core(), self.fixed, self.element, self._ties.core)

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle and copy: the compiled body is made again."""
        return _again, (self.mesh, self.law, self.fixed, self.element, self.supports)

    def __repr__(self) -> str:
        size = f"{len(self.mesh.points)} points, {len(self.mesh.cells)} cells"
        held = [f"{len(self.fixed)} fixed nodes"] if len(self.fixed) or not self.supports else []
        held += [f"{len(self.supports)} elastic supports"] if self.supports else []
        return f"Organ({size}, {type(self.law).__name__}, {self.element}, {', '.join(held)})"

    def with_law(self, law: Law | Mapping[Any, Law]) -> Organ:
        """The same mesh, supports and element with another law.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> beam.with_law(vs.Corotated(young=1e5, poisson=0.3)).law
        Corotated(mu=38461.5, lam=57692.3)
        """
        return Organ(self.mesh, law, fixed=self.fixed, element=self.element, supports=self.supports)

    def with_mesh(self, mesh: Mesh) -> Organ:
        """The same law, fixed nodes and element on another mesh with the same numbers of nodes and cells.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> longer = vs.mesh(2 * beam.mesh.points, beam.mesh.cells, beam.mesh.sets)
        >>> beam.with_mesh(longer).mesh.diagonal / beam.mesh.diagonal
        2.0
        """
        supports = [support.on(self.mesh) for support in self.supports]
        return Organ(mesh, self.law, fixed=self.fixed, element=self.element, supports=supports)

    @shown
    def solve(
        self,
        *,
        displacement: Displacements | None = None,
        force: Forces | None = None,
        traction: Tractions | None = None,
        pressure: Pressures | None = None,
        gravity: ArrayLike | None = None,
        density: Density | None = None,
        contact: Sequence[Tool | AnyShape] | None = None,
        steps: int = 1,
        start: State | Frame | Floats | None = None,
        settings: Mapping[str, float] | None = None,
        solver: Solver = "cholesky",
        throw: bool = False,
        progress: Progress | None = None,
    ) -> State:
        """Static equilibrium, f_int(u) = f_ext, under prescribed displacements, forces, surface loads and gravity.

        displacement: `{where: (x, y, z)}` [m] or in words such as "-10 mm"; None or "free" leaves a component free. An
            array (k, 3) moves each node of a set on its own. For a contact patch (`Organ.patch`) the weighted mean is
            prescribed.
        force: `{where: (x, y, z)}`, the total [N]. It is spread as a uniform traction over the surface of the set, or
            in equal shares over its nodes if it has no surface. An array (n, 3) gives nodal forces.
        traction: `{where: (x, y, z)}` [Pa], a dead load per area at rest on the surface triangles within the set.
        pressure: `{where: p}` [Pa] on the same triangles. It pushes against their outward normal as they deform, so a
            positive pressure on a `lumen` inflates a vessel.
        gravity: acceleration (3,) [m/s^2]; it needs `density` [kg/m^3], one number, one per cell, or by place:
            `{"liver": 1060, "gallbladder": 1010}`.
        contact: rigid tools, `[Tool(Sphere(0.01), position=..., displacement=...)]`, which move by their `displacement`
            in proportion to the load. They must start outside the organ. `State.contact(tool)` gives their forces.
            Friction is integrated from load step to load step; if a tool reverses its direction, solve each direction
            separately.
        steps: initial number of load steps; more are taken where needed.
        start: a state or a frame to continue from, or its displacement (n, 3) [m]; by default rest.
        settings: of Newton's method, by name: "tolerance", "max_iterations", "max_backtracks", "smallest_step", as in
            `[settings.newton]` of a case file (docs/case-file.md).
        solver: of the linear systems, "cholesky", "cg", "multigrid", "gpu" or a `ConjugateGradients`; or "auto", which
            chooses the one that is likely to be the fastest (docs/solvers.md). `State.solver` says which it was.
        throw: raise `NotConverged` if the solve fails, instead of returning the state with its status.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(displacement={"tip": (None, None, -0.05)}, gravity=(0, 0, -9.81), density=100)
        >>> state.status, state.reaction("tip")[2].round(3).item()
        ('converged', 12.333)
        """
        if gravity is not None and density is None:
            raise VisceraError("gravity needs a density [kg/m^3]")
        steps, begin = STEPS(steps, "steps"), displacement_of(start, self.mesh)
        moved = prescribed(self.mesh, self.fixed, displacement or {})
        require_held(self.mesh, self.fixed, moved.dofs, [patch for patch, _ in moved.patches], self._ties)
        applied = nodal_forces(self.mesh, self.fixed, {} if force is None else force)
        applied += traction_forces(self.mesh, self.fixed, traction or {})
        pressed, pressures = pressed_faces(self.mesh, self.fixed, pressure or {})
        weight = np.zeros_like(applied)
        if gravity is not None and density is not None:
            acceleration = vector(gravity, "gravity", "m/s^2")
            weight = self._body.gravity(acceleration, density_per_cell(self.mesh, density))
        means = [mean for _, mean in moved.patches]
        tools = [*tools_of(contact), *self._bodies]
        began = perf_counter()
        result = self._body.solve(
            prescribed=moved.dofs,
            values=moved.values,
            force=applied,
            body_force=weight,
            pressed=pressed,
            pressure=pressures,
            patches=moved.patches,
            tools=[tool._spec() for tool in tools],
            start=begin,
            steps=steps,
            settings=newton_settings(settings),
            solver=core_solver(solver),
            on_progress=lambda load: progress(round(100 * load), 100, "load") if progress else None,
        )
        gpu.report(result["device_fault"])
        seconds, patches = perf_counter() - began, [patch for patch, _ in moved.patches]
        state = State(self, result, patches, seconds, has_pressure=bool(pressure), tools=tools)
        acting = (moved.values, means, applied, weight, pressures)
        if state.is_converged and not tools and not any(np.any(each) for each in acting):
            state.message = NOTHING_ACTS
        if throw and not state.is_converged:
            raise NotConverged(state)
        return state

    def stepper(
        self,
        grasped: Displacements | None = None,
        *,
        start: State | Frame | Floats | None = None,
        solver: Solver = "cholesky",
        iterations: int = 1,
        settled: float = 1e-3,
        budget: float | None = None,
        density: Density | None = None,
        time_step: float | None = None,
        dynamics: Integration | None = None,
        mass: str = "lumped",
        damping: tuple[float, float] = (0.0, 0.0),
        relaxation: Prony | None = None,
    ) -> Stepper:
        """The organ in real time: each frame continues from the last by Newton's method, quasi-static or with inertia.

        grasped: `{where: (x, y, z)}` as in `solve`: what the hands hold at first. Every frame may change it.
        start: a state or a frame to start from, or its displacement (n, 3) [m]; by default rest.
        solver: "cholesky", "cg" (conjugate gradients with a lagged factor), "multigrid", "gpu" or a
            `ConjugateGradients`.
        iterations: largest number of Newton iterations in a frame. A frame ends earlier at a residual of `settled`.
        budget: wall time [s] after which conjugate gradients stop and no further iteration begins.
        density [kg/m^3], one number or one per cell: needed for gravity and inertia.
        time_step [s] between frames: needed for inertia and relaxation.
        dynamics: "newmark", "backward_euler", a `Newmark` or a `BackwardEuler`; quasi-static if None.
        mass: "lumped" or "consistent"; damping: Rayleigh's alpha [1/s] and beta [s], C = alpha M + beta K.
        relaxation: `Prony` viscoelasticity.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> stepper.frame({"tip": (None, None, -0.01)}).is_settled
        True
        """
        settings = settings_of(
            self.mesh,
            solver=solver,
            iterations=iterations,
            settled=settled,
            budget=budget,
            density=density,
            time_step=time_step,
            dynamics=dynamics,
            mass=mass,
            damping=damping,
            relaxation=relaxation,
        )
        return Stepper(self, grasped or {}, displacement_of(start, self.mesh), settings)

    @shown
    def path(
        self,
        *,
        force: Forces | None = None,
        traction: Tractions | None = None,
        pressure: Pressures | None = None,
        order: int = 15,
        parameter: str = "load",
        until: float = 1.0,
        tolerance: float = 1e-6,
        max_expansions: int = 50,
    ) -> Path:
        """The equilibrium path under `until` times a load, by the asymptotic numerical method.

        Each expansion is u(a) = sum_p a^p u_p, where all orders share one tangent. The next one begins at the end of
        its range. The parameter a is the "load", or the "arc length", which passes limit points.
        force, traction, pressure: as in `solve`, at load 1. A pressure follows the surface.
        Cochelin, Damil and Potier-Ferry (1994); Niroomandi et al., IJNME 96 (2013) 129.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> path = beam.path(force={"tip": (0, 0, -10.0)}, order=8)
        >>> load, displacement = path.curve(samples=5)
        >>> load[-1].round(6).item(), displacement[-1, :, 2].min().round(4).item()
        (1.0, -0.1993)
        """
        Choice(("load", "arc length"))(parameter, "the path parameter")
        order = Whole(2, 100)(order, "order")
        until = Number(above=0)(until, "until")
        tolerance = TOLERANCE(tolerance, "tolerance")
        max_expansions = Whole(1, 100_000)(max_expansions, "max_expansions")
        pressed, pressures = pressed_faces(self.mesh, self.fixed, pressure or {})
        applied = nodal_forces(self.mesh, self.fixed, {} if force is None else force)
        applied += traction_forces(self.mesh, self.fixed, traction or {})
        expansions = self._body.path(
            force=applied,
            pressed=pressed,
            pressure=pressures,
            order=order,
            parameter=parameter,
            until=until,
            tolerance=tolerance,
            max_expansions=max_expansions,
        )
        return Path([Expansion(**expansion) for expansion in expansions], self)

    def moved(self, displacement: State | Frame | ArrayLike) -> Moved:
        """The organ under any displacement (n, 3) [m] from rest, such as one of a `path`: stress, files and probes.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> half = beam.moved(0.5 * state.displacement)
        >>> f"{half.von_mises().max():.0f} Pa"
        '2831 Pa'
        """
        given = displacement_of(displacement, self.mesh)
        return Moved(self, np.zeros_like(self.mesh.points) if given is None else given)

    @shown
    def unloaded(
        self,
        *,
        gravity: ArrayLike | None = None,
        density: Density | None = None,
        force: Forces | None = None,
        traction: Tractions | None = None,
        pressure: Pressures | None = None,
        tolerance: float = 1e-10,
        max_iterations: int = 100,
        throw: bool = False,
        progress: Progress | None = None,
    ) -> Unloaded:
        """The organ free of the loads under which it was scanned: its mesh is taken as the loaded equilibrium.

        gravity, density, force, traction, pressure: loads during the scan, as in `solve`. Densities [kg/m^3], areas of
            tractions and fibres are those of the unloaded organ.
        tolerance: largest distance of a node between the scan and the unloaded organ under these loads again, in units
            of the bounding-box diagonal.
        max_iterations: iterations for one load step.
        throw: raise `VisceraError` if no unloaded shape is found, instead of returning the last one found.

        For another posture, call `rest.organ.solve(..., start=rest.state)` on the result `rest`. `rest.from_scan` then
        counts the displacement from the scan.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> rest = beam.unloaded(gravity=(0, 0, -1.0), density=100)
        >>> turned = rest.organ.solve(gravity=(0, 1.0, 0), density=100, start=rest.state)
        >>> f"{1e3 * rest.from_scan(turned).max_displacement:.0f} mm"
        '41 mm'
        """
        placed = {"force": force, "traction": traction, "pressure": pressure}
        placed = {name: by_place(load, name) if are_pairs(load) else load for name, load in placed.items()}
        loads = {"gravity": gravity, "density": density, **placed}
        result = navigation.unloaded(self, loads, tolerance, max_iterations, progress)
        if throw and not result.is_converged:
            raise VisceraError(result.message)
        return result

    @shown
    def register(
        self,
        surface: ArrayLike | None = None,
        *,
        landmarks: Mapping[str, ArrayLike] | None = None,
        points: tuple[ArrayLike, ArrayLike] | None = None,
        weights: ArrayLike | None = None,
        noise: float | str = 2e-3,
        landmark_noise: float | str | None = None,
        visible: Where | None = None,
        loaded: Where | None = None,
        start: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> Registered:
        """The organ fitted to measured points of it: a rigid motion, and a deformation under unknown forces.

        surface: measured points (k, 3) [m] on a part of the organ's surface, which may contain outliers.
        weights: of these points (k,); by default 1.
        landmarks: `{name: (x, y, z)}` [m]: measured position of the mean of a node set of the mesh.
        points: points (l, 3) [m] of the organ at rest, and their measured displacements (l, 3) [m].
        noise: standard deviation [m] of the surface points along each axis, also in words: "2 mm".
        landmark_noise: the same of `landmarks` and `points`; by default that of the surface.
        visible: the part of the surface that the measured points may lie on; by default all of it.
        loaded: the part of the surface on which forces may act; by default all of it.
        start: a matrix (4, 4), the approximate rigid motion from the mesh to the measured points. Without it, and
            without three landmarks, rotations of up to 60 degrees are tried.

        The fixed nodes move as one rigid body; their reactions are free. Elsewhere, smooth forces on the surface and a
        uniform force in the volume deform the organ: docs/navigation.md. Raises `VisceraError` for data that are not
        finite, in another unit or too few, and for landmarks that are no node sets of the mesh.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> bent = beam.solve(force={"tip": (0, 0, -10.0)}).displacement
        >>> found = beam.register(points=(beam.mesh.points[::20], bent[::20]), noise="1 mm")
        >>> found.is_converged, bool(abs(found.displacement - bent).max() < 0.1 * abs(bent).max())
        (True, True)
        """
        from viscera import registration

        if self.supports:
            raise VisceraError(
                "an organ with elastic supports cannot be registered yet: the springs would have to move with it; "
                "register it with fixed nodes"
            )
        deviation = self._length("noise", noise)
        other = deviation if landmark_noise is None else self._length("landmark_noise", landmark_noise)
        seen = registration.observed(self.mesh, surface, weights, landmarks, points, deviation, other)
        triangles = self.mesh.surface
        if visible is not None:
            triangles = triangles[np.isin(triangles, self.mesh.nodes(visible)).all(axis=1)]
            if not len(triangles):
                raise VisceraError("`visible` holds no whole triangle of the surface; choose a larger part")
        motion = None if start is None else registration.rigid_of(start)
        return registration.register(
            self,
            seen,
            triangles,
            self.touchable(self.mesh.surface_nodes if loaded is None else loaded),
            motion,
            progress,
        )

    def patch(self, point: Lengths, radius: float | str) -> _core.Patch:
        """The contact patch around a surface point (3,) [m]: smooth weights of sum 1 within `radius` [m].

        Both may be given in words: `organ.patch("(100, 50, 80) mm", "12 mm")`.
        In `solve` a patch can take the place of a node set: to prescribe its mean displacement, or to spread a force
        over it.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> patch = beam.patch("(100%, 50%, 100%)", "5 cm")
        >>> state = beam.solve(displacement={patch: (0, 0, -0.01)})
        >>> state.reaction(patch)[2].round(3).item()
        -0.789
        """
        return self._body.patch(point_of(point, self.mesh, "contact point"), self._length("radius", radius))

    def touchable(self, where: Where | None = None, radius: float | str | None = None) -> Indices:
        """The free surface nodes of a place; by default all that are farther than `radius` [m] from fixed nodes.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> len(beam.touchable()), len(beam.touchable("top and x > 50%"))
        (297, 50)
        """
        surface = np.setdiff1d(self.mesh.surface_nodes, self.fixed)
        if where is not None:
            nodes = np.intersect1d(surface, self.mesh.nodes(where))
            advice = "the touchable set holds no whole free triangle of the surface; choose a larger one"
        else:
            reach = defaults.RADIUS_FRACTION * self.mesh.diagonal if radius is None else self._length("radius", radius)
            nodes = surface
            if len(self.fixed):
                nodes = surface[_distances(self.mesh.points[surface], self.mesh.points[self.fixed]) > reach]
            advice = f"no surface triangle is farther than {reach:g} m from the fixed nodes; lower the radius"
        if not np.isin(self.mesh.surface, nodes).all(axis=1).any():
            raise VisceraError(advice)
        return nodes

    @shown
    def reduce(
        self,
        touchable: Where | None = None,
        *,
        radius: float | str | None = None,
        depth: float | str | None = None,
        order: int = defaults.ORDER,
        tolerance: float = defaults.TOLERANCE,
        pade: bool = True,
        start: State | None = None,
        vary: Vary | None = None,
        checkpoint: Checkpoint | str | os.PathLike[str] | None = None,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> Touch:
        """The reduced model of all contacts on a surface: u(x; s, d) = sum of d^alpha u_alpha(x; s), |alpha| <= order.

        touchable: a place whose free surface nodes may be touched; by default all surface nodes farther than `radius`
            from fixed nodes.
        radius: of the contact patch [m], or in words such as "12 mm" or "5%" of the bounding-box diagonal; by default
            a tenth of the diagonal.
        depth: largest displacement [m] of a touch, given in the same way; by default a tenth of the diagonal.
        order: total order of the series in the three components of the contact displacement d, 2 to 8.
        tolerance: relative error of the compressed field at full depth, at the worst position, root mean square over
            directions.
        pade: sum the orders in their vector Padé form, which reaches deeper than the polynomial.
        start: a stable equilibrium under dead loads, which remain during the touches; by default rest. Contact points,
            patches and lengths are then those of the loaded shape; displacements and forces are what the touch adds.
        vary: a parameter for which the model covers a range of values; `Touch.at` sets it.
        checkpoint: a file that keeps finished batches of positions until the model is complete. After an interruption,
            the same call continues from there. If the file belongs to another case, the work starts again, with a
            warning.
        executor: a `concurrent.futures.Executor` whose workers solve the batches: processes, Dask or MPI
            (docs/cluster.md). On one kind of processor, the model is the same bit by bit for any number of workers.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> touch((1, 0.1, 0.1), (0, 0, -0.01)).force.round(3).tolist()
        [0.242, -0.034, -0.498]
        """
        radius = self._length("radius", defaults.RADIUS_FRACTION * self.mesh.diagonal if radius is None else radius)
        depth = self._length("depth", defaults.DEPTH_FRACTION * self.mesh.diagonal if depth is None else depth)
        order, tolerance, pade = ORDER(order, "order"), TOLERANCE(tolerance, "tolerance"), Flag()(pade, "pade")
        if vary is not None and not isinstance(vary, Vary):
            raise refused("vary", 'a viscera.Vary, such as Vary("young", 1e3, 1e5)', vary)
        if start is not None and not isinstance(start, State):
            raise refused("the state to reduce about", "a State, as solve returns it", start)
        if not self.law.is_analytic:
            if isinstance(self.law, StrainEnergy):
                raise VisceraError(
                    "max, min and step have no power series at the point where they switch, so a reduced model of this "
                    "formula could be wrong; write it without them, or use solve"
                )
            raise VisceraError(
                "fibres that go slack have no power series about rest, so a reduced model would be wrong wherever they "
                "are compressed; reduce with bear_compression=True, or use solve"
            )
        self._require_linear_ties()
        nodes = self.touchable(touchable, radius)
        require_held(self.mesh, self.fixed, np.empty(0, dtype=np.uint32), [], self._ties)
        organ, family = (self, None) if vary is None else vary.on(self.mesh).family(self, radius)
        preload = None if start is None else preload_of(self, start)
        numbers: dict[str, Any] = {
            "radius": radius,
            "depth": depth,
            "order": order,
            "tolerance": tolerance,
            "pade": pade,
        }
        settings = {"touchable": nodes, **numbers, "preload": preload}
        with (
            nullcontext() if checkpoint is None else organ._batches(checkpoint, nodes, preload, numbers, family) as kept
        ):
            batches: _core.Batches | None = kept
            if executor is not None:
                from viscera.offline import Finished, Offline

                offline = Offline(organ, vary and vary.on(self.mesh), settings)
                batches = Finished(offline.batches(executor, kept, progress))
            model = organ._body.reduce(
                **settings,
                family=family,
                metadata=json.dumps(notes(self.mesh)),
                on_progress=progress or (lambda done, total, stage: None),  # a callback lets Ctrl-C through
                batches=batches,
            )
        return Touch(model)

    def _batches(
        self,
        checkpoint: Checkpoint | str | os.PathLike[str],
        nodes: Indices,
        preload: Floats | None,
        numbers: dict[str, Any],
        family: dict[str, Any] | None,
    ) -> AbstractContextManager[Batches]:
        """The kept batches of this reduction."""
        keeper = checkpoint if isinstance(checkpoint, Checkpoint) else Checkpoint(checkpoint)
        words = {"law": self.law.name, "element": self.element, **numbers}
        if family is not None:
            members = [[value, radius] for value, _, radius in family["members"]]
            words["family"] = [family["name"], family["value"], family["cells"], members]
        rest = np.empty(0) if preload is None else preload
        arrays = [self.mesh.points, self.mesh.cells, self.law.parameters, self.fixed, nodes, rest]
        arrays += self._ties.arrays if self.supports else ()
        return keeper.batches(fingerprint(arrays, words))

    def to_case(
        self,
        path: str | os.PathLike[str],
        *,
        loads: Mapping[str, Any] | None = None,
        scan: Mapping[str, Any] | None = None,
        settings: Mapping[str, Any] | None = None,
        reduction: Mapping[str, Any] | None = None,
    ) -> Case:
        """Write the organ as a case file (docs/case-file.md), its mesh beside it as NAME_mesh.vtu, and read it back.

        loads, scan: as `solve` and `unloaded` take them, such as `{"gravity": (0, 0, -9.81), "density": 1060}`.
        settings: "steps", and "newton" with a table of its settings.
        reduction: as `reduce` takes it, but "start" is "rest", "loads" or "scan".
        `viscera.case(path)` reads the file. Raises `VisceraError` for what a case cannot express: contact patches,
        nodal forces, parameters with a value for each cell, fibres whose direction varies from cell to cell.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = beam.to_case("beam.toml", loads={"gravity": (0, 0, -9.81), "density": 1000.0})
        >>> case.organ().solve(**case.loading()).is_converged
        True
        """
        from viscera import casefile

        return casefile.write(self, path, loads=loads, scan=scan, settings=settings, reduction=reduction)

    def plot(self, path: str | os.PathLike[str] | None = None, *, title: str = "") -> Figure:
        """Draw the organ at rest, with fixed nodes as dots and cell sets as wireframes. `path`: write a PNG file there.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> figure = beam.plot("beam.png")
        """
        from viscera.picture import draw_rest

        mesh = self.mesh
        parts = {name: _core.surface(mesh.points, mesh.cells[cells]) for name, cells in mesh.cell_sets.items()}
        return draw_rest(mesh.points, mesh.surface, fixed=self.fixed, parts=parts, title=title, path=path)

    @shown
    def pgd(
        self,
        touchable: Where | None = None,
        *,
        load: float,
        order: int = 4,
        radius: float | str = 0.0,
        tolerance: float | None = 0.05,
        max_terms: int = 100,
        stagnation: float = 0.05,
        max_iterations: int = 30,
        progress: Progress | None = None,
    ) -> Pgd:
        """Paper A's model: a load normal to the surface at any node of a place, u = sum a^p sum_i F_i^p(x) G_i^p(s).

        load: force [N] at a = 1; positive pushes in.
        radius: 0 puts the load on single nodes, as in the paper. A positive radius [m] spreads it over a contact patch,
            which separates better and does not depend on the mesh.
        order: 1 to 15.
        tolerance: an order is complete when the energy norm of a pair falls below this fraction of the largest norm in
            its order. None solves every position exactly instead, for comparison.
        max_terms: largest number of pairs in an order.
        stagnation, max_iterations: of the alternating directions. A pair is found when the unit vector along its G
            changes by less than `stagnation`.
        Niroomandi et al., IJNME 96 (2013) 129, sections 3 and 4.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> model = beam.pgd("tip", load=1.0, order=3)
        >>> model.displacement((1, 0.1, 0.1), a=0.5).shape
        (525, 3)
        """
        self._require_linear_ties()
        order = Whole(1, 15)(order, "order")
        max_terms = Whole(1, 10_000)(max_terms, "max_terms")
        max_iterations = Whole(1, 10_000)(max_iterations, "max_iterations")
        load, stagnation = Number("N")(load, "load"), TOLERANCE(stagnation, "stagnation")
        radius = length(radius, self.mesh.diagonal, "radius")
        require_held(self.mesh, self.fixed, np.empty(0, dtype=np.uint32), [], self._ties)
        rules = {"max_terms": max_terms, "stagnation": stagnation, "max_iterations": max_iterations}
        return separate(
            self,
            self.touchable(touchable),
            load=load,
            radius=radius,
            order=order,
            enrichment=None if tolerance is None else {"tolerance": TOLERANCE(tolerance, "tolerance"), **rules},
            progress=progress,
        )

    def _require_linear_ties(self) -> None:
        if self._ties.links:
            raise VisceraError("a series does not know springs and cables; leave them out, or solve in load steps")
        if self._ties.surfaces:
            raise VisceraError(
                "a series does not know surfaces that touch; leave the contact pairs out, or solve in load steps"
            )

    def _length(self, name: str, value: float | str) -> float:
        metres = length(value, self.mesh.diagonal, name)
        if not 0.0 < metres <= self.mesh.diagonal:
            raise VisceraError(
                f"{name} is {metres:g} m; it must be positive and at most the organ's diagonal, "
                f"{self.mesh.diagonal:g} m"
            )
        return metres


def _element(name: str | None, law: Law) -> str:
    """The element of this name; without a name, the one that suits the law."""
    if name is None:
        locks = law.poisson.max() > defaults.LOCKING_POISSON * (1.0 + ROUNDING)
        return defaults.LOCKING_FREE_ELEMENT if locks else defaults.ELEMENT
    return Choice(ELEMENTS)(name, "the element")


def _again(mesh: Mesh, law: Law, fixed: Indices, element: str, supports: Sequence[Tied]) -> Organ:
    return Organ(mesh, law, fixed, element=element, supports=supports)


def displacement_of(start: State | Frame | ArrayLike | None, mesh: Mesh) -> Floats | None:
    """The displacement (n, 3) [m] of a state to start from; None for rest."""
    if start is None:
        return None
    given = numbers_of(start.displacement if isinstance(start, State | Frame) else start)
    if given is None or not np.isfinite(given).all():
        raise refused("start", "a State, a Frame or a finite displacement (n, 3) [m]", start)
    if given.shape != mesh.points.shape:
        raise VisceraError(
            f"the state to start from belongs to another mesh: its displacement has shape {given.shape}, "
            f"this mesh needs {mesh.points.shape}"
        )
    return given


def _distances(points: Floats, others: Floats) -> Floats:
    """Distance of each point (k, 3) to the nearest of `others` (l, 3)."""
    return np.array([np.sqrt(((others - point) ** 2).sum(axis=1).min()) for point in points])
