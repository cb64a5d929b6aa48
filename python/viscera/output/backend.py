"""matplotlib, imported whatever MPLBACKEND says: pictures here are drawn by Agg, which needs no window.

matplotlib itself cannot be imported where that variable names no backend, and the work before a picture would be lost.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress


@contextmanager
def without_window() -> Iterator[None]:
    """While this lasts, MPLBACKEND names no backend."""
    named = os.environ.pop("MPLBACKEND", None)
    try:
        yield
    finally:
        if named is not None:
            os.environ["MPLBACKEND"] = named


def require() -> None:
    """Import matplotlib, and then give it the backend as it would have taken it: for the windows of a script."""
    if "matplotlib" in sys.modules:
        return
    with without_window():
        import matplotlib
    if named := os.environ.get("MPLBACKEND"):
        with suppress(ValueError):
            matplotlib.rcParams["backend"] = named
