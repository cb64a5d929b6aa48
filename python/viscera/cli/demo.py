"""The main job on the built-in liver: reduce it, check it against Newton, draw it, show it.

Writes liver.viscera and liver.png into the output folder; at a terminal the viewer opens, until Ctrl-C.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from time import perf_counter

import numpy as np

from viscera import organs, progress
from viscera.check import surface_points
from viscera.cli.check import say
from viscera.cli.output import DONE, FAILED, Outcome, Output
from viscera.cli.view import show
from viscera.law import NeoHookean
from viscera.organ import Organ
from viscera.touch import Touch, load


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera demo`."""
    parser.add_argument("-o", "--output", default="out", metavar="DIR", help="folder of the results (default: out)")
    parser.add_argument("--touches", type=int, default=50, help="random contacts of the check (default 50)")
    parser.add_argument("--no-view", action="store_true", help="stop before the viewer, which only a terminal opens")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Reduce, save, load again, check, draw, show."""
    folder = Path(args.output)
    folder.mkdir(parents=True, exist_ok=True)
    model, picture = folder / "liver.viscera", folder / "liver.png"
    liver = organs.liver()
    output.say(f"liver: {len(liver.points)} nodes, {len(liver.cells)} cells; neo-Hookean, E = 0.17 MPa, nu = 0.48")
    organ = Organ(liver, NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element="P1")  # paper A's element
    with progress.bar(output.is_quiet) as bar:
        began = perf_counter()
        organ.reduce("anterior", progress=bar).save(model)
        reduced = perf_counter() - began
        touch = load(model)
        facts = {"file_bytes": model.stat().st_size, **touch.summary()}
        output.say(
            f"reduced in {reduced:.1f} s: {facts['positions']} positions, {facts['terms']} terms, "
            f"{model} ({facts['file_bytes'] / 1e6:.1f} MB)"
        )
        result = touch.check(args.touches, progress=bar)
    say(result, touch, output)
    point, push = _push(touch)
    estimate = touch(point, push).shape_error_estimate
    depth = 1e3 * float(np.linalg.norm(push))
    title = f"Liver, pushed in {depth:.0f} mm: reduced model, estimated error {100 * estimate:.2g} %"
    touch.plot(point, push, picture, title=title)
    output.say(f"picture: {picture}")
    if sys.stdout.isatty() and not (args.no_view or output.is_quiet):
        show(str(model), output)
    facts |= {"reduce_seconds": reduced, "picture": str(picture), **result.to_json()}
    return Outcome(result.verdict, DONE if result.is_passed else FAILED, facts)


def _push(touch: Touch) -> tuple[np.ndarray, np.ndarray]:
    """A touch worth a picture: at the middle of the touchable surface, straight in, as deep as is trusted."""
    triangles = touch.mesh.points[touch.touchable_triangles]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    middle = np.average(triangles.mean(axis=1), axis=0, weights=np.linalg.norm(normals, axis=1))
    samples = surface_points(touch, 2000, np.random.default_rng(0))
    point = samples[np.argmin(np.linalg.norm(samples - middle, axis=1))]
    inward = -normals.sum(axis=0) / np.linalg.norm(normals.sum(axis=0))
    depths = (share * touch.depth for share in np.arange(1.0, 0.2, -0.1))
    depth = next((d for d in depths if touch(point, d * inward).is_shape_trusted), 0.2 * touch.depth)
    return point, depth * inward
