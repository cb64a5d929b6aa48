"""What the off-line stage costs, and what it takes: processor time, memory and file against the size of the body.

    python benchmarks/offline.py [--threads N] [--most NODES]

Cubes of neo-Hookean tissue, "P1 mean volume", Poisson's ratio 0.45, of 216 to 15,625 nodes, fixed below. A square of 64
nodes in the middle of the top may be touched (49 nodes of the smallest), with the radius and the depth that `reduce`
chooses, order 5. Each body is reduced in a process of its own. Memory is the largest of the process over what it held
before. The file is told for the default tolerance and for 1e-2.
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

SIDES = (5, 10, 16, 24)  # bricks along an edge
SIDE = 0.1  # [m]
COARSE = 1e-2


def cube(k: int) -> tuple[vs.Organ, Any]:
    """The organ, and the nodes that may be touched."""
    points, cells = bricks((k, k, k))
    points = points * SIDE
    top = points[:, 2] > SIDE * (1 - 1e-9)
    middle = np.argsort(np.abs(points - [SIDE / 2, SIDE / 2, SIDE]).max(axis=1) + 1.0 * ~top)
    places = {"bottom": points[:, 2] == 0, "touched": np.isin(np.arange(len(points)), middle[:64]) & top}
    mesh = vs.mesh(points, cells, {name: np.flatnonzero(chosen) for name, chosen in places.items()})
    law = vs.NeoHookean(young=4e3, poisson=0.45)
    return vs.Organ(mesh, law, fixed="bottom", element="P1 mean volume"), "touched"


def measure(k: int) -> dict[str, Any]:
    organ, touched = cube(k)
    organ.solve(force={"touched": (0, 0, -1e-6)})  # what every use of an organ needs is there
    before, began = peak(), time.process_time()
    touch = organ.reduce(touched)
    seconds, megabytes = time.process_time() - began, peak() - before
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
        "seconds": seconds,
        "megabytes": megabytes,
        "file": size,
        "coarse": coarse,
    }


def exponent(rows: list[dict[str, Any]], name: str) -> float:
    """Of the growth with the nodes, but for the smallest body."""
    nodes, values = (np.log([row[key] for row in rows[1:]]) for key in ("nodes", name))
    return float(np.polyfit(nodes, values, 1)[0])


def main(threads: int, most: int) -> None:
    print(describe(threads))
    print("nodes    cells  positions  processor [s]  us a cell and position  memory [MB]  file [MB]  at 1e-2")
    rows = []
    for k in (k for k in SIDES if (k + 1) ** 3 <= most):
        command = [sys.executable, __file__, "--one", str(k)]
        bounded = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
        row = json.loads(subprocess.run(command, env=bounded, check=True, capture_output=True, text=True).stdout)
        rows.append(row)
        each = 1e6 * row["seconds"] / (row["cells"] * row["positions"])
        print(
            f"{row['nodes']:5d}  {row['cells']:7d}  {row['positions']:9d}  {row['seconds']:13.1f}  {each:22.1f}  "
            f"{row['megabytes']:11.0f}  {row['file']:9.1f}  {row['coarse']:7.1f}",
            flush=True,
        )
    if len(rows) > 2:
        names = {"processor time": "seconds", "memory": "megabytes", "file": "file"}
        told = ", ".join(f"of {name} {exponent(rows, key):.2f}" for name, key in names.items())
        print(f"exponents from the second body on: {told}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--most", type=int, default=10**9)
    parser.add_argument("--one", type=int)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(measure(given.one)))
    else:
        main(given.threads, given.most)
