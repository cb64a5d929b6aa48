"""What every deformed shape of an organ offers, solved or reduced: stress, strain, values at points, files, grids."""

from __future__ import annotations

import warnings
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera import _core
from viscera.boundary.ties import Tied, Ties, carried
from viscera.errors import VisceraError
from viscera.mesh import Floats, Mesh
from viscera.output import state as statefile
from viscera.pointvalues import PointValues, interpolated
from viscera.quantity import numbers_of, refused
from viscera.sealed import Sealed
from viscera.select import has_words
from viscera.select import point as point_of
from viscera.stress import Response, pressure, von_mises

if TYPE_CHECKING:
    import os

    from viscera.boundary.bond import Bond
    from viscera.organ import Organ
    from viscera.scans.grid import Field
    from viscera.scans.scan import Scan


class Deformed(Sealed):
    """An organ with a displacement: stress, strain, values at points, files and image grids.

    Base of `State`, `Frame`, `Answer` and `Moved`.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
    >>> f"{state.von_mises().max():.0f} Pa"
    '5619 Pa'
    >>> moved = beam.moved(2 * state.displacement)
    >>> f"{moved.von_mises().max():.0f} Pa"
    '11135 Pa'
    """

    def _seen(self) -> tuple[Mesh, Floats]:
        """The mesh and the displacement (n, 3) [m] counted from it."""
        raise NotImplementedError

    def _from_rest(self) -> tuple[Organ, Floats]:
        """The organ and its displacement (n, 3) [m] from the unloaded shape, from which strain is counted."""
        raise NotImplementedError

    def _inside_out(self) -> str:
        """How many cells are inverted, in words; empty if none is."""
        inverted = self._response.inverted
        return f"{inverted.sum()} of {len(inverted)} cells are inside out" if inverted.any() else ""

    def _doubt(self) -> str:
        """Which of `statefile.DOUBTS` is true of it; empty if none is."""
        return ""

    def _nodal(self) -> dict[str, Floats]:
        """Fields at nodes of its files beside the stress, by name: `displacement` (n, 3) [m] and further ones."""
        displacement, doubt = self._seen()[1], self._doubt()
        return {"displacement": displacement} | ({doubt: np.ones(len(displacement))} if doubt else {})

    @cached_property
    def _response(self) -> Response:
        organ, displacement = self._from_rest()
        gradient, pk1, energy = organ._body.responses(np.ascontiguousarray(displacement))
        return Response(organ.mesh, gradient, pk1, energy, is_linear=organ.law.name == "linear")

    def stress(self, measure: str = "cauchy", at: str = "cells") -> Floats:
        """Stress (m, 3, 3) [Pa]: "cauchy" sigma = P F^T / J, "pk1" P = d psi / dF, or "pk2" S = F^-1 P.

        at: "cells" gives the mean over each cell at rest (m, 3, 3); "points" the values at the quadrature points
            (m, q, 3, 3), one in a linear cell and four in a quadratic one; "nodes" the mean over the cells around each
            node, weighted by volume (n, 3, 3). In a quadratic cell the linear function through its four points is
            taken to the nodes, except for the pressure, which is the mean of the cell.
        The stress is the one that the element balances: with "P1 mean volume" its pressure is that of the cluster.
        With the law `Linear` all three are the same. Nodes between two tissues get the mean of both sides, although
        the stress may jump there. Raises `VisceraError` if a cell is inverted, except for "pk1", and in
        a frame of tissue that relaxes, because a frame does not hold the history. A reduced answer whose stress is not
        balanced warns; see `Answer.stress_error_estimate`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> sigma = state.stress("cauchy", at="nodes")
        >>> sigma.shape, f"{vs.principal(sigma).max():.0f} Pa"
        ((525, 3, 3), '7186 Pa')
        """
        self._expect_stress()
        return self._stress(measure, at)

    def _stress(self, measure: str, at: str) -> Floats:
        response = self._response.even() if at == "nodes" else self._response
        return response.at(response.stress(measure), at)

    def _lacks_stress(self) -> str:
        """Why stress and energy are not known, in a sentence; empty where they are."""
        return ""

    def _expect_known_past(self) -> None:
        """Raises where stress and energy depend on a past that nothing holds."""
        if why := self._lacks_stress():
            raise VisceraError(why)

    def _expect_stress(self) -> None:
        """Raises where there is no stress, and warns where there is one that may not be relied on."""
        self._expect_known_past()

    def _expect_deviatoric_stress(self) -> None:
        """The same for what is free of the pressure."""
        self._expect_stress()

    def __getitem__(self, organ: str) -> Moved:
        """The part of one organ of a `Scene`, or of a reduced model of one, by its name.

        In a model an organ has its fixed nodes and the elastic supports that lie on it; displacements count from rest.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = vs.Scene({"beam": beam}).solve(force={"beam/tip": (0, 0, -10.0)})
        >>> f"{state['beam'].von_mises().max():.0f} Pa"
        '5619 Pa'
        """
        from viscera.joined import part_of
        from viscera.scene import Scene

        whole, displacement = self._from_rest()
        if isinstance(whole, Scene):
            part, nodes = whole.organ(organ), whole._numbers[organ]
            return Moved(part, whole.part(organ, displacement), source=self, nodes=nodes)
        part, nodes = part_of(whole, organ)
        return Moved(part, displacement[nodes], source=self, nodes=nodes)

    def support_force(self, support: Tied | Bond) -> Floats:
        """Total force (3,) [N] of one of the organ's elastic supports on it; of a bond, on its first organ.

        Of a support that several organs of a scene share, the force on all of them; `state["liver"]` tells that on one.
        A reduced model finds its supports and bonds anew by place and stiffness, and refuses what it does not find.
        `touch.organ().supports[0]` has all supports and bonds of a model; its force is that of all supports.
        With stiffness damping, that of a frame has it too; `organ.moved(frame)` is a shape at rest, without damping.

        >>> import viscera as vs
        >>> bed = vs.ElasticSupport("z < 1%", stiffness=1e6)
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), supports=[bed])
        >>> beam.solve(force={"tip": (0, 0, 10.0)}).support_force(bed).round(6).tolist()[2]
        -10.0
        """
        return self._carried(support, self._its_ties(support))

    def _carried(self, support: Tied | Bond, its: list[Ties]) -> Floats:
        """What the samples of a support or a bond carry (3,) [N]."""
        return carried(support, its, self._from_rest()[1])

    def _its_ties(self, support: Tied | Bond) -> list[Ties]:
        """The samples of a support or of a bond; raises `VisceraError` if it is none of the organ's."""
        from viscera.kept_ties import among_those_of_a_model

        organ, _ = self._from_rest()
        its = [ties for own, ties in zip(organ.supports, organ._tied, strict=True) if own.is_same(support)]
        its = its or among_those_of_a_model(support, organ)
        if not its:
            raise VisceraError(
                f"{support!r} is no elastic support of this organ: name one that it was made with, of a pickled state "
                "the one pickled with it, as in (state, support), and ask the state, the frame or the answer of the "
                "whole scene for what joins its organs"
            )
        if any(ties.surfaces for ties in its):
            raise VisceraError(f"{support!r} is a contact pair; `contact` gives its force")
        return its

    def strain(self, measure: str = "green", at: str = "cells") -> Floats:
        """Strain (m, 3, 3): "green" E = (F^T F - I) / 2, or "log" ln V = ln(F F^T) / 2.

        at: as in `stress`. Green's strain is in the axes at rest, the logarithmic one in deformed axes. F is that of
        the cell's own nodes, even if cells share their change of volume.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> state.strain("log").shape
        (1920, 3, 3)
        """
        return self._response.at(self._response.strain(measure), at)

    def pressure(self, at: str = "cells") -> Floats:
        """Pressure (m,) [Pa], -tr(sigma) / 3, positive where the tissue is compressed; at: as in `stress`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> pressure = state.pressure("nodes")
        >>> bool(pressure.min() < 0 < pressure.max())
        True
        """
        return pressure(self.stress("cauchy", at))

    def von_mises(self, at: str = "cells") -> Floats:
        """Von Mises stress (m,) [Pa] of the Cauchy stress; at nodes that of the mean stress. at: as in `stress`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> f"{state.von_mises('nodes').max():.0f} Pa"
        '5022 Pa'
        """
        self._expect_deviatoric_stress()
        return von_mises(self._stress("cauchy", at))

    def energy_density(self, at: str = "cells") -> Floats:
        """Strain energy (m,) [J/m^3] per volume at rest.

        Times the cells' volumes it adds up to the strain energy: `energy` of a state has that of supports, bonds and
        springs, too, and that of an answer is what the touch adds, by the model's force.
        at: as in `stress`; nodes get the mean of the cell means, which is never negative. In an inverted cell most laws
        have no energy: refused, as such a stress. So is that of a frame of tissue that relaxes: what it stores depends
        on its past, which a frame does not hold.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> energy = state.energy_density() @ state.mesh.facts["cell_volumes"]
        >>> bool(abs(energy - state.energy) < 1e-9 * state.energy)
        True
        """
        self._expect_known_past()
        self._response.require_values()
        energy = self._response.energy
        return self._response.at(energy.mean(axis=1, keepdims=True) if at == "nodes" else energy, at)

    def fields(self) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """The fields of written files, by name: at nodes `von_mises` and `pressure`; in cells those, `cauchy_stress`,
        `green_strain` and `energy_density`; in those of a `Scene` also `organ`, its number in `organs`. If a cell is
        inverted, they contain no stress, except with the law `Linear`, and no energy that the law does not have there.
        In a frame of tissue that relaxes they contain no stress and no energy.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> nodes, cells = state.fields()
        >>> sorted(nodes), sorted(cells)
        (['pressure', 'von_mises'], ['cauchy_stress', 'energy_density', 'green_strain', 'pressure', 'von_mises'])
        """
        from viscera.scene import Scene

        organ, _ = self._from_rest()
        strain = {"green_strain": self.strain("green")}
        has_energy = not self._response.without_value.any() and not self._lacks_stress()
        if has_energy:
            strain |= {"energy_density": self.energy_density()}
        strain |= {"organ": organ.of_cell} if isinstance(organ, Scene) else {}
        is_turned = self._response.inverted.any() and not self._response.is_linear
        if is_turned or not has_energy:
            return {}, strain
        cells, nodes = self.stress("cauchy"), self.stress("cauchy", "nodes")
        stress = {"cauchy_stress": cells, "von_mises": von_mises(cells), "pressure": pressure(cells)}
        return {"von_mises": von_mises(nodes), "pressure": pressure(nodes)}, stress | strain

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write a file; the ending chooses the format, which is checked first.

        `.vtu`, `.vtk`, `.xdmf`, `.msh`: rest points [m], cells, at points `displacement` [m], `von_mises` and
        `pressure` [Pa], in cells `cauchy_stress`, `von_mises`, `pressure` [Pa], `green_strain` and `energy_density`
        [J/m^3]. A state and a frame also have `reaction` [N] at points, a registered organ `band` [m] and
        `is_observed`, a state that did not converge `not_converged` and a frame that had not settled `not_settled`, 1
        at every point. Sets of nodes and of cells are kept, but not in `.xdmf`. `.ply`, `.glb`, `.gltf`: the deformed
        surface with the fields of the points on its vertices. `.obj`, `.stl`: the deformed surface alone. If a cell is
        inverted, no stress is written (`State.message` and a frame in print count such cells), except with the law
        `Linear`; nor are stress and energy of a frame of tissue that relaxes.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> state.write("bent.vtu")
        >>> beam.moved(0.5 * state.displacement).write("half.vtu")
        """
        target, (mesh, displacement) = statefile.checked(path), self._seen()
        points, cells = ({}, {}) if statefile.is_bare(target) else self.fields()
        statefile.write(target, mesh, displacement, self._nodal() | points, cells)

    def at(self, points: ArrayLike) -> PointValues:
        """Displacement, stress and strain at points (k, 3) [m] of the undeformed mesh.

        A single point may be given in words, "(100, 50, 80) mm". Raises `VisceraError` for a point outside all cells.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> inside = state.at([[0.5, 0.1, 0.1], [0.9, 0.1, 0.1]])
        >>> inside.displacement[:, 2].round(4).tolist()
        [-0.0621, -0.166]
        """
        mesh, displacement = self._seen()
        places = point_of(points, mesh, "the place") if has_words(points) else numbers_of(points)
        if places is None or places.ndim not in {1, 2} or places.shape[-1] != 3:
            raise refused("the places", "an array (k, 3) [m]", points)
        places = places.reshape(-1, 3)
        cells, weights = _core.Locator(mesh.points, mesh.cells).find(places)
        outside = np.flatnonzero(cells < 0)
        if len(outside):
            surface = _core.Surface(mesh.points, mesh.surface)
            place = places[outside[0]]
            away = surface.closest(place)[2] if np.isfinite(place).all() else np.inf
            raise VisceraError(
                f"place {outside[0]} at {place.tolist()} m lies outside the organ, {away:.3g} m from its surface "
                f"({len(outside)} of {len(places)} do)"
            )
        return PointValues(places, interpolated(mesh, displacement, cells, weights), cells, weights, self)

    def on_grid(
        self,
        image: str | os.PathLike[str] | Scan,
        *,
        axes: str | None = None,
        inverse: bool = False,
        margin: float | None = None,
    ) -> Field:
        """The displacement at the voxels of an image, as a `Field`; arguments as in `viscera.scans.grid.on_grid`.

        image: a file, a `Scan`, or an image of SimpleITK.
        axes: world axes of the mesh, "RAS" or "LPS"; by default those of the scan that it was made from, else "RAS".
        Warns of a state that did not converge and of a frame that had not settled.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
        >>> vs.Scan.of(beam.mesh, voxel=0.05).write("scan.nii.gz")
        >>> field = state.on_grid("scan.nii.gz")
        >>> field.displacement.shape, int(field.inside.sum())
        ((28, 12, 12, 3), 320)
        """
        from viscera.scans.grid import Grid, axes_of, on_grid

        mesh, displacement = self._seen()
        places = Grid.of(image, axes_of(mesh, axes))
        if doubt := self._doubt():
            warnings.warn(statefile.DOUBTS[doubt], stacklevel=2)
        return on_grid(mesh, displacement, places, inverse=inverse, margin=margin)


class Moved(Deformed):
    """An organ moved by any given displacement. Made by `Organ.moved`.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
    >>> half = beam.moved(0.5 * state.displacement)
    >>> f"{1e3 * half.at([[1, 0.1, 0.1]]).displacement[0, 2]:.1f} mm"
    '-97.4 mm'
    """

    def __init__(
        self,
        organ: Organ,
        displacement: Floats,
        *,
        source: Deformed | None = None,
        nodes: NDArray[np.int64] | None = None,
    ) -> None:
        """source: whose displacement it is; nodes: the numbers of its nodes there, if it is a part of that."""
        self.organ = organ
        self.displacement = displacement
        """Displacement (n, 3) [m] from rest."""
        self._source = source
        self._nodes = nodes
        self._seal()

    def _doubt(self) -> str:
        return "" if self._source is None else self._source._doubt()

    def _lacks_stress(self) -> str:
        """As its source, such as a frame that does not know its past."""
        return "" if self._source is None else self._source._lacks_stress()

    def _expect_stress(self) -> None:
        if self._source is not None:
            self._source._expect_stress()

    def _expect_deviatoric_stress(self) -> None:
        if self._source is not None:
            self._source._expect_deviatoric_stress()

    def _its_ties(self, support: Tied | Bond) -> list[Ties]:
        from viscera.boundary.bond import Bond

        if self._nodes is not None and isinstance(support, Bond):
            raise VisceraError(
                f"{support!r} joins two organs, and this is one of them alone; ask the state, the frame or the answer "
                "of the whole scene for its force"
            )
        return super()._its_ties(support)

    def _carried(self, support: Tied | Bond, its: list[Ties]) -> Floats:
        """As the whole that it is a part of knows it: of an answer, by the balance of what is held."""
        from viscera.joined import renumbered

        if self._source is None or self._nodes is None:
            return super()._carried(support, its)
        return self._source._carried(support, [renumbered(ties, self._nodes) for ties in its])

    def _seen(self) -> tuple[Mesh, Floats]:
        return self.organ.mesh, self.displacement

    def _from_rest(self) -> tuple[Organ, Floats]:
        return self.organ, self.displacement
