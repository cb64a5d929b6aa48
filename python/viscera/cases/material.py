"""The law that the table [material] of a case file describes, on the cells of a mesh."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from viscera import law
from viscera.cases import material_schema
from viscera.errors import VisceraError, naming
from viscera.fibres import helical_fibres
from viscera.mesh import Indices, Mesh


def material(words: Mapping[str, Any], mesh: Mesh) -> law.Law:
    """The law that a [material] table describes; its inner tables hold what differs in a part of the mesh."""
    others = {place: part for place, part in words.items() if material_schema.is_part(place, part) and "law" in part}
    whole = _one_law({name: value for name, value in words.items() if name not in others}, mesh, "material")
    if not others:
        return whole
    of_cell, laws = np.zeros(len(mesh.cells), dtype=int), [whole]
    for place, part in others.items():
        table = f"material.{place}"
        with naming(f"[{table}]"):
            of_cell[mesh.cells_in(place)] = len(laws)
        laws.append(_one_law(part, mesh, table))
    return law.Several.of_cells(tuple(laws), of_cell)


def _one_law(words: Mapping[str, Any], mesh: Mesh, table: str) -> law.Law:
    """A law whose parameters may differ from part to part."""
    with naming(f"[{table}]"):
        kind, given = _parameters(words, mesh)
    try:
        return kind(**list(given.values())[-1])
    except VisceraError:
        for place, parameters in given.items():  # which of the tables it is that the law cannot take
            with naming(f"[{table}.{place}]" if place else f"[{table}]"):
                kind(**parameters)
        raise


def _parameters(words: Mapping[str, Any], mesh: Mesh) -> tuple[type[law.Law], dict[str, dict[str, Any]]]:
    """The class of a law, and its parameters: without the parts, by the name "", and with each part and those before
    it, by the part's place."""
    parameters = {name: value for name, value in words.items() if not material_schema.is_part(name, value)}
    kind = law.named(parameters.pop("law"))
    if isinstance(parameters.get("fibres"), Mapping):
        parameters["fibres"] = helical_fibres(mesh, **parameters["fibres"])
    given = {"": parameters}
    for place, part in words.items():
        if not material_schema.is_part(place, part):
            continue
        with naming(f"the part {place!r}"):
            cells = mesh.cells_in(place)
        parameters = dict(parameters)
        for name, value in part.items():
            if name not in parameters:
                raise VisceraError(f"{place!r} gives {name!r}, which the rest of the organ has no value for")
            parameters[name] = _in_part(parameters[name], cells, value, mesh, f"{name!r} of {place!r}")
        given[place] = parameters
    return kind, given


def _in_part(whole: Any, cells: Indices, value: Any, mesh: Mesh, name: str) -> Any:
    """A parameter per cell: `value` in the given cells, unchanged in the others; lists (of terms) entry by entry."""
    if isinstance(whole, list):
        if not isinstance(value, list) or len(value) != len(whole):
            raise VisceraError(f"{name} must be a list of {len(whole)} numbers, as elsewhere, got {value!r}")
        return [_in_part(*pair, mesh=mesh, name=name) for pair in zip(whole, [cells] * len(whole), value, strict=True)]
    if isinstance(value, list):
        raise VisceraError(f"{name} must be one number, as elsewhere, got {value!r}")
    values = np.array(np.broadcast_to(np.asarray(whole, dtype=float), len(mesh.cells)))
    values[cells] = value
    return values
