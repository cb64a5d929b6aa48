"""Options that commands share: lengths, and an organ described on the command line instead of in a case file."""

from __future__ import annotations

import argparse
import re
from typing import Any

from viscera import defaults
from viscera.cases.case import Case, read_case
from viscera.errors import VisceraError
from viscera.files.mesh import FORMATS, METRES
from viscera.law import OF_TWO_MODULI
from viscera.output.kind import CASE, MESH, kind_of
from viscera.reduced.touch import Touch, load
from viscera.select import length

DECIMAL_COMMA = re.compile(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*[a-z%]*\s*")
AREA = re.compile(r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>[a-z]+)\^?2")
MATERIAL = ("law", "young", "poisson")
MESH_ONLY = ("units", "fixed", "element", *MATERIAL)


def metres(text: str) -> float:
    """A length [m]: a number, or a number with its unit."""
    if text.strip().endswith("%"):
        raise argparse.ArgumentTypeError(
            f"{text.strip()} of what? write metres, or a number with its unit such as 12mm"
        )
    try:
        return length(number_or_words(text), whole=None, name="length")
    except VisceraError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def square_metres(text: str) -> float:
    """An area [m^2]: a number, or a number with its unit, such as "78.5 mm2" or "78.5 mm^2"."""
    words = number_or_words(text)
    if isinstance(words, float):
        return words
    match = AREA.fullmatch(words)
    if not match or match["unit"] not in METRES:
        units = ", ".join(f"{unit}2" for unit in METRES)
        raise argparse.ArgumentTypeError(
            f"area {words!r} is not an area; write square metres, or a number with its unit such as 78.5mm2 ({units})"
        )
    return float(match["number"]) * METRES[match["unit"]] ** 2


def number_or_words(text: str) -> float | str:
    """A number as a float, anything else as it stands ("12 mm", "10%"); a decimal comma is refused."""
    if DECIMAL_COMMA.fullmatch(text):
        raise argparse.ArgumentTypeError(f"{text.strip()} has a comma; write decimals with a point, such as 0.01")
    try:
        return float(text)
    except ValueError:
        return text.strip()


def add_organ(parser: argparse.ArgumentParser) -> None:
    """A case file, or a mesh with its material and supports."""
    parser.add_argument(
        "case", metavar="CASE.toml|MESH", help="a case file; or with options a mesh file or organ:liver"
    )
    organ = parser.add_argument_group("an organ without a case file")
    organ.add_argument(
        "--units", type=number_or_words, help="unit of the mesh file: m, cm, mm, um, inch, or metres per unit"
    )
    organ.add_argument("--fixed", metavar="SET", help="a set's name, or a condition such as 'x < 10%%' or 'z > 3 cm'")
    organ.add_argument("--element", help="'P1', 'P1 mean volume' or 'P2' (default: chosen for Poisson's ratio)")
    organ.add_argument("--law", help=f"{', '.join(OF_TWO_MODULI)} (default: NeoHookean)")
    organ.add_argument("--young", type=float, metavar="PA", help="Young's modulus [Pa]")
    organ.add_argument("--poisson", type=float, help="Poisson's ratio, above -1 and below 0.5")


def add_reduction(parser: argparse.ArgumentParser) -> None:
    """The settings of a reduction; they take precedence over a case's."""
    reduction = parser.add_argument_group("the reduction")
    share = "of the bounding-box diagonal"
    reduction.add_argument(
        "--touchable",
        metavar="SET",
        help="surface to be touched (default: all farther than the radius from fixed nodes)",
    )
    reduction.add_argument(
        "--radius", type=number_or_words, metavar="LENGTH",
        help=f"radius of the contact: metres, '12 mm' or '10%%' {share} (default {defaults.RADIUS_FRACTION:.0%}%)",
    )  # fmt: skip
    reduction.add_argument(
        "--depth", type=number_or_words, metavar="LENGTH",
        help=f"largest contact displacement (default {defaults.DEPTH_FRACTION:.0%}% {share})",
    )  # fmt: skip
    reduction.add_argument("--order", type=int, help=f"order of the series (default {defaults.ORDER})")
    reduction.add_argument(
        "--tolerance", type=float, help=f"relative error of the stored field (default {defaults.TOLERANCE:g})"
    )


def add_value(parser: argparse.ArgumentParser) -> None:
    """The value of the parameter for which a model covers a range."""
    parser.add_argument(
        "--value", type=number_or_words,
        help="value of the model's parameter, within its range; a radius also in words such as 12mm",
    )  # fmt: skip


def model_at(path: str, value: float | str | None) -> Touch:
    """The model of a file, at a value of its parameter if one is given."""
    touch = load(path)
    return touch if value is None else touch.at(value)


def case_of(args: argparse.Namespace) -> Case:
    """The case that a command line means."""
    given = {name: getattr(args, name) for name in MESH_ONLY if getattr(args, name) is not None}
    reduction = {
        name: getattr(args, name)
        for name in ("touchable", "radius", "depth", "order", "tolerance")
        if getattr(args, name, None) is not None
    }
    kind = kind_of(args.case)
    if kind == CASE:
        if given:
            raise VisceraError(f"{args.case} describes the organ; change it there, and leave out --{next(iter(given))}")
        case = read_case(args.case)
        return _with_reduction(case, reduction)
    if kind != MESH and not args.case.startswith("organ:"):
        raise VisceraError(f"{args.case}: is no case file, which ends in .toml, and no mesh: {', '.join(FORMATS)}")
    for name in ("fixed", "young", "poisson"):
        if name not in given:
            raise VisceraError(f"{args.case} is a mesh: it needs --{name} as well (see --help), or write a case file")
    material: dict[str, Any] = {"law": "NeoHookean"}
    material.update({name: given[name] for name in MATERIAL if name in given})
    place: dict[str, Any] = {name: given.get(name) for name in ("units", "element")}
    case = Case(mesh=args.case, fixed=given["fixed"], material=material, **place)
    return _with_reduction(case, reduction)


def _with_reduction(case: Case, reduction: dict[str, Any]) -> Case:
    return Case(**{**vars(case), "reduction": {**case.reduction, **reduction}})
