"""Label maps of scans: the position of each voxel in the patient, and its label (extra `scan`).

World axes are right, anterior, superior (RAS, NIfTI) or left, posterior, superior (LPS, NRRD and DICOM). They are kept:
a mesh has the axes of its scan, in metres.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera import _core
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh
from viscera.naming import told_apart
from viscera.progress import shown
from viscera.quantity import Choice, Number, Whole, numbers_of, path_of, refused
from viscera.scans.image import FORMATS, ending_of, read_image, read_segmentation, write_labels
from viscera.scans.labelmap import affine_of, labels_of, several, texts
from viscera.scans.meshing import Edges, Progress, Region, mesh_regions
from viscera.select import length

AXES = ("RAS", "LPS")
NEAR = 0.75
"""A node at most this many voxels from a label touches it, since smoothing moves boundaries by fractions of a voxel."""
FEW = 0.1
"""Up to this share a label is no part of a mesh that covers it: holes and steps of a few voxels are not resolved."""
LISTED = 12
"""Largest number of labels that an error lists."""
FAR = 1e9
"""Index of a voxel outside every image, which stands for all that are farther out."""
MOST_VOXELS = 1e9
"""Largest number of voxels of a label map that is made from a mesh."""

Labels = int | str | Sequence[int | str] | Mapping[str, int | Sequence[int]]
"""A label's number, several numbers, or numbers by name; a part with several numbers is their union."""


@dataclass(frozen=True, eq=False)
class Scan:
    """A label map in world axes: what `scan` reads, or arrays of your own.

    >>> import numpy as np
    >>> ball = np.linalg.norm(np.indices((24, 24, 24)) - 11.5, axis=0) < 9.0
    >>> Scan(ball, np.diag([0.003, 0.003, 0.003, 1.0])).mesh({"ball": 1}, edge=0.008).cell_sets.keys()
    dict_keys(['ball'])
    """

    values: NDArray[Any]
    """Label of each voxel (i, j, k); 0 is none."""
    affine: Floats
    """Affine map (3, 4) or (4, 4) [m] to the position of voxel (i, j, k): `affine[:3] @ (i, j, k, 1)`."""
    axes: str = "RAS"
    """World axes, "RAS" or "LPS"."""
    names: Mapping[int, str] | None = None
    """Names of labels, if the file has them."""

    def __post_init__(self) -> None:
        """Check what a file or a caller gives."""
        Choice(AXES)(self.axes, "axes")
        object.__setattr__(self, "values", labels_of(self.values))
        object.__setattr__(self, "affine", affine_of(self.affine))
        if self.names is not None and not isinstance(self.names, Mapping):
            raise refused("the names of labels", "a mapping from labels to names, such as {1: 'liver'}", self.names)

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.values.shape))
        spacing = " x ".join(f"{1e3 * s:.3g}" for s in self.spacing)
        return f"Scan: {shape} voxels of {spacing} mm, {self.axes}; voxels by label: {self.labels}"

    @cached_property
    def labels(self) -> dict[int, int]:
        """Labels of the image, each with its number of voxels; 0 is no label."""
        values, counts = np.unique(self.values, return_counts=True)
        return {int(v): int(n) for v, n in zip(values, counts, strict=True) if v != 0}

    @property
    def spacing(self) -> Floats:
        """Distance of voxels along i, j and k (3,) [m]."""
        return np.asarray(np.linalg.norm(self.affine[:, :3], axis=0))

    @shown
    def mesh(
        self,
        labels: Labels | None = None,
        *,
        edge: Edges,
        fixed: str | Sequence[str] = (),
        progress: Progress | None = None,
    ) -> Mesh:
        """Conforming tetrahedra of some labels: a cell set for each, smooth boundaries, each label's volume kept.

        labels: a number, several, or `{name: number}`; may be left out where the image has one label.
        edge: mean length of the cells' edges [m], or words such as "8 mm"; or one for each part: {"liver": "8 mm",
        "vein": "3 mm"}. Cells then grow from those of the vein to those of the liver; lengths double from cube to cube,
        so all but one may come out shorter, and a message says so. fixed: places whose nodes become the set
        `fixed`: a condition ("z > 90%") or a set ("cut"), `label:63` (where the organ touches that label), or the file
        of an image painted for this, its nonzero voxels or one label of it (`painted.nii.gz:2`).
        The set `cut` holds the nodes where the image's edge cuts a label. The mesh's `messages` list what
        was dropped or cut. progress: callback `(done, total, stage)`.
        Raises `VisceraError` for labels that are not in the image and for an edge longer than an organ.

        >>> import numpy as np
        >>> import viscera as vs
        >>> labels = np.zeros((20, 20, 20), dtype=int)
        >>> labels[4:16, 4:16, 4:16] = 1
        >>> labels[9:, 4:16, 4:16] *= 2
        >>> scan = vs.Scan(labels, np.diag([0.005, 0.005, 0.005, 1.0]))
        >>> mesh = scan.mesh({"left": 1, "right": 2}, edge="15 mm", fixed="z < 5%")
        >>> sorted(mesh.cell_sets), sorted(mesh.sets)
        (['left', 'right'], ['fixed'])
        """
        regions = self.regions(labels)
        supports = texts(fixed)
        places = [self._place(where, regions) for where in supports]
        found = mesh_regions(self.values, self.affine, regions, edge, axes=self.axes, progress=progress)
        if not places:
            return found
        is_fixed = np.zeros(len(found.points), dtype=bool)
        for where, place in zip(supports, places, strict=True):
            nodes = place(found)
            if len(nodes) == 0:
                raise VisceraError(f"fixed {where!r} holds no node of the mesh")
            is_fixed[nodes] = True
        return found.with_sets(fixed=np.flatnonzero(is_fixed))

    def regions(self, labels: Labels | None) -> list[Region]:
        """The regions that labels in words name; raises `VisceraError` for a label that is not in the image.

        >>> import numpy as np
        >>> import viscera as vs
        >>> labels = np.zeros((20, 20, 20), dtype=int)
        >>> labels[4:16, 4:16, 4:16] = 1
        >>> labels[9:, 4:16, 4:16] *= 2
        >>> scan = vs.Scan(labels, np.diag([0.005, 0.005, 0.005, 1.0]))
        >>> [region.name for region in scan.regions({"whole": 1})]
        ['whole']
        """
        if not self.labels:
            raise VisceraError("the image has no labels: every voxel is 0")
        if labels is None:
            if len(self.labels) > 1:
                raise VisceraError(f"name the labels to mesh; the image has {self._listing()}")
            labels = next(iter(self.labels))
        if isinstance(labels, Mapping):
            named: Mapping[Any, Any] = labels
        else:
            named = self._named([self._number(label) for label in several(labels, "labels")])
        if not named:
            raise VisceraError(f"name the labels to mesh; the image has {self._listing()}")
        regions = [self._region(name, numbers) for name, numbers in named.items()]
        seen: dict[int, str] = {}
        for region in regions:
            for number in region.numbers:
                if seen.setdefault(number, region.name) != region.name:
                    raise VisceraError(f"label {number} is given twice, as {seen[number]!r} and as {region.name!r}")
        return regions

    def _named(self, numbers: Sequence[int]) -> dict[str, int]:
        """Labels by name, each once; those of one name are told apart by their numbers."""
        numbers = list(dict.fromkeys(numbers))
        names = [(self.names or {}).get(number, f"label_{number}") for number in numbers]
        return dict(zip(told_apart(names, numbers), numbers, strict=True))

    def _region(self, name: Any, numbers: Any) -> Region:
        if not isinstance(name, str) or not name:
            raise refused("the name of a part", "a text that is not empty", name)
        found = tuple(self._number(number) for number in several(numbers, f"part {name!r}"))
        if not found:
            raise VisceraError(f"part {name!r} has no label; give one or several of {self._listing()}")
        twice = next((number for number in found if found.count(number) > 1), None)
        if twice is not None:
            raise VisceraError(f"part {name!r} has the label {twice} twice; give it once")
        return Region(name, found)

    def _number(self, label: Any) -> int:
        if isinstance(label, str) and not re.fullmatch(r"-?\d+", label):
            found = [n for n, name in (self.names or {}).items() if name == label and n in self.labels]
            if not found:
                raise VisceraError(f"the image has no label {label!r}; it has {self._listing()}")
            if len(found) > 1:
                listed = ", ".join(map(str, sorted(found)))
                raise VisceraError(f"the labels {listed} have the name {label!r}; give their numbers")
            return found[0]
        if isinstance(label, bool) or not isinstance(label, int | str | np.integer):
            raise VisceraError(f"a label is a whole number, got {label!r}")
        if int(label) not in self.labels:
            raise VisceraError(f"no voxel has the label {int(label)}; the image has {self._listing()}")
        return int(label)

    def _listing(self) -> str:
        names = self.names or {}
        largest = sorted(self.labels, key=lambda label: (-self.labels[label], label))[:LISTED]
        listed = [f"{n}{f' {names[n]!r}' if n in names else ''} ({self.labels[n]} voxels)" for n in sorted(largest)]
        more = len(self.labels) - len(listed)
        return f"the labels {', '.join(listed)}{f' and {more} smaller ones' if more else ''}"

    def _place(self, where: str, regions: Sequence[Region]) -> Callable[[Mesh], Indices]:
        """A function that finds the nodes of a support in the mesh; bad words raise `VisceraError` before the work."""
        if where.startswith("label:"):
            number = self._number(where.removeprefix("label:"))
            part = next((region for region in regions if number in region.numbers), None)
            if part is None:
                return lambda mesh: self._beside(mesh, number)
            if len(part.numbers) > 1:
                raise VisceraError(f"fixed {where!r}: {_within(number, part.name)}")
            return lambda mesh: _shared(mesh, mesh.cell_sets[part.name])
        path, _, label = where.rpartition(":") if where.rpartition(":")[2].isdigit() else (where, "", "")
        if not path.lower().endswith(FORMATS):
            return lambda mesh: mesh.nodes(where)
        painted = scan(path)
        if painted.axes != self.axes:
            painted = painted.in_axes(self.axes)
        numbers = [painted._number(label)] if label else list(painted.labels)
        if not numbers:
            raise VisceraError(f"{path}: nothing is painted in it; every voxel is 0")
        return lambda mesh: np.flatnonzero(painted.near(mesh.points, numbers)).astype(np.uint32)

    def touching(self, mesh: Mesh, label: int | str) -> Indices:
        """Nodes where a mesh of this scan touches a label: those shared with the label's cells if these are meshed,
        otherwise those of the surface at most 0.75 voxels from the label's voxels.

        label: its number, or its name if the file has names. Raises `VisceraError` for a label that is not in the
        image, and if it is meshed as a part of several, since nodes do not tell its labels apart.

        >>> import numpy as np
        >>> import viscera as vs
        >>> labels = np.zeros((20, 20, 20), dtype=int)
        >>> labels[4:16, 4:16, 4:16] = 1
        >>> labels[9:, 4:16, 4:16] *= 2
        >>> scan = vs.Scan(labels, np.diag([0.005, 0.005, 0.005, 1.0]))
        >>> mesh = scan.mesh({"left": 1}, edge="15 mm")
        >>> len(scan.touching(mesh, 2)) > 0
        True
        """
        if not isinstance(mesh, Mesh):
            raise refused("the mesh", 'a Mesh, such as scan.mesh({"liver": 5}, edge="8 mm")', mesh)
        number = self._number(label)
        for name, cells in mesh.cell_sets.items():
            held = self._held(mesh, cells)
            if number in held:
                if any(share > FEW for other, share in held.items() if other != number):
                    raise VisceraError(_within(number, name))
                return _shared(mesh, cells)
        return self._beside(mesh, number)

    def _held(self, mesh: Mesh, cells: Indices) -> dict[int, float]:
        """Labels that some cells cover by more than half, each with its share of these cells' volume."""
        volumes = np.asarray(mesh.facts["cell_volumes"])[cells]
        voxel = abs(np.linalg.det(self.affine[:, :3]))
        own, index = np.unique(self.at(mesh.centroids[cells]), return_inverse=True)
        held = zip(own.tolist(), np.bincount(index, volumes).tolist(), strict=True)
        return {n: v / float(volumes.sum()) for n, v in held if n and v > 0.5 * self.labels[n] * voxel}

    def _beside(self, mesh: Mesh, label: int) -> Indices:
        """Nodes of the surface next to a label that is not meshed."""
        return mesh.surface_nodes[self.near(mesh.points[mesh.surface_nodes], [label])]

    def index(self, places: ArrayLike) -> Floats:
        """Voxel indices (k, 3) of points (k, 3) [m], or of one (3,); they may be fractions, and lie outside the image.

        >>> import numpy as np
        >>> import viscera as vs
        >>> labels = np.zeros((20, 20, 20), dtype=int)
        >>> labels[4:16, 4:16, 4:16] = 1
        >>> labels[9:, 4:16, 4:16] *= 2
        >>> scan = vs.Scan(labels, np.diag([0.005, 0.005, 0.005, 1.0]))
        >>> scan.index([[0.03, 0.0325, 0.01]]).round(2).tolist()
        [[6.0, 6.5, 2.0]]
        """
        found = numbers_of(places)
        if found is None or found.ndim not in (1, 2) or found.shape[-1] != 3 or not np.isfinite(found).all():
            raise refused("the places", "finite numbers (k, 3) [m]", places)
        return np.asarray((found.reshape(-1, 3) - self.affine[:, 3]) @ np.linalg.inv(self.affine[:, :3]).T)

    def at(self, places: ArrayLike) -> NDArray[Any]:
        """Labels (k,) at points (k, 3) [m], or at one (3,); 0 outside the image.

        >>> import numpy as np
        >>> import viscera as vs
        >>> labels = np.zeros((20, 20, 20), dtype=int)
        >>> labels[4:16, 4:16, 4:16] = 1
        >>> labels[9:, 4:16, 4:16] *= 2
        >>> scan = vs.Scan(labels, np.diag([0.005, 0.005, 0.005, 1.0]))
        >>> scan.at([[0.03, 0.03, 0.03], [0.06, 0.03, 0.03], [0, 0, 0]]).tolist()
        [1, 2, 0]
        """
        voxel = np.rint(np.clip(self.index(places), -FAR, FAR)).astype(np.int64)
        is_inside = ((voxel >= 0) & (voxel < self.values.shape)).all(axis=1)
        voxel[~is_inside] = 0
        return np.where(is_inside, self.values[tuple(voxel.T)], 0)

    def near(
        self, places: ArrayLike, labels: int | str | Sequence[int | str], reach: float = NEAR
    ) -> NDArray[np.bool_]:
        """Whether points (k, 3) [m] are at most `reach` voxels, from 0 to 1, from a voxel with one of the labels.

        labels: numbers, or names if the file has names. Raises `VisceraError` for a label that is not in the image.

        >>> import numpy as np
        >>> import viscera as vs
        >>> labels = np.zeros((20, 20, 20), dtype=int)
        >>> labels[4:16, 4:16, 4:16] = 1
        >>> labels[9:, 4:16, 4:16] *= 2
        >>> scan = vs.Scan(labels, np.diag([0.005, 0.005, 0.005, 1.0]))
        >>> scan.near([[0.03, 0.03, 0.03], [0.06, 0.03, 0.03]], [2]).tolist()
        [False, True]
        """
        reach = Number(low=0, high=1)(reach, "reach, in voxels,")  # none but the nearest voxels are looked at
        index = np.clip(self.index(places), -FAR, FAR)
        is_label = np.isin(self.values, [self._number(label) for label in several(labels, "labels")])
        base = np.rint(index).astype(np.int64)
        found = np.zeros(len(index), dtype=bool)
        for offset in np.ndindex(3, 3, 3):
            voxel = base + np.array(offset) - 1
            gap = np.linalg.norm(np.maximum(np.abs(index - voxel) - 0.5, 0.0), axis=1)
            candidate = np.flatnonzero((gap <= reach) & ((voxel >= 0) & (voxel < is_label.shape)).all(axis=1))
            found[candidate] |= is_label[tuple(voxel[candidate].T)]
        return found

    def in_axes(self, axes: str) -> Scan:
        """The same scan in other world axes: x and y change sign between RAS and LPS.

        >>> import numpy as np
        >>> import viscera as vs
        >>> labels = np.zeros((20, 20, 20), dtype=int)
        >>> labels[4:16, 4:16, 4:16] = 1
        >>> labels[9:, 4:16, 4:16] *= 2
        >>> scan = vs.Scan(labels, np.diag([0.005, 0.005, 0.005, 1.0]))
        >>> scan.in_axes("LPS").axes
        'LPS'
        """
        Choice(AXES)(axes, "axes")
        sign = np.array([1.0, 1.0, 1.0] if axes == self.axes else [-1.0, -1.0, 1.0])
        return Scan(self.values, sign[:, None] * self.affine, axes, self.names)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the label map: `.nii` or `.nii.gz` through nibabel, `.nrrd` or `.mha` through SimpleITK.

        >>> import numpy as np
        >>> import viscera as vs
        >>> labels = np.zeros((20, 20, 20), dtype=int)
        >>> labels[4:16, 4:16, 4:16] = 1
        >>> labels[9:, 4:16, 4:16] *= 2
        >>> scan = vs.Scan(labels, np.diag([0.005, 0.005, 0.005, 1.0]))
        >>> scan.write("labels.nii.gz")
        >>> vs.scan("labels.nii.gz").labels
        {1: 720, 2: 1008}
        """
        ras, lps = self.in_axes("RAS").affine, self.in_axes("LPS").affine
        write_labels(path_of(path, "the file to write"), self.values, ras, lps)

    @staticmethod
    def of(mesh: Mesh, voxel: float | str = 0.003, margin: int = 4) -> Scan:
        """The label map that a scanner would see of a mesh: 1 in its voxels, or 1, 2, ... in those of its cell sets.

        Where sets overlap, voxels are of the smaller one. Cells of no set have a label of their own, `rest`.
        voxel: side of the cubic voxels [m]; margin: empty voxels around it.

        >>> import viscera as vs
        >>> round(1e3 * 0.006**3 * Scan.of(vs.organs.liver(), voxel=0.006).labels[1], 1)  # litres
        1.5
        """
        if not isinstance(mesh, Mesh):
            raise refused("the mesh", 'a Mesh, such as vs.read("organ.vtu", units="m")', mesh)
        size = Number("m", above=0)(length(voxel, mesh.diagonal, "voxel"), "voxel")
        low, high = mesh.bounding_box
        around = Whole(0, 1000)(margin, "margin")
        counts = np.ceil((high - low) / size) + 2 * around
        if counts.prod() > MOST_VOXELS:
            raise VisceraError(f"voxels of {1e3 * size:.3g} mm would be {counts.prod():.3g}; take larger ones")
        shape = tuple(int(n) for n in counts)
        affine = np.column_stack([size * np.eye(3), low - size * (around - 0.5)])
        parts = dict(mesh.cell_sets) or {"organ": np.arange(len(mesh.cells), dtype=np.uint32)}
        rest = np.setdiff1d(np.arange(len(mesh.cells), dtype=np.uint32), np.concatenate(list(parts.values())))
        if len(rest):
            parts["rest" if "rest" not in parts else "the rest"] = rest
        values = np.zeros(shape, dtype=np.uint16)
        for number, cells in sorted(enumerate(parts.values(), start=1), key=lambda part: -len(part[1])):
            surface = _core.surface(mesh.points, np.ascontiguousarray(mesh.cells[cells]))
            inside = _core.winding_numbers(mesh.points, surface, shape, affine, on_progress=None) > 0.5
            values[inside] = number
        names = dict(enumerate(parts, start=1))
        return Scan(values, affine, mesh.axes or "RAS", names)


def scan(path: str | os.PathLike[str]) -> Scan:
    """Reads a label map: NIfTI, NRRD, MetaImage, or a DICOM segmentation, with its world axes.

    Raises `VisceraError` for images of other than three dimensions and for values that are no labels.

    >>> import numpy as np
    >>> import viscera as vs
    >>> labels = np.zeros((20, 20, 20), dtype=int)
    >>> labels[4:16, 4:16, 4:16] = 1
    >>> labels[9:, 4:16, 4:16] *= 2
    >>> scan = vs.Scan(labels, np.diag([0.005, 0.005, 0.005, 1.0]))
    >>> scan.write("labels.nrrd")
    >>> vs.scan("labels.nrrd").axes
    'LPS'
    """
    source = path_of(path, "the image")
    ending = ending_of(source)
    if source.is_dir() or not source.exists():
        raise VisceraError(f"{source}: {'is a folder, not an image' if source.is_dir() else 'no such file'}")
    try:
        if ending == ".dcm":
            return Scan(*read_segmentation(source))
        values, affine, axes = read_image(source)
        if values.ndim != 3:
            raise VisceraError(
                f"it has {values.ndim} dimensions {values.shape}; a label map has three, so save one volume of it"
            )
        return Scan(values, affine, axes)
    except VisceraError as error:
        raise VisceraError(f"{source}: {error}") from None


def _within(label: int, part: str) -> str:
    return (
        f"label {label} is meshed as a part of {part!r}, whose nodes do not tell its labels apart; mesh it as a part "
        "of its own"
    )


def _shared(mesh: Mesh, cells: Indices) -> Indices:
    """Nodes of some cells that others have too."""
    others = np.delete(mesh.cells, cells, axis=0)
    return np.intersect1d(mesh.cells[cells], others).astype(np.uint32)
