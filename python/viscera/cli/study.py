"""Run a study: the figures and tables of two papers, or a measured beam; one HTML report with PNG and CSV files.

viscera study liver -o out/liver
viscera study liver kidney.vtu --units mm --fixed "z < 15%" -o out/kidney
"""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path
from typing import Any

from viscera.cases.case import load_mesh
from viscera.cli.options import number_or_words
from viscera.cli.output import Outcome, Output
from viscera.errors import VisceraError
from viscera.files.atomic import made_folder

STUDIES = ("artery", "beam", "liver", "measured-beam")
"""Modules of `viscera.study`, with an underscore for the hyphen."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera study`."""
    parser.add_argument("name", choices=STUDIES, metavar="NAME", help=f"one of {', '.join(STUDIES)}")
    parser.add_argument("-o", "--output", default="out", metavar="DIR", help="folder of the report (default: out)")
    parser.add_argument("--quick", action="store_true", help="a smaller study, to see what it writes")
    other = parser.add_argument_group("another organ than the built-in liver")
    other.add_argument("mesh", nargs="?", metavar="MESH", help="a mesh file")
    other.add_argument(
        "--units", type=number_or_words, help="unit of the file: m, cm, mm, um, inch, or metres per unit"
    )
    other.add_argument("--fixed", metavar="SET", help="a set's name, or a condition such as 'x < 10%%' or 'z > 3 cm'")
    other.add_argument("--touchable", metavar="SET", help="surface to be loaded (default: all away from fixed nodes)")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Run the study, which writes its own report."""
    output.spare([args.mesh], ("-o", Path(args.output, "index.html")))
    organ = _organ(args)
    made_folder(args.output)
    module = args.name.replace("-", "_")
    study = import_module(f"viscera.study.{module}")  # with matplotlib, which no other verb has to wait for
    facts: dict[str, Any] = study.run(args.output, quick=args.quick, say=output.say, **organ)
    output.say(f"report: {facts['report']}")
    return Outcome(facts.pop("status"), facts=facts)


def _organ(args: argparse.Namespace) -> dict[str, Any]:
    """The organ given instead of the built-in one."""
    if args.mesh is None:
        given = next((name for name in ("units", "fixed", "touchable") if getattr(args, name) is not None), None)
        if given:
            raise VisceraError(f"--{given} describes a mesh; give its file as well")
        return {}
    if args.name != "liver":
        raise VisceraError(f"the {args.name} study has its own mesh; for another organ use `viscera study liver`")
    if args.fixed is None:
        raise VisceraError(f"{args.mesh} is a mesh: it needs --fixed as well, a set's name or a condition")
    mesh = load_mesh(args.mesh, args.units)
    touchable = None if args.touchable is None else mesh.nodes(args.touchable)
    return {"mesh": mesh, "fixed": mesh.nodes(args.fixed), "touchable": touchable}
