"""An organ: a mesh, a law and supports. `solve` and `path` find its equilibria, `reduce` makes its reduced model."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from viscera import defaults, navigation
from viscera.boundary.holding import AT_REST, BY_NODES
from viscera.boundary.loads import Density, Displacements, Forces, Pressures, Tractions, are_pairs, by_place
from viscera.boundary.ties import Tied
from viscera.deformed import Deformed, Moved
from viscera.errors import VisceraError
from viscera.law import Law
from viscera.mesh import Floats, Indices, Mesh, Where
from viscera.navigation import Unloaded
from viscera.progress import Progress, shown
from viscera.quantity import refused
from viscera.reducible import Reducible
from viscera.solver import Solver
from viscera.state import State
from viscera.statics import Statics, displacement_of
from viscera.stepping.dynamics import Integration, Prony
from viscera.stepping.frame import Frame
from viscera.stepping.stepper import Stepper, settings_of

if TYPE_CHECKING:
    from viscera.cases.case import Case
    from viscera.registration import Registered


class Organ(Statics, Reducible):
    """A soft body at rest: a tetrahedral mesh, its law and its fixed nodes.

    mesh: `viscera.Mesh`; law: one of `viscera.laws`, or several by place, `{"liver": ..., "vein": ...}`, as in
        `viscera.laws.Several`.
    fixed: a node set's name, a condition such as "x < 10%", indices or a predicate on points (n, 3): see `Mesh.nodes`;
        by default no node.
    element: "P1" (linear cells), "P1 mean volume" (linear cells in clusters that share one change of volume) or "P2"
        (quadratic cells). By default it is "P1 mean volume" above a Poisson's ratio of 0.45 at rest, where "P1" locks,
        and "P1" below (docs/elements.md). With "P2" the organ's own `mesh` also has the midpoints of edges as points.
    supports: `[ElasticSupport(where, stiffness), Spring(where, ...)]`.

    Prescribed displacements hold an organ too, and so do the bonds of a `Scene`. Wherever its mesh, or a disconnected
    part of it, could still move rigidly, everything but a stepper with inertia raises `VisceraError`.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
    >>> state.is_converged, state.reaction("clamp").round(3).tolist()[2]
    (True, 10.0)
    """

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle and copy: the compiled body is made again."""
        return _again, (self.mesh, self.law, self.fixed, self._chosen_element, self.supports)

    def with_law(self, law: Law | Mapping[Any, Law]) -> Organ:
        """The same mesh, supports and element with another law.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> beam.with_law(vs.Corotated(young=1e5, poisson=0.3)).law
        Corotated(mu=38461.5, lam=57692.3)
        """
        return Organ(self.mesh, law, fixed=self.fixed, element=self.element, supports=self.supports)

    def _locking_free(self) -> Organ:
        """The same with linear cells that do not lock."""
        return Organ(
            self.mesh, self.law, fixed=self.fixed, element=defaults.LOCKING_FREE_ELEMENT, supports=self.supports
        )

    def with_mesh(self, mesh: Mesh) -> Organ:
        """The same law, fixed nodes and element in another shape: a mesh with the same cells and other points.

        Raises `VisceraError` for a mesh with other numbers of nodes or cells, or whose cells join other nodes.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> longer = vs.mesh(2 * beam.mesh.points, beam.mesh.cells, beam.mesh.sets)
        >>> beam.with_mesh(longer).mesh.diagonal / beam.mesh.diagonal
        2.0
        """
        require_same_cells(self.mesh, mesh)
        supports = [support.on(self.mesh) for support in self.supports]
        return Organ(mesh, self.law, fixed=self.fixed, element=self._chosen_element, supports=supports)

    def stepper(
        self,
        grasped: Displacements | None = None,
        *,
        start: State | Frame | Floats | None = None,
        solver: Solver = "cholesky",
        iterations: int = 1,
        settled: float = 1e-3,
        extrapolate: bool = True,
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
        start: a state or a frame to start from, or its displacement (n, 3) [m]; by default rest. Neither
            velocity nor relaxation is taken over (docs/real-time.md).
        solver: "cholesky", "cg" (conjugate gradients with a lagged factor), "multigrid", "gpu" or a
            `ConjugateGradients`.
        iterations: largest number of Newton iterations in a frame. A frame ends earlier at a residual of `settled`.
        extrapolate: whether a frame sets out from where the motion of the last one leads, as far as the hands repeat
            theirs, instead of from the last state; with dynamics it never does.
        budget: wall time [s] after which conjugate gradients stop and no further iteration begins.
        density [kg/m^3], one number or one per cell: needed for gravity and inertia.
        time_step [s] between frames: needed for inertia and relaxation.
        dynamics: "newmark", "backward_euler", a `Newmark` or a `BackwardEuler`; quasi-static if None.
        mass: "lumped" or, with dynamics, "consistent"; damping: Rayleigh's alpha [1/s] and beta [s], alpha M + beta K.
            Gravity pulls at the same masses: lumped, a "P2" organ at rest differs from statics by its discretisation.
        relaxation: `Prony` viscoelasticity, of the element "P1" alone.

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
            extrapolate=extrapolate,
            budget=budget,
            density=density,
            time_step=time_step,
            dynamics=dynamics,
            mass=mass,
            damping=damping,
            relaxation=relaxation,
        )
        return Stepper(self, grasped or {}, displacement_of(start, self.mesh), settings)

    def moved(self, displacement: State | Frame | ArrayLike) -> Moved:
        """The organ under any displacement (n, 3) [m] from rest, such as one of a `path`: stress, files and probes.

        Of a state that counts from a scan, the displacement from the unloaded shape is taken. What a frame of tissue
        that relaxes does not know, its stress, is not known of `moved(frame)` either. Raises `VisceraError` for a state
        of an organ of another shape.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> half = beam.moved(0.5 * state.displacement)
        >>> f"{half.von_mises().max():.0f} Pa"
        '2831 Pa'
        """
        given = displacement_of(displacement, self.mesh, "the displacement of `moved`", "the state given to `moved`")
        source = displacement if isinstance(displacement, Deformed) else None
        return Moved(self, np.zeros_like(self.mesh.points) if given is None else given, source=source)

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
            tractions and fibres are those of the unloaded organ; places, such as "x > 99%", those of the scan.
        tolerance: largest distance of a corner of a cell between the scan and the unloaded organ under these loads
            again, in units of the bounding-box diagonal.
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
        self._require_held(AT_REST)
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
        weights: of these points (k,); by default 1. A point of weight 0 has no influence; its residual is told. Equal
            points count once, with the largest of their weights.
        landmarks: `{name: (x, y, z)}` [m]: measured position of the mean of a node set of the mesh.
        points: points (l, 3) [m] of the organ at rest, and their measured displacements (l, 3) [m].
        noise: standard deviation [m] of the surface points along each axis, also in words: "2 mm".
        landmark_noise: the same of `landmarks` and `points`; by default that of the surface.
        visible: the part of the surface that the measured points may lie on; by default all of it.
        loaded: the part of the surface on which forces may act; by default all of it.
        start: a matrix (4, 4), the approximate rigid motion from the mesh to the measured points. Without it, and
            without three landmarks, rotations of up to 60 degrees are tried.

        The fixed nodes move as one rigid body; their reactions are free. Elsewhere, forces deform the organ: mostly one
        cause, which is a pressure on a disk of the surface, a pull, or a force in the volume, beside small smooth
        forces. If no equilibrium is found so, smooth forces alone are it: docs/navigation.md. Raises
        `VisceraError` for data that are not finite, in another unit or too few, and for landmarks that are no node sets
        of the mesh.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> bent = beam.solve(force={"tip": (0, 0, -10.0)}).displacement
        >>> found = beam.register(points=(beam.mesh.points[::20], bent[::20]), noise="1 mm")
        >>> found.is_converged, bool(abs(found.displacement - bent).max() < 0.1 * abs(bent).max())
        (True, True)
        """
        from viscera import registration

        self._refuse_ties()
        self._require_held(BY_NODES)
        deviation = self._length("noise", noise)
        other = deviation if landmark_noise is None else self._length("landmark_noise", landmark_noise)
        seen = registration.observed(self.mesh, surface, weights, landmarks, points, deviation, other)
        triangles = self.mesh.surface
        if visible is not None:
            triangles = triangles[np.isin(triangles, self.mesh.nodes(visible)).all(axis=1)]
            if not len(triangles):
                raise VisceraError("`visible` holds no whole triangle of the surface; choose a larger part")
        place, what = (self.mesh.surface_nodes, "the organ") if loaded is None else (loaded, "`loaded`")
        pushed = self._free_surface(place, what)
        motion = None if start is None else registration.rigid_of(start)
        return registration.register(
            self,
            seen,
            triangles,
            pushed,
            motion,
            progress,
        )

    def _refuse_ties(self) -> None:
        """Raise `VisceraError` for what a registration does not know."""
        if self.supports:
            raise VisceraError(
                "an organ with elastic supports cannot be registered yet: the springs would have to move with it; "
                "register it with fixed nodes"
            )

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
        settings: "steps", "solver", and "newton" with a table of its settings. They may stand among the loads too, by
            their names in `solve`, as `loading` of a case gives them.
        reduction: as `reduce` takes it, but "start" is "rest", "loads" or "scan".
        `viscera.case(path)` reads the file. Raises `VisceraError` for what a case cannot express: contact patches,
        nodal forces, parameters with a value for each cell, fibres whose direction varies from cell to cell.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = beam.to_case("beam.toml", loads={"gravity": (0, 0, -9.81), "density": 1000.0})
        >>> case.organ().solve(**case.loading()).is_converged
        True
        """
        from viscera.cases import casefile

        return casefile.write(self, path, loads=loads, scan=scan, settings=settings, reduction=reduction)


def require_same_cells(own: Mesh, other: Mesh) -> None:
    """Raise `VisceraError` unless nodes and cells are numbered alike: fixed nodes and laws by cell go by number."""
    if not isinstance(other, Mesh):
        raise refused("the mesh", "a viscera.Mesh with the same cells", other)
    counts = [(mesh.n_corners, len(mesh.cells)) for mesh in (own, other)]
    if counts[0] != counts[1]:
        (nodes, cells), (other_nodes, other_cells) = counts
        raise VisceraError(
            f"the mesh has {other_nodes} nodes and {other_cells} cells, and that of the organ {nodes} and {cells}: "
            "fixed nodes go by their numbers; make a new Organ for another mesh"
        )
    joined = [np.sort(mesh.cells, axis=1) for mesh in (own, other)]  # a mirrored mesh has its cells turned round
    if len(others := np.flatnonzero((joined[0] != joined[1]).any(axis=1))):
        raise VisceraError(
            f"cell {others[0]} of the mesh joins the nodes {joined[1][others[0]].tolist()}, and that of the organ "
            f"{joined[0][others[0]].tolist()}: fixed nodes go by their numbers; make a new Organ for another mesh"
        )


def _again(mesh: Mesh, law: Law, fixed: Indices, element: str | None, supports: Sequence[Tied]) -> Organ:
    return Organ(mesh, law, fixed, element=element, supports=supports)
