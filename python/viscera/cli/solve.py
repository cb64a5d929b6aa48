"""Nonlinear statics of one case: displacements, reactions, energy and volume change."""

from __future__ import annotations

import argparse

from viscera import progress
from viscera.atomic import writable
from viscera.case import read_case
from viscera.cli.output import DONE, FAILED, Outcome, Output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera solve`."""
    parser.add_argument("case", metavar="CASE.toml")
    parser.add_argument("-o", "--output", metavar="FILE", help="write the deformed organ, as VTU by the suffix .vtu")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Solve, print, write."""
    case = read_case(args.case)
    if args.output:
        writable(args.output)
    organ = case.organ()
    output.say_all(organ.mesh.messages)
    with progress.bar(output.is_quiet) as bar:
        state = case.solve(organ, bar)
    reactions = case.reactions(organ, state)
    words = "converged" if state.is_converged else f"did not converge ({state.message}); load reached {state.load:.3g}"
    output.say(f"{args.case}: {words}, {state.iterations} iterations in {state.seconds:.2f} s")
    output.say(f"  largest displacement  {1e3 * state.max_displacement:.4g} mm")
    output.say(f"  strain energy         {state.energy:.4g} J")
    output.say(f"  volume ratio          {state.volume_ratio:.6g}")
    for name, force in reactions.items():
        output.say(f"  reaction at {name!r}: " + ", ".join(f"{component:.4g}" for component in force) + " N")
    if args.output:
        state.write(args.output)
        output.say(f"  written to {args.output}")
    facts = {
        "iterations": state.iterations,
        "residuals": state.residuals,
        "energy": state.energy,
        "volume_ratio": state.volume_ratio,
        "max_displacement": state.max_displacement,
        "reactions": reactions,
        "load": state.load,
        "message": state.message,
    }
    return Outcome(state.status, DONE if state.is_converged else FAILED, facts)
