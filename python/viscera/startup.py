"""Ctrl-C while the command's modules load: there is nothing to clean up yet, so it ends at once, without a traceback.

The first import of the package, before anything that takes time; a program that uses Viscera keeps its own handler.
"""

from __future__ import annotations

import signal
import sys
from threading import current_thread, main_thread


def _is_command() -> bool:
    """Whether this process is `viscera` or `python -m viscera`."""
    program = sys.argv[0].replace("\\", "/").rpartition("/")[2] if sys.argv else ""
    if program in {"viscera", "viscera.exe"}:
        return True
    words = sys.orig_argv[1:]
    return program == "-m" and "-m" in words and words[words.index("-m") + 1 : words.index("-m") + 2] == ["viscera"]


def handle_interrupts() -> None:
    """From here on Ctrl-C is Python's `KeyboardInterrupt` again, where it was before."""
    if _ends_at_once and signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)


_ends_at_once = (
    _is_command()
    and current_thread() is main_thread()
    and signal.getsignal(signal.SIGINT) is signal.default_int_handler
)
if _ends_at_once:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
