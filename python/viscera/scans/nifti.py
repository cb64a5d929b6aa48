"""NIfTI files through nibabel: their voxels, where these lie, and whether the file holds all of them unharmed."""

from __future__ import annotations

import gzip
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.files.mesh import METRES
from viscera.mesh import Floats
from viscera.scans.room import in_memory

GZIP = ".nii.gz"
MOST = 1032
"""Bytes that a compressed byte holds at the most: deflate codes 258 of them in two bits."""
CHUNK = 1 << 20
"""Bytes that are read at once."""


def nibabel() -> Any:
    """The library of NIfTI; raises `VisceraError` if it is not installed."""
    try:
        import nibabel as library
    except ImportError:
        raise VisceraError("this image needs the package nibabel: pip install nibabel") from None
    return library


def read(path: Path, ending: str) -> tuple[NDArray[Any], Floats]:
    """Values (i, j, k, ...) and affine map (3, 4) [m] to RAS of a file.

    Raises `VisceraError` if the file is shorter than its header says or was changed since it was compressed, if the
    voxels do not fit into memory, and if it does not say where it lies; else whatever nibabel raises.
    """
    image = nibabel().load(path)
    _require_length(image, path, ending)
    shape = image.dataobj.shape
    with in_memory(shape, _bytes_of(image)):
        values = _unharmed(type(image), path) if ending == GZIP else np.asanyarray(image.dataobj)
    while values.ndim > 3 and values.shape[-1] == 1:
        values = values[..., 0]
    return values, _affine(image)


def _unharmed(kind: Any, path: Path) -> NDArray[Any]:
    """The voxels of a compressed file, read to the end of its stream, where gzip keeps checksum and length.

    nibabel stops at the last voxel: most changes of a compressed file would be other voxels without a word.
    """
    try:
        with gzip.open(path) as stream:
            values: NDArray[Any] = np.asanyarray(kind.from_stream(stream).dataobj)
            while stream.read(CHUNK):
                pass
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise VisceraError(f"it is damaged or cut short, so its voxels may be wrong ({error}); copy it anew") from error
    return values


def _require_length(image: Any, path: Path, ending: str) -> None:
    """Raises `VisceraError` if a file cannot hold the voxels that it declares, before room is made for them."""
    size, needed = path.stat().st_size, _bytes_of(image)
    held = MOST * size if ending == GZIP else size - int(image.dataobj.offset)
    if needed > held:
        shape = " x ".join(map(str, image.dataobj.shape))
        raise VisceraError(
            f"its header declares {shape} voxels of {needed} bytes, which a file of {size} bytes does not hold: it is "
            "cut short or damaged; copy it anew"
        )


def _bytes_of(image: Any) -> int:
    """Bytes of the voxels as they are stored."""
    return math.prod(map(int, image.dataobj.shape)) * int(image.dataobj.dtype.itemsize)


def _affine(image: Any) -> Floats:
    # Of such an image nibabel and ITK guess different places, and nobody says what is left and what is right.
    if int(image.header["sform_code"]) == 0 and int(image.header["qform_code"]) == 0:
        raise VisceraError(
            "its header does not say where the image lies (sform_code and qform_code are 0); set the sform, with "
            'nibabel by image.set_sform(affine, "scanner"), or give its values and axes to vs.Scan'
        )
    unit = {"meter": 1.0, "micron": 1e-6}.get(image.header.get_xyzt_units()[0], METRES["mm"])
    return np.asarray(unit * image.affine[:3])
