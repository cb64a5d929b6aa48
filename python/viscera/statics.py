"""The equilibria of an organ: one load case by Newton's method, or a path along a load by its series."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from viscera import gpu
from viscera.boundary.holding import AT_REST, IN_SOLVE
from viscera.boundary.loads import (
    Density,
    Displacements,
    Forces,
    Pressures,
    Tractions,
    dead_forces,
    density_per_cell,
    prescribed,
    pressed_faces,
)
from viscera.contact.shapes import AnyShape
from viscera.contact.tool import Tool, tools_of
from viscera.continued import anchored
from viscera.errors import NotConverged, VisceraError
from viscera.mesh import Floats, Indices, Mesh
from viscera.path import Expansion, Path
from viscera.progress import Progress, shown
from viscera.quantity import Choice, Number, Whole, check_nodal, numbers_of, refused, vector
from viscera.solver import Solver, core_solver, newton_settings
from viscera.state import State, refuse_other_points
from viscera.stepping.frame import Frame
from viscera.supported import Supported

STEPS = Whole(1, 10_000)
TOLERANCE = Number(above=0, below=1)
ORDER = Whole(2, 30)
"""As in `crates/series/src/path.rs`."""

NOTHING_ACTS = "nothing acts on the organ: no load, no tightened spring, no prescribed displacement other than zero"


class Statics(Supported):
    """What is held, under loads."""

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
        solver: Solver = "auto",
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
            separately. With a state as `start`, friction goes on for tools that begin where the state's solve has left
            them (`Tool.arrived`).
        steps: initial number of load steps; more are taken where needed.
        start: a state or a frame to continue from, or its displacement (n, 3) [m]; by default rest.
        settings: of Newton's method, by name: "tolerance", "max_iterations", "max_backtracks", "smallest_step", as in
            `[settings.newton]` of a case file (docs/case-file.md).
        solver: of the linear systems. "auto" chooses the one that is likely to be the fastest (docs/solvers.md);
            `State.solver` says which it was. Or "cholesky", "cg", "multigrid", "gpu" or a `ConjugateGradients`.
        throw: raise `NotConverged` if the solve fails, instead of returning the state with its status.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(displacement={"tip": (None, None, -0.05)}, gravity=(0, 0, -9.81), density=100)
        >>> state.status, state.reaction("tip")[2].round(3).item()
        ('converged', 12.333)
        """
        steps, begin = STEPS(steps, "steps"), displacement_of(start, self.mesh)
        moved = prescribed(self.mesh, self.fixed, displacement)
        self._require_held(IN_SOLVE, moved.dofs, [patch for patch, _ in moved.patches])
        applied, pressed, pressures, weight = self._loads(force, traction, pressure, gravity, density)
        means = [mean for _, mean in moved.patches]
        tools = [*tools_of(contact, self._bodies), *self._bodies]
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
            anchored=anchored(tools, start, self.mesh),
            start=begin,
            steps=steps,
            settings=newton_settings(settings),
            solver=core_solver(solver),
            on_progress=lambda load: progress(round(100 * load), 100, "load") if progress else None,
        )
        gpu.report(result["device_fault"])
        seconds, patches = perf_counter() - began, [patch for patch, _ in moved.patches]
        state = State(self._organ, result, patches, seconds, has_pressure=bool(pressure), tools=tools)
        pulls = [link.force(np.zeros_like(applied)) for link in self._ties.links]
        acting = (moved.values, means, applied, weight, pressures, pulls)
        if state.is_converged and not tools and not any(np.any(each) for each in acting):
            state.message = NOTHING_ACTS
        if throw and not state.is_converged:
            raise NotConverged(state)
        return state

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
        tolerance: relative accuracy of the displacement over an expansion; its range is chosen by it.
        A path that ends before `until` is returned as far as it goes; `Path.message` says why.
        A law with a switch (fibres that go slack, max, min) ends an expansion wherever one turns over; if that takes
        more than `max_expansions`, it is an error.
        Cochelin, Damil and Potier-Ferry (1994); Niroomandi et al., IJNME 96 (2013) 129.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> path = beam.path(force={"tip": (0, 0, -10.0)}, order=8)
        >>> load, displacement = path.curve(samples=5)
        >>> load[-1].round(6).item(), displacement[-1, :, 2].min().round(4).item()
        (1.0, -0.1993)
        """
        Choice(("load", "arc length"))(parameter, "the path parameter")
        order = ORDER(order, "order")
        until = Number(above=0)(until, "until")
        tolerance = TOLERANCE(tolerance, "tolerance")
        max_expansions = Whole(1, 100_000)(max_expansions, "max_expansions")
        self._require_linear_ties()
        self._require_held(AT_REST)
        applied, pressed, pressures, _ = self._loads(force, traction, pressure)
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
        return Path([Expansion(**expansion) for expansion in expansions], self._organ, until, parameter, max_expansions)

    def _loads(
        self,
        force: Forces | None = None,
        traction: Tractions | None = None,
        pressure: Pressures | None = None,
        gravity: ArrayLike | None = None,
        density: Density | None = None,
    ) -> tuple[Floats, Indices, Floats, Floats]:
        """Dead forces (n, 3) [N], pressed faces and their pressures [Pa], weight (n, 3) [N]; raises `VisceraError` for
        what is no load."""
        if gravity is not None and density is None:
            raise VisceraError("gravity needs a density [kg/m^3]")
        applied = dead_forces(self.mesh, self.fixed, force, traction)
        pressed, pressures = pressed_faces(self.mesh, self.fixed, pressure)
        weight = np.zeros_like(self.mesh.points)
        if gravity is not None and density is not None:
            acceleration = vector(gravity, "gravity", "m/s^2")
            weight = self._body.gravity(acceleration, density_per_cell(self.mesh, density))
        return np.zeros_like(weight) if applied is None else applied, pressed, pressures, weight


def displacement_of(
    start: State | Frame | ArrayLike | None, mesh: Mesh, what: str = "start", call: str = "the state to start from"
) -> Floats | None:
    """The displacement (n, 3) [m] from rest of a state, which errors call `what` and `call`; None for rest."""
    if start is None:
        return None
    organ, known = start._from_rest() if isinstance(start, State | Frame) else (None, start)
    given = numbers_of(known)
    if given is None or given.ndim != 2 or given.shape[1] != 3 or not np.isfinite(given).all():
        raise refused(what, "a State, a Frame or a finite displacement (n, 3) [m]", start)
    if given.shape != mesh.points.shape:
        raise VisceraError(
            f"{call} belongs to another mesh: its displacement has shape {given.shape}, "
            f"this mesh needs {mesh.points.shape}"
        )
    check_nodal(given, f"{what}: the displacement of node", "m")
    if organ is not None:
        refuse_other_points(
            organ.mesh, mesh, f"{call} is not one of this organ", "take the organ that it was solved with"
        )
    return given
