"""A reduced model on-line: from a contact point and its displacement to force, stiffness and displacement field."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from viscera import _core, defaults, law
from viscera.boundary.ties import Ties
from viscera.display import Pictured
from viscera.errors import VisceraError, refuse_case_file
from viscera.files.atomic import replacing
from viscera.mesh import Floats
from viscera.output.kind import model_path
from viscera.quantity import Number, Whole, path_of, vector
from viscera.reduced.answer import Answer
from viscera.reduced.stored import Stored
from viscera.reduced.vary import UNITS, law_at
from viscera.select import Lengths, has_words, length, offset, place
from viscera.select import point as point_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from viscera.organ import Organ
    from viscera.reduced.check import Check
    from viscera.reduced.checkpoint import Batches
    from viscera.reduced.galerkin import Galerkin
    from viscera.reduced.probe import RigidProbe


log = logging.getLogger("viscera")
T = TypeVar("T")
COMPRESSION = Number(above=0, below=1)
"""Tolerance of a smaller model."""


class Touch(Stored, Pictured):
    """The reduced model of an organ: it answers touches anywhere on its touchable surface.

    Made by `Organ.reduce`, or read from a file by `viscera.load`. Calling it with a contact point (3,) [m] and the
    displacement (3,) [m] of the contact gives an `Answer`. Points are those of the shape before the touch: at rest, or
    under a preload; displacements and forces are what the touch adds.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> touch = beam.reduce("tip", depth="2%", order=2)
    >>> touch
    Touch(525 points, order 2, depth 0.0207846 m)
    >>> touch((1, 0.1, 0.1), (0, 0, -0.01)).is_trusted
    True
    """

    def __init__(self, model: _core.Model, batches: Batches | None = None) -> None:
        super().__init__(model)
        self._batches = batches

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle and copy: the bytes of the model file."""
        return load_bytes, (self._model.to_bytes(),)

    def __call__(self, point: Lengths, displacement: Lengths) -> Answer:
        """The organ's answer to a touch.

        point (3,): contact point on the untouched surface [m]; displacement (3,): mean displacement of the patch [m].
        Both may be given in words: `touch("(100, 50, 80) mm", [0, 0, "-10 mm"])`. Raises `VisceraError` if the point is
        farther from the touchable surface than the mean length of its edges.
        """
        at, push = self._point(point), self._push(displacement)
        return Answer(self, at, push, self._asked(self._model.evaluate, at, push, False))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the model file (safetensors, see docs/model-file.md). If writing fails, no partial file is left.

        Once it is written, the file of finished batches that `Organ.reduce(checkpoint=)` has kept is removed.
        Raises `VisceraError` for a name with the ending of something else: a mesh, a surface, an image or a case.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> touch.save("beam.viscera")
        >>> vs.load("beam.viscera")
        Touch(525 points, order 2, depth 0.0207846 m)
        """
        with replacing(model_path(path)) as scratch:
            scratch.write_bytes(self._model.to_bytes())
        if self._batches is not None:
            self._batches.remove()
            self._batches = None

    def at(self, value: float | str) -> Touch:
        """The model at another value of its parameter (see `Organ.reduce(vary=)`).

        value: within the range; a radius [m] may be given in words such as "12 mm".

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2, vary=vs.Vary("young", 5e4, 2e5, nodes=2))
        >>> soft, stiff = (touch.at(young)((1, 0.1, 0.1), (0, 0, -0.01)).force[2] for young in (5e4, 2e5))
        >>> f"{stiff / soft:.2f}"
        '4.00'
        """
        parameter = self.metadata.get("parameter")
        if parameter is None:
            raise VisceraError("this model has no parameter to set; reduce with vary=")
        name, (low, high) = parameter["name"], parameter["range"]
        if name == "radius" and isinstance(value, str):
            value = length(value, self.mesh.diagonal, name)
        value = Number(UNITS.get(name, ""), low=low, high=high)(value, f"{name} of this model")
        full = law.from_core(self.metadata["law"], self._model.array("law_parameters"))
        if name != "radius":
            cells = self._model.array("parameter_cells")
            full = law_at(full, name, value, cells, len(self._model.array("cells")))
        return Touch(self._model.at(value, full.parameters.ravel().tolist()))

    def compressed(self, tolerance: float) -> Touch:
        """The model with fewer modes: a smaller file and faster fields; forces and their trust stay the same.

        tolerance: relative error of the field at full depth, at the worst position, root mean square over directions;
        between 0 and 1. The loss is added to the estimated error of the shape (`Answer.shape_error_estimate`). As
        off-line, the fewest principal directions of the stored fields of each region are kept, with each order weighted
        by the depth to the power of its degree.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> smaller = touch.compressed(0.05)
        >>> smaller.summary()["modes"] < touch.summary()["modes"]
        True
        """
        return Touch(self._model.compressed(COMPRESSION(tolerance, "tolerance")))

    def check(
        self,
        touches: int = 50,
        seed: int = 0,
        depths: Sequence[float | str] | None = None,
        executor: Executor | None = None,
        progress: Callable[[int, int, str], None] | None = None,
    ) -> Check:
        """Compare the model with Newton's method at random unseen touches; see `viscera.reduced.check`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> touch.check(touches=3, depths=["1%"]).verdict
        'passed'
        """
        from viscera.reduced.check import check

        return check(self, touches=touches, seed=seed, depths=depths, executor=executor, progress=progress)

    def probe(
        self,
        radius: float | str | None = None,
        friction: float = 0.0,
        *,
        tolerance: float = _core.PROBE_TOLERANCE,
        stiffness: float | None = None,
        damping: float = 0.0,
    ) -> RigidProbe:
        """A rigid sphere that presses, sticks, slides and lets go; see `RigidProbe` and docs/probe.md.

        radius: of the sphere [m], 0.8 to 1.25 times that of the patch, which is the default.
        friction: Coulomb's coefficient.
        tolerance: largest estimated error of a trusted force, relative to its norm, where the contact is as wide as the
            mesh can show; a smaller contact has a larger relative error, and a smaller one in newtons.
        stiffness, damping: of a coupling to a device [N/m], [N s/m]; without one the sphere is where the device is.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("x > 70% and z > 99%", depth="5%", order=3)
        >>> touch.probe("100 mm", friction=0.3)
        RigidProbe(radius=0.1, friction=0.3)
        """
        from viscera.reduced.probe import RigidProbe

        return RigidProbe(self, radius, friction, tolerance, stiffness, damping)

    def galerkin(
        self,
        *,
        order: int | None = None,
        tolerance: float = defaults.GALERKIN_TOLERANCE,
        depth: float | str | None = None,
        snapshots: int = 0,
    ) -> Galerkin:
        """The model of several touches at once; see `viscera.reduced.galerkin`.

        order: highest order of the series fields in its basis, at most the order of this model; by default 3, or the
            order of this model if that is lower.
        tolerance: error of the forces of the sampled cells in training, relative to the forces of all cells.
        depth: largest displacement of a contact [m], or in words such as "5%" of the diagonal; by default this model's.
        snapshots: largest number of states that are solved on the whole organ when contacts take hold. They add to the
            basis what the series do not contain. Two dozen are spread evenly; more follow in rounds, until the errors
            of all answers in a round are below a tenth of the allowance.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> fingers = touch.galerkin()
        >>> held = fingers.solve([((1, 0, 0.1), (0, 0, -0.01)), ((1, 0.2, 0.1), (0, 0, 0.01))])
        >>> held.is_converged, held.force.shape
        (True, (2, 3))
        """
        from viscera.reduced.galerkin import galerkin

        order = min(defaults.GALERKIN_ORDER, self.order) if order is None else order
        return galerkin(self, order, tolerance, depth, snapshots)

    def organ(self) -> Organ:
        """The full organ that this model was reduced from. Its mesh, law and supports are in the model file.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> touch.organ()
        Organ(525 points, 1920 cells, NeoHookean, P1, 25 fixed nodes)
        """
        from viscera.organ import Organ

        full = law.from_core(self.metadata["law"], self._model.array("law_parameters"))
        fixed = self._model.array("fixed")
        return Organ(self.rest, full, fixed=fixed, element=self.element, supports=self._supports)

    @cached_property
    def _supports(self) -> list[Ties]:
        kept = [self._model.array(f"tie_{name}") for name in ("start", "nodes", "weights", "stiffness")]
        start, nodes, weights, stiffness = kept
        return [Ties(start, nodes, weights, stiffness)] if len(start) else []

    @cached_property
    def _full(self) -> Organ:
        return self.organ()

    def _whole(self, displacement: Floats) -> tuple[Organ, Floats]:
        """The full organ, and its displacement from rest when a touch adds `displacement` to the preload."""
        return self._full, displacement if self.preload is None else self.preload + displacement

    def surface_displacement(self, point: Lengths, displacement: Lengths, order: int | None = None) -> Floats:
        """Displacement (k, 3) [m] of the surface nodes alone, in the order of `surface_nodes`.

        order: the order after which the series is cut; 1 is linear elasticity. By default the model's own.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> moved = touch.surface_displacement((1, 0.1, 0.1), (0, 0, -0.01))
        >>> moved.shape == (len(touch.surface_nodes), 3)
        True
        """
        last = self.order if order is None else Whole(1, self.order)(order, "order")
        return self._asked(self._model.surface_displacement, self._point(point), self._push(displacement), last)

    def patch(self, point: Lengths) -> _core.Patch:
        """The contact patch at a point, for a full solution to prescribe.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> patch = touch.patch((1, 0.1, 0.1))
        >>> full = touch.organ().solve(displacement={patch: (0, 0, -0.01)}).reaction(patch)
        >>> reduced = touch((1, 0.1, 0.1), (0, 0, -0.01)).force
        >>> bool(abs(full[2] - reduced[2]) < 0.01 * abs(full[2]))
        True
        """
        return self._asked(self._model.weights, self._point(point))

    def locate(self, point: Lengths) -> Floats:
        """The touchable point (3,) [m] that is nearest to a point (3,) [m].

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> touch.locate((1.2, 0.1, 0.1)).round(6).tolist()
        [1.0, 0.1, 0.1]
        """
        triangle, weights, _ = self._touchable.closest(self._point(point))
        return np.asarray(weights @ self.points[self.touchable_triangles[triangle]])

    def plot(
        self, point: Lengths, displacement: Lengths, path: str | os.PathLike[str] | None = None, title: str = ""
    ) -> Figure:
        """Draw the touched organ over its rest shape, with the contact force. `path`: write a PNG file there.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> figure = touch.plot((1, 0.1, 0.1), (0, 0, -0.01), "touch.png")
        """
        from viscera.output.picture import draw

        answer = self(point, displacement)
        arrow = (answer.contact_point + self._push(displacement), answer.force)
        return draw(self.mesh.points, self.mesh.surface, answer.displacement, force=arrow, title=title, path=path)

    def _picture(self) -> Figure:
        from viscera.output.picture import draw_rest

        mesh = self.mesh
        none = np.empty(0, dtype=np.uint32)
        return draw_rest(mesh.points, mesh.surface, fixed=none, parts={"touchable": self.touchable_triangles})

    def view(self, name: str = "Organ", height: int = 560) -> Any:
        """Show the touchable organ in a notebook (`pip install anywidget`); elsewhere, use `viscera view`.

        name: text above the organ; height: of the view, in pixels.

        The widget works both ways. `widget.touch(point, displacement)` [m] moves the organ in the notebook, and
        `widget.release()` lets go. `widget.point`, `widget.displacement`, `widget.force` and `widget.is_trusted` follow
        every touch, made from Python or on the page, and are None without a touch. `widget.observe(handler, "force")`
        calls a handler at each change. A saved notebook keeps a picture.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> widget = touch.view("Beam", height=400)
        >>> widget.observe(lambda change: print(f"{change.new[2]:.3f} N"), "force")
        >>> widget.touch((1, 0.05, 0.1), (0, 0, -0.01))
        -0.494 N
        """
        from viscera.viewer.notebook import PlayedTouch, widget

        return widget(PlayedTouch(self, name), height)

    def _asked(self, question: Callable[..., T], at: Floats, *more: Any) -> T:
        """The core's answer for a point of the surface; its errors also name the nearest touchable point."""
        try:
            return question(at, *more)
        except ValueError as error:
            nearest = ", ".join(f"{1e3 * x:.1f}" for x in self.locate(at))
            raise VisceraError(f"{error}; the nearest touchable point is ({nearest}) mm") from None

    def _point(self, point: Lengths) -> Floats:
        # The mesh is made only when words need it: a haptic loop gives numbers.
        return point_of(point, self.mesh, "contact point") if has_words(point) else place(point, "contact point")

    def _push(self, displacement: Lengths) -> Floats:
        name = "contact displacement"
        return offset(displacement, self.mesh, name) if has_words(displacement) else vector(displacement, name, "m")

    def __repr__(self) -> str:
        parameter = self.metadata.get("parameter")
        at = f", {parameter['name']} = {self.value:g}" if parameter else ""
        return f"Touch({len(self.points)} points, order {self.order}, depth {self.depth:g} m{at})"


def load(path: str | os.PathLike[str]) -> Touch:
    """Read a model file written by `Touch.save`; raises `VisceraError` if it is damaged or inconsistent.

    Files of format version 1 have no checksums, so damage to them may go unnoticed; a warning says so.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> touch = beam.reduce("tip", depth="2%", order=2)
    >>> touch.save("beam.viscera")
    >>> vs.load("beam.viscera")((1, 0.1, 0.1), (0, 0, -0.01)).is_trusted
    True
    """
    name = str(path_of(path, "the model file"))
    refuse_case_file(name, "a model")
    if Path(name).is_dir():
        raise VisceraError(f"{name}: is a folder, not a model")
    if not Path(name).is_file():
        raise VisceraError(f"{name}: no such model file")
    try:
        touch = load_bytes(Path(name).read_bytes())
    except ValueError as error:
        raise VisceraError(f"{name}: {error}") from error
    if touch.metadata["format_version"] == 1:
        log.warning("%s is of format version 1, which has no checksums: damage may go unnoticed; save it anew", name)
    return touch


def load_bytes(data: bytes) -> Touch:
    """Read the bytes of a model file; raises `VisceraError` if they are damaged or inconsistent."""
    touch = Touch(_core.Model.from_bytes(data))
    touch._require_own_notes()
    return touch
