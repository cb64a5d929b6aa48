"""The separated series of a case: modes (figures 8 to 11), routes by tolerance, errors, on-line rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import perf_counter
from typing import Any

import numpy as np

from viscera.mesh import Floats
from viscera.output.picture import draw_panels
from viscera.pgd import Pgd, error_analysis
from viscera.study.case import PGD_ORDER, Case, Say
from viscera.study.report import Cell, Report

SHOWN_PAIRS = (1, 2, 3, 20)
FIGURES = {1: ("8", "10"), 4: ("9", "11")}
"""Numbers of the paper's figures of the modes in space and over the position, by order."""
LOAD = 0.25
"""Load factor at which fields are compared: half the radius of convergence of the series of the curves."""


def report_modes(page: Report, case: Case, say: Say) -> Pgd:
    """Draws F_i and G_i of low and high order, as the enrichment finds them; returns their PGD."""
    say(f"{case.law}: {max(SHOWN_PAIRS)} pairs of each order")
    model, mesh = case.separate(1e-4, max_terms=max(SHOWN_PAIRS)), case.mesh
    for p, (space, position) in FIGURES.items():
        order = model.orders[p - 1]
        shown = [i for i in SHOWN_PAIRS if i <= len(order.F)]
        F = {f"F_{i}": order.F[i - 1] for i in shown}
        bent = {title: 0.08 * mesh.diagonal * mode / np.linalg.norm(mode, axis=1).max() for title, mode in F.items()}
        picture = case.draw_vertical(bent, label="vertical part [mm, scaled]")
        caption = f"{case.law}: modes in space at order {p}, scaled to one size (figure {space})."
        page.figure(f"modes_F_order{p}_{case.key}", picture, caption)
        G = {f"G_{i}": 1e3 * model.over_nodes(order.G[i - 1]) for i in shown}
        picture = draw_panels(
            mesh.points, mesh.surface, G, label="[mm]", is_signed=True, is_common=False, view=case.view
        )
        caption = f"{case.law}: modes over the load position at order {p} (figure {position})."
        page.figure(f"modes_G_order{p}_{case.key}", picture, caption)
    return model


def report_routes(page: Report, case: Case, tolerances: Sequence[float], say: Say) -> tuple[Pgd, Pgd, dict[str, Any]]:
    """Compares pairs, time and error of three routes; returns the last PGD, the exact series, and the rows."""
    say(f"{case.law}: all {len(case.positions)} positions solved")
    direct = case.separate(None)
    found = direct
    rows = [_route("every position solved", "", direct, direct)]
    for tolerance in tolerances:
        say(f"{case.law}: PGD to a tolerance of {tolerance:g}")
        found = case.separate(tolerance)
        rows.append(_route("PGD", tolerance, found, direct))
        rows.append(_route("projected PGD", tolerance, found.project(tolerance), direct))
        rows.append(_route("every position solved, then SVD", tolerance, direct.project(tolerance), direct))
    orders = range(1, PGD_ORDER + 1)
    header = [
        "route", "tolerance", *(f"pairs, order {p}" for p in orders), "fixed-point iterations", "seconds",
        *(f"error, order {p}" for p in orders), "mean error", "worst error",
    ]  # fmt: skip
    caption = (
        f"{case.law}, {len(case.positions)} positions: pairs of modes, off-line time, and error against the series of "
        "every position. The error is that of each order over all positions, and of the displacement at a = 0.25 (mean "
        "and worst position). A star marks orders whose number of pairs was cut at the limit. "
        "The tolerance of a PGD ends its enrichment; that of a projection bounds the error it adds to an order."
    )
    page.table(f"routes_{case.key}", header, rows, caption)
    return found, direct, {"routes": [dict(zip(header, row, strict=True)) for row in rows]}


def _route(name: str, tolerance: Cell, model: Pgd, direct: Pgd) -> list[Cell]:
    pairs: list[Cell] = [f"{len(order.F)}*" if order.is_cut else len(order.F) for order in model.orders]
    iterations = sum(int(order.iterations.sum()) for order in model.orders)
    by_order: list[Cell] = [
        _order_error(order.table(), exact.table(), model.weights)
        for order, exact in zip(model.orders, direct.orders, strict=True)
    ]
    errors = model.errors(direct, a=LOAD)
    ends: list[Cell] = [float(errors.mean()), float(errors.max())]
    return [name, tolerance, *pairs, iterations or "", model.seconds, *by_order, *ends]


def _order_error(ours: Floats, exact: Floats, weights: Floats) -> float:
    """Relative error in the norm (sum_s w_s |u(., s)|^2)^1/2 over all positions."""
    return float(np.sqrt((weights @ (ours - exact) ** 2).sum() / (weights @ exact**2).sum()))


def report_errors(page: Report, case: Case, direct: Pgd, terms: Sequence[int]) -> None:
    """Errors by number of pairs and order for the optimal modes, which are those of the exact series."""
    places = case.positions[:: max(1, len(case.positions) // 40)]
    table = error_analysis(direct.project(0.0), direct, terms=terms, loads=(LOAD,), positions=list(places))
    rows = [list(row) for row in zip(*(column.tolist() for column in table.values()), strict=True)]
    caption = (
        f"{case.law}: the exact series truncated in order and in pairs per order (optimal modes by SVD), "
        f"against order {PGD_ORDER} at {len(places)} positions, at a = 0.25."
    )
    page.table(f"error_analysis_{case.key}", list(table), rows, caption)


def report_rate(page: Report, case: Case, models: Mapping[str, Pgd], seconds: float) -> dict[str, Any]:
    """On-line evaluations of the whole field per second, at random points between the positions."""
    triangles = case.mesh.surface[np.isin(case.mesh.surface, case.positions).all(axis=1)]
    random = np.random.default_rng(0)
    rows: list[list[Cell]] = []
    for name, model in models.items():
        model.displacement(int(case.positions[0]))
        times: list[float] = []
        began = perf_counter()
        while perf_counter() - began < seconds:
            corners = case.mesh.points[triangles[random.integers(len(triangles))]]
            point, a = random.dirichlet(np.ones(3)) @ corners, random.random()
            start = perf_counter()
            model.displacement(point, a)
            times.append(perf_counter() - start)
        median, slow = (float(np.quantile(times, q)) for q in (0.5, 0.99))
        pairs = sum(model.counts)
        rows.append([name, pairs, 8e-6 * pairs * case.mesh.points.size, 1.0 / median, 1e6 * median, 1e6 * slow])
    header = ["model", "pairs", "modes [MB]", "evaluations per second", "median [us]", "99th percentile [us]"]
    caption = (
        f"{case.law}, on-line, called from Python: closest point of the surface, interpolation over its triangle, "
        f"displacement of all {len(case.mesh.points)} nodes."
    )
    page.table(f"rate_{case.key}", header, rows, caption)
    return {"rate": [dict(zip(header, row, strict=True)) for row in rows]}
