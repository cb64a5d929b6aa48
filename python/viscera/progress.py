"""Progress of long work: a bar on a terminal or in a notebook, otherwise a line every ten seconds.

All of them consume the events `(done, total, stage)` that long work sends. They write at their own pace, so work that
sends nothing for a while is not silent.
"""

from __future__ import annotations

import contextvars
import functools
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from threading import Event, Thread
from time import perf_counter
from typing import Any, ParamSpec, TypeVar, cast

from viscera.quantity import refused

Progress = Callable[[int, int, str], None]
"""Called with the steps done, the total of steps, and the name of the stage. An exception that it raises stops all."""

Work = ParamSpec("Work")
Result = TypeVar("Result")

LINE_EVERY = 10.0
"""Pause between lines without a terminal [s]."""
PATIENCE = 2.0
"""Work that takes no longer shows no bar in a notebook [s]."""
REDRAW_EVERY = 0.5
"""Pause between two states of a notebook's bar [s]."""

_is_shown = False  # in this process, by a bar or lines; work within other work adds none


@contextmanager
def bar(is_quiet: bool = False) -> Iterator[Progress]:
    """A callback for the events of long work, shown on standard error: a bar per stage, or lines without a terminal."""
    if is_quiet:
        yield lambda done, total, stage: None
    elif sys.stderr.isatty():
        with _alone(), _terminal_bar() as show:
            yield show
    else:
        with _alone(), _told(_line, LINE_EVERY, LINE_EVERY) as show:
            yield show


def shown(work: Callable[Work, Result]) -> Callable[Work, Result]:
    """Decorator: the work shows a bar in a notebook, unless the caller's `progress` or work around it shows one.

    Raises `VisceraError` if that `progress` cannot be called: before the work, which calls it late.
    """

    @functools.wraps(work)
    def watched(*arguments: Work.args, **words: Work.kwargs) -> Result:
        if not (words.get("progress") is None or callable(words["progress"])):
            raise refused("progress", "a function of (done, total, stage), or None", words["progress"])
        if _is_shown or words.get("progress") is not None or not _is_notebook():
            return work(*arguments, **words)
        with _alone(), _told(_notebook_bar(), PATIENCE, REDRAW_EVERY) as show:
            show(0, 0, work.__name__)
            if "progress" in work.__annotations__:
                cast("dict[str, Any]", words)["progress"] = show
            return work(*arguments, **words)

    return watched


@contextmanager
def _alone() -> Iterator[None]:
    global _is_shown
    was_shown, _is_shown = _is_shown, True
    try:
        yield
    finally:
        _is_shown = was_shown


@contextmanager
def _told(tell: Callable[[int, int, str, float], None], first: float, every: float) -> Iterator[Progress]:
    """A callback whose latest event is told after a while, and then again and again until the work is done."""
    latest = [0, 0, "working"]
    is_done = Event()
    began = perf_counter()

    def keep_telling() -> None:
        wait = first
        while not is_done.wait(wait):
            tell(*cast("tuple[int, int, str]", tuple(latest)), perf_counter() - began)
            wait = every

    def show(done: int, total: int, stage: str) -> None:
        latest[:] = done, total, stage

    # What it displays belongs to the cell of the notebook that runs this.
    teller = Thread(target=contextvars.copy_context().run, args=(keep_telling,), daemon=True)
    teller.start()
    try:
        yield show
    finally:
        is_done.set()
        teller.join()


def _line(done: int, total: int, stage: str, seconds: float) -> None:
    print(f"{stage}{f' {done}/{total}' if total else ''}, {seconds:.0f} s", file=sys.stderr, flush=True)


def _is_notebook() -> bool:
    """Whether a Jupyter kernel runs this."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return shell is not None and hasattr(shell, "kernel")


def _notebook_bar() -> Callable[[int, int, str, float], None]:
    """A bar below the cell, drawn by the browser's own element, so that no widget has to be installed."""
    from IPython.display import HTML, display

    handle: Any = None

    def tell(done: int, total: int, stage: str, seconds: float) -> None:
        nonlocal handle
        extent = f'value="{done}" max="{total}"' if total else ""
        count = f" {done}/{total}" if total else ""
        drawn: Any = HTML(f"<progress {extent}></progress> {escape(stage)}{count}, {seconds:.0f} s")  # type: ignore[no-untyped-call]
        if handle is None:
            handle = display(drawn, display_id=True)  # type: ignore[no-untyped-call]
        else:
            handle.update(drawn)

    return tell


@contextmanager
def _terminal_bar() -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Display

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed}/{task.total}"))
    with Display(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True)) as display:
        stages: dict[str, TaskID] = {}

        def show(done: int, total: int, stage: str) -> None:
            if stage not in stages:
                stages[stage] = display.add_task(stage, total=total)
            display.update(stages[stage], completed=done, total=total)

        yield show
