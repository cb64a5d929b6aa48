"""Make the reduced model of an organ: a model file that answers touches in microseconds.

viscera reduce liver.toml -o liver.viscera
viscera reduce kidney.vtu --units mm --fixed "z < 15%" --young 10e3 --poisson 0.45
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import perf_counter

from viscera import progress
from viscera.cli.options import add_organ, add_reduction, case_of
from viscera.cli.output import Outcome, Output
from viscera.errors import VisceraError
from viscera.files.atomic import followed
from viscera.output.kind import CASE, MESH, model_path, require
from viscera.reduced.checkpoint import SUFFIX, Checkpoint
from viscera.reduced.touch import Touch


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera reduce`."""
    add_organ(parser)
    add_reduction(parser)
    parser.add_argument("-o", "--output", metavar="FILE", help="the model file (default: the case's name, .viscera)")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Reduce, save, print."""
    output.spare([args.case], ("-o", args.output))
    if not args.case.startswith("organ:"):
        require(args.case, CASE, MESH)
    default = Path(args.case.removeprefix("organ:")).with_suffix(".viscera").name
    wanted = default if args.output is None else args.output
    output.spare([args.case], ("-o", wanted))
    case = case_of(args)
    output.spare(case.files, ("-o", wanted))
    target = model_path(wanted)
    organ = output.organ(case)
    began = perf_counter()
    real = followed(target)  # beside the file itself, where another command of it finds them, too
    kept = Checkpoint(real.with_name(real.name + SUFFIX), output.say)
    kept_at = f"finished positions are kept in {kept.path}, and the same command goes on from there"
    try:
        with progress.bar(output.is_quiet) as bar:
            touch = case.reduce(organ, bar, kept)
        _save(touch, target, kept_at)
    except KeyboardInterrupt:
        if kept.path.exists():
            raise KeyboardInterrupt(f"interrupted; {kept_at}") from None
        raise
    facts = {"file": str(target), "file_bytes": target.stat().st_size, **touch.summary()}
    output.say(
        f"{target}: {facts['positions']} positions, {facts['terms']} terms, {facts['modes']} modes, "
        f"{facts['file_bytes'] / 1e6:.1f} MB, worst error off-line {100 * facts['worst_error']:.2g} %, "
        f"{perf_counter() - began:.1f} s"
    )
    return Outcome("reduced", facts=facts)


def _save(touch: Touch, target: Path, kept_at: str) -> None:
    """Writes the model, which removes the finished batches; where that fails, the error says that they stay."""
    try:
        touch.save(target)
    except VisceraError as error:
        raise type(error)(f"{error}; {kept_at}") from error
