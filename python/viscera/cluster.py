"""Work spread over processes or machines, by any `concurrent.futures.Executor`.

What all tasks share, such as an organ, travels once to each worker. A task is sent without it; a worker that lacks it
says so, and only then is it sent along. So nothing needs to be known of the workers: how many there are, which of them
are new, where they run. What a task returns does not depend on who does it, and results are put in the order of tasks,
so they are the same for any number of workers.
"""

from __future__ import annotations

import os
import pickle
import socket
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from queue import Empty, SimpleQueue
from traceback import walk_tb
from typing import Any, TypeVar
from uuid import uuid4

from viscera.errors import VisceraError
from viscera.progress import Progress, shown
from viscera.quantity import refused

Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")

EVERY = 0.1
"""Seconds between two calls of a progress callback, which may stop the work."""
KEPT = 2
"""Number of shared objects that a worker keeps: memory is bounded, and two studies may take turns."""

_UNPICKLABLE = (pickle.PicklingError, AttributeError, TypeError)
"""What pickle raises where it cannot take a value."""
_DASK = "distributed"
"""The package of Dask: its errors have no base class of the standard library, and are known by it."""

_is_fork = False
"""Whether this process is a fork of another: it lacks the threads of the core, and would wait for them for ever."""


def _mark_fork() -> None:
    global _is_fork
    _is_fork = True


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_mark_fork)

_shared: dict[str, Any] = {}
"""In a worker: what tasks share, by the name of the work."""


@dataclass(frozen=True)
class Reply:
    """What a worker gives back."""

    worker: str
    is_done: bool
    """False if the worker lacks what the tasks share."""
    result: Any = None


@shown
def sweep(
    work: Callable[[Shared, Task], Result],
    shared: Shared,
    tasks: Iterable[Task],
    *,
    executor: Executor,
    progress: Progress | None = None,
) -> list[Result]:
    """`[work(shared, task) for task in tasks]` on the workers of an executor, in the order of the tasks.

    work: a function that the workers can import, or any for threads. shared: an organ, a model or whatever pickle
    takes; it travels once to each worker. executor: a `ProcessPoolExecutor`, `client.get_executor()` of Dask, an
    `MPIPoolExecutor` of mpi4py, a `ThreadPoolExecutor`. What a task raises ends the sweep.

    >>> from concurrent.futures import ThreadPoolExecutor
    >>> with ThreadPoolExecutor(2) as pool:
    ...     sweep(pow, 2, [3, 5, 1], executor=pool)
    [8, 32, 2]
    """
    if not callable(work):
        raise refused("the work of a sweep", "a function of what the tasks share and of a task", work)
    if not isinstance(tasks, Iterable):
        raise VisceraError(f"the tasks of a sweep must be a sequence of what `work` takes one by one, got {tasks!r}")
    each = list(tasks)
    found: dict[int, Result] = {}
    for number, result in spread(work, shared, each, executor, lambda: _report(progress, len(found), len(each))):
        found[number] = result
    return [found[number] for number in range(len(each))]


def spread(
    work: Callable[[Shared, Task], Result],
    shared: Shared,
    tasks: Sequence[Task],
    executor: Executor,
    attend: Callable[[], None] = lambda: None,
) -> Iterator[tuple[int, Result]]:
    """Number and result of each task when it is done; `attend` is called several times a second and may raise."""
    if not isinstance(executor, Executor):
        remedy = "; give its get_executor()" if hasattr(executor, "get_executor") else ""
        raise VisceraError(f"the executor must be a concurrent.futures.Executor, got {executor!r}{remedy}")
    with _at_hand(shared) as name:
        sender = _Sender(executor, work, name, shared)
        try:
            yield from sender.results(tasks, attend)
        finally:
            sender.cancel()


class _Sender:
    """Sends the tasks of one work, and what they share to the workers that lack it."""

    def __init__(self, executor: Executor, work: Callable[..., Any], name: str, shared: Any) -> None:
        self._executor, self._work, self._name, self._shared = executor, work, name, shared
        self._data: bytes | None = None
        self._attempts = count()
        self._under_way: dict[Future[Reply], tuple[int, bool]] = {}
        """Number of the task, and whether it took the data along."""
        self._done: SimpleQueue[Future[Reply]] = SimpleQueue()
        """Also what an executor cancels that is shut down, of which `concurrent.futures.wait` never hears."""
        self._lacking: set[str] = set()

    def results(self, tasks: Sequence[Any], attend: Callable[[], None]) -> Iterator[tuple[int, Any]]:
        """Number and result of each task."""
        waiting: deque[int] = deque()
        for number in range(len(tasks)):
            self._send(number, tasks[number])
        while self._under_way:
            future = self._next()
            attend()
            if future is None:
                continue
            number, _ = self._under_way.pop(future)
            reply = self._reply(future, tasks[number], number)
            if reply.is_done:
                self._lacking.discard(reply.worker)
                yield number, reply.result
                released = 2  # one for the worker that is free, one for a worker that may be
            else:
                self._lacking.add(reply.worker)
                waiting.append(number)
                released = 0
            while waiting and self._carrying() < len(self._lacking):
                number = waiting.popleft()
                self._send(number, tasks[number], takes_data=True)
            while waiting and (released or not self._under_way):
                number, released = waiting.popleft(), max(released - 1, 0)
                self._send(number, tasks[number])

    def cancel(self) -> None:
        """Calls back what has not begun."""
        for future in self._under_way:
            future.cancel()

    def _next(self) -> Future[Reply] | None:
        """What is done or cancelled next; none if nothing is in a while."""
        try:
            return self._done.get(timeout=EVERY)
        except Empty:
            return None

    def _carrying(self) -> int:
        return sum(takes_data for _, takes_data in self._under_way.values())

    def _send(self, number: int, task: Any, *, takes_data: bool = False) -> None:
        if takes_data and self._data is None:
            self._data = _dumped(self._shared, "what the tasks share")
        data = self._data if takes_data else None
        # The number of the attempt makes each call another: Dask takes equal calls for one.
        # Executors of the standard library say by a RuntimeError that they are shut down.
        with _telling("takes no work", RuntimeError):
            future = self._executor.submit(_do, next(self._attempts), self._work, self._name, data, task)
        self._under_way[future] = number, takes_data
        future.add_done_callback(self._done.put)

    def _reply(self, future: Future[Reply], task: Any, number: int) -> Reply:
        with _telling(f"gave up task {number}"):
            try:
                return future.result()
            except _UNPICKLABLE as error:
                if not any(frame.f_code is _do.__code__ for frame, _ in walk_tb(error.__traceback__)):
                    _dumped(self._work, "the work")
                    _dumped(task, f"task {number}")
                raise


@contextmanager
def _telling(refusal: str, *others: type[Exception]) -> Iterator[None]:
    """Errors of the executor itself become `VisceraError`; those of Dask, and `others`, by the words of `refusal`."""
    try:
        yield
    except CancelledError as error:
        raise VisceraError("the executor was shut down; make another one and call again") from error
    except BrokenExecutor as error:
        raise VisceraError(f"the executor has lost its workers ({error}); make another one and call again") from error
    except Exception as error:
        if not isinstance(error, others) and type(error).__module__.partition(".")[0] != _DASK:
            raise
        raise VisceraError(f"the executor {refusal} ({error}); make another one and call again") from error


def _dumped(value: Any, name: str) -> bytes:
    """The value as it travels to a worker."""
    try:
        return pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
    except _UNPICKLABLE as error:
        is_code = callable(value) or "function" in str(error) or "local object" in str(error)
        hint = (
            "a function must stand at the top of a module, so no lambda and none within another"
            if is_code
            else ("send what it is made of, and make it in the work")
        )
        raise VisceraError(f"{name} cannot travel to another process ({error}): {hint}; or take threads") from error


def _do(attempt: int, work: Callable[[Any, Any], Any], name: str, data: bytes | None, task: Any) -> Reply:
    """One task, in a worker."""
    if _is_fork:
        raise VisceraError(
            "the workers are forks of this process and lack its threads; make the executor with "
            'ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn"))'
        )
    worker = f"{socket.gethostname()} {os.getpid()}"
    try:
        shared = _shared[name]
    except KeyError:
        if data is None:
            return Reply(worker, is_done=False)
        for oldest in list(_shared)[: max(len(_shared) + 1 - KEPT, 0)]:
            _shared.pop(oldest, None)
        shared = _shared[name] = pickle.loads(data)
    return Reply(worker, is_done=True, result=work(shared, task))


@contextmanager
def _at_hand(shared: Any) -> Iterator[str]:
    """A name of the work, by which threads of this process have what it shares."""
    name = uuid4().hex
    _shared[name] = shared
    try:
        yield name
    finally:
        _shared.pop(name, None)


def _report(progress: Progress | None, done: int, total: int) -> None:
    if progress:
        progress(done, total, "sweep")
