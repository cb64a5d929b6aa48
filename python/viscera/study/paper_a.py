"""What the studies of paper A share: load-displacement curves, modes, routes by tolerance, errors, on-line rate.

Numbers of figures are those of Niroomandi, Alfaro, González, Cueto and Chinesta, IJNME 96 (2013) 129. The paper gives no
geometry, mesh or load of its examples, so these are the project's own cases; what is reproduced is its claims.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from viscera._core import vector_pade
from viscera.mesh import Floats, Indices
from viscera.organ import Organ
from viscera.pgd import Pgd, error_analysis
from viscera.picture import ACCENT, INK, PAPER, draw_panels
from viscera.study.report import Cell, Report

Say = Callable[[str], None]

ORDER = 15
"""Of the single expansion from which the curves of all lower orders are cut."""
POLYNOMIALS = (1, 2, 3, 4, 5, 6, 10, 15)
RATIONALS = (4, 6, 10, 15)
ONE_STEP = {"max_backtracks": 0, "smallest_step": 0.9}
"""Newton as of old: the whole load at once, full steps, no line search."""
SHOWN_PAIRS = (1, 2, 3, 20)
SHOWN_ORDERS = (1, 4)
PGD_ORDER = 4


@dataclass(frozen=True)
class Case:
    """An organ of one law under a load at one position, and the positions of its separated series."""

    key: str
    """Of its files: svk or neo_hookean."""
    law: str
    organ: Organ
    positions: Indices
    node: int
    """The loaded position of the curves."""
    load: float
    """At a = 1 [N], pushing in."""
    view: tuple[float, float]

    def force(self) -> Floats:
        """The nodal forces (n, 3) [N] at a = 1."""
        return self.organ.pgd(self.positions, load=self.load, order=1, max_terms=1).force(self.node)

    def separate(self, tolerance: float | None, **settings: Any) -> Pgd:
        """The separated series of all positions; None solves each of them."""
        order = settings.pop("order", PGD_ORDER)
        return self.organ.pgd(self.positions, load=self.load, order=order, tolerance=tolerance, **settings)


@dataclass(frozen=True)
class Curves:
    """Displacements at the loaded node [m] over load factors, by what computed them; NaN where it failed."""

    loads: Floats
    series: Floats
    """u_p (order + 1, n, 3) [m]."""
    newton: list[Floats | None]
    """Equilibria (n, 3) [m] of Newton with line search and load steps."""
    one_step: list[bool]
    """Where Newton of old converges."""
    seconds: dict[str, float]
    reached: float
    """Load factor reached by continuation of the series, and its number of expansions."""
    expansions: int
    radius: float
    """Estimated radius of convergence of the series, |u_N-1| / |u_N|."""


def sum_series(series: Floats, a: float, order: int, is_rational: bool = False) -> Floats:
    """The field (n, 3) [m] of a series (order + 1, n, 3) cut at an order, as a polynomial or in its Padé form."""
    cut = series[: order + 1]
    if is_rational:
        return vector_pade(cut.reshape(order + 1, -1), a).reshape(cut.shape[1:])
    return np.asarray(np.tensordot(a ** np.arange(order + 1.0), cut, axes=1))


def compute_curves(case: Case, samples: int) -> Curves:
    """The series, Newton with and without its safeguards, and the continued series, up to a = 1."""
    force, loads, seconds = case.force(), np.linspace(0.0, 1.0, samples + 1)[1:], {}
    began = perf_counter()
    series = case.organ.path(force=force, order=ORDER, until=1.0, max_expansions=1).expansions[0].displacement
    seconds["series"] = perf_counter() - began
    began = perf_counter()
    path = case.organ.path(force=force, order=ORDER, until=1.0, max_expansions=30)
    seconds["continuation"] = perf_counter() - began
    began = perf_counter()
    newton: list[Floats | None] = []
    state = None
    for a in loads:
        if newton and newton[-1] is None:
            newton.append(None)
            continue
        found = case.organ.solve(force=a * force, start=state, settings={"smallest_step": 1 / 64, "tolerance": 1e-8})
        newton.append(found.displacement if found.is_converged else None)
        state = found if found.is_converged else state
    seconds["newton"] = perf_counter() - began
    one_step = [case.organ.solve(force=a * force, settings=ONE_STEP).is_converged for a in loads]
    norms = np.linalg.norm(series.reshape(ORDER + 1, -1), axis=1)
    reached = float(path.expansions[-1].at(path.expansions[-1].range)[0])
    radius = float((norms[-3] / norms[-1]) ** 0.5)
    return Curves(loads, series, newton, one_step, seconds, reached, len(path.expansions), radius)


def report_curves(report: Report, case: Case, curves: Curves, figures: str) -> dict[str, Any]:
    """The load-displacement curves (figures 6, 13, 14), where Newton fails, and the error of each order by load."""
    direction = case.force()[case.node] / np.linalg.norm(case.force()[case.node])

    def along(u: Floats | None) -> float:
        return float("nan") if u is None else 1e3 * float(u[case.node] @ direction)

    columns: dict[str, list[float]] = {"load factor": curves.loads.tolist()}
    for order in POLYNOMIALS:
        columns[f"order {order}"] = [along(sum_series(curves.series, a, order)) for a in curves.loads]
    for order in RATIONALS:
        columns[f"Padé {order}"] = [along(sum_series(curves.series, a, order, True)) for a in curves.loads]
    columns["Newton"] = [along(u) for u in curves.newton]
    columns["Newton in one step converges"] = [float(ok) for ok in curves.one_step]
    name = f"curves_{case.key}"
    report.figure(name, _plot_curves(columns, case.law), f"Displacement of the loaded node along the load ({figures}).")
    report.table(name, list(columns), _rows(columns), "The curves [mm].")
    failed = [float(a) for a, ok in zip(curves.loads, curves.one_step, strict=True) if not ok]
    missing = [float(a) for a, u in zip(curves.loads, curves.newton, strict=True) if u is None]
    errors = _errors_by_order(report, case, curves)
    report.text(
        f"{case.law}, {case.load:.4g} N at a = 1. Newton in one step without a line search "
        + (f"fails from a = {failed[0]:.3g} on" if failed else "converges at every load")
        + "; with line search and load steps it "
        + (f"fails from a = {missing[0]:.3g} on. " if missing else "reaches a = 1. ")
        + f"The series, continued by {curves.expansions} expansions, reaches a = {curves.reached:.3g}; one expansion "
        f"alone has an estimated radius of convergence of a = {curves.radius:.3g}. "
        + ", ".join(f"{name} {seconds:.2f} s" for name, seconds in curves.seconds.items())
        + "."
    )
    return {
        "one_step_fails_from": failed[0] if failed else None,
        "newton_fails_from": missing[0] if missing else None,
        "continuation_reaches": curves.reached,
        "expansions": curves.expansions,
        "radius": curves.radius,
        **errors,
    }


def _errors_by_order(report: Report, case: Case, curves: Curves) -> dict[str, Any]:
    """Error of the whole field against Newton, by order and load."""
    rows: list[list[Cell]] = []
    for label, orders, is_rational in (("order", POLYNOMIALS, False), ("Padé", RATIONALS, True)):
        for order in orders:
            cells: list[Cell] = [f"{label} {order}"]
            for a, exact in zip(curves.loads, curves.newton, strict=True):
                if exact is None:
                    cells.append("-")
                    continue
                u = sum_series(curves.series, a, order, is_rational)
                cells.append(float(np.linalg.norm(u - exact) / np.linalg.norm(exact)))
            rows.append(cells)
    header = ["terms", *(f"a = {a:.3g}" for a in curves.loads)]
    caption = f"{case.law}: error of the displacement field against Newton, |u - u_FE| / |u_FE|."
    report.table(f"errors_{case.key}", header, rows, caption)
    last_good = {
        str(row[0]): max(
            (float(a) for a, e in zip(curves.loads, row[1:], strict=True) if isinstance(e, float) and e < 0.01),
            default=0.0,
        )
        for row in rows
    }
    return {"one_percent_up_to": last_good}


def _plot_curves(columns: dict[str, list[float]], title: str) -> Figure:
    figure = Figure(figsize=(9.0, 5.5), dpi=150, facecolor=PAPER, layout="constrained")
    FigureCanvasAgg(figure)
    plot = figure.add_subplot()
    loads = np.array([0.0, *columns["load factor"]])
    newton = np.array([0.0, *columns["Newton"]])
    low = ["#f0c9a8", "#e8a783", "#de8062", "#cc5648", "#a93342", "#7f1d3b", "#5b1532", "#3a0d22"]
    for colour, name in zip(low, [n for n in columns if n.startswith("order")], strict=True):
        plot.plot(loads, [0.0, *columns[name]], color=colour, linewidth=1.4, label=name)
    for width, name in zip((0.8, 1.1, 1.5, 2.0), [n for n in columns if n.startswith("Padé")], strict=True):
        plot.plot(loads, [0.0, *columns[name]], "--", color=ACCENT, linewidth=width, label=name)
    plot.plot(loads, newton, "o", color=INK, markersize=4.5, label="Newton FE", zorder=5)
    top = float(np.nanmax([*newton, columns["Padé 15"][0]])) * 1.6
    plot.set_ylim(min(0.0, -0.05 * top), top)
    failed = [a for a, ok in zip(columns["load factor"], columns["Newton in one step converges"], strict=True) if not ok]
    plot.plot(failed, [0.0] * len(failed), "x", color="#b00020", label="Newton in one step fails", clip_on=False)
    missing = [a for a, u in zip(columns["load factor"], columns["Newton"], strict=True) if np.isnan(u)]
    if missing:
        plot.axvspan(missing[0], 1.0, color="#b00020", alpha=0.08, label="Newton with load steps fails")
    plot.set_xlabel("load factor a")
    plot.set_ylabel("displacement along the load [mm]")
    plot.set_title(title, loc="left", color=INK, fontsize=11)
    plot.spines[["top", "right"]].set_visible(False)
    plot.legend(fontsize=8, frameon=False, ncols=2)
    return figure


def report_modes(report: Report, case: Case, model: Pgd) -> None:
    """The modes F_i and G_i on the organ at low and high order (figures 8 to 11)."""
    mesh = case.organ.mesh
    for p in SHOWN_ORDERS:
        order = model.orders[p - 1]
        shown = [i for i in SHOWN_PAIRS if i <= len(order.F)]
        F = {f"F_{i}, order {p}": order.F[i - 1] for i in shown}
        bent = {title: 0.06 * mesh.diagonal * mode / np.abs(mode).max() for title, mode in F.items()}
        vertical = {title: mode[:, 2] / np.linalg.norm(mode, axis=1).max() for title, mode in F.items()}
        picture = draw_panels(
            mesh.points, mesh.surface, vertical, label="vertical part", displacements=bent, is_signed=True, view=case.view
        )
        number = {1: "8", 4: "9"}[p]
        caption = f"Modes in space at order {p}, {case.law}, as deformations and by their vertical part (figure {number})."
        report.figure(f"modes_F_order{p}_{case.key}", picture, caption)
        G = {f"G_{i}, order {p}": 1e3 * model.over_nodes(order.G[i - 1]) for i in shown}
        picture = draw_panels(mesh.points, mesh.surface, G, label="[mm]", is_signed=True, is_common=False, view=case.view)
        number = {1: "10", 4: "11"}[p]
        caption = f"Modes over the load position at order {p}, {case.law} (figure {number})."
        report.figure(f"modes_G_order{p}_{case.key}", picture, caption)


def report_routes(report: Report, case: Case, tolerances: Sequence[float], say: Say) -> tuple[Pgd, Pgd, dict[str, Any]]:
    """Pairs, time and error of the greedy PGD, its projection, and the direct route; the last PGD, and the exact one."""
    say(f"{case.law}: every position solved")
    direct = case.separate(None)
    rows: list[list[Cell]] = [_route("direct", "-", direct, direct, [])]
    greedy = direct
    for tolerance in tolerances:
        say(f"{case.law}: PGD to {tolerance:g}")
        greedy = case.separate(tolerance)
        iterations = [int(order.iterations.sum()) for order in greedy.orders]
        rows.append(_route("PGD", tolerance, greedy, direct, iterations))
        rows.append(_route("projected PGD", tolerance, greedy.project(tolerance), direct, []))
        rows.append(_route("direct, then SVD", tolerance, direct.project(tolerance), direct, []))
    header = ["route", "tolerance"]
    header += [f"pairs, order {p}" for p in range(1, PGD_ORDER + 1)]
    header += ["fixed-point iterations", "off-line seconds"]
    header += [f"error of order {p}" for p in range(1, PGD_ORDER + 1)]
    header += ["mean error at a = 0.5", "worst error at a = 0.5"]
    caption = (
        f"{case.law}, {len(case.positions)} positions, orders 1 to {PGD_ORDER}. Errors against the direct route: of each "
        "order in the norm over all positions, and of the displacement at half the load, mean and worst of the positions."
    )
    report.table(f"routes_{case.key}", header, rows, caption)
    facts = [dict(zip(header, row, strict=True)) for row in rows]
    return greedy, direct, {"routes": facts}


def _route(name: str, tolerance: Cell, model: Pgd, direct: Pgd, iterations: list[int]) -> list[Cell]:
    errors = model.errors(direct, a=0.5)
    by_order = [_order_error(ours.table(), exact.table(), model.weights) for ours, exact in zip(model.orders, direct.orders, strict=True)]
    pairs: list[Cell] = [f"{count} (limit)" if o.is_cut else count for count, o in zip(model.counts, model.orders, strict=True)]
    return [
        name, tolerance, *pairs, sum(iterations) if iterations else "-", model.seconds,
        *by_order, float(errors.mean()), float(errors.max()),
    ]  # fmt: skip


def _order_error(ours: Floats, exact: Floats, weights: Floats) -> float:
    squares = weights @ (ours - exact) ** 2, weights @ exact**2
    return float(np.sqrt(squares[0].sum() / squares[1].sum()))


def report_error_analysis(report: Report, case: Case, model: Pgd, truth: Pgd, terms: Sequence[int]) -> None:
    """Errors over number of pairs, order and load, of the orthogonal modes of the direct route."""
    table = error_analysis(model, truth, terms=terms, loads=(0.25, 0.5))
    rows = [list(row) for row in zip(*(column.tolist() for column in table.values()), strict=True)]
    caption = f"{case.law}: the first pairs of each order (direct, then SVD) against the direct route, all positions."
    report.table(f"error_analysis_{case.key}", list(table), rows, caption)


def report_rate(report: Report, case: Case, models: dict[str, Pgd], seconds: float) -> dict[str, Any]:
    """On-line evaluations of the whole field per second, at random places between the positions."""
    triangles = case.organ.mesh.surface
    triangles = triangles[np.isin(triangles, case.positions).all(axis=1)]
    random = np.random.default_rng(0)
    rows: list[list[Cell]] = []
    for name, model in models.items():
        model.displacement(case.node)
        times: list[float] = []
        while sum(times) < seconds:
            corners = case.organ.mesh.points[triangles[random.integers(len(triangles))]]
            point, a = random.dirichlet(np.ones(3)) @ corners, random.random()
            began = perf_counter()
            model.displacement(point, a)
            times.append(perf_counter() - began)
        numbers = sum(model.counts) * case.organ.mesh.points.size
        median, slowest = float(np.median(times)), float(np.quantile(times, 0.99))
        rows.append([name, sum(model.counts), 8e-6 * numbers, 1.0 / median, 1e6 * median, 1e6 * slowest])
    header = ["model", "pairs", "MB", "evaluations per second", "median [us]", "99th percentile [us]"]
    caption = "On-line: closest point, interpolation over its triangle, and the displacement of every node, from Python."
    report.table(f"rate_{case.key}", header, rows, caption)
    return {"rate": [dict(zip(header, row, strict=True)) for row in rows]}


def vertical_panels(case: Case, fields: dict[str, Floats]) -> Figure:
    """The vertical displacement [mm] of some fields (n, 3) [m] on the deformed organ (figure 7)."""
    mesh = case.organ.mesh
    vertical = {title: 1e3 * u[:, 2] for title, u in fields.items()}
    return draw_panels(
        mesh.points, mesh.surface, vertical, label="vertical displacement [mm]", displacements=fields, is_signed=True,
        view=case.view,
    )  # fmt: skip


def _rows(columns: dict[str, list[float]]) -> list[list[Cell]]:
    return [list(row) for row in zip(*columns.values(), strict=True)]
