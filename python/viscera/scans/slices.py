"""Slices of a DICOM segmentation that are not in its file, or twice: those without labels may be left out, and those
that the scan itself lacks look the same. The order of the images in which it was drawn tells them apart.

DICOM PS3.3: Plane Position and Derivation Image (C.7.6.16.2), Common Instance Reference (C.12.2).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from viscera.mesh import Floats

LISTED = 3
"""Largest number of slices whose places are listed."""


def source_images(segmentation: Any) -> list[str]:
    """The images in which the segments were drawn, one for each slice, in the file's order; none if it does not say."""
    series = getattr(segmentation, "ReferencedSeriesSequence", ())
    images = [image for one in series for image in getattr(one, "ReferencedInstanceSequence", ())]
    return list(dict.fromkeys(str(image.ReferencedSOPInstanceUID) for image in images))


def doubt(segmentation: Any, affine: Floats) -> str:
    """What is wrong between the slices of a segmentation, in words; empty if nothing is known to be.

    affine: map (3, 4) [mm] of the volume, its first axis across the slices. Where the images of the scan are listed in
    the order of their places, two stored slices that are `n` steps apart have `n - 1` images between them. With fewer
    the scan lacks slices; with more the steps are too long, if the file does not state them.
    """
    images = {uid: number for number, uid in enumerate(source_images(segmentation))}
    frames = getattr(segmentation, "PerFrameFunctionalGroupsSequence", ())
    drawn = {_slice(frame, affine): images.get(_source(frame)) for frame in frames}
    stored = sorted(k for k in drawn if k is not None)
    if len(stored) < 2 or len(images) < len(stored):  # one image may hold all slices
        return ""
    steps = np.diff(stored)
    between = np.diff([np.nan if drawn[k] is None else drawn[k] for k in stored])
    between *= np.sign(between[0])
    if (between >= 1).all() and (between > steps).any() and not _states_step(segmentation):
        n = int(np.argmax(between - steps))
        return (
            f"images of the scan in which it was drawn lie between its slices at {_place(affine, stored[n])} and "
            f"{_place(affine, stored[n + 1])} mm, which count as neighbours, each as thick as their distance; save it "
            "with all slices, or with their distance (Spacing Between Slices)"
        )
    if ((between >= 1) & (between <= steps)).all():
        short, count = np.flatnonzero(between < steps), int((steps - between).sum())
    else:  # the images are in another order: some are lacking if the gaps are more than the images without a slice
        short, count = np.flatnonzero(steps > 1), int((steps - 1).sum()) - (len(images) - len(stored))
    return _lacking([k for n in short for k in range(stored[n] + 1, stored[n + 1])], count, affine)


def twice(segmentation: Any) -> str:
    """Which frames hold the same slice of the same segment, in words; empty if none do."""
    seen: dict[tuple[float, ...], int] = {}
    for number, frame in enumerate(getattr(segmentation, "PerFrameFunctionalGroupsSequence", ()), start=1):
        if "PlanePositionSequence" not in frame:
            continue
        place = [round(float(x), 3) for x in frame.PlanePositionSequence[0].ImagePositionPatient]
        segments = [int(one.ReferencedSegmentNumber) for one in getattr(frame, "SegmentIdentificationSequence", ())]
        first = seen.setdefault((*segments, *place), number)
        if first != number:
            of = f" of segment {segments[0]}" if segments else ""
            return f"its frames {first} and {number} are both the slice{of} at {place} mm; leave one of them out"
    return ""


def _lacking(empty: list[int], count: int, affine: Floats) -> str:
    """That a scan lacks so many of some slices, in words; empty if it lacks none."""
    if count <= 0:
        return ""
    places = ", ".join(_place(affine, k) for k in empty[:LISTED])
    more = f" and {len(empty) - LISTED} others" if len(empty) > LISTED else ""
    some = "" if count == len(empty) else f"{count} of "
    return (
        f"the scan in which it was drawn lacks {some}the {'slice' if len(empty) == 1 else 'slices'} at {places}{more} "
        "mm, between others that it has, where no organ is found; draw the organs anew in a scan without gaps, or fill "
        "the gap in a label map"
    )


def _place(affine: Floats, number: int) -> str:
    """Where the first voxel of a slice is."""
    return str((affine[:, 0] * number + affine[:, 3]).round(1).tolist())


def _states_step(segmentation: Any) -> bool:
    """Whether the file says how far apart slices are; otherwise their smallest distance is taken."""
    shared = getattr(segmentation, "SharedFunctionalGroupsSequence", ())
    measures = [one for group in shared for one in getattr(group, "PixelMeasuresSequence", ())]
    return any("SpacingBetweenSlices" in one for one in measures)


def _slice(frame: Any, affine: Floats) -> int | None:
    """The number of a frame's slice in the volume, if the frame states its place."""
    if "PlanePositionSequence" not in frame:
        return None
    place = np.array(frame.PlanePositionSequence[0].ImagePositionPatient, dtype=np.float64)
    return round(float(np.linalg.solve(affine[:, :3], place - affine[:, 3])[0]))


def _source(frame: Any) -> str:
    """The image in which a frame was drawn; empty if the frame does not say, or names several."""
    derived = getattr(frame, "DerivationImageSequence", ())
    sources = [image for one in derived for image in getattr(one, "SourceImageSequence", ())]
    return str(sources[0].ReferencedSOPInstanceUID) if len(sources) == 1 else ""
