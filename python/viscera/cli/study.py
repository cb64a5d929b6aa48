"""The studies behind the two papers, measured anew: one HTML report with every figure as PNG and every table as CSV."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from viscera.cli.output import Outcome, Output
from viscera.study import artery

STUDIES: dict[str, Callable[..., dict[str, Any]]] = {"artery": artery.run}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera study`."""
    parser.add_argument("name", choices=sorted(STUDIES), metavar="NAME", help=f"one of {', '.join(sorted(STUDIES))}")
    parser.add_argument("-o", "--output", default="out", metavar="DIR", help="folder of the report (default: out)")
    parser.add_argument("--quick", action="store_true", help="a smaller study, to see what it writes")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Run the study, which writes its own report."""
    facts = STUDIES[args.name](args.output, quick=args.quick, say=output.say)
    output.say(f"report: {facts['report']}")
    return Outcome(facts.pop("status"), facts=facts)
