"""Fibre directions of the cells of a mesh, from images of vectors."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from viscera.errors import VisceraError, naming
from viscera.mesh import Floats, Mesh
from viscera.quantity import numbers_of, refused
from viscera.scans.grid import require_as_scanned
from viscera.scans.image import read_vectors
from viscera.scans.scan import Scan

log = logging.getLogger("viscera")


def image_fibres(mesh: Mesh, *images: str | os.PathLike[str] | tuple[ArrayLike, ArrayLike]) -> Floats:
    """Fibre directions per cell (2, m, 3), two families, from one or two vector images (both families from one).

    images: files, or pairs of vectors (i, j, k, 3) and affine map (3, 4) [m]. Their components are along the world
    axes, in a NRRD file along the axes of its `space` or its `measurement frame`; they are turned to the axes of the
    mesh. At a centroid the direction is the principal one of `sum w v v^T` over the eight voxels around it, w being
    trilinear weights: v and -v are the same fibre. Raises `VisceraError` if a cell lies outside the image, where no
    direction is given around it, and for a mesh without the loads of its scan.

    >>> import numpy as np
    >>> import viscera as vs
    >>> vectors = np.zeros((30, 10, 10, 3))
    >>> vectors[..., 0] = 1.0  # along x everywhere
    >>> affine = np.hstack([0.04 * np.eye(3), [[-0.05]] * 3])
    >>> vs.image_fibres(vs.organs.beam(), (vectors, affine))[:, 0].tolist()
    [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    """
    require_as_scanned(mesh)
    if len(images) not in (1, 2):
        raise VisceraError(f"fibres need one image or two, got {len(images)}")
    families = [_directions(mesh, image, str(k)) for k, image in enumerate(images, start=1)]
    return np.stack([families[0], families[-1]])


def _directions(mesh: Mesh, image: Any, name: str) -> Floats:
    """Unit directions (m, 3) at the centroids."""
    if isinstance(image, str | os.PathLike):
        name = str(image)
        with naming(name):
            vectors, affine, axes = read_vectors(Path(image))
        if not mesh.axes:
            log.warning(
                "the mesh states no world axes; they are taken for %s, those of %s: "
                "a mesh in other axes has its fibres mirrored",
                axes,
                name,
            )
    else:
        if not isinstance(image, tuple | list) or len(image) != 2:
            raise refused(f"image {name} of fibres", "a file of vectors, or vectors (i, j, k, 3) with their map", image)
        (given, affine), axes = image, mesh.axes
        numbers = numbers_of(given)
        if numbers is None:
            raise refused(f"image {name} of fibres", "vectors (i, j, k, 3) of numbers", given)
        vectors = numbers
    vectors = np.where(np.isfinite(vectors), vectors, 0.0)  # tools write NaN where they know no direction
    if vectors.ndim == 5 and vectors.shape[3] == 1:
        vectors = vectors[:, :, :, 0]  # NIfTI keeps the components of vectors in the fifth dimension
    if vectors.ndim != 4 or vectors.shape[3] != 3:
        raise VisceraError(f"image {name} of fibres has the shape {vectors.shape}; it needs three components per voxel")
    vectors = vectors / max(float(np.abs(vectors).max(initial=0.0)), np.finfo(float).tiny)  # only directions count
    grid = Scan(np.zeros(vectors.shape[:3], dtype=np.uint16), np.asarray(affine), axes or "RAS")
    if mesh.axes and mesh.axes != grid.axes:
        grid, vectors = grid.in_axes(mesh.axes), vectors * [-1.0, -1.0, 1.0]
    index = grid.index(mesh.centroids)
    outside = np.flatnonzero(((index < -0.5) | (index > np.array(vectors.shape[:3]) - 0.5)).any(axis=1))
    if len(outside):
        place = mesh.centroids[outside[0]].round(4).tolist()
        raise VisceraError(f"{len(outside)} cells lie outside image {name} of fibres, the first at {place} m")
    first = np.floor(index).astype(np.int64)
    tensor = np.zeros((len(index), 3, 3))
    for offset in np.ndindex(2, 2, 2):
        voxel = first + offset
        weight = np.prod(1.0 - np.abs(index - voxel), axis=1)
        v = vectors[tuple(np.clip(voxel, 0, np.array(vectors.shape[:3]) - 1).T)]
        tensor += weight[:, None, None] * v[:, :, None] * v[:, None, :]
    values, frames = np.linalg.eigh(tensor)
    blank = np.flatnonzero(~(values[:, 2] > 0.0))
    if len(blank):
        raise VisceraError(f"image {name} has no direction around {len(blank)} cells, the first of which is {blank[0]}")
    return np.asarray(frames[:, :, 2])
