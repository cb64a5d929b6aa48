"""What every law costs with every element, and what its reduced models are worth; and whether that got worse."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from time import process_time
from typing import Any

import numpy as np

from viscera.bench.problem import cube
from viscera.errors import VisceraError
from viscera.law import (
    ArrudaBoyce,
    Corotated,
    Fung,
    HolzapfelGasserOgden,
    Law,
    Linear,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    SaintVenantKirchhoff,
    StableNeoHookean,
    StrainEnergy,
    VerondaWestmann,
    Yeoh,
)
from viscera.mesh import mesh
from viscera.organ import Organ
from viscera.reduced.check import allowed_error

ELEMENTS = {"P1": 750, "P1 mean volume": 750, "P2": 162}
"""Cells of the cube for each element."""
TOUCHES = 12
SLOWER = 1.25
"""A cost has risen if it grew by this factor more than the costs of all laws did in the median."""
FEWER = 0.1
"""Trust has fallen if this share of all answers is no longer trusted."""
COSTS = {"iteration": "ms/iteration", "off_line": "off-line [s]", "tick": "tick [us]"}


def samples() -> dict[str, Law]:
    """Every law, with parameters of soft tissue."""
    laws: Sequence[Law] = (
        Linear(young=5e3, poisson=0.4),
        Corotated(young=5e3, poisson=0.4),
        SaintVenantKirchhoff(young=5e3, poisson=0.4),
        NeoHookean(young=5e3, poisson=0.45),
        StableNeoHookean(young=5e3, poisson=0.45),
        MooneyRivlin(c1=600.0, c2=200.0, kappa=15e3, volumetric="ln J"),
        Yeoh(c10=800.0, c20=300.0, c30=50.0, poisson=0.45),
        Ogden(mu=[500.0, -100.0], alpha=[3.0, -4.0], poisson=0.45),
        ArrudaBoyce(1e3, 1.3, poisson=0.45),
        VerondaWestmann(c1=2e3, c2=0.5, poisson=0.45),
        Fung(mu=1e3, b=1.0, poisson=0.45),
        HolzapfelGasserOgden(
            2e3, 1e3, 0.5, fibres=[(1, 0, 0), (0, 1, 1)], dispersion=0.1, poisson=0.45, bear_compression=True
        ),
        StrainEnergy("mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2", mu=1.7e3, lam=15e3),
    )
    return {type(law).__name__: law for law in laws}


@dataclass(frozen=True)
class Row:
    """Cost and trust of a law with an element."""

    law: str
    element: str
    iterations: int
    """Newton iterations of the cube, drawn out by a quarter in four steps."""
    iteration: float
    """Processor time of one of them [ms]."""
    off_line: float
    """Processor time of the reduced model [s]."""
    tick: float
    """Time of a force and its stiffness [us]."""
    trusted: float
    """Share of the answers that are trusted."""
    beyond: int
    """Trusted answers beyond their allowance."""
    worst: float
    """Largest error of a trusted answer, over its allowance."""

    @property
    def key(self) -> str:
        """Law and element."""
        return f"{self.law}, {self.element}"


def run(
    laws: Sequence[str] | None = None,
    elements: Sequence[str] | None = None,
    touches: int = TOUCHES,
    progress: Callable[[int, int, str], None] | None = None,
    keep: Callable[[list[Row]], None] | None = None,
) -> list[Row]:
    """A row for every law and element; by default all. `keep` is given the rows after each of them."""
    every, cases = samples(), chosen(laws, elements)
    rows: list[Row] = []
    for k, (name, element) in enumerate(cases):
        rows.append(_row(name, every[name], element, touches))
        if keep:
            keep(rows)
        if progress:
            progress(k + 1, len(cases), rows[-1].key)
    return rows


def chosen(laws: Sequence[str] | None, elements: Sequence[str] | None) -> list[tuple[str, str]]:
    """The pairs of law and element that are asked for; raises `VisceraError` for names that are unknown."""
    every = samples()
    for name in laws or ():
        if name not in every:
            raise VisceraError(f"there is no law {name!r}; there are {', '.join(every)}")
    for name in elements or ():
        if name not in ELEMENTS:
            raise VisceraError(f"there is no element {name!r}; there are {', '.join(ELEMENTS)}")
    return [(name, element) for name in laws or every for element in elements or ELEMENTS]


def _row(name: str, law: Law, element: str, touches: int) -> Row:
    problem = cube(ELEMENTS[element])
    sets = {"clamped": problem.clamped, "moved": problem.moved}
    organ = Organ(mesh(problem.points, problem.cells, sets), law, fixed="clamped", element=element)
    began = process_time()
    state = organ.solve(displacement={"moved": (problem.stretch, 0, 0)}, steps=problem.steps, solver="cholesky")
    solved = process_time() - began
    began = process_time()
    touch = organ.reduce("moved")
    reduced = process_time() - began
    found = touch.check(touches=touches, seed=1)
    worth = [
        max(row.displacement_error or 0.0, row.force_error or 0.0) / allowed_error(row.depth_fraction)
        for row in found.rows
        if row.is_trusted and row.is_converged
    ]
    return Row(
        law=name,
        element=element,
        iterations=state.iterations,
        iteration=1e3 * solved / max(state.iterations, 1),
        off_line=reduced,
        tick=found.microseconds_force,
        trusted=found.trusted_share,
        beyond=sum(not row.is_within_limits for row in found.rows),
        worst=max(worth, default=0.0),
    )


def table(rows: Sequence[Row]) -> str:
    """One line a law and element."""
    lines = [f"{'law':22s}{'element':16s}iterations  ms/iteration  off-line [s]  tick [us]  trusted  beyond  worst"]
    lines += [
        f"{row.law:22s}{row.element:16s}{row.iterations:10d}{row.iteration:14.2f}{row.off_line:14.2f}{row.tick:11.2f}"
        f"{100 * row.trusted:7.0f} %{row.beyond:8d}{row.worst:7.2f}"
        for row in rows
    ]
    return "\n".join(lines)


def facts(rows: Sequence[Row]) -> dict[str, Any]:
    """For machines, and for the next run to be compared with."""
    return {"rows": [asdict(row) for row in rows]}


def rows_of(kept: Any, name: str) -> dict[str, Row]:
    """The rows of an earlier run's JSON by law and element; raises `VisceraError` if it holds none."""
    given = kept.get("rows") if isinstance(kept, Mapping) else None
    if not isinstance(given, list) or not all(isinstance(row, Mapping) for row in given):
        raise VisceraError(f"{name} holds no rows of `viscera bench laws`; give the laws.json that it wrote")
    fields = Row.__dataclass_fields__
    missing = next((field for row in given for field in fields if field not in row), None)
    if missing is not None:
        raise VisceraError(f"{name} holds rows without {missing!r}; give the laws.json that `viscera bench laws` wrote")
    rows = [Row(**{field: row[field] for field in fields}) for row in given]
    for row in rows:
        for field in (*COSTS, "iterations", "trusted", "beyond"):
            value = getattr(row, field)
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if not is_number or not np.isfinite(value) or value < 0 or (field in COSTS and value == 0):
                raise VisceraError(f"{name}: {field} of {row.key} is {value!r}; it is no measured number")
    return {row.key: row for row in rows}


def worse(rows: Sequence[Row], before: Mapping[str, Row]) -> list[str]:
    """What got worse since an earlier run, in sentences.

    Machines differ: a cost is compared after division by the median ratio over all laws and elements, which is told by
    `speed`.
    """
    both = [(row, before[row.key]) for row in rows if row.key in before]
    told = []
    for cost, words in COSTS.items():
        typical = speed(rows, before, cost)
        for now, then in both:
            ratio = getattr(now, cost) / getattr(then, cost) / typical
            if ratio > SLOWER:
                told.append(f"{now.key}: {words} grew {ratio:.2f} times as much as in the median of all laws")

    for now, then in both:
        if now.beyond > then.beyond:
            told.append(f"{now.key}: {now.beyond} trusted answers are beyond their allowance, {then.beyond} before")
        if now.trusted < then.trusted - FEWER:
            shares = f"{100 * now.trusted:.0f} % of the answers are trusted, {100 * then.trusted:.0f} % before"
            told.append(f"{now.key}: {shares}")
        if now.iterations > then.iterations + 2:
            told.append(f"{now.key}: {now.iterations} Newton iterations, {then.iterations} before")
    return told


def speed(rows: Sequence[Row], before: Mapping[str, Row], cost: str) -> float:
    """Median over laws and elements of a cost over that of an earlier run."""
    ratios = [getattr(row, cost) / getattr(before[row.key], cost) for row in rows if row.key in before]
    return float(np.median(ratios)) if ratios else float("nan")
