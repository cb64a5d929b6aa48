"""The one package that fitting needs beside those of Viscera: scipy, of the extra `fit`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from viscera.errors import VisceraError


def scipy(module: str) -> Any:
    """A module of scipy, such as "optimize", loaded where it is first needed.

    Raises `VisceraError` if scipy is not installed.
    """
    try:
        return import_module(f"scipy.{module}")
    except ImportError as error:
        raise VisceraError("fitting needs scipy: pip install 'viscera[fit]'") from error
