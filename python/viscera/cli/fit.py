"""Fit laws to material tests: the parameters of one law, or of all laws ranked, with intervals, error and stability.

A curve is a CSV file with a line of names: columns `stretch` (in simple shear `shear`) and `stress` [Pa], or
`displacement` [m] and `force` [N] with the specimen's --length and --area or --diameter. A name may end in a unit,
`displacement_mm`, `stress [kPa]`, `stress [N/mm^2]`, or have it in the line below.
Fails (exit 1) if the best law is not stable over the fitted range.
"""

from __future__ import annotations

import argparse
import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from viscera.cli.options import metres, square_metres
from viscera.cli.output import DONE, FAILED, Outcome, Output
from viscera.curves import MODES
from viscera.errors import VisceraError
from viscera.files.mesh import METRES
from viscera.fitting import Fit, MaterialTest, SpecimenTest, fit
from viscera.fitting.columns import Columns, read_columns
from viscera.fitting.families import FAMILIES
from viscera.fitting.fit import Undetermined
from viscera.mesh import Floats
from viscera.output.kind import check_picture
from viscera.progress import Progress, bar
from viscera.quantity import Choice

RATIOS = {"-": 1.0, "mm/mm": 1.0}
FORCES = {"N": 1.0, "uN": 1e-6, "mN": 1e-3, "kN": 1e3}
PASCALS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9}
NEWTONS_PER_AREA = {"N/m2": 1.0, "kN/m2": 1e3, "MN/m2": 1e6, "N/cm2": 1e4, "N/mm2": 1e6, "mN/mm2": 1e3}
UNITS: dict[str, dict[str, float]] = {
    "stretch": RATIOS,
    "shear": RATIOS,
    "stress": PASCALS | NEWTONS_PER_AREA,
    "displacement": METRES,
    "compression": METRES,
    "force": FORCES,
    "load": FORCES,
}
"""Columns, and the units that their names may end in."""
AMBIGUOUS = ("mpa", "mn")
"""How units begin that are a thousandth or a million by the case of their first letter."""
SPELLINGS = str.maketrans({"²": "2", "^": None, "µ": "u", "μ": "u"})
"""`N/mm²`, `N/mm^2` and `µm` (with either of two letters) to the units above."""
NAMED = re.compile(r"\s*(?P<name>[a-z]+)\s*(_\s*(?P<unit>.*?)|[(\[]\s*(?P<bracketed>[^()\[\]]*?)\s*[)\]])?\s*", re.I)
"""The name of a column, and its unit."""
DOWNWARD = ("compression", "load")
"""Columns that count positive in compression."""
ROUNDING = 1e-9
"""Strain by which a point may be beyond --up-to: that of the stretch 1.1, 1.1 - 1, is 0.1 + 8e-17 in floating point."""
CANDIDATES = (
    ("NeoHookean", 1),
    ("MooneyRivlin", 1),
    ("Yeoh", 2),
    ("Yeoh", 3),
    ("Ogden", 1),
    ("Ogden", 2),
    ("Ogden", 3),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera fit`."""
    parser.add_argument("curves", metavar="TEST.csv", nargs="+")
    laws = ", ".join(FAMILIES)
    parser.add_argument("--law", default="all", help=f"{laws}; or all of them, the best by AIC first (default)")
    parser.add_argument("--terms", type=int, help="number of terms in Yeoh's or Ogden's sum, 1 to 3")
    parser.add_argument("--mode", default="uniaxial", help=f"deformation: {', '.join(MODES)} (default uniaxial)")
    parser.add_argument(
        "--length", type=metres, metavar="LENGTH", help="length of the specimen between the grips, such as '30 mm'"
    )
    parser.add_argument(
        "--area", type=square_metres, metavar="AREA", help="rest cross-section of the specimen, such as '78.5 mm2'"
    )
    parser.add_argument(
        "--diameter", type=metres, metavar="LENGTH", help="diameter of a cylindrical specimen, in place of --area"
    )
    parser.add_argument(
        "--stuck", action="store_true",
        help="the specimen is a cylinder that sticks to its plates: fit through its finite-element model",
    )  # fmt: skip
    parser.add_argument(
        "--up-to", type=float, metavar="STRAIN", help="use the points up to this nominal strain or shear, such as 0.35"
    )
    parser.add_argument("--compression", action="store_true", help="displacement and force are positive in compression")
    parser.add_argument("--poisson", type=float, default=0.499, help="Poisson's ratio of the law (default 0.499)")
    parser.add_argument(
        "--compressible", action="store_true",
        help="compute the curves with the bulk modulus that --poisson gives, in place of det F = 1; for one law of one "
        "modulus, as SaintVenantKirchhoff needs it",
    )  # fmt: skip
    parser.add_argument("--plot", metavar="FILE.png", help="draw the points and the best law")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Read the curves, fit, rank, print."""
    output.spare(args.curves, ("--plot", args.plot))
    check_picture(args.plot)
    Choice(MODES)(args.mode, "--mode")
    named = zip(args.curves, _names(args.curves), strict=True)
    tables = [(Path(path), read_columns(path), name) for path, name in named]
    tests = [_test(*table, args) for table in tables]
    if all(_is_of_parameter(columns, args.mode) for _, columns, _ in tables):
        _refuse_of_specimen(args)
    with bar(output.is_quiet) as progress:
        fits, left_out = _ranked(tests, args, progress)
    best = fits[0]
    if args.plot is not None:
        best.plot(args.plot)
    output.say("\n".join(map(repr, tests)))
    output.say(_table(fits))
    output.say_all(f"left out: {reason}" for reason in left_out)
    output.say(f"{'best by AIC' if best.is_ranked else 'not ranked'}: {best.law!r}")
    output.say("\n".join(_intervals(best)))
    for test, error in best.errors().items():
        output.say(f"root-mean-square error of {test}: {error:.4g} Pa")
    if not best.is_followed_by_law:
        output.say(
            f"with a Poisson's ratio of {args.poisson:g} the law is compressible, and up to "
            f"{best.compressibility_error:.1%} of the largest stress off the fit, which is incompressible: intervals "
            "and errors are not the law's; take a --poisson nearer to 0.5, or --compressible with a law of one modulus"
        )
    if args.plot is not None:
        output.say(f"picture: {args.plot}")
    if not best.is_stable:
        output.say(f"{best.name} is not stable over the range fitted; take another law, or fewer terms")
    return Outcome(
        "fitted" if best.is_stable else "not stable",
        DONE if best.is_stable else FAILED,
        {"fits": [_json(f) for f in fits], "left_out": left_out},
    )


def _ranked(tests: list[MaterialTest], args: argparse.Namespace, progress: Progress) -> tuple[list[Fit], list[str]]:
    """The fit of the law asked for; or those of all laws, the best first, and why some of them are left out."""
    if args.law != "all":
        progress(0, 1, f"fitting {args.law}")
        is_incompressible = not args.compressible
        return [fit(args.law, tests, terms=args.terms, poisson=args.poisson, incompressible=is_incompressible)], []
    for option, is_given in (("terms", args.terms is not None), ("compressible", args.compressible)):
        if is_given:
            raise VisceraError(f"--{option} belongs to one law; name it with --law")
    fits, left_out = list[Fit](), list[str]()
    for done, (law, terms) in enumerate(CANDIDATES):
        progress(done, len(CANDIDATES), "fitting laws")
        try:
            found = fit(law, tests, terms=terms, poisson=args.poisson)
        except Undetermined as error:
            left_out.append(str(error))
            continue
        if found.is_ranked:
            fits.append(found)
        else:
            left_out.append(f"{law} has as many parameters as there are points off rest, {len(found.parameters)}")
    progress(len(CANDIDATES), len(CANDIDATES), "fitting laws")
    if not fits:
        raise VisceraError(f"these tests determine none of the laws: {'; '.join(dict.fromkeys(left_out))}")
    return sorted(fits, key=lambda found: found.aic), left_out


def _names(curves: list[str]) -> list[str]:
    """The names of the files; those of one name have their folders in front."""
    stems = [Path(path).stem for path in curves]
    return [stem if stems.count(stem) == 1 else path for stem, path in zip(stems, curves, strict=True)]


def _refuse_of_specimen(args: argparse.Namespace) -> None:
    """Raises `VisceraError` for an option of displacement and force, where all curves are of stretch and stress."""
    for name in ("length", "area", "diameter", "compression"):
        if getattr(args, name) not in (None, False):
            raise VisceraError(
                f"--{name} is for curves of displacement and force; those of stretch and stress need no specimen, so "
                "leave it out"
            )


def _test(path: Path, columns: Columns, name: str, args: argparse.Namespace) -> MaterialTest:
    kind, driven = MODES[args.mode], _is_of_parameter(columns, args.mode)
    if args.stuck and (args.mode != "uniaxial" or driven):
        raise VisceraError("--stuck takes uniaxial curves of displacement and force, with --length and --diameter")
    if driven:
        stretch, stress = (_column(path, columns, column, kind.parameter) for column in (kind.parameter, "stress"))
        return MaterialTest(args.mode, *_up_to(args.up_to, stretch, stress, kind.at_rest, 1.0), name)
    displacement, force = _first(columns, "displacement", "compression"), _first(columns, "force", "load")
    moved, pulled = (_column(path, columns, column, kind.parameter) for column in (displacement, force))
    area = math.pi * args.diameter**2 / 4.0 if args.diameter is not None else args.area
    if args.length is None or area is None or (args.diameter is not None and args.area is not None):
        raise VisceraError(
            f"{path}: force and displacement need the specimen's --length and one of --area and --diameter"
        )
    moved, pulled = _up_to(args.up_to, moved, pulled, 0.0, args.length)
    moved, pulled = (
        -values if args.compression or column in DOWNWARD else values
        for values, column in ((moved, displacement), (pulled, force))
    )
    if np.sum(np.sign(moved) * np.sign(pulled)) < 0.0:
        raise VisceraError(
            f"{path}: {displacement} and {force} mostly point in opposite directions; columns `compression` and `load` "
            "count positive in compression, `displacement` and `force` in tension, and --compression turns both"
        )
    if args.stuck:
        if args.diameter is None:
            raise VisceraError("--stuck is for cylinders; give --diameter in place of --area")
        return SpecimenTest.cylinder(args.diameter / 2.0, args.length, moved, pulled, name=name)
    return MaterialTest.from_force(args.mode, moved, pulled, length=args.length, area=area, name=name)


def _up_to(
    largest: float | None, parameter: Floats, measured: Floats, at_rest: float, length: float
) -> tuple[Floats, Floats]:
    """The points whose nominal strain is at most `largest`."""
    if largest is None:
        return parameter, measured
    if not largest > 0.0:
        raise VisceraError(f"--up-to is {largest:g}; it must be a positive strain, such as 0.35")
    near = np.abs(parameter - at_rest) <= (largest + ROUNDING) * length
    return parameter[near], measured[near]


def _is_of_parameter(columns: Columns, mode: str) -> bool:
    """Whether a curve is of the parameter of its deformation and stress: it has the one, or needs it for the other.

    A stretch is no amount of shear: 1 is rest for the one, and 45 degrees for the other.
    """
    if _find(columns, MODES[mode].parameter):
        return True
    return bool(_find(columns, "stress")) and not any(_find(columns, name) for name in ("displacement", "compression"))


def _find(columns: Columns, name: str) -> list[str]:
    return [column for column in columns if _named(column)[0] == name]


def _named(column: str) -> tuple[str, str]:
    """What a column holds, and in which unit: of `Stress_kPa`, `stress (kPa)` and `stress [kPa]` the same."""
    match = NAMED.fullmatch(column)
    if not match:
        return column.lower(), ""
    return match["name"].lower(), match["unit"] or match["bracketed"] or ""


def _factor(unit: str, units: dict[str, float]) -> float | None:
    """The size of a unit in any case of its letters, unless that would leave open which it is."""
    unit = unit.translate(SPELLINGS)
    whole = unit.lower()
    known = [u for u in units if u.lower() == whole and (not whole.startswith(AMBIGUOUS) or u[0] == unit[0])]
    return units[known[0]] if known else None


def _first(columns: Columns, *names: str) -> str:
    """The first of the names that a column has; if none has one, the first, which is then missed in words."""
    return next((name for name in names if _find(columns, name)), names[0])


def _column(path: Path, columns: Columns, name: str, parameter: str) -> Floats:
    """The numbers of a column in SI units. parameter: what drives the deformation, for the error."""
    found = _find(columns, name)
    if not found:
        raise VisceraError(
            f"{path}: no column {name!r}; it has {', '.join(columns)}. "
            f"Give {parameter} and stress, or displacement and force, with a unit as in stress_kPa"
        )
    if len(found) > 1:
        raise VisceraError(f"{path}: the columns {' and '.join(found)} both are {name}; leave one")
    unit = _named(found[0])[1]
    factor = _factor(unit, {"": 1.0, **UNITS[name]})
    if factor is None:
        known = "it takes none" if UNITS[name] is RATIOS else f"known: {', '.join(UNITS[name])}"
        raise VisceraError(f"{path}: column {found[0]!r} has a unit that is not known of {name}, {unit!r}; {known}")
    return columns[found[0]] * factor


def _table(fits: list[Fit]) -> str:
    lines = ["law              parameters  standard error         AIC  stable"]
    for found in fits:
        stable = "yes" if found.is_stable else "no"
        name = f"{found.name} {_terms(found)}".rstrip()
        errors = f"{found.standard_error:12.4g} Pa {found.aic:11.1f}" if found.is_ranked else f"{'-':>15s} {'-':>11s}"
        lines.append(f"{name:16s} {len(found.parameters):10d} {errors}  {stable}")
    return "\n".join(lines)


def _terms(found: Fit) -> str:
    sums = {"Yeoh": "c", "Ogden": "mu"}
    return f"({sum(name.startswith(sums[found.name]) for name in found.parameters)})" if found.name in sums else ""


def _intervals(found: Fit) -> list[str]:
    lines = []
    for name, value in found.parameters.items():
        interval = found.intervals[name]
        if interval is not None:
            band = f"95 %: {interval[0]:.6g} to {interval[1]:.6g}"
        elif name in found.vanishing:
            exponent = found.vanishing[name]
            product = f"{name} {exponent} = {value * found.parameters[exponent]:.6g} Pa"
            band = f"{exponent} may be 0, the logarithmic strain: the curves determine {product}"
        elif name in found.at_bound:
            band = "no interval: at its bound"
        elif found.is_ranked:
            band = "no interval: undetermined"
        else:
            band = "no interval: as many parameters as points"
        lines.append(f"  {name} = {value:.6g}   ({band})")
    return lines


def _json(found: Fit) -> dict[str, Any]:
    return {
        "law": found.name,
        "parameters": found.parameters,
        "intervals": found.intervals,
        "at_bound": found.at_bound,
        "standard_error": found.standard_error,
        "aic": found.aic,
        "stable": found.is_stable,
        "stable_range": found.stable,
        "errors": found.errors(),
        "compressibility_error": found.compressibility_error,
        "followed_by_law": found.is_followed_by_law,
    }
