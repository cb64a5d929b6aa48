"""Answer one touch: a contact point and its displacement give the force and its stiffness.

viscera touch out/liver.viscera --at -15mm -59mm 49mm --push 0 5mm -3mm
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from viscera.cli.options import add_value, model_at, number_or_words
from viscera.cli.output import Outcome, Output
from viscera.output.kind import MODEL, check_picture, require
from viscera.reduced.answer import Answer
from viscera.reduced.touch import Touch
from viscera.reduced.vary import UNITS

NEAR = 0.05
"""Part of the radius of the contact by which it may be off the given point without a word."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera touch`."""
    parser.add_argument("model", metavar="organ.viscera")
    axes = ("X", "Y", "Z")
    words: dict[str, Any] = {"nargs": 3, "type": number_or_words, "required": True, "metavar": axes}
    parser.add_argument("--at", **words, help="contact point: metres, 12mm, or 80%% of the bounding box")
    parser.add_argument("--push", **words, help="contact displacement: metres, 12mm, or 5%% of the diagonal")
    add_value(parser)
    parser.add_argument("--picture", metavar="FILE.png", help="draw the touched organ")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Touch once, print."""
    output.spare([args.model], ("--picture", args.picture))
    check_picture(args.picture)
    require(args.model, MODEL)
    touch = model_at(args.model, args.value)
    answer = touch(args.at, args.push)
    if args.picture is not None:
        touch.plot(args.at, args.push, args.picture)
    output.say_all([*_parameter(touch), *_moved(touch, answer, args.at)])
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
        "parameter": touch.parameter,
    }
    return Outcome("answered", facts=facts)


def _parameter(touch: Touch) -> list[str]:
    """The value that a model for a range answers for, and the range."""
    if touch.parameter is None:
        return []
    name, value, (low, high) = (touch.parameter[key] for key in ("name", "value", "range"))
    unit = f" {UNITS.get(name, '')}".rstrip()
    return [f"{name} = {value:g}{unit}, in the range {low:g} to {high:g}{unit}"]


def _moved(touch: Touch, answer: Answer, given: list[float | str]) -> list[str]:
    """Where the contact is, if the given point is beside the touchable surface."""
    distance = float(np.linalg.norm(answer.contact_point - touch._point(given)))
    if distance <= NEAR * touch.radius:
        return []
    at = ", ".join(f"{1e3 * x:.1f}" for x in answer.contact_point)
    return [f"contact at ({at}) mm, {1e3 * distance:.3g} mm from the given point"]
