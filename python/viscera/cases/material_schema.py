"""What the table [material] of a case file may hold: the laws, their parameters, and parts that differ."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from inspect import Parameter, signature
from typing import Any

from viscera import _core, law
from viscera.cases.entries import Key, PerCell, Point, Table, known, of_table
from viscera.errors import VisceraError, did_you_mean
from viscera.quantity import Check, Choice, Flag, Number, Vector, brief, numbers_of, refused


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
class Fibres:
    """Directions of fibres: given, or winding round an axis."""

    table: str = "material"
    """That of their law."""

    def __call__(self, value: Any, what: str) -> None:
        if isinstance(value, Mapping):
            replace(HELICAL, name=f"{self.table}.fibres")(value, what)
            return
        numbers = numbers_of(value)
        if numbers is None or numbers.shape != (2, 3):
            raise refused(what, self, value)

    def __str__(self) -> str:
        return f"two directions of three numbers each; or {HELICAL}"


class Formula:
    """The text of a strain energy, which the law reads."""

    def __call__(self, value: Any, what: str) -> None:
        if not isinstance(value, str):
            raise refused(what, self, value)

    def __str__(self) -> str:
        return "a formula in quotes"


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
            return self._formula(table, own, {name: part for name, part in words.items() if is_part(name, part)})
        for _ in known(own, ("law", *PARAMETERS), table):
            pass
        if "law" not in own:
            raise VisceraError(f"the material names no law; {did_you_mean('', law.LAWS)}")
        kind = own.pop("law")
        Choice(law.LAWS)(kind, f"law{of_table(table)}" if table != "material" else "law")
        _refuse_places(own, taken_by(kind), table)
        for name, value in own.items():
            _parameter(kind, name, table)(value, f"{name} in [{table}]")
        _require_all(kind, own, table)
        for part_table, part in parts.items():
            _refuse_of_whole(part, [name for name in taken_by(kind) if name not in PARTIAL], part_table)
            for name, value in known(part, PARTIAL, part_table):
                _parameter(kind, name, part_table)(value, f"{name} in [{part_table}]")

    def _formula(self, whole: str, own: Mapping[str, Any], parts: Mapping[str, Any]) -> None:
        """Checks a law given as a formula, whose parameters are the names in it."""
        if "energy" not in own:
            raise VisceraError(f'[{whole}] StrainEnergy: it needs a formula, as in energy = "mu/2*(I1bar - 3) + ..."')
        Formula()(own["energy"], f"energy in [{whole}]")
        names = _names_in(own["energy"])
        _refuse_places(own, ("energy", "fibres", *names), whole)
        for place, part in parts.items():
            if place in names:
                PerCell(Number())(part, f"{place} in [{whole}]")
            _refuse_of_whole(part, ("energy", "fibres"), f"{whole}.{place}")
        for table, entries in ((whole, own), *((f"{whole}.{place}", part) for place, part in parts.items())):
            for name, value in known(entries, entries, table):
                if name == "fibres":
                    Fibres(table)(value, f"fibres in [{table}]")
                elif name not in {"law", "energy"}:
                    PerCell(Number())(value, f"{name} in [{table}]")

    def __str__(self) -> str:
        return "a table, `[material]`"


def is_part(name: str, value: Any) -> bool:
    """Whether an entry of [material] is a table for a part of the mesh: no parameter has a table, but `fibres`."""
    return isinstance(value, Mapping) and name != "law" and name not in PARAMETERS


def _refuse_places(own: Mapping[str, Any], taken: Collection[str], table: str) -> None:
    """Raise `VisceraError` if a table is that of a place which is called as a parameter of some other law is."""
    for name, value in own.items():
        if isinstance(value, Mapping) and name not in taken:
            raise VisceraError(
                f"[{table}.{name}] is no table of a part, for {name!r} is the name of a parameter; call the set of "
                "cells otherwise, or give a condition"
            )


def _refuse_of_whole(part: Mapping[str, Any], names: Collection[str], table: str) -> None:
    """Raise `VisceraError` for what the parts of a law share."""
    name = next((name for name in names if name in part), None)
    if name is not None:
        raise VisceraError(
            f"unknown key {name!r} in [{table}]: the parts of a law share it; for another, give this part its own `law`"
        )


def _names_in(formula: str) -> list[str]:
    """The parameters of a formula; none if it is wrong, which the law says."""
    try:
        return _core.law_parameters(law.StrainEnergy.prefix + " ".join(formula.split()))
    except ValueError:
        return []


def taken_by(kind: str) -> tuple[str, ...]:
    """The parameters that a law takes."""
    return tuple(name for name in signature(law.LAWS[kind]).parameters if name in PARAMETERS)


def _require_all(kind: str, own: Mapping[str, Any], table: str) -> None:
    """Raise `VisceraError` if a parameter lacks for which a law has no default."""
    taken, known_to_law = taken_by(kind), signature(law.LAWS[kind]).parameters
    lacking = [name for name in taken if known_to_law[name].default is Parameter.empty and name not in own]
    if lacking:
        lines = ", ".join(f"{name} = ..." for name in lacking)
        raise VisceraError(f"[{table}] {kind}: write {lines} there; it takes {', '.join(taken)}")


def _parameter(kind: str, name: str, table: str) -> Check:
    """What a parameter of a law must be."""
    if name not in taken_by(kind):
        raise VisceraError(f"[{table}] {kind}: it has no parameter {brief(name)}; {did_you_mean(name, taken_by(kind))}")
    if name == "fibres":
        return Fibres(table)
    return (OTHERS[kind] if name in OTHERS.get(kind, {}) else PARAMETERS)[name].value


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
