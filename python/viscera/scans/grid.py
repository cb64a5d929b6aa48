"""A displacement on the grid of an image, and files of images: NIfTI, NRRD, MetaImage (`pip install SimpleITK`).

World axes are right, anterior, superior (RAS) or left, posterior, superior (LPS); they differ in the sign of x and y.
A mesh is in metres in either. Files of images are read and written by SimpleITK, which uses LPS and millimetres.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera import _core
from viscera.errors import VisceraError, naming
from viscera.files.atomic import replacing, writable
from viscera.mesh import Floats, Indices, Mesh
from viscera.quantity import Choice, Number, path_of, refused
from viscera.scans.image import IMAGES, MM, WRITTEN, ending_of, read_image
from viscera.scans.itk import sitk, write_by_itk
from viscera.scans.scan import Scan
from viscera.sealed import Sealed

AXES = {"LPS": np.ones(3), "RAS": np.array([-1.0, -1.0, 1.0])}
"""Signs that turn coordinates into LPS and back."""
CHUNK = 1 << 20
"""Voxels looked up at once."""
EIGHT = np.array([[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3], [4, 9, 5, 6], [4, 9, 6, 7], [4, 9, 7, 8],
                  [4, 9, 8, 5]])  # fmt: skip
"""The eight linear cells that replace a quadratic one."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Where the voxels of an image are: index (i, j, k) at `origin + matrix @ index`."""

    shape: tuple[int, int, int]
    """Voxels along i, j, k."""
    matrix: Floats
    """Steps between voxels, one column for each of i, j, k (3, 3) [m]."""
    origin: Floats
    """Centre of voxel (0, 0, 0) (3,) [m]."""
    axes: str
    """"RAS" or "LPS", the world axes of both and of the mesh."""

    @staticmethod
    def of(image: str | os.PathLike[str] | Any, axes: str = "RAS") -> Grid:
        """The grid of an image file, of a `Scan`, or of a SimpleITK image, in the world axes of the mesh."""
        Choice(AXES)(axes, "the axes")
        if isinstance(image, Scan):
            affine = _right_angled(image.in_axes(axes).affine, "the scan")
            size = image.values.shape
            return Grid((size[0], size[1], size[2]), affine[:, :3], affine[:, 3], axes)
        if isinstance(image, str | os.PathLike):
            image = read(image)
        if not hasattr(image, "GetDirection") or image.GetDimension() != 3:
            raise refused("the image", "a file, a Scan, or a SimpleITK image of three dimensions", image)
        sign = MM * AXES[axes]
        direction = np.array(image.GetDirection()).reshape(3, 3)
        matrix = sign[:, None] * direction * np.array(image.GetSpacing())
        size = image.GetSize()
        return Grid((size[0], size[1], size[2]), matrix, sign * np.array(image.GetOrigin()), axes)

    @property
    def spacing(self) -> Floats:
        """Distance of voxels along i, j, k (3,) [m]."""
        return np.asarray(np.linalg.norm(self.matrix, axis=0))

    def index(self, places: Floats) -> Floats:
        """Indices (..., 3), fractions and those outside included, of places (..., 3) [m]."""
        return np.asarray((places - self.origin) @ np.linalg.inv(self.matrix).T)

    def places(self, index: NDArray[Any]) -> Floats:
        """Places (..., 3) [m] of indices (..., 3)."""
        return np.asarray(self.origin + index @ self.matrix.T)

    def part(self, first: NDArray[Any], shape: tuple[int, int, int]) -> Grid:
        """The grid of some of its voxels, from index `first` (3,) on."""
        return replace(self, shape=shape, origin=self.places(np.asarray(first)))

    def image(self, voxels: NDArray[Any]) -> Any:
        """Voxels (i, j, k) or (i, j, k, 3) as a SimpleITK image."""
        axes = (2, 1, 0, 3)[: voxels.ndim]
        image = sitk().GetImageFromArray(np.ascontiguousarray(voxels.transpose(axes)), isVector=voxels.ndim == 4)
        sign = AXES[self.axes]
        image.SetOrigin((sign * self.origin / MM).tolist())
        image.SetSpacing((self.spacing / MM).tolist())
        image.SetDirection((sign[:, None] * self.matrix / self.spacing).ravel().tolist())
        return image


def require_as_scanned(mesh: Mesh) -> None:
    """Raises `VisceraError` if a mesh does not lie where an image of its scan shows the organ."""
    if mesh.is_unloaded:
        raise VisceraError(
            "the mesh is not under the loads of its scan, so it does not lie where an image shows the organ; take the "
            "mesh of the scan, a state counted from it, as `rest.from_scan(state)` is, or a model reduced about "
            "`rest.state`"
        )


def axes_of(mesh: Mesh, axes: str | None) -> str:
    """The world axes of a mesh: those given, those that it states, or "RAS".

    Raises `VisceraError` if they differ, and for a mesh that does not lie where an image shows the organ.
    """
    require_as_scanned(mesh)
    if axes is None:
        return mesh.axes or "RAS"
    Choice(AXES)(axes, "the axes")
    if mesh.axes and mesh.axes != axes:
        raise VisceraError(
            f"the axes are {axes}, and the mesh comes from a scan in {mesh.axes}: leave the axes out, or take a mesh "
            "that states none"
        )
    return axes


@dataclass(frozen=True, repr=False, eq=False)
class Field(Sealed):
    """A displacement at the voxels of a part of an image: the box around the organ."""

    grid: Grid
    """The grid of the box."""
    first: NDArray[np.int64]
    """Index (3,) of its first voxel in the image."""
    displacement: Floats
    """Displacement (i, j, k, 3) [m] at voxels; zero where it is not known."""
    inside: NDArray[np.bool_]
    """Whether a voxel's centre (i, j, k) is in the organ."""
    is_known: NDArray[np.bool_]
    """Whether there is a displacement: inside, and within the margin."""

    def __repr__(self) -> str:
        sizes = " x ".join(map(str, self.grid.shape))
        inside, known = int(self.inside.sum()), int(self.is_known.sum())
        return f"Field({sizes} voxels in {self.grid.axes}, {inside} in the organ, {known - inside} in the margin)"

    def write(self, path: str | os.PathLike[str]) -> None:
        """The field as a vector image of millimetres in LPS, as ITK and 3D Slicer read displacement fields."""
        vectors = AXES[self.grid.axes] * self.displacement / MM
        write(path, self.grid.image(vectors.astype(np.float32)))

    def write_mask(self, path: str | os.PathLike[str]) -> None:
        """Where the field is known: 2 in the organ, 1 in the margin around it, 0 elsewhere."""
        write(path, self.grid.image(self.is_known.astype(np.uint8) + self.inside.astype(np.uint8)))


def on_grid(
    mesh: Mesh, displacement: Floats, grid: Grid, *, inverse: bool = False, margin: float | None = None
) -> Field:
    """The displacement of an organ at the voxels of a grid, linear between its nodes.

    Forward, at a voxel X of the organ before it moves: x = X + u(X). With `inverse`, at a voxel x of the moved organ:
    X = x + v(x), which is needed to resample an image.
    margin: distance [m] from the surface up to which a voxel outside moves with the nearest point of the surface. By
        default it is the diagonal of a voxel, so that an organ whose edge in the image differs a little from the mesh
        moves as a whole, and interpolation of the field finds a displacement on both sides of the surface.
    Raises `VisceraError` if no voxel lies in the organ.
    """
    reach = float(np.linalg.norm(grid.spacing)) if margin is None else Number("m", low=0)(margin, "the margin")
    moved = mesh.points + displacement
    source, vectors = (moved, -displacement) if inverse else (mesh.points, displacement)
    low, high = _box(grid, source, reach)
    shape = tuple(int(n) for n in high - low)
    box = grid.part(low, (shape[0], shape[1], shape[2]))
    cells = _linear_cells(mesh)
    locator = _core.Locator(source, cells)
    field, inside = np.zeros((*box.shape, 3)), np.zeros(box.shape, dtype=bool)
    rows = max(1, CHUNK // (shape[1] * shape[2]))
    for start in range(0, shape[0], rows):
        block = slice(start, min(start + rows, shape[0]))
        index = np.stack(np.meshgrid(np.arange(block.start, block.stop), *map(np.arange, shape[1:]), indexing="ij"), -1)
        found, weights = locator.find(box.places(index).reshape(-1, 3))
        held = found >= 0
        values = np.zeros((len(found), 3))
        values[held] = np.einsum("ka,kai->ki", weights[held], vectors[cells[found[held]]])
        field[block], inside[block] = values.reshape(*index.shape), held.reshape(index.shape[:-1])
    if not inside.any():
        raise VisceraError(
            f"no voxel of the image lies in the organ, which spans {_span(source)} m in {grid.axes}; the image spans "
            f"{_span(grid.places(_corners(grid.shape)))} m: are they of one scan, and are the mesh's axes {grid.axes}?"
        )
    is_known = _extended(box, field, inside, source, mesh.surface, vectors, reach)
    return Field(box, low, field, inside, is_known)


def _box(grid: Grid, points: Floats, reach: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First voxel, and one past the last, of the box around the points and their surroundings."""
    index = grid.index(points)
    more = reach * np.linalg.norm(np.linalg.inv(grid.matrix), axis=1) + 1.0
    low = np.clip(np.floor(index.min(axis=0) - more), 0, np.array(grid.shape) - 1)
    high = np.clip(np.ceil(index.max(axis=0) + more) + 1, low + 1, grid.shape)
    return low.astype(np.int64), high.astype(np.int64)


def _linear_cells(mesh: Mesh) -> Indices:
    """Cells between neighbouring nodes: eight for a quadratic one."""
    if not len(mesh.edges):
        return mesh.cells
    return np.ascontiguousarray(_core.quadratic(mesh.n_corners, mesh.cells)[1][:, EIGHT].reshape(-1, 4))


def _extended(
    box: Grid,
    field: Floats,
    inside: NDArray[np.bool_],
    points: Floats,
    triangles: Indices,
    vectors: Floats,
    reach: float,
) -> NDArray[np.bool_]:
    """Gives voxels within reach of the surface the displacement of its nearest point, in place; which ones have one."""
    steps = np.ceil(reach * np.linalg.norm(np.linalg.inv(box.matrix), axis=1)).astype(int)
    near: NDArray[np.bool_] = inside.copy()
    for axis, count in enumerate(steps):
        near = _spread(near, axis, int(count))
    surface = _core.Surface(points, triangles)
    index = np.argwhere(near & ~inside)
    is_known: NDArray[np.bool_] = inside.copy()
    for (i, j, k), place in zip(index.tolist(), box.places(index), strict=True):
        triangle, weights, distance = surface.closest(place)
        if distance <= reach:
            field[i, j, k] = np.asarray(weights) @ vectors[triangles[triangle]]
            is_known[i, j, k] = True
    return is_known


def _spread(mask: NDArray[np.bool_], axis: int, count: int) -> NDArray[np.bool_]:
    """What lies within so many voxels of a mask along an axis."""
    wide: NDArray[np.bool_] = mask.copy()
    for step in range(1, min(count, mask.shape[axis] - 1) + 1):
        ahead, behind = [slice(None)] * 3, [slice(None)] * 3
        ahead[axis], behind[axis] = slice(step, None), slice(None, -step)
        wide[tuple(ahead)] |= mask[tuple(behind)]
        wide[tuple(behind)] |= mask[tuple(ahead)]
    return wide


def _corners(shape: tuple[int, int, int]) -> NDArray[np.int64]:
    """Indices (8, 3) of the outermost voxels: all, since which are farthest in space depends on how the image turns."""
    return np.asarray(np.array(list(np.ndindex(2, 2, 2))) * (np.array(shape) - 1))


def _span(places: Floats) -> str:
    low, high = places.min(axis=0), places.max(axis=0)
    return f"{np.round(low, 3).tolist()} to {np.round(high, 3).tolist()}"


def read(path: str | os.PathLike[str]) -> Any:
    """A volume image as SimpleITK holds it, from what `read_image` reads; more than one value at a voxel is a vector.

    Raises `VisceraError` if the file is missing, damaged or no volume, and if its voxels are sheared.
    """
    source = path_of(path, "the image")
    ending_of(source, IMAGES)
    if not source.is_file():
        raise VisceraError(f"{source}: no such image")
    with naming(str(source)):
        values, affine, axes = read_image(source)
        if values.ndim < 3:
            raise VisceraError(f"it has {values.ndim} dimensions {values.shape}; a volume has three")
        if values.dtype.kind not in "iuf" or values.dtype.itemsize > 8:
            raise VisceraError(f"its voxels hold {values.dtype}; give an image of real numbers, of 8 bytes at most")
    affine = _right_angled(affine, str(source))
    voxels = values.reshape(*values.shape[:3], -1) if values.ndim > 3 else values
    grid = Grid(voxels.shape[:3], affine[:, :3], affine[:, 3], axes)
    return grid.image(voxels.astype(voxels.dtype.newbyteorder("="), copy=False))


def _right_angled(affine: Floats, name: str) -> Floats:
    """The affine map; raises `VisceraError` if the axes of its voxels are not at right angles, as those of ITK are."""
    steps = affine[:, :3]
    squares = steps.T @ steps
    sizes = np.sqrt(np.diag(squares))
    if not (sizes.min() > 0.0 and (np.abs(squares - np.diag(sizes**2)) <= 1e-4 * np.outer(sizes, sizes)).all()):
        raise VisceraError(
            f"{name}: its voxels are sheared or flat, which those of an image that is deformed here cannot be; "
            "resample it to a grid with right angles"
        )
    return affine


def write(path: str | os.PathLike[str], image: Any) -> None:
    """An image in the format of the ending, whole or not at all."""
    target = path_of(path, "the file to write")
    ending = ending_of(target, WRITTEN)
    with replacing(target) as scratch:
        write_by_itk(image, scratch, ending)


def checked(path: str | os.PathLike[str]) -> Path:
    """The path. It is an error if its format or its folder cannot take an image; call this before long work."""
    ending_of(path_of(path, "the file to write"), WRITTEN)
    return writable(path)
