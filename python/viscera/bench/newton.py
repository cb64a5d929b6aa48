"""A Newton iteration beside other codes: the same mesh, the same energy, one thread, in one run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from viscera.bench.measure import Row, measured, peer_named, reference
from viscera.bench.peers import PEERS
from viscera.bench.problem import cube
from viscera.errors import VisceraError
from viscera.output.picture import PARTS

CELLS = (1_000, 9_000)
LARGEST = 10_000_000
ALARM = "#b23a48"
LIMIT = 300.0
"""Seconds after which a code is stopped; it then sits out the larger bodies."""


def run(
    cells: Sequence[int] = CELLS,
    codes: Sequence[str] | None = None,
    limit: float = LIMIT,
    progress: Callable[[int, int, str], None] | None = None,
    keep: Callable[[list[Row]], None] | None = None,
) -> list[Row]:
    """All rows: of every code, for every number of cells.

    codes: names of `viscera.bench.peers.PEERS`, by default all. A code that is not installed has a row that says so.
    keep: is given the rows after each of them.
    """
    if not cells or min(cells) < 6 or max(cells) > LARGEST:
        raise VisceraError(
            f"a body has at least 6 cells, a brick of six tetrahedra, and at most {LARGEST:,}; got {list(cells)}"
        )
    if not 0.0 < limit < np.inf:
        raise VisceraError(f"a code is stopped after {limit:g} s; give a positive number of seconds")
    peers = PEERS if codes is None else [peer_named(name) for name in codes]
    rows: list[Row] = []
    stopped: set[str] = set()
    sizes = sorted(set(cells))
    for k, size in enumerate(sizes):
        exact: dict[str, Any] = {}
        for i, peer in enumerate(peers):
            if peer.name not in stopped:
                if peer.volumetric not in exact:
                    exact[peer.volumetric] = reference(cube(size), peer.volumetric)
                row = measured(peer, size, exact[peer.volumetric], limit)
                rows.append(row)
                if row.fault:
                    stopped.add(peer.name)
                if keep:
                    keep(rows)
            if progress:
                progress(k * len(peers) + i + 1, len(sizes) * len(peers), f"{peer.name}, {size} cells")
    return rows


def exponent(rows: Sequence[Row], of: Callable[[Row], float] = lambda row: row.per_iteration) -> float:
    """Least-squares growth exponent of a measure over the number of cells; NaN of fewer than two sizes."""
    good = [row for row in rows if not row.fault and of(row) > 0.0]
    if len({row.cells for row in good}) < 2:
        return float("nan")
    x, y = np.log([row.cells for row in good]), np.log([of(row) for row in good])
    return float(np.polyfit(x, y, 1)[0])


def table(rows: Sequence[Row]) -> str:
    """One line a code and size, with its ratio to the fastest of that size, then the exponents."""
    width = max(len(row.code) for row in rows)
    head = "   cells  iterations  ms/iteration  over best  whole [s]  memory [MB]  difference  version"
    lines = ["code".ljust(width) + head]
    for size in sorted({row.cells for row in rows}):
        of_size = [row for row in rows if row.cells == size]
        best = min((row.per_iteration for row in of_size if not row.fault), default=float("nan"))
        for row in of_size:
            start = f"{row.code:{width}s}{row.cells:8d}"
            if row.fault:
                lines.append(f"{start}  {row.fault}")
                continue
            lines.append(
                f"{start}{row.iterations:12d}{1e3 * row.per_iteration:14.2f}{row.per_iteration / best:11.1f}"
                f"{row.seconds:11.2f}{row.megabytes:13.0f}{row.difference:12.0e}  {row.version}"
            )
    grown = {code: exponent([row for row in rows if row.code == code]) for code in dict.fromkeys(r.code for r in rows)}
    known = [f"{code} {value:.2f}" for code, value in grown.items() if np.isfinite(value)]
    if known:
        lines.append(f"growth exponents of an iteration: {', '.join(known)}")
    return "\n".join(lines)


def plot(rows: Sequence[Row]) -> Figure:
    """Time of an iteration over the number of cells, both logarithmic."""
    figure = Figure(figsize=(7, 4.6), layout="constrained")
    axes = figure.subplots()
    codes = list(dict.fromkeys(row.code for row in rows if not row.fault))
    palette = (*PARTS, ALARM)
    colours = {module: palette[k % len(palette)] for k, module in enumerate(dict.fromkeys(c.split()[0] for c in codes))}
    for k, code in enumerate(codes):
        good = [row for row in rows if row.code == code and not row.fault]
        style = ("-", "--", ":", "-.")[sum(c.split()[0] == code.split()[0] for c in codes[:k]) % 4]
        axes.loglog(
            [row.cells for row in good],
            [1e3 * row.per_iteration for row in good],
            style,
            marker="o",
            markersize=4,
            color=colours[code.split()[0]],
            label=code,
        )
    sizes = sorted({row.cells for row in rows if not row.fault})
    axes.set_xticks(sizes, [f"{size:,}" for size in sizes])
    axes.minorticks_off()
    axes.set(xlabel="cells", ylabel="processor time of a Newton iteration [ms]")
    axes.grid(alpha=0.3, linewidth=0.4)
    axes.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def facts(rows: Sequence[Row]) -> dict[str, Any]:
    """For machines."""
    return {
        "rows": [{**asdict(row), "per_iteration": row.per_iteration} for row in rows],
        "exponents": {
            code: exponent([row for row in rows if row.code == code]) for code in dict.fromkeys(r.code for r in rows)
        },
    }
