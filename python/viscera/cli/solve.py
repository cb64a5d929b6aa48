"""Solve the nonlinear statics of one case: displacements, reactions, energy and volume change.

If the case has a [scan], its loads are removed first, and displacements count from the scan.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from viscera import progress, statefile
from viscera.case import read_case
from viscera.cli.output import DONE, FAILED, Outcome, Output
from viscera.navigation import Unloaded
from viscera.organ import NOTHING_ACTS


def _say_unloaded(rest: Unloaded, name: str, output: Output) -> None:
    if not rest.is_converged:
        output.say(f"{name}: {rest.message}")
        return
    moved = 1e3 * np.linalg.norm(rest.state.displacement, axis=1).max()
    output.say(
        f"{name}: loads of the scan taken off in {len(rest.errors)} iterations, {rest.seconds:.2f} s; they move the "
        f"organ by up to {moved:.4g} mm; displacements count from the scan"
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera solve`."""
    parser.add_argument("case", metavar="CASE.toml")
    parser.add_argument(
        "-o", "--output", metavar="FILE",
        help="write the solution: as a volume with its fields (.vtu, .vtk, .xdmf, .msh), or as its deformed surface "
        "(.ply, .glb, .gltf, .obj, .stl)",
    )  # fmt: skip


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Solve, print, write."""
    case = read_case(args.case)
    if args.output:
        statefile.checked(args.output)
    organ = case.organ()
    output.say_all(organ.mesh.messages)
    facts: dict[str, Any] = {}
    with progress.bar(output.is_quiet) as bar:
        if case.scan:
            rest = case.unloaded(organ, bar)
            _say_unloaded(rest, args.case, output)
            facts["unloading"] = {"iterations": len(rest.errors), "error": rest.error, "message": rest.message}
            if not rest.is_converged:
                return Outcome("no unloaded shape", FAILED, facts)
            state = case.predict(rest, bar)
        else:
            state = case.solve(organ, bar)
    reactions = case.reactions(organ, state)
    words = "converged" if state.is_converged else f"did not converge ({state.message}); load reached {state.load:.3g}"
    output.say(f"{args.case}: {words}, {state.iterations} iterations in {state.seconds:.2f} s")
    if "solver" in case.settings:
        output.say(f"  linear solver         {state.solver}")
    if state.message == NOTHING_ACTS:
        output.say(f"  {NOTHING_ACTS}")
    output.say(f"  largest displacement  {1e3 * state.max_displacement:.4g} mm")
    output.say(f"  strain energy         {state.energy:.4g} J")
    output.say(f"  volume ratio          {state.volume_ratio:.6g}")
    for name, force in reactions.items():
        output.say(f"  reaction at {name!r}: " + ", ".join(f"{component:.4g}" for component in force) + " N")
    if args.output:
        state.write(args.output)
        output.say(f"  written to {args.output}: {statefile.contents(args.output)}")
    facts |= {
        "iterations": state.iterations,
        "linear_iterations": state.linear_iterations,
        "solver": state.solver,
        "residuals": state.residuals,
        "energy": state.energy,
        "volume_ratio": state.volume_ratio,
        "max_displacement": state.max_displacement,
        "reactions": reactions,
        "load": state.load,
        "message": state.message,
    }
    return Outcome(state.status, DONE if state.is_converged else FAILED, facts)
