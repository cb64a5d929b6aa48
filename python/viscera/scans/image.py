"""Image files: NIfTI through nibabel, NRRD and MetaImage through SimpleITK, DICOM segmentations through highdicom."""

from __future__ import annotations

import logging
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.files.atomic import replacing
from viscera.mesh import Floats
from viscera.scans import metaspace, nifti, nrrdspace, slices
from viscera.scans.itk import read_by_itk, sitk, write_by_itk
from viscera.scans.room import in_memory

log = logging.getLogger("viscera")

IMAGES = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd")
"""The formats of images of any values."""
FORMATS = (*IMAGES, ".dcm")
"""The formats of label maps."""
WRITTEN = (".nii", ".nii.gz", ".nrrd", ".mha")
"""The formats of one file each: a header without its data would be worth nothing."""
MM = 1e-3
"""Files are in millimetres [m], unless they say otherwise."""


def read_image(path: Path) -> tuple[NDArray[Any], Floats, str]:
    """Values (i, j, k, ...), affine map (3, 4) [m] and world axes of an image file.

    NIfTI never through SimpleITK, which takes the voxels of `scan.nii`, if that is there, for those of `scan.nii.gz`.
    Raises `VisceraError` for a file that is no image of three dimensions, or does not say where it lies.
    """
    ending = ending_of(path, IMAGES)
    try:
        if ending in (".nii", ".nii.gz"):
            return *nifti.read(path, ending), "RAS"
        image = read_by_itk(path, ending)
        with in_memory(image.GetSize(), sitk().GetArrayViewFromImage(image).nbytes):
            values = sitk().GetArrayFromImage(image)
    except VisceraError:
        raise
    except Exception as error:  # the readers raise whatever their parsers meet
        # What MetaIO gives as the reason is left from another call of the system.
        reason = " ".join(str(error).split()).partition(" Reason:")[0][-200:]
        raise VisceraError(f"not a readable {ending} image ({reason or type(error).__name__})") from error
    n = image.GetDimension()
    if n != 3:
        raise VisceraError(f"it has {n} dimensions {image.GetSize()}; a volume has three, so save one volume of it")
    is_vector = image.GetNumberOfComponentsPerPixel() > 1
    values = values.transpose([*reversed(range(n)), *([n] if is_vector else [])])
    direction = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
    space = nrrdspace if ending in (".nrrd", ".nhdr") else metaspace
    return values, space.unit_of_space(path) * np.column_stack([direction, image.GetOrigin()]), "LPS"


def read_vectors(path: Path) -> tuple[Floats, Floats, str]:
    """Vectors (i, j, k, 3), affine map (3, 4) [m] and world axes of an image file, with components along these axes.

    Shapes other than that of vectors are left to the caller. Raises `VisceraError` as `read_image` does.
    """
    values, affine, axes = read_image(path)
    vectors = np.asarray(values, dtype=np.float64)
    if ending_of(path, IMAGES) in (".nrrd", ".nhdr") and vectors.shape[3:] == (3,):
        vectors = vectors @ nrrdspace.turn_of_vectors(path).T
    return vectors, affine, axes


SEGMENTATIONS = ("1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.66.7")
"""DICOM's classes of segmentations: of segments that may overlap, and of labels."""
EMPTY = 2
"""Slices without labels that are put back at either end of a segmentation that left some out."""


def read_segmentation(path: Path) -> tuple[NDArray[Any], Floats, str, dict[int, str]]:
    """A DICOM segmentation: labels, affine map (3, 4) [m], axes, names of its segments, which may not overlap."""
    highdicom = _library("highdicom")
    try:
        _require_segmentation(path)
        found = highdicom.seg.segread(path)
        names = {n: str(found.get_segment_description(n).segment_label) for n in found.segment_numbers}
        volume = _one_label_each(found, names)
    except VisceraError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[-200:]
        raise VisceraError(
            f"a DICOM segmentation that is damaged, or of a form that is not read ({reason}); export it anew, or as a "
            "label map, such as .nii.gz"
        ) from error
    array, affine = volume.array, MM * volume.affine[:3]
    if doubt := slices.doubt(found, volume.affine[:3]):
        log.warning("%s: %s", path, doubt)
    if len(slices.source_images(found)) > len(array):
        array, affine = _with_empty_ends(array, affine)
    return array, affine, "LPS", names


def _require_segmentation(path: Path) -> None:
    """Raises `VisceraError` for a file that is not of DICOM, or of DICOM and no segmentation of voxels."""
    pydicom = _library("pydicom")
    try:
        head = pydicom.dcmread(path, stop_before_pixels=True, specific_tags=["SOPClassUID"])
    except pydicom.errors.InvalidDicomError as error:
        raise VisceraError("not a DICOM file: its bytes 128 to 131 are not 'DICM'; export it anew") from error
    kind = getattr(head, "SOPClassUID", None)
    if kind not in SEGMENTATIONS:
        what = "does not say of which kind it is" if kind is None else f"is of the kind {kind.name}"
        raise VisceraError(
            f"a DICOM file, but no segmentation of voxels: it {what}; export the segmentation as DICOM SEG or as a "
            "label map, such as .nii.gz"
        )


def _one_label_each(segmentation: Any, names: dict[int, str]) -> Any:
    """The volume of labels; raises `VisceraError` if voxels have several, or a fraction of one."""
    try:
        return segmentation.get_volume(combine_segments=True)
    except ValueError:
        if str(segmentation.SegmentationType) != "FRACTIONAL":
            raise
        raise VisceraError(
            "it says how much of each voxel its segments hold (a fractional segmentation), and labels are all or "
            "nothing; save it as a binary segmentation or as a label map, such as .nii.gz"
        ) from None
    except RuntimeError as error:  # left before the next question: what it holds on to locks the table of frames
        reason = str(error)
    if twice := slices.twice(segmentation):
        raise VisceraError(twice)
    shared = _overlaps(segmentation)
    if not shared:
        raise RuntimeError(reason)
    (first, second), count = shared.most_common(1)[0]
    more = " (and others elsewhere)" if len(shared) > 1 else ""
    raise VisceraError(
        f"its segments {first} {names[first]!r} and {second} {names[second]!r} overlap in {count} voxels{more}, "
        "and a voxel has one label; cut one out of the other, or save each in a file of its own"
    )


def _overlaps(segmentation: Any) -> Counter[tuple[int, int]]:
    """Number of voxels of pairs of segments that overlap; of three in one voxel, pairs with the first."""
    masks = segmentation.get_volume(combine_segments=False).array > 0
    owner = np.zeros(masks.shape[:3], dtype=np.int64)
    shared: Counter[tuple[int, int]] = Counter()
    for place, number in enumerate(segmentation.segment_numbers):
        mask = masks[..., place]
        held = owner[mask & (owner > 0)]
        shared.update(
            {(int(n), int(number)): int(count) for n, count in zip(*np.unique(held, return_counts=True), strict=True)}
        )
        owner[mask & (owner == 0)] = number
    return shared


def _with_empty_ends(array: NDArray[Any], affine: Floats) -> tuple[NDArray[Any], Floats]:
    """With two slices on either side, since the file leaves out some without labels.

    At which end they were it does not say, so an organ at an end counts as whole there.
    """
    padded = np.pad(array, ((EMPTY, EMPTY), (0, 0), (0, 0)))
    moved = affine.copy()
    moved[:, 3] -= EMPTY * affine[:, 0]
    return padded, moved


def write_labels(path: Path, values: NDArray[Any], ras: Floats, lps: Floats) -> None:
    """Write a label map, placed by its affine map (3, 4) [m] in either kind of axes: each format has its own."""
    ending = ending_of(path, WRITTEN)
    values = np.ascontiguousarray(values)
    with replacing(path) as scratch:
        if ending in (".nii", ".nii.gz"):
            image = nifti.nibabel().Nifti1Image(values, np.vstack([ras / MM, [0.0, 0.0, 0.0, 1.0]]))
            image.header.set_xyzt_units("mm")
            # A scratch file keeps only the last ending, which would not be compressed.
            scratch.write_bytes(_compressed(image.to_bytes(), ending))
            return
        affine = lps / MM
        image = sitk().GetImageFromArray(values.transpose(2, 1, 0))
        spacing = np.linalg.norm(affine[:, :3], axis=0)
        image.SetSpacing(spacing.tolist())
        image.SetOrigin(affine[:, 3].tolist())
        image.SetDirection((affine[:, :3] / spacing).ravel().tolist())
        write_by_itk(image, scratch, ending)


def ending_of(path: Path, formats: tuple[str, ...] = FORMATS) -> str:
    """The ending of an image file, or the sentence that lists those there are."""
    name = path.name.lower()
    found = [ending for ending in formats if name.endswith(ending)]
    if not found:
        what = "images are not written in that format" if formats is WRITTEN else "unknown image format"
        raise VisceraError(f"{path}: {what}; the formats are {', '.join(formats)}")
    return max(found, key=len)


def _compressed(data: bytes, ending: str) -> bytes:
    import gzip

    return gzip.compress(data, mtime=0) if ending.endswith(".gz") else data


def _library(name: str) -> Any:
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError:
        raise VisceraError(f"this image needs the package {name}: pip install {name}") from None
