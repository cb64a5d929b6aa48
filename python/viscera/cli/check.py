"""Compare a reduced model with full solutions at random unseen touches: errors by depth, beside the model's estimates.

Fails (exit 1) if a trusted answer is off by more than 1 % at depths up to 5 % of the diagonal, or by more than 5 %
beyond. Also fails if nothing could be checked: no trusted answer was compared, or most full solutions did not converge.
"""

from __future__ import annotations

import argparse

from viscera import progress
from viscera.cli.options import add_value, model_at, number_or_words
from viscera.cli.output import DONE, FAILED, Outcome, Output
from viscera.output.kind import MODEL, require
from viscera.reduced.check import Check, Row, allowed_error
from viscera.reduced.touch import Touch


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera check`."""
    parser.add_argument("model", metavar="organ.viscera")
    parser.add_argument("--touches", type=int, default=50, help="random contacts, each at every depth (default 50)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the random contacts (default 0)")
    add_value(parser)
    parser.add_argument(
        "--depths", nargs="+", type=number_or_words, metavar="DEPTH",
        help="metres, '12 mm' or '5%%' of the bounding-box diagonal (default 5%% 10%%)",
    )  # fmt: skip


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Check, print the table."""
    output.spare([args.model])
    require(args.model, MODEL)
    touch = model_at(args.model, args.value)
    with progress.bar(output.is_quiet) as bar:
        result = touch.check(args.touches, args.seed, args.depths, progress=bar)
    say(result, touch, output)
    return Outcome(result.verdict, DONE if result.is_passed else FAILED, result.to_json())


def say(result: Check, touch: Touch, output: Output) -> None:
    """The table, the exceptions and the rates, in words."""
    output.say(f"model against Newton, {touch!r}\n{result.table()}")
    trusted = sum(row.is_trusted for row in result.rows)
    output.say(f"the model trusts {trusted} of {len(result.rows)} answers ({100 * result.trusted_share:.0f} %)")
    missing = [row for row in result.rows if not row.is_converged]
    if missing:
        unseen = sum(row.is_trusted for row in missing)
        output.say(
            f"{len(missing)} of {len(result.rows)} full solutions did not converge, so their answers are not compared "
            f"({unseen} of these answers are trusted)"
        )
    unstable = sum(row.is_converged and row.status != "converged" for row in result.rows)
    if unstable:
        output.say(
            f"{unstable} of {len(result.rows)} full solutions passed an instability: "
            "the organ may have buckled to another equilibrium"
        )
    beyond = [row for row in result.rows if not row.is_within_limits]
    for row in beyond[:5]:
        output.say(f"beyond its limit though trusted: {_failure(row)}")
    if len(beyond) > 5:
        output.say(f"and {len(beyond) - 5} more beyond their limits")
    output.say(
        f"{result.microseconds_force:.1f} us per answer with force and stiffness, {result.microseconds_field:.0f} us "
        f"with the whole field (called from Python); check took {result.seconds:.1f} s"
    )
    output.say(_verdict(result, touch, len(beyond)))


def _failure(row: Row) -> str:
    """One answer beyond its limit: where, how far off, and the status of the full solution."""
    at, push = (f"({', '.join(f'{1e3 * x:.1f}' for x in vector)}) mm" for vector in (row.point, row.displacement))
    errors = f"{_percent(row.displacement_error)} off in displacement, {_percent(row.force_error)} in force"
    limit = f"limit {_percent(allowed_error(row.depth_fraction))}"
    return f"at {at}, push {push}: {errors}, {limit}; full solution {row.status}"


def _verdict(result: Check, touch: Touch, beyond: int) -> str:
    if beyond:
        return f"the check FAILED: trusted answers beyond their limits: {beyond}"
    if result.is_passed:
        return "every trusted answer that could be compared is within its limit"
    overall = result.overall
    found = (
        f"{overall.converged} of {overall.touches} full solutions converged, {overall.trusted} of their answers trusted"
    )
    of_parameter = float(touch.metadata["errors"].get("parameter", 0.0))
    if touch.parameter is not None and of_parameter > allowed_error(0.0):
        off = f"between the values of {touch.parameter['name']} that were solved answers are up to"
        cure = f"{off} {_percent(of_parameter)} off; reduce with more nodes in Vary, or a narrower range"
    else:
        cure = "check smaller depths, or reduce to a higher order"
    return f"nothing could be checked: {found}; {cure}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.3g} %"
