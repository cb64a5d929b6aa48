"""What a label map is made of and asked for, checked: its values, the place of its voxels, labels, places in words."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.mesh import Floats
from viscera.quantity import numbers_of, refuse_masked, refused

ROUNDING = 1e-6
"""Of labels that a file keeps as multiples of a number such as 1/3, in single precision."""

AGREE = 0.5
"""Share of equal neighbours from which an image is taken for a label map. In organs of voxels it is nearly 1."""


def affine_of(given: Any) -> Floats:
    """An invertible map (3, 4) from the indices of voxels to their places."""
    affine = numbers_of(given)
    if affine is None or affine.ndim != 2:
        raise refused("the affine map", "an array (3, 4) or (4, 4)", given)
    affine = affine[:3]
    if affine.shape != (3, 4) or not np.isfinite(affine).all() or not _is_invertible(affine[:, :3]):
        raise VisceraError(f"the affine map {affine.tolist()} places no voxels; it must be (3, 4), and invertible")
    return affine


def _is_invertible(matrix: Floats) -> bool:
    """Whatever the size of the voxels."""
    return bool(abs(np.linalg.det(matrix)) > 1e-9 * np.linalg.norm(matrix, axis=0).prod())


def labels_of(given: Any) -> NDArray[np.uint16]:
    """Labels (i, j, k), whole numbers from 0 to 65535."""
    refuse_masked(given, "the values of a label map", "an array (i, j, k)")
    try:
        values = np.asarray(given)
    except ValueError:  # rows of different lengths
        raise refused("the values of a label map", "an array (i, j, k)", given) from None
    if values.ndim != 3 or values.size == 0:
        raise VisceraError(f"a label map has three dimensions, not the shape {values.shape}")
    if values.dtype.kind not in "biuf":
        raise VisceraError(f"a label map holds whole numbers, not {values.dtype}")
    if values.dtype.kind == "f":
        whole = np.rint(values)
        with np.errstate(invalid="ignore"):  # inf - inf, which is no label either
            wrong = values[~(np.abs(values - whole) <= ROUNDING * np.maximum(whole, 1.0))]
        if wrong.size:
            raise VisceraError(f"it holds {wrong.flat[0]:.9g}, which is no label; give a segmentation, not the scan")
        values = whole
    if values.dtype != np.bool_ and (values.min() < 0 or values.max() > 65535):
        raise VisceraError(f"its values go from {values.min()} to {values.max()}; labels are 0 to 65535")
    return np.ascontiguousarray(values.astype(np.uint16))


def is_label_map(voxels: NDArray[Any]) -> bool:
    """Whether the values (i, j, k) of an image are taken for labels.

    They are labels (`labels_of`), and at least half of the neighbours that are both above the smallest value are
    equal. Few are in a scan, whose noise changes from voxel to voxel; only what is cut off below is even there.
    """
    try:
        values = labels_of(voxels)
    except VisceraError:
        return False
    lowest, both, equal = values.min(), 0, 0
    for axis in range(3):
        lines = np.moveaxis(values, axis, 0)
        first, second = lines[:-1], lines[1:]
        counts = (first > lowest) & (second > lowest)
        both += int(np.count_nonzero(counts))
        equal += int(np.count_nonzero(counts & (first == second)))
    return equal >= AGREE * both


def several(numbers: Any, what: str) -> list[Any]:
    """One label or several as a list."""
    given = numbers.tolist() if isinstance(numbers, np.ndarray) else numbers
    if isinstance(given, int | str | np.integer):
        return [given]
    if isinstance(given, bytes) or not isinstance(given, Iterable):
        raise refused(what, "a label's number, or several", numbers)
    return list(given)


def texts(places: Any) -> list[str]:
    """One place in words or several as a list."""
    found = [places] if isinstance(places, str) or not isinstance(places, Iterable) else list(places)
    if not all(isinstance(place, str) for place in found):
        raise refused("fixed", "one place or several in words, such as 'z > 90%' or 'label:63'", places)
    return found
