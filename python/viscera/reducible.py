"""The models of an organ that answer a load anywhere on its surface: the reduced model, and paper A's."""

from __future__ import annotations

import json
import logging
import os
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from viscera import _core, defaults, gpu
from viscera.boundary.holding import AT_REST
from viscera.errors import VisceraError
from viscera.law import StrainEnergy
from viscera.mesh import Floats, Indices, Where
from viscera.pgd import Pgd, separate
from viscera.progress import Progress, shown
from viscera.quantity import Choice, Flag, Number, Whole, refused
from viscera.reduced.checkpoint import Batches, Checkpoint, fingerprint
from viscera.reduced.notes import notes
from viscera.reduced.preload import preload_of
from viscera.reduced.touch import Touch
from viscera.reduced.vary import Vary
from viscera.select import length
from viscera.state import State
from viscera.statics import TOLERANCE
from viscera.supported import Supported

log = logging.getLogger("viscera")

ORDER = Whole(2, 8)
MEMORY = Number("bytes", above=0)
SOLVER = Choice(("cholesky", "gpu"))


class Reducible(Supported):
    """What is held, by its response to a touch at every place."""

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
        memory: float = defaults.MEMORY,
        solver: str = "cholesky",
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
            a tenth of the diagonal. Below half the mean edge of the surface it is taken with a warning, as in `patch`.
        depth: largest displacement [m] of a touch, given in the same way; by default a tenth of the diagonal.
        order: total order of the series in the three components of the contact displacement d, 2 to 8.
        tolerance: relative error of the compressed field at full depth, at the worst position, root mean square over
            directions.
        pade: sum the orders in their vector Padé form, which reaches deeper than the polynomial.
        memory: what the positions in progress may take [bytes]; organ, factor and finished positions come on top, and
            the check with a factor for each thread. Where it is small, fewer threads work at a time, down to one; the
            model is the same.
        solver: "cholesky"; or "gpu": the right-hand sides of the series come from the graphics processor, in single
            precision (docs/gpu.md), and the processor solves and compresses. What the device has no kernels for, the
            processor computes, with a warning.
        start: a stable equilibrium under dead loads, which remain during the touches; by default rest. Contact points,
            patches and lengths are then those of the loaded shape; displacements and forces are what the touch adds.
        vary: a parameter for which the model covers a range of values; `Touch.at` sets it.
        checkpoint: a file that keeps finished batches of positions until `Touch.save` has written the model, and then
            removes it. Before that the same call continues from there, after an interruption or where the model could
            not be written. If the file belongs to another case, the work starts again, with a warning.
        executor: a `concurrent.futures.Executor` whose workers solve the batches: processes, Dask or MPI
            (docs/cluster.md). On one kind of processor, the model is the same bit by bit for any number of workers.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> touch((1, 0.1, 0.1), (0, 0, -0.01)).force.round(3).tolist()
        [0.242, -0.034, -0.498]
        """
        radius, depth, vary = self._sizes(radius, depth, vary)
        order, tolerance, pade = ORDER(order, "order"), TOLERANCE(tolerance, "tolerance"), Flag()(pade, "pade")
        memory = MEMORY(memory, "memory")
        on_gpu = SOLVER(solver, "solver") == "gpu"
        if on_gpu and executor is not None:
            raise VisceraError('the workers of an executor have solver="cholesky"; leave one of the two out')
        if on_gpu:
            gpu.load()
        if start is not None and not isinstance(start, State):
            raise refused("the state to reduce about", "a State, as solve returns it", start)
        self._require_series()
        self._require_linear_ties()
        nodes = self.touchable(touchable, radius)
        narrowest = vary.low if vary is not None and vary.name == "radius" else radius
        self._warn_if_narrow(float(narrowest), nodes)
        self._require_held(AT_REST)
        organ, family = (self._organ, None) if vary is None else vary.family(self._organ, radius)
        if start is not None and organ.element != self.element:
            raise VisceraError(
                f"the range of poisson asks for the element {organ.element!r}, and the state to reduce about was found "
                f"with {self.element!r}; make the organ with element={organ.element!r}"
            )
        preload = None if start is None else preload_of(self._organ, start)
        numbers: dict[str, Any] = {
            "radius": radius,
            "depth": depth,
            "order": order,
            "tolerance": tolerance,
            "pade": pade,
        }
        settings = {"touchable": nodes, **numbers, "memory": memory, "preload": preload}
        words = {**numbers, "solver": "gpu"} if on_gpu else numbers
        keeping = nullcontext() if checkpoint is None else organ._batches(checkpoint, nodes, preload, words, family)
        with keeping as kept:
            batches: _core.Batches | None = kept
            if executor is not None:
                from viscera.reduced.offline import Finished, Offline

                offline = Offline(organ, vary, settings)
                batches = Finished(offline.batches(executor, kept, progress))
            model, fault = organ._body.reduce(
                **settings,
                family=family,
                metadata=json.dumps(notes(self.mesh, start)),
                on_progress=progress or (lambda done, total, stage: None),  # a callback lets Ctrl-C through
                batches=batches,
                on_gpu=on_gpu,
            )
        gpu.report(fault)
        touch = Touch(model, kept)
        if vary is not None:
            _warn_if_coarse(vary, touch)
        return touch

    def _sizes(
        self, radius: float | str | None, depth: float | str | None, vary: Vary | None
    ) -> tuple[float, float, Vary | None]:
        """Radius and depth [m] of a reduction, and its range in numbers.

        Raises `VisceraError` for what no touch can have, such as a length above the organ's diagonal.
        """
        if vary is not None and not isinstance(vary, Vary):
            raise refused("vary", 'a viscera.Vary, such as Vary("young", 1e3, 1e5)', vary)
        whole = self.mesh.diagonal
        metres = self._length("radius", defaults.RADIUS_FRACTION * whole if radius is None else radius)
        deepest = self._length("depth", defaults.DEPTH_FRACTION * whole if depth is None else depth)
        return metres, deepest, None if vary is None else vary.on(self.mesh)

    def _batches(
        self,
        checkpoint: Checkpoint | str | os.PathLike[str],
        nodes: Indices,
        preload: Floats | None,
        settings: dict[str, Any],
        family: dict[str, Any] | None,
    ) -> AbstractContextManager[Batches]:
        """The kept batches of this reduction."""
        keeper = checkpoint if isinstance(checkpoint, Checkpoint) else Checkpoint(checkpoint)
        words = {"law": self.law.name, "element": self.element, **settings}
        if family is not None:
            members = [[value, radius] for value, _, radius in family["members"]]
            words["family"] = [family["name"], family["value"], family["cells"], members]
        rest = np.empty(0) if preload is None else preload
        arrays = [self.mesh.points, self.mesh.cells, self.law.parameters, self.fixed, nodes, rest]
        arrays += self._ties.arrays if self.supports else ()
        return keeper.batches(fingerprint(arrays, words))

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
        self._require_series()
        self._require_linear_ties()
        order = Whole(1, 15)(order, "order")
        max_terms = Whole(1, 10_000)(max_terms, "max_terms")
        max_iterations = Whole(1, 10_000)(max_iterations, "max_iterations")
        load, stagnation = Number("N")(load, "load"), TOLERANCE(stagnation, "stagnation")
        radius = length(radius, self.mesh.diagonal, "radius")
        self._require_held(AT_REST)
        rules = {"max_terms": max_terms, "stagnation": stagnation, "max_iterations": max_iterations}
        return separate(
            self._organ,
            self.touchable(touchable),
            load=load,
            radius=radius,
            order=order,
            enrichment=None if tolerance is None else {"tolerance": TOLERANCE(tolerance, "tolerance"), **rules},
            progress=progress,
        )

    def _require_series(self) -> None:
        """Raises for a law without a power series about rest."""
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


def _warn_if_coarse(vary: Vary, touch: Touch) -> None:
    """A warning where interpolation over the parameter alone is worse than an answer may be: at any depth that the
    model has, or at those that are shallow."""
    error = float(touch.metadata["errors"]["parameter"])
    depths, allowed = np.array(sorted(defaults.ALLOWED_ERROR.items())).T
    if error <= allowed[0]:
        return
    share = float(np.interp(error, allowed, depths))  # of the diagonal, from where on as much is allowed
    least = share * touch.mesh.diagonal
    if error > allowed[-1] or least > touch.depth:
        consequence = "the model trusts none"
    else:
        consequence = (
            f"the model trusts none at a depth below {1e3 * least:.3g} mm, {100 * share:.2g} % of the diagonal"
        )
    log.warning(
        "between the %d values of %s that were solved, answers are up to %.2g %% off, so that %s; give Vary more "
        "nodes, or a narrower range",
        vary.nodes,
        vary.name,
        100 * error,
        consequence,
    )
