"""A scan deformed in 3D Slicer by a solution of Viscera. Paste into Slicer's Python console, or run there:

    exec(open("examples/slicer/show.py").read()); show("scan.nii.gz", "inverse.nii.gz")

`inverse.nii.gz` is what `viscera warp scan.nii.gz --with solved.vtu --field inverse.nii.gz` writes: at each voxel of
the deformed organ the way back to the scan, in millimetres and LPS. Slicer takes it for a transform "from parent", by
which it resamples volumes; the transform stays editable in the module Transforms until it is hardened.
"""

from __future__ import annotations

from typing import Any


def show(scan: str, field: str, harden: bool = False) -> Any:
    """Load a volume and a displacement field, apply one to the other, and show the result; the node of the volume."""
    import slicer

    volume = slicer.util.loadVolume(scan)
    transform = slicer.util.loadTransform(field)
    volume.SetAndObserveTransformNodeID(transform.GetID())
    if harden:  # resampled for good, so that it can be saved
        volume.HardenTransform()
    slicer.util.setSliceViewerLayers(background=volume, fit=True)
    return volume
