"""Several touches at once: a hyper-reduced Galerkin model over the series of single touches (docs/two-fingers.md)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from time import sleep
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh
from viscera.output import state as statefile
from viscera.progress import shown
from viscera.quantity import Number, Whole, numbers_of, refused
from viscera.reduced.shape import ReducedShape
from viscera.sealed import read_only
from viscera.select import Lengths, has_words, length, offset, place
from viscera.select import point as point_of

if TYPE_CHECKING:
    from viscera.reduced.touch import Touch

BUDGET = Number("s", low=0.0, high=1e19)
"""As many seconds as the clock of the core can count."""
TOLERANCE = Number(above=0, below=1)
NOT_COPIED = (
    "a grasp, what makes it and its answers can be neither copied nor pickled; keep the touch, or its file, and an "
    "array such as answer.displacement, and take hold again with touch.galerkin().grasp(points)"
)
Touches = Sequence[tuple[ArrayLike, ArrayLike]] | Floats
"""For each touch its contact point (3,) at rest [m] and its displacement (3,) [m]."""


class GalerkinAnswer(ReducedShape):
    """The answer of a hyper-reduced model.

    The displacement field and the error estimate are computed on first access, since a haptic loop needs neither.
    """

    def __init__(self, held: _core.GalerkinAnswer, grasp: HyperReducedModel) -> None:
        self._held, self._grasp, self._model = held, grasp, grasp._touch
        facts = held.facts
        self.force: Floats = facts["force"]
        """Force (k, 3) [N] of each tool on the organ."""
        self.stiffness: Floats | None = facts.get("stiffness")
        """Derivative (3 k, 3 k) [N/m] of the forces with respect to the displacements; None with `stiffness=False`, and
        where the search has not converged (see `status`), since it belongs to an equilibrium."""
        self.energy: float = facts["energy"]
        """Reduced strain energy [J]."""
        self.status: str = facts["status"]
        """How the search for equilibrium ended: "converged", "step too small", "too many iterations", "out of time"."""
        self.is_converged: bool = facts["is_converged"]
        self.smallest_jacobian: float = facts["smallest_jacobian"]
        """Smallest volume ratio of a sampled cell; below zero the cell is inverted."""
        self.iterations: int = facts["iterations"]
        """Number of Newton steps."""
        self.tangents: int = facts["tangents"]
        """Number of tangents that were evaluated for them."""
        self.seconds: float = facts["seconds"]
        """Time of the search [s]."""
        self._seal()

    def __reduce__(self) -> NoReturn:
        """For pickle and copy: refused, as it computes its field from the grasp when it is asked for."""
        raise VisceraError(NOT_COPIED)

    @cached_property
    def displacement(self) -> Floats:
        """Displacement of all nodes (n, 3) [m]."""
        return read_only(self._held.displacement())

    def _doubt(self) -> str:
        return "" if self.is_converged else statefile.NOT_CONVERGED

    def _touched(self) -> Indices:
        return np.concatenate([patch.nodes for patch in self._grasp.patches])

    def _solved(self) -> str:
        return "touch.organ().solve(displacement=dict(zip(grasp.patches, displacements)))"

    @property
    def error_estimate(self) -> float:
        """Estimated error of the forces, relative to their norm over all contacts; at most 1.

        It is the distance to the forces to which two Newton steps of the full-order model lead, and how far these have
        yet to go (docs/two-fingers.md).
        """
        return self._assessment[0]

    @property
    def shape_error_estimate(self) -> float:
        """Estimated error of the displacement field, relative to its norm, by the same steps; at most 1."""
        return self._assessment[1]

    @property
    def is_trusted(self) -> bool:
        """Whether the answer has converged within the depth of training, without an inverted cell, is stable, and the
        estimated errors of its forces and its field are within the allowance."""
        return not self.reason

    @property
    def reason(self) -> str:
        """Why the answer is not trusted; empty if it is."""
        return self._assessment[2]

    @cached_property
    def _assessment(self) -> tuple[float, float, str]:
        return self._held.assess()

    def __repr__(self) -> str:
        trust = "trusted" if self.is_trusted else f"not trusted: {self.reason}"
        return f"GalerkinAnswer(force={np.round(self.force, 4).tolist()} N, {trust})"


class HyperReducedModel:
    """Contacts that hold an organ at some points and move it at 1 kHz. Made by `Galerkin.grasp`."""

    def __init__(self, grasp: _core.HyperReducedModel, points: Floats, touch: Touch) -> None:
        self._grasp, self._touch = grasp, touch
        self.points = read_only(points)
        """Contact points (k, 3) at rest [m]."""

    def __reduce__(self) -> NoReturn:
        """For pickle and copy: refused, as it may still be learning, and belongs to its touch."""
        raise VisceraError(NOT_COPIED)

    @property
    def modes(self) -> int:
        """Number of modes."""
        return self._grasp.modes

    @property
    def cells(self) -> int:
        """Number of sampled cells, over which the energy is summed."""
        return self._grasp.cells

    @property
    def snapshots(self) -> int:
        """Number of states solved on the whole organ that the modes contain."""
        return self._grasp.snapshots

    @property
    def seconds(self) -> float:
        """Time from taking hold until the present modes and cells were ready [s]."""
        return self._grasp.seconds

    @property
    def is_training(self) -> bool:
        """Whether snapshots are still being solved in the background. Those that are ready are already in use."""
        return self._grasp.is_training()

    def wait(self) -> None:
        """Wait until training in the background has ended."""
        while self.is_training:
            sleep(0.02)

    def add_snapshot(self) -> bool:
        """Compare the last answer with the nearest equilibrium of the whole organ; add a snapshot if they differ.

        Returns whether a snapshot was added; if so, solve again. The tolerance is that of training. The result is also
        False if no such equilibrium is found; `is_trusted` of the answer says whether it can be relied on. A grasp
        made with `wait=False` does this by itself, at the present position of the tools.
        """
        return self._grasp.add_snapshot()

    def solve(
        self,
        displacements: ArrayLike,
        *,
        from_last: bool = False,
        stiffness: bool = True,
        budget: float | None = None,
    ) -> GalerkinAnswer:
        """Equilibrium with the mean of each patch displaced: minimise W(q) under A q = d.

        displacements: (k, 3) [m], or in words: `[(0, 0, "-10 mm"), ...]`.
        from_last: start from the last solution instead of the superposed series, for a moving hand. This is faster,
            but if there is more than one equilibrium, the answer depends on the path.
        stiffness: whether to compute the stiffness, which takes one more tangent. An answer that has not converged has
            none.
        budget: time for the search [s], for loops that must not be late. When it is over, the status is "out of time",
            and the next search with `from_last` continues. At least one step is always taken, with a new tangent if it
            needs one.
        """
        limit = None if budget is None else BUDGET(budget, "budget")
        held = self._grasp.solve(self._displacements(displacements), from_last, stiffness, limit)
        return GalerkinAnswer(held, self)

    def superposed(self, displacements: ArrayLike) -> Floats:
        """Displacement (n, 3) [m] by the superposed series with coupling, from which `solve` may start."""
        return self._grasp.superposed(self._displacements(displacements))

    @property
    def patches(self) -> list[_core.Patch]:
        """The contact patches. A full solution that prescribes their means can be compared with the model."""
        return self._grasp.patches()

    def __repr__(self) -> str:
        return f"HyperReducedModel({len(self.points)} contacts, {self.modes} modes, {self.cells} cells)"

    def _displacements(self, displacements: ArrayLike) -> Floats:
        rows = numbers_of(displacements)
        if rows is None:  # words are read one by one, which a haptic loop need not wait for
            rows = self._in_words(displacements)
        if rows.shape != self.points.shape:
            raise VisceraError(
                f"displacements have shape {rows.shape}; one (3,) for each of the {len(self.points)} contacts is needed"
            )
        return rows

    def _in_words(self, displacements: ArrayLike) -> Floats:
        given = displacements.tolist() if isinstance(displacements, np.ndarray) else displacements
        if not isinstance(given, list | tuple):
            raise refused("displacements", f"(x, y, z) [m] for each of the {len(self.points)} contacts", displacements)
        mesh = self._touch.mesh
        return np.array([offset(row, mesh, f"the displacement of contact {k}") for k, row in enumerate(given)])


class Galerkin:
    """The model of several touches at once. Made by `Touch.galerkin`.

    `grasp` makes a basis from the fields of some contacts and chooses a few weighted cells. That takes less than a
    second without snapshots and some seconds with them. `HyperReducedModel.solve` then answers any displacement of
    the contacts, a thousand times a second. Sampling follows Farhat, Avery, Chapman and Cortial, IJNME 98 (2014) 625.
    """

    def __init__(self, touch: Touch, core: _core.Galerkin) -> None:
        self.touch = touch
        """The series model of single touches."""
        self._core = core
        self._last: HyperReducedModel | None = None

    def __reduce__(self) -> NoReturn:
        """For pickle and copy: refused, as its grasps may still be learning."""
        raise VisceraError(NOT_COPIED)

    def grasp(self, points: Lengths, *, wait: bool = True) -> HyperReducedModel:
        """Take hold at some points (k, 3) [m] of the touchable surface at rest, in numbers or in words.

        wait: whether to wait for the snapshots. With `wait=False` the grasp answers at once, by the fields of the
        series, and improves while it is in use: snapshots are solved in the background, on all processors but one,
        first in rounds and then at the position of the tools.
        """
        rows = _points(points, self.touch.mesh)
        return HyperReducedModel(self._core.grasp(rows, wait), rows, self.touch)

    def solve(self, touches: Touches, *, stiffness: bool = True) -> GalerkinAnswer:
        """Answer to touches `[(point, displacement), ...]` [m]. The grasp is kept while the points are the same."""
        pairs = _pairs(touches)
        points = np.array([point_of(point, self.touch.mesh, "contact point") for point, _ in pairs])
        pushes = np.array([offset(push, self.touch.mesh, "contact displacement") for _, push in pairs])
        last = self._last  # another thread may take hold elsewhere meanwhile
        if last is None or not np.array_equal(last.points, points):
            self._last = last = self.grasp(points)
        return last.solve(pushes, stiffness=stiffness)

    def __repr__(self) -> str:
        return f"Galerkin({self.touch!r})"


def _points(points: Lengths, mesh: Mesh) -> Floats:
    """Contact points (k, 3) [m] from numbers or words; a single one may stand alone."""
    numbers = numbers_of(points)
    if numbers is None:
        return _points_in_words(points, mesh)
    if numbers.shape[-1:] != (3,) or numbers.ndim > 2:
        raise VisceraError(f"contact points have shape {numbers.shape}; they must be (k, 3)")
    if len(numbers) == 0:
        raise VisceraError("no contact; give at least one point of the touchable surface")
    return np.array([place(row, f"contact point {k}") for k, row in enumerate(numbers.reshape(-1, 3))])


def _points_in_words(points: Lengths, mesh: Mesh) -> Floats:
    given = points.tolist() if isinstance(points, np.ndarray) else points
    rows = [given] if _is_a_point(given) else given
    if not isinstance(rows, list | tuple) or not any(has_words(row) for row in rows):
        raise refused("contact points", "(k, 3) [m]", points)
    return np.array([point_of(row, mesh, f"contact point {k}") for k, row in enumerate(rows)])


def _is_a_point(words: Any) -> bool:
    """Whether words are one point, such as "(100, 50, 80) mm" or ["10 cm", 0.05, "80%"], and not a list of points."""
    if isinstance(words, str):
        return True
    return has_words(words) and not any("," in part for part in words if isinstance(part, str))


def _pairs(touches: Touches) -> list[tuple[ArrayLike, ArrayLike]]:
    try:
        pairs = [(point, push) for point, push in touches]
    except (TypeError, ValueError):
        raise refused("touches", "pairs (point, displacement)", touches) from None
    if not pairs:
        raise VisceraError("no touch; give at least one (point, displacement)")
    return pairs


SNAPSHOTS = Whole(0, 200)
"""Solutions of the full organ for a grasp, as many as the core takes."""


class Depth(Number):
    """Largest displacement of a contact in training, below the diagonal of the organ.

    >>> Depth(1.0392)(5.0, "depth")
    Traceback (most recent call last):
    viscera.errors.VisceraError: depth must be above 0 and below 1.0392 m, the diagonal of the organ, got 5.0
    """

    def __init__(self, diagonal: float) -> None:
        super().__init__("m", above=0.0, below=diagonal)

    def __str__(self) -> str:
        return f"above 0 and below {self.below:.5g} m, the diagonal of the organ"


@shown
def galerkin(touch: Touch, order: int, tolerance: float, depth: float | str | None, snapshots: int) -> Galerkin:
    """The model of `Touch.galerkin`."""
    diagonal = touch.mesh.diagonal  # a model without cells is refused
    order, tolerance = Whole(1, touch.order)(order, "order"), TOLERANCE(tolerance, "tolerance")
    core = _core.Galerkin(
        touch._model,
        order=order,
        tolerance=tolerance,
        depth=touch.depth if depth is None else length(depth, diagonal, "depth", Depth(diagonal)),
        snapshots=SNAPSHOTS(snapshots, "snapshots"),
    )
    return Galerkin(touch, core)
