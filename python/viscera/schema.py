"""What a case file may hold: its tables, their keys, and what each value must be.

Cases are checked against it before anything else is done, and docs/case-file.md is written from it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from inspect import signature
from types import SimpleNamespace
from typing import Any

import numpy as np

from viscera import defaults, elastic_support, held, law, reducible, statics, vary
from viscera.errors import VisceraError, did_you_mean
from viscera.meshfile import METRES
from viscera.quantity import Check, Choice, Flag, Number, Vector, Whole, brief, numbers_of, refused
from viscera.select import FREE, METRIC, length, point
from viscera.solver import NAMES as SOLVERS
from viscera.solver import NEWTON

STARTS = ("rest", "loads", "scan")
"""States that the touches of a reduced model may start from."""


class Text:
    """A text that is not empty."""

    def __call__(self, value: Any, what: str) -> None:
        if not isinstance(value, str) or not value:
            raise refused(what, self, value)

    def __str__(self) -> str:
        return "words in quotes"


class Units:
    """The unit of a mesh file."""

    def __call__(self, value: Any, what: str) -> None:
        if isinstance(value, str):
            Choice(METRES)(value, what)
        else:
            self.factor(value, f'{what}, a word such as "mm" or metres per unit,')

    factor = Number("m", above=0)

    def __str__(self) -> str:
        return f"{Choice(METRES)}; or metres per unit, {self.factor}"


@dataclass(frozen=True)
class Place:
    """Nodes or cells."""

    noun: str

    def __call__(self, value: Any, what: str) -> None:
        is_list = isinstance(value, list) and value != []
        if not (is_list or (isinstance(value, str) and value)):
            raise refused(what, self, value)
        for index in value if is_list else []:
            Whole(0, 2**32 - 1)(index, f"a {self.noun} of {what}")

    def __str__(self) -> str:
        return f'a {self.noun} set\'s name, conditions such as "x < 10%", or a list of {self.noun} indices'


class Length:
    """A length of a contact."""

    def __call__(self, value: Any, what: str) -> None:
        self.metres(length(value, 1.0, what), what)

    metres = Number("m", above=0)

    def __str__(self) -> str:
        return f'{self.metres}; or words such as "12 mm", or "10%" of the diagonal of the bounding box'


UNIT = SimpleNamespace(bounding_box=np.array([[0.0] * 3, [1.0] * 3]), diagonal=1.0)
"""Stands in for the mesh, which has not been read yet."""


class Point:
    """A point of the mesh."""

    def __call__(self, value: Any, what: str) -> None:
        point(value, UNIT, what)

    def __str__(self) -> str:
        return f'three lengths, each {METRIC} or words such as "12 mm" and "10%"; or "(100, 50, 80) mm"'


class Components:
    """A displacement, some of whose components may be free."""

    def __call__(self, value: Any, what: str) -> None:
        parts = [part for part in value if part != FREE] if isinstance(value, list) and len(value) == 3 else []
        if not parts or any(isinstance(part, bool | list | dict) for part in parts):
            raise refused(what, self, value)
        for part in parts:
            if isinstance(part, str) and not any(letter.isdigit() for letter in part):
                raise refused(what, self, value)
            length(part, 1.0, what)

    def __str__(self) -> str:
        return f'three lengths, each {METRIC} or words such as "-12 mm", or "{FREE}" for one or two of them'


@dataclass(frozen=True)
class PerCell:
    """A number; in Python also one per cell as an array, which law and loads check against the mesh."""

    number: Number

    def __call__(self, value: Any, what: str) -> None:
        if not isinstance(value, np.ndarray):
            self.number(value, what)

    def __str__(self) -> str:
        return str(self.number)


@dataclass(frozen=True)
class Terms:
    """One number for each term of a sum."""

    term: Number

    def __call__(self, value: Any, what: str) -> None:
        if isinstance(value, list) and not 1 <= len(value) <= law.Ogden.terms:
            raise refused(what, self, value)
        for term in value if isinstance(value, list) else [value]:
            self.term(term, what)

    def __str__(self) -> str:
        return f"{self.term}, or a list of one to {law.Ogden.terms}"


@dataclass(frozen=True)
class Key:
    """One entry of a table."""

    value: Check
    means: str
    default: str = ""
    """What applies if the key is left out."""
    is_required: bool = False


@dataclass(frozen=True)
class Table:
    """A table with known keys."""

    name: str
    means: str
    keys: Mapping[str, Key]

    def __call__(self, words: Any, what: str) -> None:
        for name, value in known(words, self.keys, self.name):
            self.keys[name].value(value, f"{name}{_of(self.name)}")
        for name, key in self.keys.items():
            if key.is_required and name not in words:
                raise VisceraError(f"the key {name!r} is missing{_of(self.name)}")

    def __str__(self) -> str:
        return f"a table, `[{self.name}]`"


@dataclass(frozen=True)
class Places:
    """A table of places, each with its load."""

    name: str
    load: Check

    def __call__(self, words: Any, what: str) -> None:
        kind = self.name.rpartition(".")[2]
        for place, value in known(words, words, self.name):
            self.load(value, f"{kind} of {place!r}")

    def __str__(self) -> str:
        return f"for each place {self.load}"


class Fibres:
    """Directions of fibres: given, or winding round an axis."""

    def __call__(self, value: Any, what: str) -> None:
        if isinstance(value, Mapping):
            HELICAL(value, what)
            return
        numbers = numbers_of(value)
        if numbers is None or numbers.shape != (2, 3):
            raise refused(what, self, value)

    def __str__(self) -> str:
        return f"two directions of three numbers each; or {HELICAL}"


class End:
    """One end of a range: of a length, or of another parameter."""

    def __call__(self, value: Any, what: str) -> None:
        (Length() if isinstance(value, str) else Number())(value, what)

    def __str__(self) -> str:
        return f"a number in the unit of the parameter; for the radius {Length()}"


class Formula:
    """The text of a strain energy, which the law reads."""

    def __call__(self, value: Any, what: str) -> None:
        if not isinstance(value, str):
            raise refused(what, self, value)

    def __str__(self) -> str:
        return "a formula in quotes"


class Varied:
    """The table of a range."""

    def __call__(self, words: Any, what: str) -> None:
        VARY(words, what)
        for end in ("low", "high"):
            (Length() if words["parameter"] == "radius" else Number())(words[end], f"{end} in [{VARY.name}]")

    def __str__(self) -> str:
        return str(VARY)


class Material:
    """The table of a law's parameters, with a table inside for each part that differs."""

    def __call__(self, words: Any, what: str) -> None:
        parts = {place: part for place, part in known(words, words, "material") if is_part(place, part)}
        others = {place: part for place, part in parts.items() if "law" in part}
        self._one_law({name: value for name, value in words.items() if name not in others}, "material")
        for place, part in others.items():
            table = f"material.{place}"
            for name, value in part.items():
                if is_part(name, value):
                    raise VisceraError(
                        f"[{table}] has a law of its own, and no parts; give [material.{name}] a law too"
                    )
            self._one_law(part, table)

    def _one_law(self, words: Mapping[str, Any], table: str) -> None:
        """Checks one law, and the parts in which its parameters differ."""
        own = {name: value for name, value in words.items() if not is_part(name, value)}
        parts = {f"{table}.{place}": part for place, part in words.items() if is_part(place, part)}
        if own.get("law") == law.StrainEnergy.__name__:
            return self._formula({table: own, **parts})
        for _ in known(own, ("law", *PARAMETERS), table):
            pass
        if "law" not in own:
            raise VisceraError(f"the material names no law; {did_you_mean('', law.LAWS)}")
        kind = own.pop("law")
        Choice(law.LAWS)(kind, f"law{_of(table)}" if table != "material" else "law")
        for name, value in own.items():
            _parameter(kind, name)(value, f"{name} in [{table}]")
        for part_table, part in parts.items():
            for name, value in known(part, PARTIAL, part_table):
                _parameter(kind, name)(value, f"{name} in [{part_table}]")

    def _formula(self, tables: dict[str, Any]) -> None:
        """Checks a law given as a formula, whose parameters are the names in it."""
        whole, own = next(iter(tables.items()))
        if "energy" not in own:
            raise VisceraError('material StrainEnergy: it needs a formula, as in energy = "mu/2*(I1bar - 3) + ..."')
        Formula()(own["energy"], f"energy in [{whole}]")
        for table, entries in tables.items():
            for name, value in known(entries, entries, table):
                if name == "fibres":
                    Fibres()(value, f"fibres in [{table}]")
                elif name not in {"law", "energy"}:
                    PerCell(Number())(value, f"{name} in [{table}]")

    def __str__(self) -> str:
        return "a table, `[material]`"


def is_part(name: str, value: Any) -> bool:
    """Whether an entry of [material] is a table for a part of the mesh."""
    return isinstance(value, Mapping) and name != "fibres"


def known(words: Any, keys: Collection[str], table: str) -> Iterator[tuple[str, Any]]:
    """The entries of a table. A key that is not among `keys` is an error."""
    if not isinstance(words, Mapping):
        raise VisceraError(f"{table!r} is a table, written as [{table}], got {brief(words)}")
    for name, value in words.items():
        if name not in keys:
            raise VisceraError(f"unknown key {name!r}{_of(table)}; {did_you_mean(str(name), keys)}")
        yield name, value


def taken_by(kind: str) -> tuple[str, ...]:
    """The parameters that a law takes."""
    return tuple(name for name in signature(law.LAWS[kind]).parameters if name in PARAMETERS)


def _parameter(kind: str, name: str) -> Check:
    """What a parameter of a law must be."""
    if name not in taken_by(kind):
        raise VisceraError(f"material {kind}: it has no parameter {name!r}; {did_you_mean(name, taken_by(kind))}")
    return (OTHERS[kind] if name in OTHERS.get(kind, {}) else PARAMETERS)[name].value


def _of(table: str) -> str:
    return f" in [{table}]" if table else ""


def _percent(fraction: float) -> str:
    return f'"{100 * fraction:g}%"'


STRESS = PerCell(Number("Pa", above=0))


def _of_row(parameter: Mapping[str, Any]) -> Key:
    """A parameter as the core's row of its law describes it."""
    unit = "" if parameter["unit"] == "1" else parameter["unit"]
    number = Number(unit, above=parameter["above"], low=parameter["low"], high=parameter["high"])
    default = parameter["default"]
    return Key(PerCell(number), parameter["means"], "" if default is None else f"{default:g}")


PARAMETERS = {
    "young": Key(STRESS, "Young's modulus at small strain"),
    "poisson": Key(PerCell(Number(above=-1, below=0.5)), "Poisson's ratio at small strain"),
    **{
        parameter["name"]: _of_row(parameter)
        for row in reversed(law.ROWS.values())  # where two rows share a name, the first is meant
        if row["name"] not in law.Ogden.core_names
        for parameter in row["parameters"]
        if parameter["kind"] != "fibre"
    },
    "alpha": Key(STRESS, "penalty of a perturbed Lagrangian, in place of `kappa`"),
    "volumetric": Key(Choice(law.MooneyRivlin.bulk_moduli_per_alpha), "form of the volumetric energy", '"J^2-1"'),
    "bear_compression": Key(Flag(), "whether the fibres bear compression as well", "false"),
    "fibres": Key(Fibres(), "two families of fibres"),
    "energy": Key(
        Formula(), "strain energy of [a law of your own](laws.md#a-law-of-your-own); its parameters are further keys"
    ),
}
"""Parameters of all laws, from their rows in the core. `taken_by` says which of them a law takes."""
OTHERS = {
    "Ogden": {
        "mu": Key(Terms(Number("Pa")), "moduli of the terms"),
        "alpha": Key(Terms(Number()), "exponents of the terms"),
    },
    "VerondaWestmann": {p["name"]: _of_row(p) for p in law.ROWS["veronda_westmann"]["parameters"][:2]},
}
"""Parameters that mean something else in some laws."""
PARTIAL = tuple(name for name in PARAMETERS if name not in {"volumetric", "bear_compression", "fibres", "energy"})
"""Parameters that may differ in a part of the organ."""

HELICAL = Table(
    "material.fibres",
    "Two families of fibres that wind round an axis, one at plus and one at minus the angle.",
    {
        "angle": Key(Number(low=-360, high=360), "angle to the circumference, in degrees", is_required=True),
        "axis": Key(Vector(""), "axis of the vessel", "[0, 0, 1]"),
        "through": Key(Point(), "a point of the axis", "[0, 0, 0]"),
    },
)
DENSITY = Key(PerCell(Number("kg/m^3", above=0)), "density of the tissue")
GRAVITY = Key(Vector("m/s^2"), "acceleration; needs the density", "none")


def _loads(table: str) -> dict[str, Key]:
    return {
        "force": Key(Places(f"{table}.force", Vector("N")), "total force over the surface of the place", "none"),
        "traction": Key(Places(f"{table}.traction", Vector("Pa")), "dead load per area of the shape at rest", "none"),
        "pressure": Key(
            Places(f"{table}.pressure", Number("Pa")),
            "pressure on the deformed surface, against its outward normal",
            "none",
        ),
        "gravity": GRAVITY,
        "density": DENSITY,
    }


LOADS = Table(
    "loads",
    "Loads on the organ.",
    {
        "displacement": Key(Places("loads.displacement", Components()), "prescribed displacement", "none"),
        **_loads("loads"),
    },
)
SCAN = Table(
    "scan",
    "Loads under which the mesh was acquired. `viscera solve` removes them first, and counts displacements from the "
    "scan. If no density is given here, that of `[loads]` applies.",
    _loads("scan"),
)
SETTINGS = Table(
    "settings",
    "Settings of the solver; rarely needed.",
    {
        "steps": Key(statics.STEPS, "initial number of load steps; more are taken where needed", "1"),
        "solver": Key(Choice(SOLVERS), "solver of the linear systems", '"cholesky"'),
        "newton": Key(
            Table(
                "settings.newton",
                "Settings of Newton's method.",
                {name: Key(kind, means, default) for name, (kind, means, default) in NEWTON.items()},
            ),
            "settings of Newton's method",
        ),
    },
)
VARY = Table(
    "reduce.vary",
    "One model for a range of a parameter.",
    {
        "parameter": Key(Choice(vary.PARAMETERS), "parameter that varies", is_required=True),
        "part": Key(Place("cell"), "part in which it varies", "the whole organ"),
        "low": Key(End(), "lower end of the range", is_required=True),
        "high": Key(End(), "upper end of the range", is_required=True),
        "nodes": Key(vary.NODES, "number of values that are solved", str(vary.Vary.nodes)),
    },
)
REDUCE = Table(
    "reduce",
    "The reduced model that `viscera reduce` makes.",
    {
        "touchable": Key(
            Place("node"),
            "part of the surface that may be touched",
            "the surface farther than the radius from fixed nodes",
        ),
        "radius": Key(Length(), "radius of the contact patch", _percent(defaults.RADIUS_FRACTION)),
        "depth": Key(Length(), "largest contact displacement", _percent(defaults.DEPTH_FRACTION)),
        "order": Key(reducible.ORDER, "order of the series", str(defaults.ORDER)),
        "tolerance": Key(
            statics.TOLERANCE, "relative compression error of the stored field", f"{defaults.TOLERANCE:g}"
        ),
        "pade": Key(Flag(), "sum the series in its Padé form", "true"),
        "start": Key(Choice(STARTS), "state that touches start from", '"rest"; required if there is a `[scan]`'),
        "vary": Key(Varied(), "range of a parameter that the model covers", "none"),
    },
)
SUPPORT = Table(
    "supports.PLACE",
    "Springs spread over the surface of a place, where PLACE stands for its name or condition in quotes.",
    {
        "stiffness": Key(elastic_support.STIFFNESS, "force per area and displacement across it", is_required=True),
        "tangential": Key(elastic_support.TANGENTIAL, "the same along the surface", "the `stiffness`"),
    },
)
CASE = Table(
    "",
    "One organ, with its loads, settings and reduction.",
    {
        "mesh": Key(
            Text(), 'path of a mesh file, from the folder of the case; or an organ: "organ:liver"', is_required=True
        ),
        "units": Key(Units(), "unit of the mesh file", "required, except for a built-in organ"),
        "fixed": Key(Place("node"), "fixed nodes", "required, unless there are `supports`"),
        "supports": Key(Places("supports", SUPPORT), "elastic supports", "none"),
        "element": Key(Choice(held.ELEMENTS), "element of the mesh", "chosen for the material"),
        "material": Key(Material(), "law and parameters", is_required=True),
        "loads": Key(LOADS, "loads", "no load"),
        "scan": Key(SCAN, "loads under which the mesh was acquired", "the mesh is at rest"),
        "settings": Key(SETTINGS, "settings of the solver"),
        "reduce": Key(REDUCE, "reduced model"),
    },
)
