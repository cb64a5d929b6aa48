"""One code on one body, in a process of its own, on one thread.

    python -m viscera.bench.measure CODE CELLS FOLDER

is that process; it leaves its answer in FOLDER.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np

from viscera.bench.peers import PEERS, Peer
from viscera.bench.problem import Problem, cube
from viscera.errors import VisceraError
from viscera.mesh import Floats

ONE_THREAD = dict.fromkeys(
    ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NGS_NUM_THREADS"), "1"
)


@dataclass(frozen=True)
class Row:
    """What a code took for one body, or why it did not finish."""

    code: str
    cells: int
    iterations: int = 0
    seconds: float = float("nan")
    """Processor time of the whole solution [s]."""
    megabytes: float = float("nan")
    """Largest memory of the process over what it held before the solution [MB]; of a program, all of it."""
    difference: float = float("nan")
    """Largest difference of the displacement from Viscera's, over the largest displacement."""
    version: str = ""
    fault: str = ""

    @property
    def per_iteration(self) -> float:
        """Processor time of an iteration, assembly included [s]."""
        return self.seconds / self.iterations if self.iterations else float("nan")


def missing(peer: Peer) -> str:
    """The first of its requirements that is not here; empty if all are."""
    for name in peer.requires:
        if importlib.util.find_spec(name) is None and shutil.which(name) is None:
            return name
    return ""


def measured(peer: Peer, cells: int, reference: Floats | None, limit: float) -> Row:
    """The row of a code; stopped after `limit` seconds."""
    count = len(cube(cells).cells)
    absent = missing(peer)
    if absent:
        return Row(peer.name, count, fault=f"{absent} is not installed")
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "viscera.bench.measure", peer.name, str(cells), folder]
        try:
            run = subprocess.run(
                command, env={**os.environ, **ONE_THREAD}, capture_output=True, text=True, timeout=limit, check=False
            )
        except subprocess.TimeoutExpired:
            return Row(peer.name, count, fault=f"not done after {limit:g} s")
        if run.returncode:
            words = (run.stderr.strip() or f"it ended with code {run.returncode}").splitlines()[-1]
            return Row(peer.name, count, fault=words[:120])
        facts = json.loads((Path(folder) / "facts.json").read_text(encoding="utf-8"))
        u = np.load(Path(folder) / "displacement.npy")
    difference = float("nan") if reference is None else float(np.abs(u - reference).max() / np.abs(reference).max())
    return Row(peer.name, count, difference=difference, **facts)


def reference(problem: Problem, volumetric: str) -> Floats:
    """Viscera's displacement (n, 3) [m] for an energy."""
    from viscera import MooneyRivlin
    from viscera.bench.peers import viscera as own

    if volumetric == "ln J":
        return own.solve(problem, "cholesky").displacement
    bulk = problem.lam + 2 / 3 * problem.mu
    law = MooneyRivlin(c1=problem.mu / 2, c2=0.0, kappa=bulk, volumetric="J-1")
    return own.solve(problem, "cholesky", law).displacement


def peer_named(name: str) -> Peer:
    """A code by its name; raises `VisceraError` with the names that there are."""
    for peer in PEERS:
        if peer.name == name:
            return peer
    raise VisceraError(f"there is no code {name!r} to measure; there are {', '.join(peer.name for peer in PEERS)}")


def peak(of_children: bool = False) -> float:
    """Largest memory that this process has held, or a child of it that has ended [MB]."""
    status = Path("/proc/self/status")
    if not of_children and status.exists():  # on Linux getrusage also counts the parent's, before this program began
        return int(status.read_text(encoding="ascii").partition("VmHWM:")[2].split()[0]) / 1024
    try:
        import resource
    except ModuleNotFoundError:  # on Windows
        return float("nan")
    usage = resource.getrusage(resource.RUSAGE_CHILDREN if of_children else resource.RUSAGE_SELF).ru_maxrss
    return usage / (1024**2 if sys.platform == "darwin" else 1024)


def main(name: str, cells: int, folder: Path) -> None:
    """Solve, and leave the answer in the folder."""
    peer = peer_named(name)
    module = import_module(f"viscera.bench.peers.{peer.module}")
    problem = cube(cells)
    before = peak()
    found = module.solve(problem, peer.option)
    facts = {
        "iterations": found.iterations,
        "seconds": found.seconds,
        "megabytes": peak(of_children=True) if peer.is_program else peak() - before,
        "version": found.version,
    }
    np.save(folder / "displacement.npy", found.displacement)
    (folder / "facts.json").write_text(json.dumps(facts), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]))
