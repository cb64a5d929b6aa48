"""The result of a solve: the equilibrium, how it was reached, and whether it was."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera import _core
from viscera.boundary.loads import Where
from viscera.contact.pair import ContactPair, unknown_contact
from viscera.contact.shapes import AnyShape
from viscera.contact.tool import Contact, Tool, contacts
from viscera.deformed import Deformed
from viscera.display import Pictured
from viscera.errors import VisceraError
from viscera.mesh import Floats, Mesh
from viscera.output import state as statefile
from viscera.quantity import Choice

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from viscera.organ import Organ


SAME = 1e-9
"""Part of the diagonal by which points may differ and still count as the same: files and sums round them."""


class State(Deformed, Pictured):
    """An equilibrium, or the last one found before a solve failed (`is_converged`, `status`, `message`, `load`).

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
    >>> state.is_converged, f"{state.energy:.3f} J", f"{1e3 * state.max_displacement:.0f} mm"
    (True, '0.957 J', '200 mm')
    """

    def __init__(
        self,
        organ: Organ,
        result: Mapping[str, Any],
        patches: list[_core.Patch],
        seconds: float,
        *,
        has_pressure: bool = False,
        tools: Sequence[Tool] = (),
    ) -> None:
        self._organ = organ
        self.mesh = organ.mesh
        self.displacement: Floats = result["displacement"]
        """Displacement (n, 3) [m]."""
        self._displacement_from_rest = self.displacement
        self.energy: float = result["energy"]
        """Strain energy [J], and that of elastic supports, bonds, springs and cables."""
        self.volume_ratio: float = result["volume"] / organ.mesh.volume
        """Deformed over rest volume."""
        self.status: str = result["status"]
        self.is_converged: bool = result["is_converged"]
        self._told: str = result["message"]
        self.load: float = result["load"]
        """Fraction of the load reached, 1 where converged."""
        self.iterations: int = result["iterations"]
        self.factorizations: int = result["factorizations"]
        """Tangents factorised (with "cg": taken over), those rejected and those of failed load steps included."""
        self.linear_iterations: int = result["linear_iterations"]
        """Iterations of conjugate gradients in all; 0 with a direct solver."""
        self.solver: str = result["solver"]
        """The linear solver: "cholesky" or the preconditioner of conjugate gradients. With "auto", what was chosen; if
        that was given up, both: "incomplete_cholesky, then cholesky"."""
        self.residuals: list[list[float]] = result["residuals"]
        """Relative force residual of each iteration, one list per load step."""
        self.seconds = seconds
        """Wall time of the solve."""
        self.timings: dict[str, float] = result["seconds"]
        """Wall time [s] by stage."""
        self.tangent_on_device: str | None = result.get("tangent_on_device")
        """"formed" if the graphics processor formed the last tangent by itself, "uploaded" if it took that of the
        processor; None without one."""
        self.internal_force: Floats = result["internal_force"]
        """Nodal forces (n, 3) [N] of the stress and of elastic supports."""
        self.external_force: Floats = result["external_force"]
        """Nodal forces (n, 3) [N] of the part of the load that was reached, all of it where the solve converged; then
        equal but for what is held."""
        self.has_pressure = has_pressure
        """Whether a pressure is part of the load: it follows the surface, all other loads are dead."""
        self._is_as_scanned = False
        """Whether it is the organ under the loads of its scan, as `unloaded` finds it."""
        self._held: Floats = self.internal_force - self.external_force
        self._patches = [(patch.nodes, patch.weights) for patch in patches]
        self._patch_forces: Floats = result["patch_forces"]
        self._tools = list(zip(tools, contacts(result.get("contact", [])), strict=True))
        self._anchored: list[list[_core.Anchored]] = result.get("anchored", [[] for _ in tools])
        self._pairs = list(zip(organ._contact_pairs, contacts(result.get("contact_pairs", [])), strict=True))
        self._seal()

    def _seen(self) -> tuple[Mesh, Floats]:
        return self.mesh, self.displacement

    def _from_rest(self) -> tuple[Organ, Floats]:
        return self._organ, self._displacement_from_rest

    def _doubt(self) -> str:
        return "" if self.is_converged else statefile.NOT_CONVERGED

    def _nodal(self) -> dict[str, Floats]:
        return super()._nodal() | {"reaction": self._held}

    @cached_property
    def message(self) -> str:
        """How the solve ended, in words: what went wrong, and how many cells are inside out, which some laws allow."""
        inside_out = self._inside_out()
        if inside_out and not self._response.is_linear:
            inside_out += ", and files hold no stress"
        organ, displacement = self._from_rest()
        return "; ".join(filter(None, (organ._named(self._told), inside_out, organ._doubt_of_bonds(displacement))))

    @property
    def max_displacement(self) -> float:
        """Largest displacement of a node [m]."""
        return float(np.linalg.norm(self.displacement, axis=1).max())

    def reaction(self, where: Where) -> Floats:
        """Total force (3,) [N] by which the support at a place holds the organ: internal minus external nodal force.

        For a contact patch that the solve prescribed, the contact force. If the solve did not converge, that under the
        part of the load that was reached.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> state.reaction("clamp").round(6).tolist()
        [-0.0, 0.0, 10.0]
        """
        if isinstance(where, _core.Patch):
            for (nodes, weights), force in zip(self._patches, self._patch_forces, strict=True):
                if np.array_equal(nodes, where.nodes) and np.array_equal(weights, where.weights):
                    return np.array(force)
            raise VisceraError("this contact patch was not prescribed in the solve, so it has no reaction")
        return np.asarray(self._supports[self.mesh.nodes(where)].sum(axis=0))

    @cached_property
    def _supports(self) -> Floats:
        """Nodal forces (n, 3) [N] without those of the patches."""
        supports = np.array(self._held)
        for (nodes, weights), force in zip(self._patches, self._patch_forces, strict=True):
            supports[nodes] -= np.outer(weights, force)
        return supports

    def contact(self, tool: Tool | AnyShape | ContactPair) -> Contact:
        """What a tool of the solve does to the organ: force, torque, area, pressures, gap.

        Of a contact pair of a scene: force and torque of its second organ on the first, the torque about the origin of
        space; pressures at the nodes of both.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> tool = vs.Tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3), displacement=(0, 0, -0.01))
        >>> state = beam.solve(contact=[tool])
        >>> state.contact(tool).touching > 0
        True
        """
        found = [contact for known, contact in self._tools if known is tool or known.shape is tool]
        if len(found) > 1:
            raise VisceraError(f"{len(found)} tools of this solve have the shape {tool!r}; ask by one of these tools")
        if found:
            return found[0]
        for pair, contact in self._pairs:
            if pair.is_same(tool):
                return contact
        remedy = "name it in contact=[...]; of a pickled state take the tool pickled with it, as in (state, tool)"
        raise unknown_contact(tool, "solve", remedy)

    def force(self, tool: Tool | AnyShape | ContactPair) -> Floats:
        """Force (3,) of a tool on the organ [N]; of a contact pair, see `contact`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> tool = vs.Tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3), displacement=(0, 0, -0.01))
        >>> state = beam.solve(contact=[tool])
        >>> bool(abs(state.force(tool) + state.reaction("clamp")).max() < 1e-6)
        True
        """
        return self.contact(tool).force

    def torque(self, tool: Tool | AnyShape | ContactPair) -> Floats:
        """Torque (3,) of a tool on the organ about the tool's origin [N m].

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> tool = vs.Tool(vs.Sphere(0.1), position=(0.9, 0.1, 0.3), displacement=(0, 0, -0.01))
        >>> state = beam.solve(contact=[tool])
        >>> bool(abs(state.torque(tool)).max() < 1e-9)  # a sphere without friction turns nothing
        True
        """
        return self.contact(tool).torque

    def plot(self, path: str | os.PathLike[str] | None = None, *, colour: str = "displacement") -> Figure:
        """The deformed organ over its rest shape. `path`: write a PNG file there.

        colour: "displacement", "von_mises", "pressure" or "energy_density", the last three as they are at nodes.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> figure = state.plot("bent.png", colour="von_mises")
        """
        from viscera.output.picture import COLOURS, draw

        Choice([name for name in COLOURS if name != "band"])(colour, "the colour")
        values = None if colour == "displacement" else getattr(self, colour)("nodes")
        return draw(self.mesh.points, self.mesh.surface, self.displacement, values=values, colour=colour, path=path)

    def view(self, name: str = "Organ", height: int = 560) -> Any:
        """The deformed organ below a notebook's cell, to be turned, cut open and coloured by displacement or stress.

        Needs `pip install viscera[notebook]`. A solved state stays as it is: to touch an organ, view its stepper or a
        reduced model. Tools of the solve are shown where they ended, as are the bodies and springs of a `Scene`.
        name: shown above the organ; height: of the view, in pixels.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> widget = beam.solve(force={"tip": (0, 0, -10.0)}).view("Beam")
        """
        from viscera.viewer.notebook import widget
        from viscera.viewer.stepped import PlayedState

        return widget(PlayedState(self, name), height)

    def __repr__(self) -> str:
        return f"State({self.status}, load={self.load:g}, max_displacement={self.max_displacement:g} m)"


def refuse_other_points(its: Mesh, mesh: Mesh, said: str, advice: str) -> None:
    """Raise `VisceraError` if a state of the mesh `its` is none of `mesh`, where its strain would be another."""
    is_same = its.points.shape == mesh.points.shape
    if not is_same or np.abs(its.points - mesh.points).max() > SAME * mesh.diagonal:
        raise VisceraError(f"{said}: its mesh has other points; {advice}")
