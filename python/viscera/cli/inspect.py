"""Show what a mesh file contains: sizes, bounding box, volume, quality, problems and node sets.

Prints everything it can find, then fails (exit 1) if there is a problem.
"""

from __future__ import annotations

import argparse

from viscera.cases.case import BUILT_IN, load_mesh
from viscera.cli.options import number_or_words
from viscera.cli.output import DONE, FAILED, Outcome, Output
from viscera.inspection import inspect, report

AXES = {"RAS": "right, anterior, superior", "LPS": "left, posterior, superior"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera inspect`."""
    parser.add_argument("mesh", metavar="MESH", help=f"a mesh file, or organ: and one of {', '.join(BUILT_IN)}")
    parser.add_argument(
        "--units", type=number_or_words, default="m", help="m (default), cm, mm, um, inch, or metres per unit"
    )


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Read, measure, print."""
    output.spare([args.mesh])
    is_built_in = args.mesh.startswith("organ:")
    facts = report(load_mesh(args.mesh, args.units)) if is_built_in else inspect(args.mesh, units=args.units)
    output.say(f"{args.mesh}: {facts['n_points']} points, {facts['n_cells']} cells")
    if facts["volume"] is not None:
        sides = [f"{1e3 * (high - low):.4g}" for low, high in zip(*facts["bounding_box"], strict=True)]
        output.say(f"  bounding box  {' x '.join(sides)} mm")
        output.say(f"  volume        {facts['volume_ml']:.4g} ml")
        quality = facts["quality"]
        output.say(f"  quality       min {quality['min']:.3g}, mean {quality['mean']:.3g} (1 is best)")
        output.say(f"  parts         {facts['parts']}")
    if facts["axes"]:
        output.say(f"  axes          {facts['axes']} ({AXES[facts['axes']]}), in metres")
    for name, size in facts["sets"].items():
        output.say(f"  set           {name!r}: {size} nodes")
    for name, size in facts["cell_sets"].items():
        output.say(f"  cell set      {name!r}: {size} cells")
    for message in facts["messages"]:
        output.say(f"  repaired      {message}")
    for problem in facts["problems"]:
        output.say(f"  problem       {problem}")
    return Outcome("problems", FAILED, facts) if facts["problems"] else Outcome("sound", DONE, facts)
