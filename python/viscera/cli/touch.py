"""Answer one touch: a contact point and its displacement give the force and its stiffness.

viscera touch out/liver.viscera --at -15mm -59mm 49mm --push 0 5mm -3mm
"""

from __future__ import annotations

import argparse
from typing import Any

from viscera.cli.options import number_or_words
from viscera.cli.output import Outcome, Output
from viscera.filekind import MODEL, check_picture, require
from viscera.touch import load


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera touch`."""
    parser.add_argument("model", metavar="organ.viscera")
    axes = ("X", "Y", "Z")
    words: dict[str, Any] = {"nargs": 3, "type": number_or_words, "required": True, "metavar": axes}
    parser.add_argument("--at", **words, help="contact point: metres, 12mm, or 80%% of the bounding box")
    parser.add_argument("--push", **words, help="contact displacement: metres, 12mm, or 5%% of the diagonal")
    parser.add_argument("--value", type=float, help="value of the model's parameter, within its range")
    parser.add_argument("--picture", metavar="FILE.png", help="draw the touched organ")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Touch once, print."""
    output.spare([args.model], ("--picture", args.picture))
    check_picture(args.picture)
    require(args.model, MODEL)
    touch = load(args.model) if args.value is None else load(args.model).at(args.value)
    answer = touch(args.at, args.push)
    if args.picture is not None:
        touch.plot(args.at, args.push, args.picture)
    output.say("force      " + "  ".join(f"{component:10.4g}" for component in answer.force) + "  N")
    for name, row in zip(("stiffness", "", ""), answer.stiffness, strict=True):
        output.say(f"{name:9s}  " + "  ".join(f"{entry:10.4g}" for entry in row) + "  N/m")
    output.say(f"largest displacement {1e3 * answer.max_displacement:.4g} mm")
    of_force, of_shape = 100 * answer.error_estimate, 100 * answer.shape_error_estimate
    output.say(f"estimated error {of_force:.3g} % of the force, {of_shape:.3g} % of the shape")
    if answer.is_trusted and not answer.is_shape_trusted:
        output.say(f"force trusted, shape not: {answer.shape_reason}")
    else:
        output.say("trusted" if answer.is_trusted else f"not trusted: {answer.reason}")
    facts = {
        "force": answer.force,
        "stiffness": answer.stiffness,
        "error_estimate": answer.error_estimate,
        "is_trusted": answer.is_trusted,
        "reason": answer.reason,
        "shape_error_estimate": answer.shape_error_estimate,
        "is_shape_trusted": answer.is_shape_trusted,
        "shape_reason": answer.shape_reason,
        "max_displacement": answer.max_displacement,
        "contact_point": answer.contact_point,
    }
    return Outcome("answered", facts=facts)
