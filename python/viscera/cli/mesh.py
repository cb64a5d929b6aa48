"""Make tetrahedra from a scan's labels, or from the surface of an organ.

A label map (NIfTI, NRRD, MetaImage, DICOM segmentation) gives a cell set for each label; the sets share nodes where
they meet. A closed or nearly closed surface (STL, OBJ, PLY) gives one set. The mesh is in metres, in the world axes of
the scan.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

import numpy as np

from viscera.cli.options import metres, number_or_words
from viscera.cli.output import Outcome, Output
from viscera.errors import VisceraError, did_you_mean
from viscera.files.mesh import checked, lacking
from viscera.mesh import Mesh
from viscera.output.kind import IMAGE, SURFACE, kind_of, require
from viscera.progress import bar
from viscera.scans.image import FORMATS
from viscera.scans.meshing import SURFACES, edge_means, least_angles, mesh_surface
from viscera.scans.scan import Scan, scan


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera mesh`."""
    parser.add_argument("source", metavar="LABELS|SURFACE", help="a label map, or a surface (.stl, .obj, .ply)")
    parser.add_argument(
        "--label", action="append", default=[], metavar="NAME=NUMBER",
        help="a label to mesh, such as 5, liver=5 or kidneys=2+3; once for each part",
    )  # fmt: skip
    parser.add_argument(
        "--edge", action="append", required=True, metavar="LENGTH",
        help="mean edge length of the cells, such as 8mm; again for a part with shorter ones: vein=3mm",
    )  # fmt: skip
    parser.add_argument(
        "--fixed", action="append", default=[], metavar="PLACE",
        help="nodes for the set 'fixed': a condition such as 'z > 90%%', label:63 (where it touches that label), or a "
        "painted image",
    )  # fmt: skip
    parser.add_argument(
        "--units", type=number_or_words, help="unit of a surface: m, cm, mm, um, inch, or metres per unit"
    )
    parser.add_argument("-o", "--output", default="organ.vtu", metavar="FILE", help="the mesh (default organ.vtu)")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Read, mesh, write, print."""
    painted = [place for place in args.fixed if os.path.isfile(place)]  # of a condition too long for a name it is false
    output.spare([args.source, *painted], ("-o", args.output))
    target = checked(args.output)
    made = _from_surface if _is_surface(args.source) else _from_labels
    with output.saying_messages():
        found, voxels = made(args, output)
        found.write(target)
    return Outcome("done", facts=_told(found, voxels, target, output))


def _is_surface(source: str) -> bool:
    """Whether a surface was named, and not a label map; it is an error if neither was."""
    formats = f"label maps end in {', '.join(FORMATS)}, surfaces in {', '.join(SURFACES)}"
    require(source, IMAGE, SURFACE, advice=formats)
    if Path(source).suffix.lower() in SURFACES:
        return True
    if kind_of(source) != IMAGE:
        raise VisceraError(f"{source}: unknown format; {formats}")
    return False


def _from_labels(args: argparse.Namespace, output: Output) -> tuple[Mesh, dict[str, float]]:
    """The mesh, and the volume of each part's voxels [m^3]."""
    if args.units is not None:
        raise VisceraError("--units is for surfaces; an image states the positions of its voxels")
    image = scan(args.source)
    size, sides = image.values.shape, [f"{1e3 * side:.3g}" for side in image.spacing]
    shape = " x ".join(map(str, size))
    output.say(f"{args.source}: {shape} voxels of {' x '.join(sides)} mm, axes {image.axes}")
    labels = parsed(args.label) if args.label else None
    names = [region.name for region in image.regions(labels)]
    checked(args.output, names)
    edges = parsed_edges(args.edge, names)
    with bar(output.is_quiet) as progress:
        found = image.mesh(labels, edge=edges, fixed=args.fixed, progress=progress)
    return found, _voxel_volumes(image, labels)


def _from_surface(args: argparse.Namespace, output: Output) -> tuple[Mesh, dict[str, float]]:
    """The mesh; a surface has no voxels."""
    if args.units is None:
        raise VisceraError(f"{args.source}: a surface needs its --units, such as mm or m")
    if len(args.label) > 1 or any(not _is_name(label) for label in args.label):
        raise VisceraError("a surface has no labels; --label NAME names its only part")
    name = args.label[0] if args.label else "organ"
    checked(args.output, [name])
    edge = parsed_edges(args.edge, [name])[name]
    with bar(output.is_quiet) as progress:
        found = mesh_surface(args.source, edge=edge, units=args.units, name=name, progress=progress)
    places = [found.nodes(where) for where in args.fixed]
    return found.with_sets(fixed=np.unique(np.concatenate(places))) if places else found, {}


def parsed(words: list[str]) -> Any:
    """Labels as `Scan.mesh` takes them, from `5`, `liver=5` or `kidneys=2+3`.

    >>> parsed(["liver=5", "kidneys=2+3"]), parsed(["5"])
    ({'liver': [5], 'kidneys': [2, 3]}, [5])
    """
    if all("=" not in word for word in words):
        return [int(word) if word.isdigit() else word for word in words]
    named: dict[str, list[int]] = {}
    for word in words:
        name, sign, numbers = word.rpartition("=")
        if sign and not name.strip():
            raise VisceraError(f"--label {word} names no part; say NAME=NUMBER, or the number alone")
        if not all(number.strip().isdigit() for number in numbers.split("+")):
            raise VisceraError(f"--label {word} is not NAME=NUMBER, such as liver=5 or kidneys=2+3")
        name = name or f"label_{numbers}"
        if name in named:
            raise VisceraError(f"--label {name} is given twice; one part of two labels is {name}=2+3")
        named[name] = [int(number) for number in numbers.split("+")]
    return named


def parsed_edges(words: list[str], parts: list[str]) -> dict[str, float]:
    """The edge of each part [m], from one length for all, `vein=3mm` for some.

    >>> parsed_edges(["8mm", "vein=3mm"], ["liver", "spleen", "vein"])
    {'liver': 0.008, 'spleen': 0.008, 'vein': 0.003}
    """
    given: dict[str, float] = {}
    for word in words:
        name, sign, size = word.rpartition("=")
        if sign and not name:
            raise VisceraError(f"--edge {word} names no part; say NAME=LENGTH, or the length alone for all parts")
        if name in given:
            raise VisceraError(f"--edge {word}: {f'{name!r} has' if name else 'the other parts have'} an edge already")
        if name and name not in parts:
            raise VisceraError(f"--edge {word}: {name!r} is no part; {did_you_mean(name, parts)}")
        given[name] = _metres(size)
    if missing := [part for part in parts if part not in given and "" not in given]:
        raise VisceraError(f"--edge: none for {missing[0]!r}; --edge 8mm is for all parts that have none of their own")
    return {part: given[part] if part in given else given[""] for part in parts}


def _metres(word: str) -> float:
    try:
        return metres(word)
    except argparse.ArgumentTypeError as error:
        raise VisceraError(f"--edge {word}: {error}") from error


def _is_name(word: str) -> bool:
    return "=" not in word and not word.isdigit()


def _voxel_volumes(image: Scan, labels: Any) -> dict[str, float]:
    voxel = abs(float(np.linalg.det(image.affine[:, :3])))
    return {r.name: voxel * sum(image.labels[n] for n in r.numbers) for r in image.regions(labels)}


def _told(found: Mesh, voxels: dict[str, float], target: Path, output: Output) -> dict[str, Any]:
    """Prints the mesh, and returns its facts."""
    volumes, angles = found.facts["cell_volumes"], least_angles(found.points, found.cells)
    edges = edge_means(found.points, found.cells)
    facts: dict[str, Any] = {
        "file": str(target),
        "n_points": len(found.points),
        "n_cells": len(found.cells),
        "axes": found.axes or None,
        "least_angle": float(angles.min()),
        "first_percentile_angle": float(np.percentile(angles, 1)),
        "parts": {},
        "sets": {name: len(nodes) for name, nodes in found.sets.items()},
        "messages": list(found.messages),
    }
    for name, cells in found.cell_sets.items():
        volume, own = float(volumes[cells].sum()), voxels.get(name)
        low, high = np.percentile(edges[cells], (5, 95)).tolist()
        facts["parts"][name] = {"cells": len(cells), "edges": [low, high], "volume": volume, "voxel_volume": own}
        beside = f", {100.0 * (volume / own - 1.0):+.2f} % of its voxels" if own else ""
        cells_of = f"{len(cells)} cells of {1e3 * low:.2g} to {1e3 * high:.2g} mm"
        output.say(f"  part          {name!r}: {cells_of}, {1e6 * volume:.4g} ml{beside}")
    output.say(f"  angles        {angles.min():.1f} degrees at least, first percentile {np.percentile(angles, 1):.1f}")
    for name, nodes in found.sets.items():
        output.say(f"  set           {name!r}: {len(nodes)} nodes")
    for message in found.messages:
        output.say(f"  note          {message}")
    where = f", axes {found.axes}" if found.axes else ""
    output.say(f"{target}: {len(found.points)} points, {len(found.cells)} cells, in metres{where}")
    lacks = lacking(target, found.sets, found.cell_sets, found.axes)
    if lacks:
        output.say(f"  note          {target.suffix} cannot hold {' and '.join(lacks)}; .vtu does")
    return facts
