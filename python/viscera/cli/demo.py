"""Reduce the built-in liver, check the model against full solutions, draw it and show it in the browser.

The tissue is as soft as elastography measures it in healthy people: E = 4.1 kPa, the mean of 530 volunteers, with a
range of 2.3 to 5.9 kPa (Fung et al., PLoS ONE 8 (2013) e85067, doi 10.1371/journal.pone.0085067). The liver can be
touched within 7 cm of the middle of its front, to a depth of 2 cm. `--paper` takes the liver of paper A instead:
0.17 MPa, in linear cells, which lock, touchable on all of its front to a tenth of the diagonal. `viscera study liver`
has the paper's figures.

Writes liver.viscera and liver.png into the output folder. At a terminal the viewer then opens, until Ctrl-C.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from viscera import organs, progress
from viscera.cli.check import say
from viscera.cli.output import DONE, FAILED, Outcome, Output
from viscera.cli.view import show
from viscera.files.atomic import made_folder
from viscera.law import NeoHookean
from viscera.organ import Organ
from viscera.reduced.check import TOUCHES, surface_points
from viscera.reduced.touch import Touch, load


@dataclass(frozen=True)
class Tissue:
    """What the liver is made of, where it may be touched, and how it is reduced."""

    young: float
    """Young's modulus [Pa]."""
    poisson: float
    element: str | None
    touchable: str
    reduction: dict[str, Any]
    depths: list[str] | None
    """Depths of the check; None for its defaults."""


MEASURED = Tissue(
    young=4.1e3,
    poisson=0.48,
    element=None,
    touchable="anterior and within 7 cm of (-15, -59, 49) mm",
    reduction={"depth": "20 mm", "order": 5, "tolerance": 1e-3},
    depths=["10 mm", "20 mm"],
)
PAPER = Tissue(young=0.17e6, poisson=0.48, element="P1", touchable="anterior", reduction={}, depths=None)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera demo`."""
    parser.add_argument("-o", "--output", default="out", metavar="DIR", help="folder of the results (default: out)")
    parser.add_argument("--touches", type=int, default=50, help="random contacts of the check (default 50)")
    parser.add_argument("--paper", action="store_true", help="the liver of paper A: 0.17 MPa, linear cells")
    parser.add_argument("--no-view", action="store_true", help="stop before the viewer, which only a terminal opens")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Reduce, save, load again, check, draw, show."""
    TOUCHES(args.touches, "touches")
    model, picture = (Path(args.output, name) for name in ("liver.viscera", "liver.png"))
    output.spare([], ("-o", model), ("-o", picture))
    made_folder(args.output)
    tissue = PAPER if args.paper else MEASURED
    organ = Organ(
        organs.liver(), NeoHookean(young=tissue.young, poisson=tissue.poisson), fixed="hilum", element=tissue.element
    )
    output.say(
        f"liver: {len(organ.mesh.points)} nodes, {len(organ.mesh.cells)} cells, {organ.element}; "
        f"neo-Hookean, E = {1e-3 * tissue.young:g} kPa, nu = {tissue.poisson:g}"
    )
    with progress.bar(output.is_quiet) as bar:
        began = perf_counter()
        organ.reduce(tissue.touchable, **tissue.reduction, progress=bar).save(model)
        reduced = perf_counter() - began
        touch = load(model)
        facts = {"file_bytes": model.stat().st_size, **touch.summary()}
        output.say(
            f"reduced in {reduced:.1f} s: {facts['positions']} positions, {facts['terms']} terms, "
            f"{model} ({facts['file_bytes'] / 1e6:.1f} MB)"
        )
        result = touch.check(args.touches, depths=tissue.depths, progress=bar)
    say(result, touch, output)
    point, inward = _middle(touch)
    facts["forces"] = _say_forces(touch, point, inward, output)
    push = _deepest_trusted(touch, point, inward) * inward
    estimate = touch(point, push).shape_error_estimate
    depth = 1e3 * float(np.linalg.norm(push))
    title = f"Liver, pushed in {depth:.0f} mm: reduced model, estimated error {100 * estimate:.2g} %"
    touch.plot(point, push, picture, title=title)
    output.say(f"picture: {picture}")
    if not (args.no_view or output.is_quiet) and sys.stdout.isatty():
        show(touch, "Liver", output)
    facts |= {"reduce_seconds": reduced, "picture": str(picture), **result.to_json()}
    return Outcome(result.verdict, DONE if result.is_passed else FAILED, facts)


def _say_forces(touch: Touch, point: np.ndarray, inward: np.ndarray, output: Output) -> dict[str, float]:
    """What dents straight in at a point take [N], by their depth in millimetres."""
    answers = {
        f"{share * touch.depth * 1e3:.0f} mm": touch(point, share * touch.depth * inward) for share in (0.5, 1.0)
    }
    forces = {depth: float(np.linalg.norm(answer.force)) for depth, answer in answers.items()}
    told = (f"{depth} {forces[depth]:.2g} N ({'' if a.is_trusted else 'not '}trusted)" for depth, a in answers.items())
    output.say(f"pushed straight in at the middle: {', '.join(told)}")
    return forces


def _middle(touch: Touch) -> tuple[np.ndarray, np.ndarray]:
    """A point in the middle of the touchable surface, and the direction straight in."""
    triangles = touch.mesh.points[touch.touchable_triangles]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    middle = np.average(triangles.mean(axis=1), axis=0, weights=np.linalg.norm(normals, axis=1))
    samples = surface_points(touch, 2000, np.random.default_rng(0))
    point = samples[np.argmin(np.linalg.norm(samples - middle, axis=1))]
    return point, -normals.sum(axis=0) / np.linalg.norm(normals.sum(axis=0))


def _deepest_trusted(touch: Touch, point: np.ndarray, inward: np.ndarray) -> float:
    """The depth [m] of a touch worth a picture: as deep as is trusted."""
    depths = (share * touch.depth for share in np.arange(1.0, 0.2, -0.1))
    return next((d for d in depths if touch(point, d * inward).is_shape_trusted), 0.2 * touch.depth)
