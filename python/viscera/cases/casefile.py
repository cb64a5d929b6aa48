"""An organ written as a case: CASE.toml, with its mesh in a file beside it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from viscera import _core, law
from viscera.boundary.elastic_support import ElasticSupport
from viscera.boundary.loads import by_place
from viscera.cases import material_schema
from viscera.cases.case import NAMES, PLACED, Case, read_case
from viscera.errors import VisceraError
from viscera.files.atomic import followed, replacing
from viscera.mesh import Floats, Indices, Mesh, Where
from viscera.quantity import brief, path_of, refused
from viscera.reduced.vary import Vary
from viscera.select import FREE

if TYPE_CHECKING:
    from viscera.organ import Organ

IN_SOLVE = {"steps": "steps", "settings": "newton", "solver": "solver"}
"""What `solve` calls the settings of a case."""
MOST_PARTS = 64
"""Largest number of parts of a material in a case file. With more, its parameters count as a field over the cells."""


def write(
    organ: Organ,
    path: str | os.PathLike[str],
    *,
    loads: Mapping[str, Any] | None = None,
    scan: Mapping[str, Any] | None = None,
    settings: Mapping[str, Any] | None = None,
    reduction: Mapping[str, Any] | None = None,
) -> Case:
    """The case of `Organ.to_case`, written and read back."""
    import tomli_w

    target = target_of(path)
    real = followed(target)
    mesh_file = real.with_name(f"{real.stem}_mesh.vtu")
    places = Places(organ.mesh)
    words: dict[str, Any] = {
        **organ_words(organ, places, mesh_file.name),
        **solve_words(loads, settings, places),
        "scan": load_words(_table(scan, "scan"), places),
        "reduce": _reduction(_table(reduction, "reduction"), places),
    }
    words = {name: plain(word) for name, word in words.items() if word != {}}
    Case(**{NAMES.get(name, name): word for name, word in words.items()})  # refused before anything is written
    places.mesh.write(mesh_file)
    with replacing(target) as scratch:
        scratch.write_text(tomli_w.dumps(words), encoding="utf-8")
    return read_case(target)


def target_of(path: str | os.PathLike[str]) -> Path:
    """The path of a case to be written, which must end as one."""
    target = path_of(path, "the case file")
    if target.suffix != ".toml":
        raise VisceraError(f"{target}: a case file ends in .toml")
    return target


def organ_words(organ: Organ, places: Places, mesh_file: str) -> dict[str, Any]:
    """What a case says of the organ itself; a table that would be empty is left out."""
    words = {
        "mesh": mesh_file,
        "units": "m",
        "fixed": places.word(organ.fixed, "fixed") if len(organ.fixed) else {},
        "supports": _supports(organ, places),
        "element": organ.element,
        "material": _material(organ.law, places),
    }
    return {name: word for name, word in words.items() if word != {}}


class Places:
    """The names of places in a case, and the linear mesh with the sets that they name."""

    def __init__(self, mesh: Mesh) -> None:
        self._own = mesh
        self.mesh = mesh.linear()

    def of(self, where: Where, name: str) -> str:
        """Words are kept; other nodes get the name of a set."""
        if isinstance(where, _core.Patch):
            raise VisceraError("a case file has no word for a contact patch; load a set, or give its nodes")
        nodes = self._own.nodes(where)
        return where if isinstance(where, str) else self.word(nodes, name)

    def word(self, nodes: Indices, name: str) -> str:
        """The name of a set with these nodes, which may be a new one; indices if no set of corners gives them."""
        for known, members in self._own.sets.items():
            if np.array_equal(members, nodes):
                return known
        corners = nodes[nodes < self.mesh.n_corners]
        if len(corners):
            name = _unused(name, self.mesh.sets)
            wider = self.mesh.with_sets(**{name: corners})
            resolved = wider.quadratic() if len(self._own.edges) else wider
            if np.array_equal(resolved.sets[name], nodes):
                self.mesh = wider
                return name
        return ", ".join(map(str, nodes.tolist()))

    def part(self, cells: Indices) -> str:
        """The name of a cell set, which may be a new one."""
        for known, members in self.mesh.cell_sets.items():
            if np.array_equal(members, cells) and known not in material_schema.PARAMETERS:
                return known
        name = _unused("part", self.mesh.cell_sets)
        self.mesh = self.mesh.with_cell_sets(**{name: cells})
        return name


def _material(material: law.Law, places: Places) -> dict[str, Any]:
    """The law: the parameters of most cells, and a table for each part with those that differ."""
    rows, owner, counts = np.unique(material.parameters, axis=0, return_inverse=True, return_counts=True)
    if len(rows) > MOST_PARTS:
        raise VisceraError(
            f"the law has {len(rows)} sets of parameters among its cells; a case file names at most {MOST_PARTS} parts"
        )
    owner = owner.ravel()
    own = int(np.argmax(counts))
    one = _one_law(material, rows[own])
    whole = _parameters(one)
    partial = one.names if isinstance(one, law.StrainEnergy) else material_schema.PARTIAL
    words = {"law": _class_of(one), **whole}
    for k in range(len(rows)):
        if k == own:
            continue
        other = _one_law(material, rows[k])
        part = _parameters(other)
        changed = {name: value for name, value in part.items() if value != whole.get(name)}
        if other.name != one.name:
            changed = {"law": _class_of(other), **part}
        elif not set(changed) <= set(partial):
            raise VisceraError(f"a case file cannot say that {', '.join(sorted(changed))} differ from cell to cell")
        words[places.part(np.flatnonzero(owner == k).astype(np.uint32))] = changed
    return words


def _one_law(material: law.Law, row: Floats) -> law.Law:
    """The law with one row of parameters; of several laws, the one that the row belongs to."""
    one = law.from_core(material.name, row)
    return one.laws[0] if isinstance(one, law.Several) else one


def _class_of(material: law.Law) -> str:
    """The name of a law; for a class of the user's, that of the law it derives from."""
    return next(each.__name__ for each in type(material).__mro__ if each.__name__ in law.LAWS)


def _parameters(material: law.Law) -> dict[str, Any]:
    """The parameters of one cell, in the form of a case."""
    (row,) = material.parameters.tolist()
    if isinstance(material, law.TwoModuli):
        return dict(zip(("mu", "lam"), row, strict=True))
    if isinstance(material, law.MooneyRivlin):
        return {**dict(zip(("c1", "c2", "kappa"), row, strict=True)), "volumetric": material.volumetric}
    if isinstance(material, law.OfRow):
        return dict(zip(_core.law_parameters(material.name), row, strict=True))
    if isinstance(material, law.StrainEnergy):
        return material.words
    if isinstance(material, law.Ogden):
        used = [p for p in range(law.Ogden.terms) if row[p] != 0.0]
        return {"mu": [row[p] for p in used], "alpha": [row[law.Ogden.terms + p] for p in used], "kappa": row[-1]}
    assert isinstance(material, law.HolzapfelGasserOgden)
    names = dict(zip(("c", "k1", "k2", "dispersion", "kappa"), row, strict=False))
    return {**names, "fibres": material.fibres[:, 0].tolist(), "bear_compression": material.bear_compression}


def _supports(organ: Organ, places: Places) -> dict[str, Any]:
    """The elastic supports, each by its place."""
    words: dict[str, Any] = {}
    for k, support in enumerate(organ.supports):
        if not isinstance(support, ElasticSupport):
            raise VisceraError("a case file has no word for springs, or for the ties that a model file keeps")
        place = places.of(support.where, f"support {k + 1}")
        if place in words:
            raise VisceraError(f"a case file gives one elastic support for each place; {place!r} has two")
        words[place] = {"stiffness": support.stiffness, "tangential": support.tangential}
    return words


class Named(Protocol):
    """What finds words for the places of loads."""

    def of(self, where: Where, name: str) -> str:
        """The words for a place; a set that they need may be called `name`."""


def solve_words(
    loads: Mapping[str, Any] | None, settings: Mapping[str, Any] | None, places: Named
) -> dict[str, dict[str, Any]]:
    """The tables [loads] and [settings], from loads that may bring settings along, as `Case.loading` gives them.

    Raises `VisceraError` for a setting that both give, with different values.
    """
    given, table = _table(loads, "loads"), _table(settings, "settings")
    for word, key in IN_SOLVE.items():
        value = given.pop(word, None)
        if value is None:
            continue
        if key in table and table[key] != value:
            raise VisceraError(
                f"{word!r} is {brief(value)} in loads=, and {key!r} is {brief(table[key])} in settings=; give it once"
            )
        table[key] = dict(value) if isinstance(value, Mapping) else value
    return {"loads": load_words(given, places), "settings": table}


def load_words(loads: Mapping[str, Any], places: Named) -> dict[str, Any]:
    """Loads in the words of a case."""
    words = {name: value for name, value in loads.items() if value is not None}
    for kind in PLACED:
        if kind not in words:
            continue
        if isinstance(words[kind], np.ndarray):
            raise VisceraError(f"a case file gives a {kind} by place, not node by node")
        placed = by_place(words[kind], kind).items()
        words[kind] = {places.of(where, f"{kind} {k + 1}"): value for k, (where, value) in enumerate(placed)}
        if not words[kind]:
            del words[kind]
    if "displacement" in words:
        moved = words["displacement"].items()
        words["displacement"] = {place: [FREE if c is None else c for c in target] for place, target in moved}
    return words


def _table(given: Mapping[str, Any] | None, name: str) -> dict[str, Any]:
    """An argument of `to_case` that becomes a table of the case; raises `VisceraError` if it is none."""
    if not isinstance(given, Mapping | None) or not all(isinstance(key, str) for key in given or {}):
        raise refused(name, 'a mapping by name, such as {"density": 1060}', given)
    return dict(given or {})


def _reduction(reduction: Mapping[str, Any], places: Places) -> dict[str, Any]:
    words = {name: value for name, value in reduction.items() if value is not None}
    if "touchable" in words:
        words["touchable"] = places.of(words["touchable"], "touchable")
    if isinstance(vary := words.get("vary"), Vary):
        words["vary"] = {"parameter": vary.name, "low": vary.low, "high": vary.high, "nodes": vary.nodes}
        if vary.part is not None:
            is_named = isinstance(vary.part, str)
            words["vary"]["part"] = vary.part if is_named else places.part(places.mesh.cells_in(vary.part))
    return words


def _unused(name: str, sets: Mapping[str, Any]) -> str:
    """The name, with a number if it is taken."""
    candidates = (name, *(f"{name} {k}" for k in range(2, len(sets) + 3)))
    return next(each for each in candidates if each not in sets)


def plain(value: Any) -> Any:
    """NumPy values as TOML values."""
    if isinstance(value, Mapping):
        return {name: plain(each) for name, each in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [plain(each) for each in value]
    return value.item() if isinstance(value, np.generic) else value
