"""How many threads share the work of the core."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from time import perf_counter

import pytest

from viscera import threads
from viscera.bench.machine import stamp

TOO_MANY = ["99999999", "99999999999999999999999", "1" * 5000]
SOLVES = """
import viscera as vs
organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
print(organ.solve(force={"tip": (0, 0, -1.0)}).status)
"""


@pytest.mark.parametrize("number", TOO_MANY)
def test_more_threads_than_are_of_use_are_limited_and_told(
    number: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv(threads.VARIABLE, number)
    with caplog.at_level(logging.WARNING, "viscera"):
        threads.limit()
        threads.limit()
    most = threads.MOST_PER_CORE * threads.cores()
    assert threads.in_use() == most
    assert os.environ[threads.VARIABLE] == str(most), "the core reads it from there"
    assert len(caplog.messages) == 1
    told, _, advice = caplog.messages[0].partition("; ")
    assert told.startswith(f"RAYON_NUM_THREADS is {number[:8]}")
    assert len(told) < 60
    assert advice == f"{most} threads are taken, 16 for each core"


@pytest.mark.parametrize(
    ("given", "expected"),
    [("3", 3), ("+3", 3), ("003", 3), ("0", None), ("", None), ("many", None), ("-1", None), (" 3", None), ("٣", None)],
)
def test_what_is_no_number_means_all_cores(
    given: str, expected: int | None, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv(threads.VARIABLE, given)
    threads.limit()
    assert (os.environ[threads.VARIABLE], caplog.messages) == (given, [])
    count = expected or threads.cores()
    assert threads.in_use() == count
    assert stamp().endswith(f" {count} thread{'s' if count > 1 else ''}")


def test_a_solve_with_too_many_threads_ends() -> None:
    began = perf_counter()
    given = {**os.environ, threads.VARIABLE: TOO_MANY[0]}
    done = subprocess.run([sys.executable, "-c", SOLVES], capture_output=True, text=True, timeout=60, env=given)
    assert (done.returncode, done.stdout) == (0, "converged\n")
    assert "RAYON_NUM_THREADS is 99999999; " in done.stderr
    assert perf_counter() - began < 30.0, "to start them takes minutes"
