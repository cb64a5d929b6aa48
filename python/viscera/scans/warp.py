"""An image or a label map of the moved organ, from one taken before it moved."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.mesh import Floats
from viscera.quantity import Choice
from viscera.scans.grid import Field
from viscera.scans.itk import sitk
from viscera.scans.labelmap import is_label_map

INTERPOLATIONS = ("linear", "nearest")
ROUNDING = 1e-9
"""Weights of neighbours below that are rounding of the place, which may fall on a voxel."""


def warp(
    image: Any, forward: Field, inverse: Field, *, interpolation: str = "linear", background: float | None = None
) -> Any:
    """An image (SimpleITK) of the moved organ: a voxel x of it takes the value that was at X = x + v(x).

    interpolation: "linear", or "nearest" for label maps. Voxels that the organ has left take `background`, by default
    the smallest finite value of the image. All others keep theirs, since the motion around the organ is not known.
    Of an image all voxels move that lie in the organ or in the margin around it; of a label map those alone whose
    label is one of `labels_moved`, so that the margin takes nothing of what lies beside the organ along.
    A value that is not finite moves too; of interpolated voxels those have one that lie between it and its neighbours.
    Raises `VisceraError` if the image has several values at a voxel, or no finite one to take for the background.
    """
    Choice(INTERPOLATIONS)(interpolation, "the interpolation")
    if image.GetNumberOfComponentsPerPixel() > 1:
        raise VisceraError("the image has several values at a voxel; give one of a single value")
    voxels = _voxels(image)
    empty = _smallest(voxels) if background is None else background
    if not _holds(voxels.dtype, empty):
        raise VisceraError(f"the background {empty} is no value of an image of {voxels.dtype}")
    left, covered = (np.argwhere(field.is_known) + field.first for field in (forward, inverse))
    values = _sampled(voxels, covered + _steps(inverse), interpolation, float(empty))
    labels = labels_moved(image, forward) if interpolation == "nearest" else None
    if labels is not None:
        left = left[np.isin(voxels[tuple(left.T)], labels)]
        arrives = np.isin(values, labels)
        covered, values = covered[arrives], values[arrives]
    moved = voxels.copy()
    moved[tuple(left.T)] = empty
    is_whole = np.issubdtype(voxels.dtype, np.integer)
    moved[tuple(covered.T)] = (np.rint(values) if is_whole else values).astype(voxels.dtype)
    warped = sitk().GetImageFromArray(np.ascontiguousarray(moved.transpose(2, 1, 0)))
    warped.CopyInformation(image)
    return warped


def labels_moved(image: Any, forward: Field) -> NDArray[Any] | None:
    """The labels of a label map that move with the organ; none if the image (SimpleITK) is no label map.

    A label is the organ's if as many of its voxels lie in the organ as in the margin around it. Of a neighbour only
    those lie in the organ that the mesh, whose surface is smooth, cuts off.
    """
    voxels = _voxels(image)
    if not is_label_map(voxels):
        return None
    box = tuple(slice(low, low + size) for low, size in zip(forward.first, forward.grid.shape, strict=True))
    labels, which = np.unique(voxels[box], return_inverse=True)
    which = which.reshape(forward.inside.shape)
    inside, beside = (
        np.bincount(which[mask], minlength=len(labels)) for mask in (forward.inside, forward.is_known & ~forward.inside)
    )
    # One at least moves, however thin the organ is.
    return np.asarray(labels[(inside > 0) & (inside >= np.minimum(beside, inside.max()))])


def _voxels(image: Any) -> NDArray[Any]:
    return np.asarray(sitk().GetArrayViewFromImage(image).transpose(2, 1, 0))


def _smallest(voxels: NDArray[Any]) -> Any:
    """The smallest finite value."""
    if np.issubdtype(voxels.dtype, np.integer):
        return voxels.min()
    finite = voxels[np.isfinite(voxels)]
    if not finite.size:
        raise VisceraError("no voxel of the image is finite; name a background, as in --background 0")
    return finite.min()


def _holds(kind: np.dtype[Any], value: Any) -> bool:
    if not np.issubdtype(kind, np.integer):
        return bool(np.isfinite(value))
    return float(value).is_integer() and np.iinfo(kind).min <= value <= np.iinfo(kind).max


def _steps(field: Field) -> Floats:
    """The displacement (k, 3) of known voxels in voxels."""
    return np.asarray(field.displacement[field.is_known] @ np.linalg.inv(field.grid.matrix).T)


def _sampled(voxels: NDArray[Any], index: Floats, interpolation: str, empty: float) -> Floats:
    """Values (k,) of an image at indices (k, 3); `empty` outside."""
    size = np.array(voxels.shape)
    values = np.full(len(index), empty)
    inside = ((index > -0.5) & (index < size - 0.5)).all(axis=1)
    at = index[inside]
    if interpolation == "nearest":
        values[inside] = voxels[tuple(np.rint(at).astype(np.int64).T)]
        return values
    at = np.clip(at, 0, size - 1)
    low = np.minimum(np.floor(at).astype(np.int64), np.maximum(size - 2, 0))
    part = at - low
    total = np.zeros(len(at))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, part, 1.0 - part), axis=1)
        counts = weight > ROUNDING  # 0 times NaN is NaN
        with np.errstate(invalid="ignore"):  # infinity beside minus infinity, between which nothing is known
            total[counts] += weight[counts] * voxels[tuple(np.minimum(low + corner, size - 1)[counts].T)]
    values[inside] = total
    return values
