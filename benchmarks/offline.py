"""What the off-line stage costs, and what it takes: processor time, memory and file against the size of the body.

    python benchmarks/offline.py [--threads N] [--most NODES]

Cubes of neo-Hookean tissue, "P1 mean volume", Poisson's ratio 0.45, of 216 to 15,625 nodes, fixed below. A square of 64
nodes in the middle of the top may be touched (36 nodes of the smallest), with the radius and the depth that `reduce`
chooses, order 5. The largest that has at most `--most` nodes is reduced once more with little `memory`. Each body is
reduced in a process of its own. Memory is the largest of the process over what it held before. The file is told for the
default tolerance and for 1e-2.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from locking import bricks
from machine import describe

import viscera as vs
from viscera.bench.measure import peak

SIDES = (5, 10, 16, 20, 24)  # bricks along an edge
SIDE = 0.1  # [m]
LITTLE = 1e9  # memory [bytes]
COARSE = 1e-2


def cube(k: int) -> tuple[vs.Organ, str]:
    """The organ, and the nodes that may be touched."""
    points, cells = bricks((k, k, k))
    points = points * SIDE
    top = points[:, 2] > SIDE * (1 - 1e-9)
    middle = np.argsort(np.abs(points - [SIDE / 2, SIDE / 2, SIDE]).max(axis=1) + 1.0 * ~top)
    places = {"bottom": points[:, 2] == 0, "touched": np.isin(np.arange(len(points)), middle[:64]) & top}
    mesh = vs.mesh(points, cells, {name: np.flatnonzero(chosen) for name, chosen in places.items()})
    law = vs.NeoHookean(young=4e3, poisson=0.45)
    return vs.Organ(mesh, law, fixed="bottom", element="P1 mean volume"), "touched"


def measure(k: int, memory: float) -> dict[str, Any]:
    """What a reduction takes in this process."""
    organ, touched = cube(k)
    organ.solve(force={"touched": (0, 0, -1e-6)})  # what every use of an organ needs is there
    before, began = peak(), time.process_time()
    checked_from: list[float] = []

    def progress(done: int, total: int, stage: str) -> None:
        if stage == "check" and not checked_from:
            checked_from.append(time.process_time())

    touch = organ.reduce(touched, order=5, memory=memory, progress=progress)
    ended, megabytes = time.process_time(), peak() - before
    solved = checked_from[0] - began if checked_from else float("nan")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cube.viscera"
        touch.save(path)
        size = path.stat().st_size / 1e6
        touch.compressed(COARSE).save(path)
        coarse = path.stat().st_size / 1e6
    count = touch.summary()["positions"]
    return {
        "nodes": len(organ.mesh.points),
        "cells": len(organ.mesh.cells),
        "positions": count,
        "seconds": ended - began,
        "solved": solved,
        "megabytes": megabytes,
        "file": size,
        "coarse": coarse,
    }


def row(k: int, memory: float, threads: int) -> dict[str, Any]:
    """What a process of its own measures; it is printed, too."""
    command = [sys.executable, __file__, "--one", str(k), str(memory)]
    bounded = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    found: dict[str, Any] = json.loads(
        subprocess.run(command, env=bounded, check=True, capture_output=True, text=True).stdout
    )
    each = 1e6 * found["solved"] / (found["cells"] * found["positions"])
    print(
        f"{found['nodes']:5d}  {found['cells']:7d}  {found['positions']:9d}  {found['solved']:8.1f}  {each:22.1f}  "
        f"{found['seconds'] - found['solved']:9.1f}  "
        f"{found['megabytes']:11.0f}  {found['file']:9.1f}  {found['coarse']:7.1f}",
        flush=True,
    )
    return found


def exponent(rows: list[dict[str, Any]], name: str) -> float:
    """Of the growth with the nodes, but for the smallest body."""
    nodes, values = (np.log([row[key] for row in rows[1:]]) for key in ("nodes", name))
    return float(np.polyfit(nodes, values, 1)[0])


def main(threads: int, most: int) -> None:
    print(describe(threads))
    print("processor time [s]")
    print("nodes    cells  positions     solve  us a cell and position      check  memory [MB]  file [MB]  at 1e-2")
    sides = [k for k in SIDES if (k + 1) ** 3 <= most]
    rows = [row(k, vs.defaults.MEMORY, threads) for k in sides]
    print(f"the last one with memory={LITTLE:g}:")
    row(sides[-1], LITTLE, threads)
    if len(rows) > 2:
        names = {"the time to solve": "solved", "memory": "megabytes", "file": "file"}
        told = ", ".join(f"of {name} {exponent(rows, key):.2f}" for name, key in names.items())
        print(f"exponents from the second body on: {told}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--most", type=int, default=10**9)
    parser.add_argument("--one", nargs=2, type=float)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(measure(int(given.one[0]), given.one[1])))
    else:
        main(given.threads, given.most)
