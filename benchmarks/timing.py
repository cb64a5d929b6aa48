"""How long something takes on a machine that others use as well."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter


def least(work: Callable[[], object], runs: int, clock: Callable[[], float] = perf_counter) -> float:
    """Seconds of the fastest of some runs, by a clock: other work only adds time."""
    times = []
    for _ in range(runs):
        began = clock()
        work()
        times.append(clock() - began)
    return min(times)
