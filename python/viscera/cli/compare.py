"""Compare the models of paper B on one case: linear, corotated, Saint Venant-Kirchhoff, neo-Hookean, Mooney-Rivlin.

Writes compare.png and, for every node and component, compare.csv into the output folder. All models have the moduli
of the case's material at small strain. Fails (exit 1) if a model does not reach the full load.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from viscera import progress
from viscera.cases.case import read_case
from viscera.cli.output import DONE, FAILED, Outcome, Output
from viscera.comparison import REFERENCE, Comparison, compare, models
from viscera.errors import VisceraError, did_you_mean, naming
from viscera.files.atomic import made_folder
from viscera.output.kind import CASE, require


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera compare`."""
    parser.add_argument("case", metavar="CASE.toml")
    parser.add_argument("-o", "--output", default="out", metavar="DIR", help="folder of the results (default: out)")
    parser.add_argument(
        "--reference",
        default=REFERENCE,
        metavar="MODEL",
        help=f"the model that the others are compared with (default {REFERENCE})",
    )
    parser.add_argument(
        "--models", nargs="+", metavar="MODEL", help="the models to compare, such as Linear 'MooneyRivlin J-1'"
    )


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Solve with every model, print the tables, draw."""
    picture, differences = (Path(args.output, name) for name in ("compare.png", "compare.csv"))
    written = (("-o", picture), ("-o", differences))
    output.spare([args.case], *written)
    require(args.case, CASE)
    case = read_case(args.case)
    output.spare(case.files, *written)
    case.require_unloaded("compare")
    made_folder(args.output)
    organ = output.organ(case)
    laws = models(organ.law)
    wanted = {args.reference, *(args.models or laws)}
    for name in wanted - set(laws):
        raise VisceraError(f"unknown model {name!r}; {did_you_mean(name, laws)}")
    laws = {name: law for name, law in laws.items() if name in wanted}
    with naming(case.file), progress.bar(output.is_quiet) as bar:
        result = compare(organ, laws=laws, reference=args.reference, progress=bar, **case.loading())
    result.plot(picture)
    result.write(differences)
    output.say(result.table())
    for name, each in result.runs.items():
        if not each.state.is_converged:
            output.say(f"{name} {each.state.status}: {each.state.message}")
    if hint := _other_reference(result, type(organ.law).__name__):
        output.say(hint)
    output.say(f"picture: {picture}; every node and component: {differences}")
    facts = {**result.to_json(), "picture": str(picture), "differences": str(differences)}
    status, code = ("converged", DONE) if result.is_converged else ("a model did not converge", FAILED)
    return Outcome(status, code, facts)


def _other_reference(result: Comparison, own: str) -> str:
    """What to compare with where the reference did not converge, first of all the case's own law; empty if it did."""
    converged = [name for name, each in result.runs.items() if each.state.is_converged]
    if result.reference in converged or not converged:
        return ""
    better = own if own in converged else converged[0]
    return (
        f"nothing is compared with {result.reference}, which did not reach the full load; choose a model that did, "
        f"such as --reference {better if ' ' not in better else repr(better)}"
    )
