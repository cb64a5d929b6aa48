"""Nominal stress of a law over stretch in homogeneous deformations, as in a testing machine; computed and drawn.

Axis 1 is pulled. Components of F are given or free; the stress P_ij of a free component is zero. F is upper triangular,
which excludes rotations.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera.errors import VisceraError
from viscera.files.atomic import replacing
from viscera.mesh import Floats
from viscera.output.kind import check_picture
from viscera.quantity import Choice, numbers_of, refused

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from viscera.law import Law

TOLERANCE = 1e-10
MAX_ITERATIONS = 20
LARGEST = 0.2
"""By how much a component moves at once, in units of the largest of F, or of 1 where that is less."""
SMALLEST = 2.0**-10
"""Part of the way from one state to the next below which it is not divided further."""
FLAT = 1e-6  # volume ratio at which a curve ends: Saint Venant-Kirchhoff is without stress when crushed to nothing
POINTS = 41
COLOURS = ("#0b4f6c", "#d9654f", "#6a8d3a", "#7a4b94", "#c98b1b", "#3a8f8f", "#4f0f2b", "#8a8f99")


@dataclass(frozen=True)
class Mode:
    """A homogeneous deformation with one parameter."""

    title: str
    parameter: str
    component: tuple[int, int]
    """Of the nominal stress that is measured."""
    driven: Sequence[tuple[int, int]]
    """Components of F that are the parameter."""
    free: Sequence[tuple[int, int]]
    """Components in which there is no stress."""
    at_rest: float = 1.0


OUT_OF_PLANE = ((2, 2), (0, 2), (1, 2))
MODES = {
    "uniaxial": Mode("uniaxial", "stretch", (0, 0), ((0, 0),), ((1, 1), (0, 1), *OUT_OF_PLANE)),
    "equibiaxial": Mode("equibiaxial", "stretch", (0, 0), ((0, 0), (1, 1)), OUT_OF_PLANE),
    "pure shear": Mode("pure shear (width held)", "stretch", (0, 0), ((0, 0),), OUT_OF_PLANE),
    "simple shear": Mode("simple shear", "shear", (0, 1), ((0, 1),), (), at_rest=0.0),
}


def curve(law: Law, mode: str, stretch: tuple[float, float], cell: int = 0) -> tuple[Floats, Floats]:
    """Parameters (k,) and nominal stress (k,) [Pa] over a range that holds the state of rest.

    mode: "uniaxial", "equibiaxial", "pure shear" (parameter: the stretch, 1 at rest) or "simple shear" (the shear, 0 at
    rest; the volume is kept and the thickness held). The curve ends early where the law has no state to continue to.
    """
    kind = MODES[Choice(MODES)(mode, "the deformation")]
    low, high = _ends(stretch)
    if not low <= kind.at_rest <= high or not low < high:
        raise VisceraError(f"{mode}: the range {low:g} to {high:g} must hold the state of rest, {kind.at_rest:g}")
    if kind.at_rest == 1.0 and not low > 0.0:
        raise VisceraError(f"{mode}: stretches must be positive, got {low:g}")
    grid = np.linspace(low, high, POINTS)
    above, below = grid[grid > kind.at_rest], grid[grid < kind.at_rest][::-1]
    branches = [_march(law, kind, branch, cell) for branch in (below, above)]
    parameters = [*below[: len(branches[0])][::-1], kind.at_rest, *above[: len(branches[1])]]
    rest = float(law.stress(np.eye(3)[None], cell)[0][kind.component])
    return np.array(parameters), np.array([*branches[0][::-1], rest, *branches[1]])


def draw(
    laws: Sequence[Law],
    *,
    stretch: tuple[float, float] = (0.6, 1.6),
    cell: int = 0,
    path: str | os.PathLike[str] | None = None,
) -> Figure:
    """The curves of several laws in the four deformations, shear from 0 to the largest elongation."""
    from viscera.output.picture import INK, PAPER

    # isort: split
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    check_picture(path)
    figure = Figure(figsize=(9.0, 6.5), dpi=150, facecolor=PAPER, layout="constrained")
    FigureCanvasAgg(figure)
    stretch = _ends(stretch)
    names = Counter(type(law).__name__ for law in laws)
    labels = [type(law).__name__ if names[type(law).__name__] == 1 else repr(law) for law in laws]
    ranges = {mode: (0.0, stretch[1] - 1.0) if kind.at_rest == 0.0 else stretch for mode, kind in MODES.items()}
    curves = {mode: [curve(law, mode, ranges[mode], cell) for law in laws] for mode in MODES}
    largest = max(float(np.abs(stress).max()) for found in curves.values() for _, stress in found)
    scale, unit = next(((s, u) for s, u in ((1e6, "MPa"), (1e3, "kPa")) if largest >= s), (1.0, "Pa"))
    for plot, (mode, found) in zip(figure.subplots(2, 2).ravel(), curves.items(), strict=True):
        for (parameter, stress), label, k in zip(found, labels, range(len(laws)), strict=True):
            plot.plot(parameter, stress / scale, color=COLOURS[k % len(COLOURS)], linewidth=1.6, label=label)
        plot.axhline(0.0, color=INK, linewidth=0.5)
        plot.axvline(MODES[mode].at_rest, color=INK, linewidth=0.5)
        plot.set_title(MODES[mode].title, loc="left", fontsize=10, color=INK)
        plot.set_xlabel(MODES[mode].parameter)
        plot.set_ylabel(f"nominal stress [{unit}]")
        plot.spines[["top", "right"]].set_visible(False)
    figure.legend(labels, loc="outside lower center", ncols=min(len(laws), 3), frameon=False, fontsize=9)
    if path is not None:
        with replacing(path) as scratch:
            figure.savefig(scratch, format="png", facecolor=PAPER)
    return figure


def _ends(stretch: Any) -> tuple[float, float]:
    """The ends of a range, checked to be two finite numbers."""
    ends = numbers_of(stretch)
    if ends is None or ends.shape != (2,) or not np.isfinite(ends).all():
        raise refused("the range of a curve", "two finite numbers, such as (0.6, 1.6)", stretch)
    return float(ends[0]), float(ends[1])


def _march(law: Law, kind: Mode, parameters: Floats, cell: int) -> list[float]:
    """Stresses at growing distance from rest, each state found from the one before."""
    F, found = np.eye(3), []
    for parameter in parameters:
        state = state_at(law, kind, float(parameter), F, cell)
        if state is None:
            break
        F = state
        found.append(float(law.stress(F[None], cell)[0][kind.component]))
    return found


def state_at(law: Law, kind: Mode, parameter: float, start: Floats, cell: int) -> Floats | None:
    """F (3, 3) of a deformation at a parameter, from a state at another; none if the law has no state to continue to.

    The way there is taken in one step, or in as many as Newton's method converges in.
    """
    begin, done, step = float(start[kind.driven[0]]), 0.0, 1.0  # in parts of the way, exact as sums of powers of 1/2
    while done < 1.0:
        F, end = start.copy(), done + step
        for place in kind.driven:
            F[place] = parameter if end == 1.0 else begin + end * (parameter - begin)
        state = _equilibrium(law, F, kind.free, cell)
        if state is not None:
            start, done, step = state, end, min(2.0 * step, 1.0 - end)
        elif step > SMALLEST:
            step /= 2.0
        else:
            return None
    return start


def _equilibrium(law: Law, F: Floats, free: Sequence[tuple[int, int]], cell: int) -> Floats | None:
    """F with no stress in its free components, by Newton's method; none if it does not converge."""
    if not free:
        return F
    rows, columns = map(list, zip(*free, strict=True))
    for _ in range(MAX_ITERATIONS):
        residual = law.stress(F[None], cell)[0][rows, columns]
        tangent = law.tangent(F[None], cell)[0][rows, columns][:, rows, columns]
        if not (np.isfinite(residual).all() and np.isfinite(tangent).all()):  # an exponential law far out
            return None
        step = np.linalg.lstsq(tangent, -residual, rcond=None)[0]
        size, most = float(np.abs(step).max()), LARGEST * max(1.0, float(np.abs(F).max()))
        F[rows, columns] += step * (most / max(size, most))
        if not np.linalg.det(F) > FLAT:
            return None
        if size <= TOLERANCE:
            return F
    return None
