"""Shapes in time, or along a load: volumes with every field for ParaView, a moving surface for viewers of glTF."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from viscera.deformed import Deformed
from viscera.errors import VisceraError
from viscera.files.atomic import replacing
from viscera.mesh import Indices
from viscera.output import state as statefile
from viscera.quantity import Number, path_of, refused

MOST_SHAPES = 256
"""Morph targets of a glTF file; viewers keep all of them in the memory of the graphics card."""


def write_series(path: str | os.PathLike[str], moments: Sequence[tuple[float, Deformed]]) -> list[Path]:
    """Writes shapes of one organ at rising times [s], load factors or the like: `[(time, state), ...]`.

    A moment is a state, a frame, the answer of a reduced model or `Organ.moved` of a displacement along a path.
    `.pvd`: a time series for ParaView, with one VTU file per moment beside it, the same as by its own `write`: moments
    may differ in their fields. `.glb`, `.gltf`: the surface before it moves and an animation that blends from shape to
    shape, z turned up; it begins at time 0 with the first of them. Returns all paths written.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> state = beam.solve(force={"tip": (0, 0, -10.0)})
    >>> paths = vs.write_series("bend.pvd", [(0.5, beam.moved(0.5 * state.displacement)), (1.0, state)])
    >>> sorted(path.name for path in paths)
    ['bend.pvd', 'bend_0000.vtu', 'bend_0001.vtu']
    """
    target = path_of(path, "the file of the series")
    if target.suffix.lower() not in (".pvd", ".glb", ".gltf"):
        raise VisceraError(f"{target}: a series is written as .pvd for ParaView, or as .glb or .gltf for other viewers")
    times = _rising(_pairs(moments), target)
    seen = [shape._seen() for _, shape in moments]
    mesh = seen[0][0]
    for index, (other, _) in enumerate(seen):
        if other is not mesh and not (
            np.array_equal(other.points, mesh.points) and np.array_equal(other.cells, mesh.cells)
        ):
            raise VisceraError(f"moment {index} is one of another mesh; write a series for each")
    if target.suffix.lower() == ".pvd":
        from viscera.output import paraview

        frames: list[paraview.Frame] = []
        for time, (_, shape), (own, _) in zip(times, moments, seen, strict=True):
            at_nodes, in_cells = shape.fields()
            frames.append((time, own, shape._nodal() | at_nodes, in_cells))
        return paraview.write_series(target, frames)
    if len(times) > MOST_SHAPES:
        raise VisceraError(
            f"{target}: {len(times)} moments; glTF viewers take at most {MOST_SHAPES}, so leave some out"
        )
    corners: Indices = np.unique(mesh.surface)
    triangles = np.searchsorted(corners, mesh.surface).astype(np.uint32)
    motion = times, [displacement[corners] for _, displacement in seen]
    is_binary = target.suffix.lower() == ".glb"
    with replacing(target) as scratch:
        scratch.write_bytes(statefile.gltf(mesh.points[corners], triangles, {}, is_binary=is_binary, motion=motion))
    return [target]


def _pairs(moments: Sequence[tuple[float, Deformed]]) -> Sequence[tuple[float, Deformed]]:
    """The moments, each of which must be a time and a shape."""
    if not isinstance(moments, Sequence) or isinstance(moments, str):
        raise refused("the moments of a series", "a list of pairs, such as [(0.5, state)]", moments)
    for index, moment in enumerate(moments):
        is_pair = isinstance(moment, tuple | list) and len(moment) == 2
        if not (is_pair and isinstance(moment[1], Deformed)):
            what = "a pair of a time and a state, a frame, an answer or Organ.moved of a displacement"
            raise refused(f"moment {index} of a series", what, moment)
    return moments


def _rising(moments: Sequence[tuple[float, Deformed]], path: Path) -> list[float]:
    if not moments:
        raise VisceraError(f"{path}: there is no moment to write")
    checked = [Number()(time, f"the time of moment {index}") for index, (time, _) in enumerate(moments)]
    for index, (before, after) in enumerate(pairwise(checked), start=1):
        if after <= before:
            raise VisceraError(f"times must rise: moment {index} is at {after:g}, the one before it at {before:g}")
    return checked
