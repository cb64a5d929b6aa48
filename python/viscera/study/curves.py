"""Load-displacement curves of the series at several orders, of its Padé form, and of Newton (figures 6, 13 and 14)."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from viscera import _core
from viscera.cluster import sweep
from viscera.mesh import Floats
from viscera.output.picture import ACCENT, INK, PAPER
from viscera.path import Path
from viscera.study.case import ORDER, Case, radius_of_convergence
from viscera.study.report import Cell, Report

POLYNOMIALS = (1, 2, 3, 4, 5, 6, 10, 15)
RATIONALS = (4, 6, 10, 15)
GOOD = 0.01
"""Relative error of the field up to which a curve counts as right."""
SAFE = {"smallest_step": 1 / 64, "tolerance": 1e-8}
ALARM = "#b00020"
REDS = ("#f3cfb3", "#eeb48f", "#e5946d", "#d66f50", "#bf4a41", "#97303c", "#651c38", "#360f24")


@dataclass(frozen=True, eq=False)
class Curves:
    """Equilibria of one case by several methods, at load factors up to 1."""

    loads: Floats
    series: Floats
    """u_p (order + 1, n, 3) [m] of one expansion about the state of rest."""
    path: Path
    """The same by continuation: expansions one after the other, in the arc length, which passes limit points."""
    newton: list[Floats | None]
    """(n, 3) [m] by Newton with line search and load steps; None if it gave up."""
    statuses: list[str]
    """How Newton ended; "converged past an instability" where it jumped to another branch."""
    in_one_step: list[bool]
    """Whether Newton with full steps converges with the whole load at once."""
    increments: int
    """Equal increments that Newton with full steps completed; there are as many as loads."""
    seconds: dict[str, float]


def compute(case: Case, samples: int, executor: Executor | None = None) -> Curves:
    """All curves of a case at equal load factors. Parts that are not timed run on the executor, if there is one."""
    loads = np.linspace(0.0, 1.0, samples + 1)[1:]
    seconds: dict[str, float] = {}
    began = perf_counter()
    series = case.organ.path(force=case.force, order=ORDER, max_expansions=1).expansions[0].displacement
    seconds["one expansion"] = perf_counter() - began
    began = perf_counter()
    path = case.organ.path(force=case.force, order=ORDER, parameter="arc length", max_expansions=30)
    seconds["all expansions"] = perf_counter() - began
    began = perf_counter()
    newton: list[Floats | None] = []
    statuses: list[str] = []
    state = None
    for a in loads:
        found = case.organ.solve(force=a * case.force, start=state, settings=SAFE)
        statuses.append(found.status)
        if not found.is_converged:
            break
        newton.append(found.displacement)
        state = found
    newton += [None] * (samples - len(newton))
    statuses += [""] * (samples - len(statuses))
    seconds["Newton with line search"] = perf_counter() - began
    tasks = [*((float(a), 1) for a in loads), (1.0, samples)]
    if executor is None:
        *went, increments = (_plain(case, task) for task in tasks)
    else:
        *went, increments = sweep(_plain, case, tasks, executor=executor)
    return Curves(loads, series, path, newton, statuses, [each == 1 for each in went], increments, seconds)


def _plain(case: Case, task: tuple[float, int]) -> int:
    """Number of equal increments that Newton with full steps completes on its way to a load factor."""
    a, increments = task
    return _core.plain_newton(
        case.organ._body, force=a * case.force, increments=increments, max_iterations=50, tolerance=1e-8
    )[1]


def partial_sum(series: Floats, a: float, order: int, is_rational: bool = False) -> Floats:
    """The field (n, 3) [m] of a series (N + 1, n, 3) cut at an order: the polynomial, or its vector Padé form."""
    cut = series[: order + 1]
    if is_rational:
        return _core.vector_pade(cut.reshape(order + 1, -1), a).reshape(cut.shape[1:])
    return np.asarray(np.tensordot(a ** np.arange(order + 1.0), cut, axes=1))


def report(page: Report, case: Case, curves: Curves, figure: str) -> dict[str, Any]:
    """The curves as figure and tables, where Newton fails, and the error of each order."""
    columns = _columns(case, curves)
    page.figure(
        f"curves_{case.key}",
        _plot(case, curves, columns),
        f"{case.law}: displacement of the loaded node ({figure}); Padé forms as far as neighbouring orders agree.",
    )
    rows: list[list[Cell]] = [list(row) for row in zip(*columns.values(), strict=True)]
    page.table(f"curves_{case.key}", list(columns), rows, f"{case.law}: the curves [mm].")
    good = _report_errors(page, case, curves)
    loads, radius = len(curves.loads), radius_of_convergence(curves.series)
    at_once = _largest_run(curves.in_one_step, curves.loads)
    increments = curves.increments / loads
    safe = sum(u is not None for u in curves.newton) / loads
    reached = curves.path.curve(20)[0]
    continued, limit = float(min(1.0, reached.max())), _first_maximum(reached)
    expansions = len(curves.path.expansions)
    rows = [
        ["Newton, full steps, whole load at once", at_once],
        [f"Newton, full steps, {loads} equal increments", increments],
        ["Newton, line search and load steps", safe],
        [f"series of order {ORDER}, continued in the arc length ({expansions} tangents)", continued],
        ["the same, first limit point", "none" if limit is None else limit],
        [f"series of order {ORDER}, one tangent, estimated radius of convergence", radius],
    ]
    caption = f"{case.law}: largest load factor that each solver reached; a = 1 is {case.load:.4g} N."
    page.table(f"reach_{case.key}", ("solver", "load factor reached"), rows, caption)
    page.text("Wall time: " + ", ".join(f"{name} {time:.2f} s" for name, time in curves.seconds.items()) + ".")
    return {
        "load": case.load,
        "full_load_at_once_reaches": at_once,
        "equal_increments_reach": increments,
        "safe_newton_reaches": safe,
        "continuation_reaches": continued,
        "limit_point": limit,
        "expansions": expansions,
        "radius": radius,
        "good_up_to": good,
        "seconds": curves.seconds,
    }


def _columns(case: Case, curves: Curves) -> dict[str, list[Cell]]:
    def along(u: Floats | None) -> Cell:
        return "" if u is None else 1e3 * float(u[case.node] @ case.direction)

    columns: dict[str, list[Cell]] = {"load factor": curves.loads.tolist()}
    for order in POLYNOMIALS:
        columns[f"order {order}"] = [along(partial_sum(curves.series, a, order)) for a in curves.loads]
    for order in RATIONALS:
        columns[f"Padé {order}"] = [along(partial_sum(curves.series, a, order, True)) for a in curves.loads]
    columns["Newton"] = [along(u) for u in curves.newton]
    columns["status of Newton"] = list(curves.statuses)
    columns["Newton with full steps converges"] = [str(ok) for ok in curves.in_one_step]
    return columns


def _report_errors(page: Report, case: Case, curves: Curves) -> dict[str, float]:
    """The error of the field by order and load; the largest load up to which each order is within `GOOD`."""
    rows: list[list[Cell]] = []
    good: dict[str, float] = {}
    for label, orders, is_rational in (("order", POLYNOMIALS, False), ("Padé", RATIONALS, True)):
        for order in orders:
            errors = [
                _relative(partial_sum(curves.series, a, order, is_rational), exact)
                for a, exact in zip(curves.loads, curves.newton, strict=True)
                if exact is not None
            ]
            good[f"{label} {order}"] = _largest_run([error < GOOD for error in errors], curves.loads)
            rows.append(
                [f"{label} {order}", good[f"{label} {order}"], *errors, *[""] * (len(curves.loads) - len(errors))]
            )
    header = ["sum", f"within {GOOD:.0%} up to", *(f"a = {a:.3g}" for a in curves.loads)]
    caption = f"{case.law}: error of the displacement of all nodes against Newton, |u - u_FE| / |u_FE|."
    page.table(f"errors_{case.key}", header, rows, caption)
    return good


def _largest_run(is_good: list[bool], loads: Floats) -> float:
    """The last load before the first that is not good."""
    count = next((k for k, good in enumerate(is_good) if not good), len(is_good))
    return float(loads[count - 1]) if count else 0.0


def _first_maximum(loads: Floats) -> float | None:
    """The load factor at which a growing load begins to fall, a limit point; None without one."""
    falls = np.flatnonzero(np.diff(loads) < -1e-9)
    return float(loads[falls[0]]) if len(falls) else None


def _relative(u: Floats, exact: Floats) -> float:
    return float(np.linalg.norm(u - exact) / np.linalg.norm(exact))


def _plot(case: Case, curves: Curves, columns: dict[str, list[Cell]]) -> Figure:
    figure = Figure(figsize=(9.0, 5.5), dpi=150, facecolor=PAPER, layout="constrained")
    FigureCanvasAgg(figure)
    plot = figure.add_subplot()
    loads = [0.0, *curves.loads.tolist()]
    for colour, order in zip(REDS, POLYNOMIALS, strict=True):
        plot.plot(loads, _numbers(columns[f"order {order}"]), color=colour, linewidth=1.5, label=f"order {order}")
    for width, order in zip((0.7, 1.0, 1.4, 1.9), RATIONALS, strict=True):
        end = 1 + _agreeing(case, curves, order)
        along = _numbers(columns[f"Padé {order}"])[:end]
        plot.plot(loads[:end], along, "--", color=ACCENT, linewidth=width, label=f"Padé {order}")
    reached, fields = curves.path.curve(8)
    along = 1e3 * fields[:, case.node] @ case.direction
    plot.plot(reached, along, color=INK, linewidth=1.0, label=f"order {ORDER}, continued")
    newton = _numbers(columns["Newton"])[1:]
    converges = np.array(curves.in_one_step)
    plot.plot(curves.loads, newton, "o", color=INK, markersize=4.5, zorder=5, label="Newton, safeguarded")
    if not converges.all():
        failed = curves.loads[~converges], newton[~converges]
        plot.plot(*failed, "o", color=ALARM, markersize=4.5, zorder=6, label="  where full steps fail")
    if curves.increments < len(curves.loads):
        stop = curves.increments / len(curves.loads)
        plot.axvline(stop, color=ALARM, linewidth=0.9, linestyle=":", label="equal increments fail beyond")
    highest = 1.35 * float(np.nanmax([*along, *newton]))
    plot.set_xlim(0.0, 1.02)
    plot.set_ylim(0.0, highest)
    plot.set_xlabel(f"load factor a (1 is {case.load:.3g} N)")
    plot.set_ylabel("displacement along the load [mm]")
    plot.set_title(case.law, loc="left", color=INK, fontsize=11)
    plot.spines[["top", "right"]].set_visible(False)
    plot.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _agreeing(case: Case, curves: Curves, order: int) -> int:
    """Number of loads up to which the Padé forms of neighbouring orders agree to a tenth; a pole lies beyond."""
    for index, a in enumerate(curves.loads):
        pair = (partial_sum(curves.series, a, p, True)[case.node] for p in (order, order - 1))
        value, lower = (float(u @ case.direction) for u in pair)
        if abs(value - lower) > 0.1 * abs(value):
            return index
    return len(curves.loads)


def _numbers(cells: list[Cell]) -> Floats:
    """The cells as numbers, with 0 first for no load; an empty cell is NaN, which leaves a gap in the curve."""
    return np.array([0.0, *(float("nan") if cell == "" else float(cell) for cell in cells)])
