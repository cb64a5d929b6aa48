"""Image files through SimpleITK, with a decimal point in every locale."""

from __future__ import annotations

import errno
import locale
import math
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from viscera.errors import VisceraError
from viscera.scans import metaspace, nifti
from viscera.scans.room import in_memory
from viscera.scans.stored import voxels_of

_ONE_AT_A_TIME = Lock()
"""The locale is that of the whole process: of two threads in turns, the second would keep what the first has set."""


def sitk() -> Any:
    """The library of images; raises `VisceraError` if it is not installed."""
    try:
        import SimpleITK
    except ImportError:
        raise VisceraError("images need the package SimpleITK: pip install SimpleITK") from None
    return SimpleITK


def read_by_itk(path: Path, ending: str) -> Any:
    """The image (SimpleITK) of a NRRD file or a MetaImage.

    Raises `VisceraError` for a header that ITK must not be given, for voxels that are damaged or not all there, and
    for more of them than fit into memory; `RuntimeError` as SimpleITK does.
    """
    library = sitk()
    stored, is_metaimage = voxels_of(path, ending), ending in (".mha", ".mhd")
    is_unsized = is_metaimage and stored.encoding == "zlib" and stored.files == [path] and stored.length is None
    with _decimal_points(), _with_size(path) if is_unsized else nullcontext(path) as source:
        shape, size = _declared(source)
        checksum = stored.require(size)
        with in_memory(shape, size):
            image = library.ReadImage(str(source))
    if is_metaimage and checksum is not None and not _has_checksum(image, checksum):
        raise VisceraError(
            f"its compressed voxels ({', '.join(file.name for file in stored.files[:3])}) are stored in a way that is "
            "not read; save it anew, without compression or as .nrrd"
        )
    return image


@contextmanager
def _with_size(path: Path) -> Iterator[Path]:
    """A copy of a MetaImage that says how many bytes its compressed voxels take."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "image.mha")
        metaspace.write_with_size(path, copy)
        yield copy


def _has_checksum(image: Any, checksum: int) -> bool:
    """Whether the voxels of an image have a CRC-32 in either order of their bytes.

    MetaIO leaves in place what was in memory where it cannot unpack voxels, and says so on the terminal alone.
    """
    voxels = np.ascontiguousarray(sitk().GetArrayViewFromImage(image))
    return checksum in (zlib.crc32(voxels.data), zlib.crc32(voxels.byteswap().data))


def _declared(path: Path) -> tuple[tuple[int, ...], int]:
    """The sizes of an image by its header, and the bytes of its voxels."""
    library = sitk()
    reader = library.ImageFileReader()
    reader.SetFileName(str(path))
    reader.ReadImageInformation()
    shape, values = reader.GetSize(), reader.GetNumberOfComponents()
    one = library.GetArrayViewFromImage(library.Image([1, 1, 1], reader.GetPixelID(), values))
    return shape, math.prod(shape) * int(one.nbytes)


def write_by_itk(image: Any, scratch: Path, ending: str) -> None:
    """Writes an image of SimpleITK in the format of the ending, whatever that of the scratch file.

    Raises `OSError` of the scratch file unless it holds every voxel: on a full disk the library writes a part of some
    formats and says nothing. What it wrote is therefore read again. Voxels that are not finite are written as they are.
    """
    library = sitk()
    # A scratch file keeps only the last ending. It stands once alone: ITK makes one `.nii` of two.
    whole = scratch.with_name(scratch.stem + ending)
    try:
        with _decimal_points():
            library.WriteImage(image, str(whole), useCompression=True)
        if not _is_kept(image, whole, ending):
            raise OSError(errno.EIO, "not every voxel is in the file", str(scratch))
        whole.replace(scratch)
    except RuntimeError as error:
        reason = str(error).strip().rpartition("\n")[2]
        raise OSError(errno.EIO, f"SimpleITK: {reason}", str(scratch)) from error
    finally:
        if whole != scratch:
            whole.unlink(missing_ok=True)


def _is_kept(image: Any, whole: Path, ending: str) -> bool:
    """Whether a file holds every voxel of an image; NIfTI through nibabel, since ITK reads NaN and infinity there as 0.

    Raises `VisceraError` if nibabel is not installed.
    """
    library = sitk()
    if ending not in (".nii", ".nii.gz"):
        return bool(library.Hash(read_by_itk(whole, ending)) == library.Hash(image))
    nibabel = nifti.nibabel()
    voxels = library.GetArrayViewFromImage(image)
    try:
        file: Any = nibabel.load(whole, mmap=False)  # a mapped file cannot be moved everywhere
        stored = np.asanyarray(file.dataobj)
    except Exception:  # of a part of a file it raises whatever its parser meets
        return False
    # Several values at a voxel are (i, j, k, 1, c) in NIfTI.
    axes = (2, 1, 0) if stored.ndim == 3 else (2, 1, 0, *range(3, stored.ndim))
    turned = stored.transpose(axes)
    return turned.size == voxels.size and np.array_equal(turned.reshape(voxels.shape), voxels, equal_nan=True)


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
