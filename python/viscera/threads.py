"""Threads that share the work of the core: as many as `RAYON_NUM_THREADS` says, within bounds, or as there are cores.

The core starts them when there is first something to share, and reads the variable then.
"""

from __future__ import annotations

import logging
import os
import re

VARIABLE = "RAYON_NUM_THREADS"
MOST_PER_CORE = 16
"""Threads for each core at most. Starting thousands takes longer than the work, and none of them is of use."""

log = logging.getLogger("viscera")


def cores() -> int:
    """Cores that this process may use."""
    has_affinity = hasattr(os, "sched_getaffinity")
    return len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1


def in_use() -> int:
    """Threads among which the core shares its work."""
    return _given() or cores()


def limit() -> None:
    """Bound the number that the variable gives: called before the core starts threads; a sentence is logged."""
    most = MOST_PER_CORE * cores()
    if _given() > most:
        given = os.environ[VARIABLE]
        os.environ[VARIABLE] = str(most)
        shown = given if len(given) <= 24 else f"{given[:21]}..."
        log.warning("%s is %s; %d threads are taken, %d for each core", VARIABLE, shown, most, MOST_PER_CORE)


def _given() -> int:
    """The number in the variable; 0 if there is none, which means as many as there are cores."""
    text = os.environ.get(VARIABLE, "")
    digits = text.lstrip("+0")[:18] if re.fullmatch(r"\+?[0-9]+", text) else ""  # more of them are too many anyway
    return int(digits or "0")


limit()
