"""Executors that cannot go on: shut down, without workers, no executors at all. One sentence says what to do."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import viscera as vs
from viscera.reduced.checkpoint import Checkpoint

PLACE = "top and x > 60%"
SETTINGS: dict[str, Any] = {"order": 2, "depth": 0.03, "radius": 0.06}


def twice(shared: list[int], task: int) -> int:
    return 2 * shared[0] + task


def raised(work: Callable[[], Any]) -> BaseException | None:
    """What some work raises within a while; none if it is still at it, on a thread that no one waits for."""
    found: list[BaseException] = []

    def run() -> None:
        try:
            work()
        except BaseException as error:
            found.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(20.0)
    return found[0] if found else None


class Lost(Executor):
    """An executor whose workers are gone: it raises an error, or its futures hold it or are cancelled."""

    def __init__(self, error: Exception, *, at_once: bool) -> None:
        self.error, self.at_once = error, at_once

    def submit(self, *_: Any, **__: Any) -> Any:
        if self.at_once:
            raise self.error
        future: Future[Any] = Future()
        if isinstance(self.error, CancelledError):
            future.cancel()
        else:
            future.set_exception(self.error)
        return future


def of_dask(name: str) -> Exception:
    distributed = pytest.importorskip("distributed", reason="pip install viscera[cluster]")
    errors: dict[str, Callable[[], Exception]] = {
        "ClosedClientError": lambda: distributed.client.ClosedClientError("abruptly"),
        "FutureCancelledError": lambda: distributed.client.FutureCancelledError("the task", "abruptly"),
        "KilledWorker": lambda: distributed.KilledWorker("the task", SimpleNamespace(address="tcp://far"), 3),
    }
    return errors[name]()


@pytest.mark.parametrize(
    ("error", "at_once", "words"),
    [
        (BrokenExecutor("abruptly"), True, "has lost its workers .abruptly"),
        (BrokenExecutor("abruptly"), False, "has lost its workers .abruptly"),
        (RuntimeError("abruptly"), True, "takes no work .abruptly"),
        (CancelledError(), False, "was shut down"),
        ("ClosedClientError", True, "takes no work .abruptly"),
        ("FutureCancelledError", True, "was shut down"),
        ("KilledWorker", False, r"gave up task 0 .*the task.*died while running it"),
    ],
)
def test_an_executor_that_cannot_go_on_is_told(error: Exception | str, at_once: bool, words: str) -> None:
    """By one remedy, that every call has: a sweep has no checkpoint."""
    given = of_dask(error) if isinstance(error, str) else error
    told = raised(lambda: vs.sweep(twice, [21], [1], executor=Lost(given, at_once=at_once)))
    assert isinstance(told, vs.VisceraError), told
    assert re.fullmatch(rf"the executor {words}(?s:.)*; make another one and call again", str(told)), told


def test_what_a_task_raises_is_no_error_of_its_executor() -> None:
    with pytest.raises(RuntimeError, match="abruptly"):
        vs.sweep(twice, [21], [1], executor=Lost(RuntimeError("abruptly"), at_once=False))


def test_a_client_of_dask_is_told_how_it_is_an_executor_and_that_it_is_closed() -> None:
    distributed = pytest.importorskip("distributed", reason="pip install viscera[cluster]")
    with distributed.Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as client:
        with pytest.raises(
            vs.VisceraError, match=r"must be a concurrent.futures.Executor, (?s:.)*; give its get_executor"
        ):
            vs.sweep(twice, [21], [1], executor=client)
        executor = client.get_executor()
        assert vs.sweep(twice, [21], [1], executor=executor) == [43]
    with pytest.raises(vs.VisceraError, match=r"the executor takes no work .*make another one and call again"):
        vs.sweep(twice, [21], [1], executor=executor)


@pytest.fixture
def organ() -> vs.Organ:
    return vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")


def test_work_ends_when_its_executor_is_shut_down_and_what_is_finished_is_kept(organ: vs.Organ, tmp_path: Path) -> None:
    whole = organ.reduce(PLACE, **SETTINGS)
    path, said = tmp_path / "beam.batches", list[str]()

    def ended(work: Callable[[Executor, Callable[..., None]], Any]) -> BaseException | None:
        pool = ThreadPoolExecutor(1)

        def shut(done: int, total: int, stage: str) -> None:
            if done > 0:
                pool.shutdown(wait=False, cancel_futures=True)

        return raised(lambda: work(pool, shut))

    for work in (
        lambda pool, shut: vs.sweep(late, [21], range(6), executor=pool, progress=shut),
        lambda pool, shut: organ.reduce(PLACE, **SETTINGS, executor=pool, progress=shut, checkpoint=path),
        lambda pool, shut: whole.check(touches=6, executor=pool, progress=shut),
    ):
        error = ended(work)
        assert isinstance(error, vs.VisceraError), error
        assert str(error) == "the executor was shut down; make another one and call again"
    organ.reduce(PLACE, **SETTINGS, checkpoint=Checkpoint(path, said.append))
    assert "continuing after" in said[0]


def late(shared: list[int], task: int) -> int:
    time.sleep(0.05)
    return shared[0] + task
