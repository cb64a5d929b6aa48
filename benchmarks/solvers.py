"""Which linear solver wins: whole solutions by each of them and by `solver="auto"`, over bodies of all kinds.

    python benchmarks/solvers.py [--limit CELLS] [--only SOLVER] [--print]

Cubes stretched by a quarter, bars, ten times as long as thick, that bend by about a third of their length under a load
on their end, and the built-in liver, whose farthest place a hand lowers by a twenty-fifth of its size; neo-Hookean
tissue; three elements; Poisson's ratios from 0.3 to 0.499. Every solution runs in a process of its own on one thread,
to a residual of 1e-9, and is given up after `PATIENCE` times the processor time of the best so far. Rows are kept in
out/solvers.jsonl as they finish; what is there is not measured again. `--print` prints the table of what there is.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from locking import bricks
from machine import ROOT, describe

import viscera as vs
from viscera.bench.measure import peak

KEPT = ROOT / "out" / "solvers.jsonl"
PATIENCE, LEAST = 4.0, 5.0  # times the best, and processor time [s] that every solver has
BRIEF = 0.15  # solutions that are shorter [s] do not count: a tick of the clock and one more iteration decide them
ENOUGH = 0.2  # processor time [s] up to which solutions are repeated, since clocks tick in milliseconds

SOLVERS: dict[str, str | vs.ConjugateGradients] = {
    "incomplete": vs.ConjugateGradients("incomplete_cholesky", 1e-3, 20_000),
    "multigrid": "multigrid",
    "lagged": "cg",
    "cholesky": "cholesky",
    "auto": "auto",
}
CUBES = {750: 5, 10_368: 12, 63_888: 22, 132_720: 28, 303_918: 37, 998_250: 55}
BARS = {1_620: 3, 12_960: 6, 60_000: 10, 131_820: 13, 294_780: 17, 960_000: 25}
LIVER = {11_714: 1}
ELEMENTS = {"P1": 10**7, "P1 mean volume": 10**7, "P2": 15_000}  # and the cells up to which they are measured
RATIOS = (0.3, 0.45, 0.49, 0.499)


class Case(NamedTuple):
    shape: str
    cells: int
    element: str
    poisson: float


def cases(limit: int) -> Iterator[Case]:
    """All cases of at most so many cells, small ones first."""
    bodies = sorted((n, shape) for shape, sizes in (("cube", CUBES), ("bar", BARS), ("liver", LIVER)) for n in sizes)
    for n, shape in bodies:
        for element, most in ELEMENTS.items():
            yield from (Case(shape, n, element, ratio) for ratio in RATIOS if n <= min(limit, most))


def block(case: Case) -> tuple[vs.Organ, dict[str, Any]]:
    """A cube or a bar, and its load."""
    is_cube = case.shape == "cube"
    k = CUBES[case.cells] if is_cube else BARS[case.cells]
    points, cells = bricks((k, k, k) if is_cube else (10 * k, k, k))
    points = points * (0.1, 0.1, 0.1) if is_cube else points * (0.1, 0.01, 0.01)
    ends = {"clamp": np.flatnonzero(points[:, 0] == 0), "tip": np.flatnonzero(points[:, 0] == points[:, 0].max())}
    law = vs.NeoHookean(young=1e4, poisson=case.poisson)
    organ = vs.Organ(vs.mesh(points, cells, ends), law, fixed="clamp", element=case.element)
    return organ, {"displacement": {"tip": (0.025, 0, 0)}} if is_cube else {"force": {"tip": (0, 0, -0.01)}}


def liver(case: Case) -> tuple[vs.Organ, dict[str, Any]]:
    """The built-in liver, and its load."""
    law = vs.NeoHookean(young=5e3, poisson=case.poisson)
    organ = vs.Organ(vs.organs.liver(), law, fixed="hilum", element=case.element)
    mesh = organ.mesh
    hilum = mesh.points[mesh.nodes("hilum")].mean(axis=0)
    farthest = mesh.points[np.linalg.norm(mesh.points - hilum, axis=1).argmax()]
    hand = organ.patch(farthest, radius=0.1 * mesh.diagonal)
    return organ, {"displacement": {hand: (0, 0, -0.04 * mesh.diagonal)}}


def solve(case: Case, solver: str) -> dict[str, Any]:
    """Processor time [s], memory [MB] and iterations of a solution."""
    organ, load = liver(case) if case.shape == "liver" else block(case)
    before, began, count = peak(), time.process_time(), 0
    while count == 0 or time.process_time() - began < ENOUGH:
        state = organ.solve(**load, solver=SOLVERS[solver])
        count += 1
    return {
        "seconds": (time.process_time() - began) / count,
        "megabytes": peak() - before,
        "nodes": len(organ.mesh.points),
        "status": state.status,
        "newton": state.iterations,
        "iterations": state.linear_iterations,
        "solver": state.solver,
        "timings": state.timings,
        "farthest": state.max_displacement,
    }


def measured(case: Case, solver: str, limit: float) -> dict[str, Any]:
    """The row of a solver, whose process ends after `limit` seconds of processor time."""
    command = [sys.executable, __file__, "--one", json.dumps([*case, solver])]
    bound = lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(limit) + 3,) * 2)  # noqa: E731
    alone = {**os.environ, "RAYON_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    run = subprocess.run(command, env=alone, preexec_fn=bound, capture_output=True, text=True, check=False)
    row = {**case._asdict(), "asked": solver}
    if run.returncode == 0:
        return {**row, **json.loads(run.stdout)}
    return {**row, "seconds": None, "limit": limit, "fault": run.stderr.strip()[-200:]}


def kept() -> dict[tuple[Any, ...], dict[str, Any]]:
    """Rows measured before."""
    lines = KEPT.read_text(encoding="utf-8").splitlines() if KEPT.exists() else []
    rows = [json.loads(line) for line in lines]
    return {(*(row[name] for name in Case._fields), row["asked"]): row for row in rows}


def measure(wanted: Iterable[Case], only: list[str], limit: float) -> None:
    """All rows that are not there yet; `limit` [s] where no other solver tells what is long."""
    KEPT.parent.mkdir(exist_ok=True)
    for case in wanted:
        for solver in sorted(only, key=lambda name: name != "auto"):  # whose time tells what is long
            rows = kept()
            if (*case, solver) in rows:
                continue
            known = [rows.get((*case, name), {}).get("seconds") for name in SOLVERS]
            best = min((seconds for seconds in known if seconds), default=1e9)
            row = measured(case, solver, max(LEAST, PATIENCE * best) if best < 1e9 else limit)
            with KEPT.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")


def table() -> None:
    """One line for each case: seconds of each solver, and how far the choice is from the best."""
    rows = kept()
    names = [name for name in SOLVERS if name != "auto"]
    print("processor time of whole solutions [s]; a dash: given up")
    print(
        "shape   cells  element          nu     " + "".join(f"{name:>11s}" for name in names) + "       auto  ratio  by"
    )
    ratios: list[float] = []
    twice: list[float] = []
    for case in sorted({key[:-1] for key in rows}, key=lambda key: (key[0], key[2], key[1], key[3])):
        seconds = {name: rows.get((*case, name), {}).get("seconds") for name in SOLVERS}
        told = "".join(f"{seconds[name]:11.3f}" if seconds[name] else f"{'-':>11s}" for name in names)
        known = [float(seconds[name]) for name in names if seconds[name]]
        shape, cells, element, ratio = case
        line = f"{shape:5s}{cells:8d}  {element:15s}{ratio:6.3f}  {told}"
        if seconds["auto"] and known:
            times, by = seconds["auto"] / min(known), rows[(*case, "auto")]["solver"]
            line += f"{seconds['auto']:11.3f}{times:7.2f}  {by}"
            if seconds["auto"] > BRIEF:
                ratios.append(times)
            if by == "cholesky" and seconds["cholesky"]:
                twice.append(seconds["auto"] / seconds["cholesky"])
        print(line)
    if ratios:
        beyond = [ratio for ratio in ratios if ratio > 1.3]
        share = f"{len(ratios) - len(beyond)} of {len(ratios)} solutions of more than {BRIEF} s"
        print(f"the choice takes at most 1.3 times as long as the best in {share}, at worst {max(ratios):.2f} times")
    if twice:
        print(f"the same solver twice, chosen and given: {min(twice):.2f} to {max(twice):.2f} times as long")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--limit", type=int, default=70_000)
    parser.add_argument("--only", action="append", choices=SOLVERS)
    parser.add_argument("--print", action="store_true")
    parser.add_argument("--one")
    given = parser.parse_args()
    if given.one:
        *case, solver = json.loads(given.one)
        print(json.dumps(solve(Case(*case), solver)))
        sys.exit()
    if not given.print:
        measure(cases(given.limit), given.only or list(SOLVERS), 600.0)
    print(describe())
    table()
