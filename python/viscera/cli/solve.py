"""Solve the nonlinear statics of one case: displacements, reactions, energy and volume change.

If the case has a [scan], its loads are removed first, and displacements count from the scan. A case with [organs.NAME]
is a scene of several organs, solved together.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

from viscera import progress
from viscera.cases.case import Case
from viscera.cases.scene_case import SceneCase, read_any
from viscera.cli.output import DONE, FAILED, Outcome, Output, iterations
from viscera.navigation import Unloaded
from viscera.organ import Organ
from viscera.output import state as statefile
from viscera.output.kind import CASE, require
from viscera.state import State
from viscera.statics import NOTHING_ACTS

WORDS = {
    "bonds": "bond of",
    "springs": "spring between",
    "contacts": "contact of",
    "bodies": "contact with the body",
}
"""How a force between the parts of a scene is announced."""


def _say_unloaded(rest: Unloaded, name: str, output: Output) -> None:
    moved = 1e3 * np.linalg.norm(rest.state.displacement, axis=1).max()
    output.say(
        f"{name}: loads of the scan taken off in {iterations(len(rest.errors))}, {rest.seconds:.2f} s; they move the "
        f"organ by up to {moved:.4g} mm; displacements count from the scan"
    )


def _say_between(facts: dict[str, Any], output: Output) -> None:
    """How far each organ of a scene moves, and the forces between them."""
    for name, organ in facts["organs"].items():
        output.say(f"  largest displacement of {name!r}: {1e3 * organ['max_displacement']:.4g} mm")
    for kind in ("bonds", "springs", "contacts", "bodies"):
        for each in facts[kind]:
            is_body = kind == "bodies"
            between = f"{each['shape']}, number {each['number']}" if is_body else f"{each['first']!r} and {_end(each)}"
            area = f" over {1e4 * each['area']:.4g} cm2" if "area" in each else ""
            force = ", ".join(f"{component:.4g}" for component in each["force"])
            gap = f", smallest gap {1e3 * each['gap']:.3g} mm" if math.isfinite(each.get("gap", math.inf)) else ""
            output.say(f"  {WORDS[kind]} {between}: {force} N{area}{gap}")


def _end(each: dict[str, Any]) -> str:
    """The second end of what lies between two, or of what touches itself."""
    if "second" in each:
        return repr(each["second"])
    if "point" in each:
        return f"({', '.join(f'{metres:g}' for metres in each['point'])}) m"
    return "itself"


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
    output.spare([args.case], ("-o", args.output))
    require(args.case, CASE)
    case = read_any(args.case)
    output.spare(case.files, ("-o", args.output))
    if args.output is not None:
        statefile.checked(args.output)
    if isinstance(case, SceneCase):
        return _scene(args, case, output)
    organ = output.organ(case)
    if case.scan:
        return _scanned(args, case, organ, output)
    with progress.bar(output.is_quiet) as bar:
        state = case.solve(organ, bar)
    _keep(args, state)
    return _told(args, state, case.reactions(organ, state), {}, output)


def _scanned(args: argparse.Namespace, case: Case, organ: Organ, output: Output) -> Outcome:
    """Solve a case with a [scan], and say how its loads were taken off."""
    with progress.bar(output.is_quiet) as bar:
        rest = case.unloaded(organ, bar)
        facts = {"unloading": {"iterations": len(rest.errors), "error": rest.error, "message": rest.message}}
        if not rest.is_converged:
            output.say(f"{args.case}: {rest.message}")
            return Outcome("no unloaded shape", FAILED, facts)
        state = case.predict(rest, bar)
    _keep(args, state)
    _say_unloaded(rest, args.case, output)
    return _told(args, state, case.reactions(organ, state), facts, output)


def _scene(args: argparse.Namespace, case: SceneCase, output: Output) -> Outcome:
    """Solve a scene, and say what lies between its organs too."""
    with output.saying_messages():
        scene = case.organ()
    for name, organ in scene.organs.items():
        output.say_all(f"{name}: {message}" for message in organ.mesh.messages)
    with progress.bar(output.is_quiet) as bar:
        state = case.solve(scene, bar)
    _keep(args, state)
    return _told(args, state, case.reactions(scene, state), case.facts(scene, state), output)


def _keep(args: argparse.Namespace, state: State) -> None:
    """Write the solution, before anything is said of it: where that cannot be printed, it is there all the same."""
    if args.output is not None:
        state.write(args.output)


def _told(
    args: argparse.Namespace, state: State, reactions: dict[str, list[float]], facts: dict[str, Any], output: Output
) -> Outcome:
    """Print the solution; `facts` are those that not every case has."""
    words = "converged" if state.is_converged else f"did not converge ({state.message}); load reached {state.load:.3g}"
    output.say(f"{args.case}: {words}, {iterations(state.iterations)} in {state.seconds:.2f} s")
    output.say(f"  linear solver         {state.solver}")
    if state.message == NOTHING_ACTS:
        output.say(f"  {NOTHING_ACTS}")
    if state.is_converged and (inside_out := state._inside_out()):
        output.say(f"  {inside_out}")
    output.say(f"  largest displacement  {1e3 * state.max_displacement:.4g} mm")
    output.say(f"  strain energy         {state.energy:.4g} J")
    output.say(f"  volume ratio          {state.volume_ratio:.6g}")
    for name, force in reactions.items():
        output.say(f"  reaction at {name!r}: " + ", ".join(f"{component:.4g}" for component in force) + " N")
    if "organs" in facts:
        _say_between(facts, output)
    if args.output is not None:
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
