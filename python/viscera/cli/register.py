"""Find an organ from what was measured of it: points on a part of its surface, landmarks with names.

viscera register CASE.toml cloud.ply --units mm --noise 2mm -o now.vtu
The case names mesh, material and fixed nodes; its [loads] play no part, and a [scan] is refused. What moved the organ
is unknown: mostly one cause, a pressure, a pull or its weight. Fails (exit 1) if the registration did not converge, if
the organ fits the points so poorly that its band is not to be trusted, or if they observe no part of it.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from viscera import progress
from viscera.cases.case import read_case
from viscera.cli.options import metres, number_or_words
from viscera.cli.output import DONE, FAILED, Outcome, Output, iterations
from viscera.errors import VisceraError
from viscera.files.mesh import metres_per_unit
from viscera.output import state as statefile
from viscera.output.kind import CASE, require
from viscera.registration import Registered
from viscera.registration.measured import CLOUDS, read_cloud, read_landmarks

USABLE = ("converged", "partly observed")
"""Statuses of a registration whose band may be trusted where it is observed."""
UNLOAD = (
    "leave the [scan] out if it moves the organ little, or register what it leaves, in Python: "
    "`case.unloaded(case.organ()).organ.register(...)`, whose displacements count from there"
)
"""What to do about a case that has one."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera register`."""
    parser.add_argument("case", metavar="CASE.toml", help="the organ: mesh, material, fixed nodes")
    parser.add_argument(
        "cloud", metavar="CLOUD", nargs="?",
        help=f"measured points on its surface: {', '.join(CLOUDS)}; a CSV file has columns x, y, z",
    )  # fmt: skip
    parser.add_argument(
        "--landmarks", metavar="FILE.csv", help="columns name, x, y, z: where the means of node sets of the mesh are"
    )
    parser.add_argument(
        "--units", type=number_or_words, default="m",
        help="unit of cloud and landmarks: m (default), cm, mm, um, inch, or metres per unit",
    )  # fmt: skip
    parser.add_argument(
        "--noise", type=_noise, default="2mm", metavar="LENGTH",
        help="standard deviation of the points along each axis, such as 1mm (default 2 mm)",
    )  # fmt: skip
    parser.add_argument(
        "--landmark-noise",
        type=_noise,
        metavar="LENGTH",
        help="the same of the landmarks (default: that of the points)",
    )
    parser.add_argument("--visible", metavar="PLACE", help="the part of the surface that the points may lie on")
    parser.add_argument("--loaded", metavar="PLACE", help="the part of the surface on which forces may act")
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="the organ where it was found, with its band (.vtu, ...)"
    )
    parser.add_argument(
        "--shape", metavar="STATE.vtu", help="its shape before the rigid motion, in axes of the scan, for viscera warp"
    )


def _noise(text: str) -> tuple[str, float]:
    """A length as it was written, and in metres."""
    return text.strip(), metres(text)


def _with_unit(option: str, noise: tuple[str, float], units: str | float) -> float:
    """The noise [m]; raises `VisceraError` for a bare number beside a cloud in another unit than metres."""
    text, length = noise
    if isinstance(number_or_words(text), float) and metres_per_unit(units) != 1.0:
        raise VisceraError(
            f"{option} {text} is in metres, and --units {units} is of the cloud and the landmarks; write its unit, as "
            f"in {option} {text}{units if isinstance(units, str) else 'mm'}"
        )
    return length


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Read, register, print, write."""
    written = (("-o", args.output), ("--shape", args.shape))
    output.spare([args.case, args.cloud, args.landmarks], *written)
    require(args.case, CASE)
    case = read_case(args.case)
    case.require_unloaded("register", UNLOAD)
    output.spare(case.files, *written)
    for path in (args.output, args.shape):
        if path is not None:
            statefile.checked(path)
    if args.cloud is None and args.landmarks is None:
        raise VisceraError("nothing was measured; name a cloud of points, or --landmarks")
    noise = _with_unit("--noise", args.noise, args.units)
    own = args.landmark_noise
    landmark_noise = None if own is None else _with_unit("--landmark-noise", own, args.units)
    cloud = None if args.cloud is None else read_cloud(args.cloud, args.units)
    landmarks = None if args.landmarks is None else read_landmarks(args.landmarks, args.units)
    organ = output.organ(case)
    with progress.bar(output.is_quiet) as bar:
        found = organ.register(
            cloud, landmarks=landmarks, noise=noise, landmark_noise=landmark_noise, visible=args.visible,
            loaded=args.loaded, progress=bar,
        )  # fmt: skip
    results = [(path, each) for path, each in ((args.output, found), (args.shape, found.state)) if path is not None]
    for path, result in results:  # before anything is said: if that cannot be printed, they are there all the same
        result.write(path)
    facts = _facts(found)
    output.say(f"{args.case}: {found.status}, {iterations(found.iterations)} in {found.seconds:.1f} s")
    output.say_all([found.message] if found.message else [])
    _say(found, facts, output)
    output.say_all(f"  written to {path}: {statefile.contents(path)}" for path, _ in results)
    return Outcome(found.status, DONE if found.status in USABLE else FAILED, facts)


def _say(found: Registered, facts: dict[str, Any], output: Output) -> None:
    """The numbers of a registration for people."""
    motion = ", ".join(f"{1e3 * metres:.1f}" for metres in facts["translation"])
    output.say(f"  rigid motion          turned by {facts['angle']:.1f} degrees, moved by ({motion}) mm")
    output.say(f"  largest deformation   {1e3 * found.state.max_displacement:.1f} mm")
    if len(found.residual):
        share = f"{100 * facts['inlier_share']:.0f} % of {len(found.residual)} points"
        output.say(f"  points of the organ   {share}, {1e3 * facts['residual']:.2f} mm from it (root mean square)")
    for name, left in facts["landmarks"].items():
        output.say(f"  landmark {name!r}: {1e3 * left:.1f} mm left")
    within = f"within {1e3 * facts['band']:.1f} mm (95 %) in the median" if facts["band"] is not None else "none"
    output.say(f"  observed nodes        {100 * facts['observed_share']:.0f} %: {within}")


def _facts(found: Registered) -> dict[str, Any]:
    inliers, seen = found.residual[found.is_inlier], found.is_observed
    cosine = np.clip(0.5 * (np.trace(found.rotation) - 1.0), -1.0, 1.0)
    return {
        "rotation": found.rotation,
        "translation": found.translation,
        "angle": float(np.degrees(np.arccos(cosine))),
        "max_displacement": found.state.max_displacement,
        "residual": float(np.sqrt(np.mean(inliers**2))) if len(inliers) else None,
        "inlier_share": float(found.is_inlier.mean()) if len(found.is_inlier) else None,
        "landmarks": found.pair_residual,
        "coverage": found.coverage,
        "misfit": found.misfit,
        "systematic_residual": found.systematic_residual,
        "observed_share": float(seen.mean()),
        "band": float(np.median(found.band[seen])) if seen.any() else None,
        "iterations": found.iterations,
        "message": found.message,
    }
