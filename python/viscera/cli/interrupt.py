"""Ctrl-C ends a command wherever it comes.

Python drops an exception that is raised in the callback of a weak reference, in `__del__` or in a callback from C: it
tells `sys.unraisablehook` and goes on. A `KeyboardInterrupt` that comes there would be lost, so it is sent again.
"""

from __future__ import annotations

import _thread
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer, main_thread
from typing import Any

AGAIN = 0.01
"""Pause before an interrupt that was dropped is sent again [s]: what dropped it is then mostly over."""


@contextmanager
def heard() -> Iterator[None]:
    """An interrupt that is dropped in this block is raised again in it, at its end at the latest."""
    before, dropped = sys.unraisablehook, list[Timer]()

    def hook(lost: Any) -> None:
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            before(lost)
            return
        dropped.append(Timer(AGAIN, _interrupt))
        dropped[-1].daemon = True
        dropped[-1].start()

    sys.unraisablehook = hook
    try:
        yield
        if any(timer.is_alive() for timer in dropped):
            raise KeyboardInterrupt
    finally:
        sys.unraisablehook = before
        for timer in dropped:
            timer.cancel()


def _interrupt() -> None:
    """Ctrl-C for the main thread, even if it waits for something."""
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        signal.pthread_kill(main_thread().ident or 0, signal.SIGINT)
