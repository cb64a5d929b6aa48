"""A fork of a process that has the core's threads is refused, and does not wait for them; one before they are is free.

Each case is a program of its own, as this process has the threads; its forks are killed where they wait.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks on this system")
ROOT = Path(__file__).resolve().parents[2]
NEED_THREADS = ("cholesky", "cg", "multigrid", "stepper", "path", "factor")
"""Work of `PROGRAM` that does, however small the organ is."""

PROGRAM = """
import multiprocessing, sys
import numpy as np
import viscera as vs
from tests.conftest import block
from viscera import _core

def solve(solver):
    return lambda: organ.solve(traction={"x > 99%": (100.0, 0.0, 0.0)}, solver=solver)

def told(work):
    try:
        work()
        print("done", flush=True)
    except vs.VisceraError as error:
        print(error, flush=True)

bricks, first, names = int(sys.argv[1]), sys.argv[2], sys.argv[3:]
mesh = vs.mesh(*block((bricks,) * 3, (1.0,) * 3))
organ = vs.Organ(mesh, vs.NeoHookean(young=1e4, poisson=0.3), fixed="x < 1%")
rest = np.zeros_like(mesh.points)
made = organ.stepper() if "frame" in names else None
touch = organ.reduce("x > 99%", order=2, radius=0.3, depth=0.05) if "compressed" in names else None
works = {
    "nothing": lambda: None,
    "cholesky": solve("cholesky"),
    "cg": solve("cg"),
    "multigrid": solve("multigrid"),
    "stepper": organ.stepper,
    "frame": lambda: made.frame(),
    "path": lambda: organ.path(traction={"x > 99%": (100.0, 0.0, 0.0)}),
    "factor": lambda: _core.Factor("cholesky", np.array([0, 1], np.uint32), np.array([0], np.uint32)),
    "compressed": lambda: touch.compressed(0.1),
    "energy": lambda: organ._body.energy(rest),
    "stress": lambda: organ.moved(rest).von_mises(),
}
works[first]()
for name in names:
    print(name, end=" ", flush=True)
    fork = multiprocessing.get_context("fork").Process(target=told, args=(works[name],))
    fork.start()
    fork.join(20.0)
    if fork.is_alive():
        print("waits", flush=True)
        fork.kill()
        break
"""


def forked(bricks: int, first: str, *names: str, threads: int = 2) -> dict[str, str]:
    """What each piece of work says in a fork of its own, after the first in their common parent."""
    given = {**os.environ, "RAYON_NUM_THREADS": str(threads), "PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-c", PROGRAM, str(bricks), first, *names]
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, env=given, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    said = dict(line.split(" ", 1) for line in done.stdout.splitlines())
    assert list(said) == list(names)
    return said


def is_refused(said: str) -> bool:
    return "is a fork of process" in said and 'get_context("spawn")' in said


@pytest.mark.parametrize("bricks", [1, 8], ids=["small", "large"])
def test_a_fork_before_there_are_threads_is_free(bricks: int) -> None:
    names = (*NEED_THREADS, "energy", "stress")
    assert forked(bricks, "nothing", *names) == dict.fromkeys(names, "done")


@pytest.mark.parametrize(
    ("bricks", "first"), [(1, "cholesky"), (1, "stepper"), (1, "path"), (1, "factor"), (8, "stepper")]
)
def test_a_fork_after_there_are_is_refused_however_small_the_organ_is(bricks: int, first: str) -> None:
    said = forked(bricks, first, *NEED_THREADS)
    assert all(map(is_refused, said.values())), said


def test_what_was_made_before_a_fork_is_refused_in_it() -> None:
    said = forked(2, "nothing", "frame", "compressed")
    assert all(map(is_refused, said.values())), said


def test_integrals_over_a_small_body_need_no_threads_and_over_a_large_one_start_them() -> None:
    """Where there is a single one, too: it works for all that ask, who would wait for it."""
    assert forked(1, "cholesky", "energy", "stress") == {"energy": "done", "stress": "done"}
    assert is_refused(forked(8, "energy", "energy")["energy"])
    assert is_refused(forked(8, "energy", "cholesky", threads=1)["cholesky"])
