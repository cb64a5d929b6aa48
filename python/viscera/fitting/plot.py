"""Measured curves and the law fitted to them, drawn."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from viscera.output import agg  # noqa: F401 - before matplotlib

# isort: split
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from viscera.curves import COLOURS, MODES
from viscera.files.atomic import replacing
from viscera.output.kind import check_picture
from viscera.output.picture import INK, PAPER

if TYPE_CHECKING:
    from viscera.fitting.fit import Fit


def draw(fit: Fit, path: str | os.PathLike[str] | None = None) -> Figure:
    """A panel for each deformation: points measured, line fitted."""
    check_picture(path)
    modes = list(dict.fromkeys(test.mode for test in fit.tests))
    figure = Figure(figsize=(4.8 * len(modes), 3.8), dpi=150, facecolor=PAPER, layout="constrained")
    FigureCanvasAgg(figure)
    for plot, mode in zip(figure.subplots(1, len(modes), squeeze=False).ravel(), modes, strict=True):
        shown = [(test, s) for test, s in zip(fit.tests, fit.stresses, strict=True) if test.mode == mode]
        for k, (test, stress) in enumerate(shown):
            order = test.stretch.argsort()
            colour = COLOURS[k % len(COLOURS)]
            plot.plot(test.stretch, test.stress / 1e3, ".", markersize=3, color=colour, label=test.name)
            plot.plot(test.stretch[order], stress[order] / 1e3, color=INK, linewidth=1.2)
        plot.set_title(f"{MODES[mode].title}: {fit.name}", loc="left", fontsize=10, color=INK)
        plot.set_xlabel(MODES[mode].parameter)
        plot.set_ylabel("nominal stress [kPa]")
        plot.spines[["top", "right"]].set_visible(False)
        plot.legend(frameon=False, fontsize=8)
    if path is not None:
        with replacing(path) as scratch:
            figure.savefig(scratch, format="png", facecolor=PAPER)
    return figure
