"""The library that computes on a graphics processor: a file beside the compiled core, in builds that have it."""

from __future__ import annotations

import logging
import sys
from pathlib import Path

from viscera import _core
from viscera.errors import VisceraError

log = logging.getLogger("viscera")

NAMES = {"darwin": "libviscera_gpu.dylib", "win32": "viscera_gpu.dll"}
LIBRARY = Path(__file__).with_name(NAMES.get(sys.platform, "libviscera_gpu.so"))


def load() -> None:
    """Load the library, once; raises `VisceraError` if there is none, or one of another version."""
    if not LIBRARY.exists():
        raise VisceraError(
            "this build of viscera has no library for graphics processors; "
            "build it with `make GPU=1 setup`, or choose another solver"
        )
    _core.load_gpu(str(LIBRARY))


def describe() -> str:
    """The graphics processor in words; raises `VisceraError` if there is none to compute on."""
    load()
    name, driver, interface, is_software = _core.gpu()
    about = f"{name} ({', '.join(word for word in (interface, driver) if word)})"
    return f"{about}, software on the processor" if is_software else about


def report(fault: str | None, told: str | None = None) -> str | None:
    """Warn of a fault of the graphics processor that was not told yet; the fault."""
    if fault not in (None, told):
        log.warning("%s; continuing on the processor", fault)
    return fault
