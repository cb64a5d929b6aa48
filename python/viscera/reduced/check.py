"""The reduced model compared with full solutions by Newton's method, at random touches that it was not built from.

Contact points are drawn uniformly over the touchable surface (between nodes too), displacement directions uniformly
over the sphere (pulls included), and each touch is compared at every depth. The full solution prescribes the same
patch mean as the model. If the model has a preload, the full solution continues from there, with the dead load acting.
Errors are relative to the norm of the displacement and of the force that the touch adds.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from threading import Event
from time import perf_counter
from typing import Any

import numpy as np

from viscera import _core, defaults
from viscera.display import Tabled
from viscera.errors import VisceraError
from viscera.mesh import Floats
from viscera.progress import Progress, shown
from viscera.quantity import Whole, refused
from viscera.reduced.touch import Touch
from viscera.select import length
from viscera.state import State


@dataclass(frozen=True)
class Row:
    """One touch at one depth; the errors are None if the full solution did not converge."""

    point: list[float]
    """Contact point (3,) on the untouched surface [m]."""
    displacement: list[float]
    """Contact displacement (3,) [m]."""
    depth_fraction: float
    """Its length in units of the bounding-box diagonal."""
    displacement_error: float | None
    """|u - u_full| / |u_full| over all nodes."""
    force_error: float | None
    """|F - F_full| / |F_full|."""
    estimate: float
    """The model's error estimate of the field or of the force, whichever is larger."""
    is_trusted: bool
    """Whether the model trusts both."""
    is_converged: bool
    """Whether the full solution converged, so that there is something to compare with."""
    status: str
    """Status of the full solution."""

    @property
    def is_within_limits(self) -> bool:
        """False only if the error of a trusted answer is larger than allowed at its depth."""
        if not self.is_trusted or self.displacement_error is None or self.force_error is None:
            return True
        return max(self.displacement_error, self.force_error) <= allowed_error(self.depth_fraction)


@dataclass(frozen=True)
class Summary:
    """The rows of one depth, or of all."""

    depth_fraction: float | None
    """None for all depths together."""
    touches: int
    converged: int
    """Touches whose full solution converged. The errors below are of these."""
    trusted: int
    """Those among them whose answer the model trusts."""
    worst: dict[str, float | None]
    median: dict[str, float | None]
    worst_trusted: dict[str, float | None]
    median_trusted: dict[str, float | None]


@dataclass(frozen=True, eq=False)
class Check(Tabled):
    """All rows, and their summary by depth."""

    rows: list[Row]
    depths: list[Summary]
    overall: Summary
    microseconds_force: float
    """Median wall time of one answer with force and stiffness, called from Python."""
    microseconds_field: float
    """The same with the displacement of every node."""
    seconds: float

    @property
    def trusted_share(self) -> float:
        """Share of all answers that the model trusts."""
        return sum(row.is_trusted for row in self.rows) / len(self.rows)

    @property
    def verdict(self) -> str:
        """`failed` if a trusted answer is beyond its limit; `passed` if none is and enough were compared.

        `nothing could be checked` if no trusted answer could be compared, or most full solutions did not converge.
        """
        if not all(row.is_within_limits for row in self.rows):
            return "failed"
        is_evidence = self.overall.trusted > 0 and 2 * self.overall.converged >= self.overall.touches
        return "passed" if is_evidence else "nothing could be checked"

    @property
    def is_passed(self) -> bool:
        """Whether the verdict is `passed`."""
        return self.verdict == "passed"

    def to_json(self) -> dict[str, Any]:
        """The keys of `viscera check --json`."""
        return {
            "touches": [asdict(row) for row in self.rows],
            "worst": self.overall.worst,
            "median": self.overall.median,
            "depths": [asdict(summary) for summary in self.depths],
            "trusted_share": self.trusted_share,
            "microseconds_force": self.microseconds_force,
            "microseconds_field": self.microseconds_field,
        }

    def table(self) -> str:
        """The errors by depth as aligned text, of all answers and of the trusted ones, in percent."""
        head = [
            "depth    answers        | displacement error  | force error         | estimate",
            "                        |   median      worst |   median      worst |   median      worst",
        ]
        return "\n".join(head + [line for summary in self.depths for line in _lines(summary)])

    def __repr__(self) -> str:
        return f"Check({self.verdict}, {len(self.rows)} answers, {self.trusted_share:.0%} trusted)"


PATIENCE = {"smallest_step": 1 / 4, "max_iterations": 25, "tolerance": 1e-6}
"""Settings of Newton's method. A residual two orders below the errors to be measured is enough, since iterations near
local instabilities converge slowly. If smaller load steps are needed the organ is collapsing, and a full solution is
expensive and doubtful."""

TOUCHES = Whole(1, 1_000_000)
"""Number of random contacts."""
SEED = Whole(0, 2**32 - 1)
"""Seed of the random contacts."""

MEASURES = ("displacement_error", "force_error", "estimate")


@shown
def check(
    touch: Touch,
    *,
    touches: int = 50,
    seed: int = 0,
    depths: Sequence[float | str] | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Check:
    """Compare the model with full solutions at `touches` random contacts, each at all `depths`.

    depths [m], or in words such as "12 mm" or "5%" of the bounding-box diagonal; by default "5%" and "10%", but at most
        the depth that the model was built for.
    seed: of the random contacts; the same seed gives the same touches.
    executor: a `concurrent.futures.Executor` whose workers solve; by default threads of this process.
    """
    TOUCHES(touches, "touches")
    SEED(seed, "seed")
    began = perf_counter()
    fractions = _depth_fractions(touch, depths)
    random = np.random.default_rng(seed)
    points, directions = surface_points(touch, touches, random), unit_vectors(touches, random)
    asked = _Asked(touch, [fraction * touch.mesh.diagonal for fraction in fractions])
    contacts = list(zip(points, directions, strict=True))
    rows: list[Row] = []

    def report(found: list[Row]) -> None:
        rows.extend(found)
        if progress:
            progress(len(rows), touches * len(fractions), "check against Newton")

    if executor is None:
        asked.on_threads(contacts, report)
    else:
        from viscera.cluster import sweep

        for found in sweep(_Asked.rows, asked, contacts, executor=executor, progress=progress):
            rows += found
    force, field = _microseconds(touch, points, directions * fractions[0] * touch.mesh.diagonal)
    return Check(
        rows=rows,
        depths=[_summary(rows[k :: len(fractions)], fraction) for k, fraction in enumerate(fractions)],
        overall=_summary(rows, None),
        microseconds_force=force,
        microseconds_field=field,
        seconds=perf_counter() - began,
    )


class Full:
    """The full organ of a model, under the model's preload: the reference of a comparison."""

    def __init__(self, touch: Touch) -> None:
        self.organ = touch.organ()
        rest = np.zeros_like(self.organ.mesh.points)
        self.preload: Floats = rest if touch.preload is None else touch.preload
        self.dead_load = self.organ._body.internal_force(self.preload)
        self.dead_load[self.organ.fixed] = 0.0

    def solve(
        self, patch: _core.Patch, push: Floats, start: State | Floats | None = None, progress: Progress | None = None
    ) -> State:
        """Equilibrium with the patch's mean displaced by `push` (3,) [m] from the preload."""
        mean = patch.weights @ self.preload[patch.nodes]
        return self.organ.solve(
            displacement={patch: mean + push},
            force=self.dead_load,
            start=self.preload if start is None else start,
            settings=PATIENCE,
            progress=progress,
        )

    def added(self, state: State) -> Floats:
        """What the touch adds to the displacement (n, 3) [m]."""
        return state.displacement - self.preload


def surface_points(touch: Touch, count: int, random: np.random.Generator) -> Floats:
    """Points (count, 3) [m], uniform over the area of the touchable surface."""
    corners = touch.mesh.points[touch.touchable_triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    chosen = corners[random.choice(len(corners), size=count, p=areas / areas.sum())]
    root, along = np.sqrt(random.random((count, 1))), random.random((count, 1))
    a, b, c = chosen.transpose(1, 0, 2)
    return np.asarray((1.0 - root) * a + root * (1.0 - along) * b + root * along * c)


def unit_vectors(count: int, random: np.random.Generator) -> Floats:
    """Directions (count, 3), uniform over the sphere."""
    vectors = random.standard_normal((count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def allowed_error(depth_fraction: float) -> float:
    """The relative error that a trusted answer may have at a depth."""
    limits = sorted(defaults.ALLOWED_ERROR.items())
    return next((limit for depth, limit in limits if depth_fraction <= depth * (1 + 1e-9)), limits[-1][1])


class _Asked:
    """A model, and the depths [m] at which it is compared with the full organ."""

    def __init__(self, touch: Touch, depths: list[float]) -> None:
        self.touch, self.depths = touch, depths
        self.full = Full(touch)
        self._stop = Event()

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle: a worker makes the full organ itself."""
        return _Asked, (self.touch, self.depths)

    def on_threads(self, contacts: list[tuple[Floats, Floats]], report: Callable[[list[Row]], None]) -> None:
        """The rows of all contacts, on the threads of this process: the core works outside the interpreter's lock."""
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            try:
                for found in pool.map(self.rows, contacts):
                    report(found)
            except BaseException:  # Ctrl-C among them: the solves under way end at their next load step
                self._stop.set()
                pool.shutdown(cancel_futures=True)
                raise

    def rows(self, contact: tuple[Floats, Floats]) -> list[Row]:
        """One contact, in one direction, at all depths, each full solution continuing from the shallower one."""

        def go_on(done: int, total: int, stage: str) -> None:
            if self._stop.is_set():
                raise InterruptedError("the check was stopped")

        touch, (point, direction), rows = self.touch, contact, list[Row]()
        patch, state = touch.patch(point), None
        for depth in self.depths:
            push = depth * direction
            state = self.full.solve(patch, push, start=state, progress=go_on)
            answer, force = touch(point, push), state.reaction(patch)
            is_known = state.is_converged
            rows.append(
                Row(
                    point=point.tolist(),
                    displacement=push.tolist(),
                    depth_fraction=float(np.linalg.norm(push)) / touch.mesh.diagonal,
                    displacement_error=_relative(answer.displacement, self.full.added(state)) if is_known else None,
                    force_error=_relative(answer.force, force) if is_known else None,
                    estimate=max(answer.error_estimate, answer.shape_error_estimate),
                    is_trusted=answer.is_trusted and answer.is_shape_trusted,
                    is_converged=is_known,
                    status=state.status,
                )
            )
            state = state if is_known else None
        return rows


def _depth_fractions(touch: Touch, depths: Iterable[float | str] | None) -> list[float]:
    diagonal = touch.mesh.diagonal
    deepest = touch.depth / diagonal
    is_one = isinstance(depths, str) or (isinstance(depths, np.ndarray) and depths.ndim == 0)
    if is_one or not isinstance(depths, Iterable | None):
        raise refused("depths", "a list of lengths, such as ['5%', '10 mm']", depths)
    if depths is None:
        return sorted({min(fraction, deepest) for fraction in defaults.CHECK_DEPTH_FRACTIONS})
    wanted = sorted({length(depth, diagonal, "depth") / diagonal for depth in depths})
    if not wanted or not all(0.0 < fraction <= deepest * (1 + 1e-9) for fraction in wanted):
        shown = ", ".join(f"{1e3 * fraction * diagonal:.4g}" for fraction in wanted)
        raise VisceraError(
            f"the depths ({shown}) mm must be positive and at most {1e3 * touch.depth:.4g} mm, the model's own depth"
        )
    return wanted


def _relative(value: Floats, truth: Floats) -> float:
    return float(np.linalg.norm(value - truth) / np.linalg.norm(truth))


def _summary(rows: list[Row], depth_fraction: float | None) -> Summary:
    converged = [row for row in rows if row.is_converged]
    trusted = [row for row in converged if row.is_trusted]
    return Summary(
        depth_fraction=depth_fraction,
        touches=len(rows),
        converged=len(converged),
        trusted=len(trusted),
        worst={name: _of(np.max, converged, name) for name in MEASURES},
        median={name: _of(np.median, converged, name) for name in MEASURES},
        worst_trusted={name: _of(np.max, trusted, name) for name in MEASURES},
        median_trusted={name: _of(np.median, trusted, name) for name in MEASURES},
    )


def _of(statistic: Callable[[list[float]], Any], rows: list[Row], name: str) -> float | None:
    return float(statistic([getattr(row, name) for row in rows])) if rows else None


def _lines(summary: Summary) -> list[str]:
    depth = f"{100 * (summary.depth_fraction or 0.0):4.1f} %"
    groups = [
        (depth, summary.converged, "compared", summary.median, summary.worst),
        ("", summary.trusted, "trusted", summary.median_trusted, summary.worst_trusted),
    ]
    return [
        " | ".join(
            [f"{label:7s} {count:4d} {word:9s} ", *(f"{_percent(m[name])}  {_percent(w[name])}" for name in MEASURES)]
        )
        for label, count, word, m, w in groups
    ]


def _percent(value: float | None) -> str:
    return "        -" if value is None else f"{100 * value:8.3f}%"


def _microseconds(touch: Touch, points: Floats, pushes: Floats) -> tuple[float, float]:
    """Median wall time [us] of the force alone and of the whole field, over the checked touches."""
    force, field = [], []
    for point, push in zip(points, pushes, strict=True):
        began = perf_counter()
        answer = touch(point, push)
        force.append(perf_counter() - began)
        _ = answer.displacement
        field.append(perf_counter() - began)
    return 1e6 * float(np.median(force)), 1e6 * float(np.median(field))
