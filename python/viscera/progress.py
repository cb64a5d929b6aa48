"""A progress bar on the terminal: a consumer of the events that long work sends; silent where nobody is watching."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn


@contextmanager
def bar(is_quiet: bool = False) -> Iterator[Callable[[int, int, str], None]]:
    """A callback `(done, total, stage)` that draws one bar per stage on standard error, if that is a terminal."""
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed}/{task.total}"))
    clock = (TimeElapsedColumn(), TimeRemainingColumn())
    is_watched = sys.stderr.isatty() and not is_quiet
    with Progress(*columns, *clock, console=Console(stderr=True), disable=not is_watched) as display:
        stages: dict[str, TaskID] = {}

        def show(done: int, total: int, stage: str) -> None:
            if stage not in stages:
                stages[stage] = display.add_task(stage, total=total)
            display.update(stages[stage], completed=done, total=total)

        yield show
