"""What a frame of a stepper shows: the organ as it is now, what holds it, and whether that can be relied on."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from viscera import _core
from viscera.boundary.loads import Where
from viscera.boundary.ties import Damping, Tied, Ties, carried
from viscera.contact.forceps import Forceps, JawForces
from viscera.contact.instrument import Instrument
from viscera.contact.pair import ContactPair, unknown_contact
from viscera.contact.tool import Contact, Tool
from viscera.deformed import Deformed
from viscera.display import Pictured
from viscera.errors import VisceraError
from viscera.mesh import Floats, Mesh
from viscera.output import state as statefile
from viscera.stepping.hand import Hand

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from viscera.boundary.bond import Bond
    from viscera.organ import Organ


@dataclass(frozen=True, repr=False, eq=False)
class Frame(Deformed, Pictured):
    """The organ after one frame, and what the frame did.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> stepper = beam.stepper(iterations=10)
    >>> frame = stepper.frame({"tip": (None, None, -0.01)})
    >>> frame.is_settled, frame.is_unstable, frame.reaction("tip")[2].round(3).item()
    (True, False, -0.496)
    """

    displacement: Floats
    """Displacement (n, 3) [m]."""
    residual: float
    """Residual: out-of-balance force at the end of the frame, relative to all nodal forces."""
    is_settled: bool
    """Whether its forces can be relied on: the residual is at most the stepper's `settled`, the hands are where they
    were told to be, no cell is at a bound, no tool is inside the organ and no organ in or behind another that it may
    touch (`contact(...).is_inside`), and with inertia the last step was not cut back."""
    steps: int
    """Newton iterations done."""
    cells_at_bound: int
    """Cells next to a bound of the volume ratio, 0.05 or 4, which no frame passes, or beyond it since the start. The
    force of a barrier acts on them beside that of the law. Where some remain, spread the load or what holds the organ
    there, or remesh it. `Linear` and `StableNeoHookean` let cells turn inside out and have no bounds."""
    taken: float
    """Part of the step that was taken: below 1 if a cell would have been crushed or torn, or a node led farther than
    the organ is long. Hands moved only so far."""
    is_unstable: bool
    """Whether the last tangent of the frame was not positive definite, as in an organ that is about to buckle."""
    iterations: int
    """Iterations of conjugate gradients; 0 with a direct solver."""
    is_solved: bool
    """Whether conjugate gradients reached their tolerance."""
    floor: float
    """Residual of the linear systems, relative to their right-hand sides, that rounding to single precision may leave:
    that of `|K| |s|`. The solver corrects what is above its tolerance. 0 without a graphics processor."""
    tangent_on_device: str | None
    """"formed" if the graphics processor formed the last tangent by itself, "uploaded" if it took that of the
    processor; None without one."""
    within_budget: bool
    """Whether the frame took no longer than its budget."""
    seconds: float
    """Wall time [s]."""
    energy: float
    """Strain energy [J] and that of elastic supports, bonds, springs and cables; of tissue that relaxes as if nothing
    had relaxed, a scale alone."""
    kinetic_energy: float
    """Kinetic energy [J]; 0 without inertia."""
    _reactions: Floats
    _supports: Floats
    _patches: list[_core.Patch]
    _patch_forces: Floats
    _organ: Organ
    _relaxes: bool
    _damping: Damping | None
    _contacts: list[tuple[Instrument, Contact]]
    _pairs: list[tuple[Tied, Contact]]
    _hands: list[tuple[Hand, Floats, Floats]]
    _grips: list[tuple[Forceps, JawForces]]

    def __repr__(self) -> str:
        inside_out, at_bound, entered = self._inside_out(), self._at_bound(), self._entered()
        flags = {
            "settled": self.is_settled,
            "not settled": not self.is_settled,
            "unstable": self.is_unstable,
            entered: entered != "",
            at_bound: at_bound != "",
            inside_out: inside_out != "",
            "linear system not solved": not self.is_solved,
            "over budget": not self.within_budget,
        }
        said = ", ".join(word for word, is_true in flags.items() if is_true)
        return f"Frame(residual {self.residual:.1e}, taken {self.taken:.3g}, {said})"

    def _entered(self) -> str:
        """Which tools are inside the organ, and which organs went through each other; empty if none did."""
        inside = [f"the {tool!r}" for tool, contact in self._contacts if contact.is_inside]
        verb = "is" if len(inside) == 1 else "are"
        said = [f"{' and '.join(inside)} {verb} inside the organ"] if inside else []
        said += [f"surfaces of {pair!r} went through each other" for pair, met in self._pairs if met.is_inside]
        return ", ".join(said)

    def _at_bound(self) -> str:
        """How many cells are at a bound of their volume, and which is farthest from its own; empty if none is."""
        if self.cells_at_bound == 0:
            return ""
        ratios = self._response.volume_ratio
        low, high = _core.VOLUME_BOUNDS
        cell, point = np.unravel_index(np.maximum(low / ratios, ratios / high).argmax(), ratios.shape)
        cells = "1 cell" if self.cells_at_bound == 1 else f"{self.cells_at_bound} cells"
        return f"{cells} at a bound, cell {cell} with {100.0 * ratios[cell, point]:.3g} % of its volume"

    def _seen(self) -> tuple[Mesh, Floats]:
        return self._organ.mesh, self.displacement

    def _from_rest(self) -> tuple[Organ, Floats]:
        return self._organ, self.displacement

    def _doubt(self) -> str:
        return "" if self.is_settled else statefile.NOT_SETTLED

    def _nodal(self) -> dict[str, Floats]:
        return super()._nodal() | {"reaction": self._reactions}

    def _carried(self, support: Tied | Bond, its: list[Ties]) -> Floats:
        return carried(support, its, self.displacement, self._damping)

    def _lacks_stress(self) -> str:
        """A frame does not hold the history of tissue that relaxes."""
        if not self._relaxes:
            return ""
        return (
            "the stress of tissue that relaxes, and what it stores, depends on its past, which a frame does not hold; "
            "step without relaxation, or solve"
        )

    @property
    def positions(self) -> Floats:
        """Positions of the nodes (n, 3) [m]."""
        return self._organ.mesh.points + self.displacement

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """Draw the organ over its rest shape, coloured by displacement. `path`: write a PNG file there.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> figure = stepper.frame({"tip": (None, None, -0.01)}).plot("frame.png")
        """
        from viscera.output.picture import draw

        mesh = self._organ.mesh
        return draw(mesh.points, mesh.surface, self.displacement, path=path)

    def contact(self, tool: Instrument | Tool | ContactPair) -> Contact:
        """What a tool, or a rigid body of a scene, did to the organ at the end of the frame.

        Of a contact pair of a scene: as `State.contact`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
        >>> tool.move((0, 0, -0.01))
        >>> frame = stepper.frame()
        >>> frame.contact(tool).touching > 0
        True
        """
        for known, contact in self._contacts:
            if tool is known or tool is known._tool:
                return contact
        for pair, contact in self._pairs:
            if pair.is_same(tool):
                return contact
        is_gone = isinstance(tool, Instrument) and not tool._is_there
        remedy = "ask a frame from before it was removed" if is_gone else "make it by Stepper.tool"
        raise unknown_contact(tool, "frame", remedy)

    def force(self, tool: Instrument | Forceps | Hand | ContactPair) -> Floats:
        """Force (3,) of a tool, of both jaws of forceps, or of a hand on the organ [N].

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
        >>> tool.move((0, 0, -0.01))
        >>> frame = stepper.frame()
        >>> bool(frame.force(tool)[2] < 0.0)
        True
        """
        return self._felt(tool)[0]

    def torque(self, tool: Instrument | Forceps | Hand | ContactPair) -> Floats:
        """Torque (3,) on the organ [N m]: of a tool or forceps about the origin, of a hand about its present centre.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> tool = stepper.tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3))
        >>> tool.move((0, 0, -0.01))
        >>> frame = stepper.frame()
        >>> bool(abs(frame.torque(tool)).max() < 1e-9)  # a sphere without friction turns nothing
        True
        """
        return self._felt(tool)[1]

    def grip(self, forceps: Forceps) -> float:
        """Force [N] with which the jaws of forceps press what is between them: the smaller of both along their x axis.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=20)
        >>> forceps = stepper.forceps(vs.Sphere(0.05), (0.9, 0.1, 0.1), (0, 0, 1.5708), opening=0.21)
        >>> forceps.close("2 cm")
        >>> frame = stepper.frame()
        >>> bool(frame.grip(forceps) > 0.0)
        True
        """
        return self._grip(forceps).grip

    def _grip(self, forceps: Forceps) -> JawForces:
        for known, grip in self._grips:
            if known is forceps:
                return grip
        raise VisceraError("these forceps were not in this frame; make them by Stepper.forceps of its stepper")

    def _felt(self, tool: Instrument | Forceps | Hand | ContactPair) -> tuple[Floats, Floats]:
        """Force and torque of what touches the organ."""
        if isinstance(tool, Forceps):
            grip = self._grip(tool)
            return grip.force, grip.torque
        if not isinstance(tool, Hand):
            contact = self.contact(tool)
            return contact.force, contact.torque
        for known, force, torque in self._hands:
            if known is tool:
                return force, torque
        raise VisceraError("this hand held nothing in this frame; make it by Stepper.grasp of the stepper of the frame")

    def reaction(self, where: Where | Hand) -> Floats:
        """Force (3,) [N] with which a place is held: by a hand, on a grasped patch, or summed over nodes.

        A patch on the same nodes as a place has a force of its own, which is not counted there.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> hand = stepper.grasp("tip")
        >>> hand.move((0, 0, -0.01))
        >>> stepper.frame().reaction(hand)[2].round(3).item()
        -1.839
        """
        if isinstance(where, Hand):
            return self.force(where)
        if isinstance(where, _core.Patch):
            for patch, force in zip(self._patches, self._patch_forces, strict=True):
                if patch is where:
                    return np.asarray(force)
            raise VisceraError("this contact patch is not held by the stepper")
        return np.asarray(self._supports[self._organ.mesh.nodes(where)].sum(axis=0))
