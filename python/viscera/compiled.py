"""The compiled part of the package is there: the first import of the package asks for it."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path


def require() -> None:
    """Import `viscera._core`; raises `ImportError` with what to do where it is missing or for another platform."""
    try:
        import_module("viscera._core")
    except ImportError as error:
        import platform

        here = f"Python {platform.python_version()} on {platform.system()} {platform.machine()}"
        raise ImportError(
            f"the compiled part of viscera, _core, is missing in {Path(__file__).parent}, or is not for {here}; build "
            f"it in a checkout of Viscera with `make setup`, or install a wheel for this platform ({error})"
        ) from error


require()
