"""The words of a case file: TOML of a size that cases have."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from viscera.errors import VisceraError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

LARGEST = 10_000_000
"""Bytes of a case file at most. Fields and places of many numbers are in mesh files."""
MOST_PARTS = 64
"""Parts of a dotted key at most: Python's parser needs a time that grows with the square of their number."""
LONG_KEY = re.compile(rf"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{MOST_PARTS}}}""", re.ASCII)


def read(path: Path) -> dict[str, Any]:
    """The tables and keys of a TOML file.

    Raises `VisceraError` with the name of the file if it is too large, not in UTF-8, or no TOML.
    """
    with path.open("rb") as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise VisceraError(
            f"{path}: a case file has at most {LARGEST / 1e6:g} MB; make long lists of nodes and cells sets of the mesh"
        )
    try:
        text = data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise VisceraError(f"{path}: not in UTF-8 (byte {error.start}: {error.reason}); save it as UTF-8") from error
    if key := LONG_KEY.search(text):
        line = text.count("\n", 0, key.start()) + 1
        raise VisceraError(f"{path}: line {line} has a key of {MOST_PARTS} parts and more, and no case has such a key")
    try:
        words: dict[str, Any] = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # wrong TOML; lists in lists in lists
        raise VisceraError(f"{path}: not a TOML file ({error})") from error
    return words
