"""Image files through SimpleITK, with a decimal point in every locale."""

from __future__ import annotations

import errno
import locale
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

from viscera.errors import VisceraError

_ONE_AT_A_TIME = Lock()
"""The locale is that of the whole process: of two threads in turns, the second would keep what the first has set."""


def sitk() -> Any:
    """The library of images; raises `VisceraError` if it is not installed."""
    try:
        import SimpleITK
    except ImportError:
        raise VisceraError("images need the package SimpleITK: pip install SimpleITK") from None
    return SimpleITK


def read_by_itk(path: Path) -> Any:
    """The image (SimpleITK) of a file; raises `RuntimeError` as SimpleITK does."""
    library = sitk()
    with _decimal_points():
        return library.ReadImage(str(path))


def write_by_itk(image: Any, scratch: Path, ending: str) -> None:
    """Writes an image of SimpleITK in the format of the ending, whatever that of the scratch file.

    Raises `OSError` of the scratch file unless it holds every voxel: on a full disk the library writes a part of some
    formats and says nothing. What it wrote is therefore read again.
    """
    library = sitk()
    # A scratch file keeps only the last ending. It stands once alone: ITK makes one `.nii` of two.
    whole = scratch.with_name(scratch.stem + ending)
    try:
        with _decimal_points():
            library.WriteImage(image, str(whole), useCompression=True)
        if library.Hash(read_by_itk(whole)) != library.Hash(image):
            raise OSError(errno.EIO, "not every voxel is in the file", str(scratch))
        whole.replace(scratch)
    except RuntimeError as error:
        reason = str(error).strip().rpartition("\n")[2]
        raise OSError(errno.EIO, f"SimpleITK: {reason}", str(scratch)) from error
    finally:
        if whole != scratch:
            whole.unlink(missing_ok=True)


@contextmanager
def _decimal_points() -> Iterator[None]:
    """Numbers have a decimal point in this block.

    ITK reads and writes the headers of NRRD files by C's `sscanf` and `sprintf`, which obey the locale of the process.
    Where that has a decimal comma, as GUI toolkits and `locale.setlocale` may set it, 2.5 mm would be read as 2 mm,
    without an error. Where it has a point, nothing is set: other threads see the change too.
    """
    with _ONE_AT_A_TIME:
        if locale.localeconv()["decimal_point"] == ".":
            yield
            return
        before = locale.setlocale(locale.LC_NUMERIC)
        locale.setlocale(locale.LC_NUMERIC, "C")
        try:
            yield
        finally:
            locale.setlocale(locale.LC_NUMERIC, before)
