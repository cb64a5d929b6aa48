"""Deform a scan, an image or a label map, by a solution, as if it had been taken after the organ moved.

viscera warp scan.nii.gz --with solved.vtu -o moved.nii.gz
The voxels of the organ move with it. Voxels that it has left get the background value; all others stay unchanged.
Of a label map the labels that lie in the organ move, and none beside it. Fails (exit 1) if the solution did not
converge or its frame had not settled; what was asked for is written all the same.
"""

from __future__ import annotations

import argparse
from typing import Any

from viscera.cli.output import FAILED, Outcome, Output
from viscera.errors import VisceraError
from viscera.output import state as statefile
from viscera.scans import grid
from viscera.scans.image import IMAGES
from viscera.scans.itk import sitk
from viscera.scans.labelmap import is_label_map
from viscera.scans.warp import INTERPOLATIONS, labels_moved, warp


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera warp`."""
    parser.add_argument("image", metavar="IMAGE", help=f"the scan, or its labels: {', '.join(IMAGES)}")
    parser.add_argument(
        "--with", dest="state", metavar="STATE.vtu", required=True, help="a solution that `viscera solve -o` wrote"
    )
    parser.add_argument("-o", "--output", metavar="IMAGE", help="the deformed image")
    parser.add_argument(
        "--axes", help="world axes of the mesh, RAS or LPS (default: those that the solution states, else RAS)"
    )
    parser.add_argument(
        "--interpolation", choices=INTERPOLATIONS,
        help="default: nearest for a label map (whole numbers from 0, in the main the same in neighbouring voxels), "
        "otherwise linear",
    )  # fmt: skip
    parser.add_argument(
        "--background", type=float, help="value for voxels that the organ has left (default: the smallest finite one)"
    )
    parser.add_argument(
        "--field", metavar="IMAGE",
        help="write the displacement from the deformed image to the given one, mm in LPS: a transform of ITK and 3D "
        "Slicer that resamples images",
    )  # fmt: skip
    parser.add_argument(
        "--forward-field", metavar="IMAGE", help="the same from the given image to the deformed one: it moves points"
    )


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Read, map, deform, write."""
    options = {"-o": args.output, "--field": args.field, "--forward-field": args.forward_field}
    wanted = [path for path in options.values() if path is not None]
    if not wanted:
        raise VisceraError("nothing to write; name -o, --field or --forward-field")
    output.spare([args.image, args.state], *options.items())
    for path in wanted:
        grid.checked(path)
    mesh, displacement, doubt = statefile.read(args.state, in_scan=True)
    image = grid.read(args.image)
    places = grid.Grid.of(image, grid.axes_of(mesh, args.axes))
    forward, inverse = (grid.on_grid(mesh, displacement, places, inverse=inverse) for inverse in (False, True))
    facts: dict[str, Any] = {"voxels": int(forward.inside.sum()), "voxels_moved": int(inverse.inside.sum())}
    told = list[str]()  # said when all is written: if it cannot be printed, the images are there all the same
    if not (mesh.axes or args.axes):
        told.append(f"  note          {args.state} does not state its axes; taken as {places.axes}, see --axes")
    told.append(f"{args.image}: {facts['voxels']} voxels in the organ, {facts['voxels_moved']} after it has moved")
    if doubt:
        told.append(f"{args.state}: {statefile.DOUBTS[doubt]}")
    if args.output is not None:
        interpolation, why = (args.interpolation, "") if args.interpolation else _fitting(image)
        warped = warp(image, forward, inverse, interpolation=interpolation, background=args.background)
        grid.write(args.output, warped)
        told.append(f"written to {args.output}, {interpolation} interpolation{why}")
        facts["interpolation"] = interpolation
        if (labels := _labels(image, forward, interpolation)) is not None:
            told.append(f"labels of the organ: {', '.join(map(str, labels))}; others stay where it does not cover them")
            facts["labels_moved"] = labels
    for path, field in ((args.field, inverse), (args.forward_field, forward)):
        if path is not None:
            field.write(path)
            told.append(f"field written to {path}")
    output.say_all(told)
    if doubt:
        return Outcome(doubt.replace("_", " "), FAILED, facts | {"message": statefile.DOUBTS[doubt]})
    return Outcome("written", facts=facts)


def _labels(image: Any, forward: grid.Field, interpolation: str) -> list[int] | None:
    """Which labels moved; None for an image."""
    moved = labels_moved(image, forward) if interpolation == "nearest" else None
    return None if moved is None else [int(label) for label in moved]


def _fitting(image: Any) -> tuple[str, str]:
    """The interpolation that fits the values of an image, and why, with how to choose the other."""
    if is_label_map(sitk().GetArrayViewFromImage(image)):
        return "nearest", ": it holds labels; otherwise say --interpolation linear"
    return "linear", ": it holds no labels; otherwise say --interpolation nearest"
