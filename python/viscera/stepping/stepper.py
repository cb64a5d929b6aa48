"""Real time: one or a few Newton iterations per frame, while hands hold, pull and let go, and gravity turns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core, gpu
from viscera.boundary.holding import IN_FRAMES
from viscera.boundary.loads import (
    Density,
    Displacements,
    Forces,
    Pressures,
    Tractions,
    Where,
    by_place,
    dead_forces,
    density_per_cell,
    name_of,
    pressed_faces,
    shares,
)
from viscera.boundary.ties import Damping
from viscera.contact.forceps import Forceps
from viscera.contact.instrument import Instrument
from viscera.contact.shapes import AnyShape, Box, Capsule, Sphere
from viscera.contact.tool import Tool, contacts
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh
from viscera.quantity import Choice, Number, Whole, check_nodal, numbers_of, refused, vector
from viscera.solver import Solver, core_solver
from viscera.stepping.bond_watch import BondWatch
from viscera.stepping.dynamics import Integration, Prony, core_integration
from viscera.stepping.frame import Frame
from viscera.stepping.hand import Hand, name_of_patch
from viscera.stepping.prescribed import PrescribedMotion

if TYPE_CHECKING:
    from viscera.organ import Organ

TIME_STEP = Number("s", low=1e-12)
"""Its square, by which masses are divided, leaves room for what a matrix can hold."""


class Stepper:
    """An organ in real time, made by `Organ.stepper`. Paper B
    (*Implementation and Evaluation of Hyperelastic Model for Surgical Simulator and Navigation*):
    one Newton iteration a frame, there from the last state, here from where the last motion leads, unless
    `extrapolate=False`.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> stepper = beam.stepper()
    >>> frame = stepper.frame({"tip": (None, None, -0.01)})
    >>> frame.steps, frame.is_settled  # one iteration is not enough for a jump of 1 cm
    (1, False)
    >>> frame = stepper.frame()
    >>> frame.is_settled
    True
    """

    def __init__(self, organ: Organ, grasped: Displacements, start: Floats | None, settings: dict[str, Any]) -> None:
        grasped = by_place(grasped, "grasped")
        self._organ = organ
        self._hands: list[Hand] = []
        self._tools: list[Instrument] = []
        self._forceps: list[Forceps] = []
        self._motion = PrescribedMotion(organ.mesh, organ.fixed, grasped)
        self._named: Displacements = grasped
        self._pressure: Pressures = {}
        self._faces: dict[Any, Indices] = {}
        self._fault: str | None = None
        self._bond_watch = BondWatch(organ)
        self._has_density = len(settings["density"]) > 0
        self._may_float = settings["dynamics"] is not None
        self._time_step: float | None = settings["time_step"]
        self._relaxation: tuple[list[float], list[float]] | None = settings["relaxation"]
        self._settings = settings
        self._core = _core.Stepper(organ._body, start=start, **settings)
        self._hold(self._motion)
        for body in organ._bodies:
            self.tool(body)

    def __reduce__(self) -> NoReturn:
        """For pickle and copy: refused, as only the compiled core knows all that a stepper goes on from."""
        raise VisceraError(
            "a stepper can be neither copied nor pickled, nor can its tools, hands and forceps, nor frames with them; "
            "keep the organ and an array such as frame.displacement, and go on with organ.stepper(start=...)"
        )

    @property
    def displacement(self) -> Floats:
        """Displacement (n, 3) after the last frame [m]."""
        return self._core.displacement()

    @property
    def velocity(self) -> Floats | None:
        """Velocity (n, 3) after the last frame [m/s]; None without inertia."""
        return self._core.velocity()

    @velocity.setter
    def velocity(self, value: ArrayLike) -> None:
        given, shape = numbers_of(value), self._organ.mesh.points.shape
        if given is None or given.shape != shape:
            raise refused("velocity", f"an array {shape} of numbers [m/s]", value)
        check_nodal(given, "the velocity of node", "m/s")
        self._core.set_velocity(given)

    def grasp(self, where: Where) -> Hand:
        """Take hold of a place where it is now: the free nodes of a set, or the mean of a contact patch.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> hand = stepper.grasp("tip")
        >>> hand.move("(0, 0, 2) mm")
        >>> f"{1e3 * stepper.frame().at([[1, 0.1, 0.1]]).displacement[0, 2]:.1f} mm"
        '2.0 mm'
        """
        if isinstance(where, _core.Patch):
            hand = Hand(self, where, where.weights, name_of_patch(where, self._organ.mesh))
        else:
            nodes = np.setdiff1d(self._organ.mesh.nodes(where), self._organ.fixed)
            if len(nodes) == 0:
                raise VisceraError(f"all nodes of {name_of(where)} are fixed: a hand cannot move them")
            hand = Hand(self, tuple(nodes.tolist()), shares(self._organ.mesh, nodes), name_of(where))
        for other in self._hands:
            if other._is_at(hand._where) and other._pull is None:
                raise VisceraError(
                    f"{hand._name} is held already, by the hand at {other._name}; release that hand first"
                )
        self._hands.append(hand)
        return hand

    def tool(
        self,
        shape: AnyShape | Tool,
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        *,
        friction: float | str | None = None,
    ) -> Instrument:
        """Add a rigid tool, with the arguments of `viscera.Tool`; it acts from the next frame on.

        A `Tool` has its own pose and friction, must have no motion, and is one instrument of the stepper alone.
        It must start outside the organ. It goes where it is told, however large its force becomes; to limit the force,
        drive it through a coupling, such as a spring.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
        >>> tool.move((0, 0, -0.01))
        >>> frame = stepper.frame()
        >>> frame.is_settled
        True
        """
        told: dict[str, Any] = {"position": position, "rotation": rotation, "friction": friction}
        given = {name: value for name, value in told.items() if value is not None}
        if isinstance(shape, Tool):
            self._may_take(shape, given)
        tool = shape if isinstance(shape, Tool) else Tool(shape, **given)
        made = Instrument(self, tool, self._core.add_tool(tool._spec()))
        self._tools.append(made)
        return made

    def forceps(
        self,
        jaw: Sphere | Capsule | Box,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | None = None,
        *,
        opening: float | str,
        friction: float | str = 0.5,
    ) -> Forceps:
        """Add forceps: two equal jaws that close along their x axis, `opening` [m] apart, with Coulomb's friction.

        The jaws must start outside the organ, on both sides of what they are to grip.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=20)
        >>> forceps = stepper.forceps(vs.Capsule(0.03, 0.1), (0.9, 0.1, 0.1), (0, 0, 1.5708), opening=0.21)
        >>> forceps.close("2 cm")
        >>> frame = stepper.frame()
        >>> frame.is_settled, f"{forceps.grip:.1f} N"
        (True, '71.1 N')
        """
        made = Forceps(self, jaw, position, rotation, opening=opening, friction=friction)
        self._forceps.append(made)
        return made

    def view(self, name: str = "Organ", height: int = 560) -> Any:
        """Show the organ in a notebook, stepped in the kernel by up to two hands on the page, or from Python.

        Needs `pip install anywidget`. `widget.touch(point, displacement)` [m] holds the patch around a surface
        point, moved by half the diagonal at most, and steps until it has settled, with inertia or relaxation until the
        organ rests; `widget.release()` lets go.
        `widget.point`, `widget.displacement`, `widget.force` and `widget.is_trusted` follow each touch:
        `widget.observe(handler, "force")`. Frames of the page apply no load except the hands. Tools that the stepper
        has by now are shown, where they are, as are the bodies and springs of a `Scene`. A stepper has one view: called
        again, this returns the same widget. `widget.close()` lets go, and forgets the stepper. name: shown above the
        organ; height: of the view, in pixels.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> widget = beam.stepper().view("Beam")
        >>> widget.touch((1, 0.05, 0.1), (0, 0, -0.01))
        >>> round(widget.force[2], 3), widget.is_trusted
        (-0.496, True)
        """
        from viscera.viewer.stepper_view import view_of

        return view_of(self, name, height)

    def frame(
        self,
        displacement: Displacements | None = None,
        *,
        force: Forces | None = None,
        traction: Tractions | None = None,
        pressure: Pressures | None = None,
        gravity: ArrayLike | None = None,
        density: Density | None = None,
    ) -> Frame:
        """One frame: the hands move, the organ follows.

        displacement: `{where: (x, y, z)}` [m] from rest; None leaves a component free. Places that are named are held;
            places that are no longer named are let go. Without this argument, the last displacements stay.
        force [N], traction [Pa], pressure [Pa]: as in `solve`. Forces and tractions are dead loads; a pressure follows
            the surface. All may change with every frame; a load that is not given no longer acts.
        gravity: acceleration (3,) [m/s^2], with the stepper's `density` or one given here.

        Ctrl-C ends a frame that takes longer than a twentieth of a second, after the iteration at work; the organ is
        then as before the frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> frame = stepper.frame(force={"tip": (0, 0, -1.0)})
        >>> frame.is_settled, f"{1e3 * frame.displacement[:, 2].min():.1f} mm"
        (True, '-20.2 mm')
        """
        named = self._named if displacement is None else by_place(displacement, "displacement")
        targets: dict[Any, Any] = dict(named)
        turned: dict[Any, Floats | None] = {}
        for hand in self._hands:
            if hand._pull is not None:
                continue
            if any(map(hand._is_at, targets)):
                raise VisceraError(f"{hand._name} is held twice; let one hand go")
            targets[hand._where] = hand.displacement
            turned[hand._where] = hand._arms_turned() if hand._holds_turn else None
        if not self._motion.fits(targets):
            motion = PrescribedMotion(self._organ.mesh, self._organ.fixed, targets)
            self._hold(motion)
            self._motion = motion
        values, means = self._motion.move(targets)
        applied, acceleration = self._loads(force, traction, gravity, density)
        applied, torques = self._pulls(applied)
        for forceps in self._forceps:
            forceps._must_be_whole()
        self._press(by_place(pressure, "pressure"))
        patches = self._motion.patches
        turns = [(k, arms) for k, patch in enumerate(patches) if (arms := turned.get(patch)) is not None]
        for forceps in self._forceps:  # last: a frame that is refused leaves the jaws where they are
            forceps._adjust()
        result = self._core.frame(
            values=values, means=means, turns=turns, force=applied, torques=torques, gravity=acceleration
        )
        self._named = named
        carried = dict(zip(patches, zip(result["patch_forces"], result["patch_torques"], strict=True), strict=True))
        supports = self._divided(result["supports"])
        for hand in self._hands:
            hand._feel(result["displacement"], supports, carried)
        told = contacts(self._core.contact([tool._number for tool in self._tools])) if self._tools else []
        felt = dict(zip(self._tools, told, strict=True))
        pairs = self._organ._contact_pairs
        self._fault = gpu.report(result["device_fault"], self._fault)
        self._bond_watch.look(result["displacement"])
        return Frame(
            displacement=result["displacement"],
            residual=result["residual"],
            is_settled=result["is_settled"],
            steps=result["steps"],
            cells_at_bound=result["cells_at_bound"],
            taken=result["taken"],
            is_unstable=result["is_unstable"],
            iterations=result["iterations"],
            is_solved=result["is_solved"],
            floor=result["floor"],
            tangent_on_device=result["tangent_on_device"],
            within_budget=result["within_budget"],
            seconds=result["seconds"],
            energy=result["energy"],
            kinetic_energy=result["kinetic_energy"],
            _reactions=result["reactions"],
            _supports=result["supports"],
            _patches=patches,
            _patch_forces=result["patch_forces"],
            _organ=self._organ,
            _relaxes=self._relaxation is not None,
            _damping=None if result["damping"] is None else Damping(*result["damping"]),
            _contacts=list(felt.items()),
            _pairs=list(zip(pairs, contacts(self._core.contact_pairs()), strict=True)) if pairs else [],
            _hands=[(hand, *hand._last()) for hand in self._hands],
            _grips=[
                (each, each._feel([felt[jaw] for jaw in each.jaws], result["is_settled"])) for each in self._forceps
            ],
        )

    def _may_take(self, tool: Tool, given: Mapping[str, Any]) -> None:
        """Raise `VisceraError` for a tool that this stepper has, that moves by itself, or that is told otherwise."""
        if given:
            raise VisceraError(f"{tool!r} has its own {next(iter(given))}; leave it out, or give the shape of the tool")
        if tool._moves:
            raise VisceraError(
                f"{tool!r} has a displacement or a turn, by which only a solve moves it; in frames the bodies of a "
                "scene stand still, and other tools go where they are moved: leave both out, or take tool.arrived()"
            )
        if any(made._tool is tool for made in self._tools):
            raise VisceraError(
                f"{tool!r} is in this stepper already and would act twice; name it once, as a body of the scene or here"
            )

    def _hold(self, motion: PrescribedMotion) -> None:
        if not self._may_float:
            self._organ._require_held(IN_FRAMES, motion.dofs, motion.patches)
        self._core.grasp(motion.dofs, motion.patches)

    def _divided(self, supports: Floats) -> Floats:
        """What each hand feels at each node [N]: hands that hold the same node share what holds it evenly."""
        holding = [hand for hand in self._hands if hand._pull is None and not isinstance(hand._where, _core.Patch)]
        if len(holding) < 2:
            return supports
        hands = np.bincount(np.concatenate([hand._nodes for hand in holding]), minlength=len(supports))
        return np.asarray(supports / np.maximum(hands, 1)[:, None])

    def _pulls(self, applied: Floats | None) -> tuple[Floats | None, list[tuple[_core.Patch, list[float]]]]:
        """Nodal forces with those of the hands that pull, and their torques."""
        torques = []
        for hand in self._hands:
            if hand._pull is None:
                continue
            force, torque = hand._pull
            applied = np.zeros_like(self._organ.mesh.points) if applied is None else applied.copy()
            applied[hand._nodes] += hand._weights[:, None] * force
            if torque.any():
                torques.append((_core.Patch(hand._nodes, hand._weights), torque.tolist()))
        return applied, torques

    def _press(self, pressure: Pressures) -> None:
        if pressure == self._pressure:
            return
        faces, values = pressed_faces(self._organ.mesh, self._organ.fixed, pressure, self._faces)
        self._core.press(faces, values)
        self._pressure = dict(pressure)

    def _loads(
        self,
        force: Forces | None,
        traction: Tractions | None,
        gravity: ArrayLike | None,
        density: Density | None,
    ) -> tuple[Floats | None, tuple[float, float, float]]:
        """Nodal forces, and the gravity from which the core computes further ones."""
        organ = self._organ
        applied = dead_forces(organ.mesh, organ.fixed, force, traction)
        if gravity is None:
            if density is not None:
                density_per_cell(organ.mesh, density)  # refused now rather than in the first frame with gravity
            return applied, (0.0, 0.0, 0.0)
        x, y, z = vector(gravity, "gravity", "m/s^2").tolist()
        if density is None:
            if not self._has_density:
                raise VisceraError("gravity needs a density [kg/m^3]")
            return applied, (x, y, z)
        if self._has_density:
            raise VisceraError("the stepper has a density already; leave it out of the frame")
        weight = organ._body.gravity(np.array([x, y, z]), density_per_cell(organ.mesh, density))
        return weight if applied is None else applied + weight, (0.0, 0.0, 0.0)


def settings_of(
    mesh: Mesh,
    *,
    solver: Solver,
    iterations: int,
    settled: float,
    extrapolate: bool,
    budget: float | None,
    density: Density | None,
    time_step: float | None,
    dynamics: Integration | None,
    mass: str,
    damping: tuple[float, float],
    relaxation: Prony | None,
) -> dict[str, Any]:
    """A stepper's settings as the core takes them; raises `VisceraError` if one is wrong or missing."""
    iterations = Whole(1, 1_000)(iterations, "iterations")
    settled = Number(above=0, below=1)(settled, "settled, a relative residual,")
    if not isinstance(extrapolate, bool):
        raise refused("extrapolate", "True or False", extrapolate)
    if time_step is not None:
        TIME_STEP(time_step, "time_step")
    if budget is not None:
        Number("s", above=0, high=1e300)(budget, "budget")
    Choice(("lumped", "consistent"))(mass, "the mass")
    rates = numbers_of(damping)
    if rates is None or rates.shape != (2,):
        raise refused("damping", "a pair (alpha [1/s], beta [s]) of Rayleigh's numbers", damping)
    if relaxation is not None and not isinstance(relaxation, Prony):
        raise refused("relaxation", "a viscera.Prony, such as Prony(g=[0.3], tau=[0.5])", relaxation)
    if dynamics is None and rates.any():
        raise VisceraError("damping has no effect without dynamics; choose dynamics='newmark' or 'backward_euler'")
    if dynamics is None and mass != "lumped":
        raise VisceraError(
            f"mass={mass!r} has no effect without dynamics; choose dynamics='newmark' or 'backward_euler'"
        )
    if time_step is not None and dynamics is None and relaxation is None:
        raise VisceraError("a time_step has no effect without dynamics or relaxation; add one, or leave it out")
    if time_step is None and not (dynamics is None and relaxation is None):
        raise VisceraError("dynamics and relaxation need a time_step [s]")
    if dynamics is not None and density is None:
        raise VisceraError("dynamics needs a density [kg/m^3]")
    inertia = None
    if dynamics is not None:
        alpha, beta = rates.tolist()
        inertia = (core_integration(dynamics), mass == "lumped", (alpha, beta))
    return {
        "solver": core_solver(solver),
        "iterations": iterations,
        "settled": settled,
        "extrapolate": extrapolate,
        "budget": budget,
        "density": np.empty(0) if density is None else density_per_cell(mesh, density),
        "time_step": time_step,
        "dynamics": inertia,
        "relaxation": None if relaxation is None else (list(relaxation.g), list(relaxation.tau)),
    }
