"""Files that appear whole or not at all: written beside their place under another name, then renamed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from viscera.errors import VisceraError


def writable(path: str | os.PathLike[str]) -> Path:
    """The path, or an error where no file can be put: worth asking before long work."""
    target = Path(path)
    if not target.parent.is_dir():
        raise VisceraError(f"{target}: the folder {str(target.parent)!r} does not exist; create it first")
    if target.is_dir():
        raise VisceraError(f"{target} is a folder; name a file in it")
    return target


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A scratch path to write to; it takes the place of `path` when the block ends well and vanishes when it does not.

    The suffix is kept, since writers choose the format by it.
    """
    target = writable(path)
    scratch = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        yield scratch
        scratch.replace(target)
    finally:
        scratch.unlink(missing_ok=True)
