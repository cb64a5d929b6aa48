"""A parameter that one reduced model covers for a range of values: of the law, or the radius of the contact patch.

The model is solved at Chebyshev's nodes of the range, and its answers are interpolated to any value within.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera import defaults
from viscera.errors import VisceraError
from viscera.law import OF_TWO_MODULI, Law, Several, TwoModuli, from_core
from viscera.mesh import Floats, Indices, Mesh, Where
from viscera.quantity import Choice, Number, Whole, refused
from viscera.select import POSITIVE, length, size

if TYPE_CHECKING:
    from viscera.organ import Organ

log = logging.getLogger("viscera")

UNITS = {"young": "Pa", "poisson": "", "radius": "m"}
PARAMETERS = tuple(UNITS)
NODES = Whole(2, 12)
ENDS = {"young": Number("Pa", above=0), "poisson": Number(above=-1, below=0.5), "radius": POSITIVE}
"""What the ends of a range may be as numbers."""
EQUAL = 1e-12
"""Difference of parameters that is rounding, as a part of the largest of a cell, as in the core."""
WORDLESS = {"young": "a number in Pa, as every stiffness is, such as 1e3 for 1 kPa", "poisson": "a number without unit"}
"""What they are for parameters that have no words."""


def require_end(parameter: str, value: Any, what: str) -> None:
    """Raise `VisceraError` unless a value, which errors call `what`, may be an end of a range of the parameter.

    >>> require_end("radius", "5 mm", "low")
    >>> require_end("poisson", 0.6, "high in [reduce.vary]")
    Traceback (most recent call last):
    viscera.errors.VisceraError: high in [reduce.vary] must be a number above -1 and below 0.5, got 0.6
    """
    if parameter == "radius":
        length(value, 1.0, what, ENDS[parameter])
    elif isinstance(value, str):
        raise refused(what, WORDLESS[parameter], value)
    else:
        ENDS[parameter](value, what)


@dataclass(frozen=True)
class Vary:
    """A range of "young" [Pa], "poisson" or the contact "radius" [m], in the whole organ or in a part of it.

    Poisson's ratio varies in laws of two moduli, such as `NeoHookean`; others keep coefficients and a bulk modulus.

    >>> import viscera as vs
    >>> nodes = vs.Vary("young", 1e3, 1e5, nodes=3).values
    >>> [round(float(young)) for young in nodes]
    [1361, 10000, 73456]
    """

    name: str
    low: float | str
    """Lower end of the range; for the radius also in words such as "5 mm" or "2%"."""
    high: float | str
    """Upper end of the range."""
    part: Where | None = None
    """Cells whose law varies: a cell set's name, a condition, indices, or a predicate on centroids; by default all."""
    nodes: int = 5
    """Number of values that are solved. The error decreases geometrically with it."""

    def __post_init__(self) -> None:
        """Raise `VisceraError` for an unknown parameter, an end out of range, an empty range, too few or many nodes."""
        Choice(PARAMETERS)(self.name, "the varied parameter")
        NODES(self.nodes, f"the number of nodes of {self.name}")
        if self.name == "radius" and self.part is not None:
            raise VisceraError("the contact radius belongs to no part of the organ; leave `part` out")
        for end, value in (("lower", self.low), ("upper", self.high)):
            require_end(self.name, value, f"the {end} end of the range of {self.name}")
        self._require_ascent()

    def _require_ascent(self) -> None:
        """Raise `VisceraError` for an empty range; only an organ tells whether one from "5%" to 0.08 is."""
        ends = (self.low, self.high)
        if len({isinstance(end, str) and "%" in end for end in ends}) > 1:
            return
        low, high = (length(end, 1.0, self.name) if isinstance(end, str) else float(end) for end in ends)
        if not low < high:
            start, stop = (end if isinstance(end, str) else f"{end:g}" for end in ends)
            raise VisceraError(f"the range of {self.name} runs from {start} to {stop}; it must ascend")

    def on(self, mesh: Mesh) -> Vary:
        """The range in numbers, for an organ of this mesh.

        Raises `VisceraError` for a radius above the diagonal of its bounding box.

        >>> import viscera as vs
        >>> vs.Vary("radius", "5%", "8 cm", nodes=3).on(vs.organs.beam()).high
        0.08
        """
        if self.name != "radius":
            return self
        low = size(self.low, mesh.diagonal, "the lower end of the range of radius")
        return replace(self, low=low, high=size(self.high, mesh.diagonal, "the upper end of the range of radius"))

    @property
    def _ends(self) -> tuple[float, float]:
        if isinstance(self.low, str) or isinstance(self.high, str):
            raise VisceraError(f"the range of {self.name} is in words, which `on(mesh)` turns into numbers")
        return float(self.low), float(self.high)

    @property
    def is_logarithmic(self) -> bool:
        """Whether the parameter is interpolated on a logarithmic scale, as a stiffness or a length is."""
        return self.name != "poisson"

    @property
    def values(self) -> Floats:
        """Chebyshev's nodes of the range, ascending."""
        angles = np.pi * (np.arange(self.nodes)[::-1] + 0.5) / self.nodes
        return self._at(np.cos(angles))

    @property
    def unseen(self) -> Floats:
        """Values at which the model's error is measured: both ends of the range, and one between two middle nodes."""
        return self._at(np.array([-1.0, np.cos(np.pi * (self.nodes // 2) / self.nodes), 1.0]))

    def _at(self, x: Floats) -> Floats:
        """Values from places in [-1, 1]."""
        ends = self._ends
        low, high = np.log(ends) if self.is_logarithmic else ends
        value = 0.5 * (low + high) + 0.5 * (high - low) * x
        return np.clip(np.exp(value) if self.is_logarithmic else value, *ends)

    def family(self, organ: Organ, radius: float) -> tuple[Organ, dict[str, Any]]:
        """The organ at its own value, or at the middle of the range if that is outside, and the core's arguments.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> organ, arguments = vs.Vary("young", 5e4, 2e5, nodes=3).on(beam.mesh).family(beam, radius=0.05)
        >>> organ.law
        NeoHookean(mu=38461.5, lam=57692.3)
        """
        organ = self._with_suited_element(organ)
        cells = np.empty(0, dtype=np.uint32) if self.part is None else organ.mesh.cells_in(self.part)
        own, (low, high) = self.own_value(organ.law, cells, radius), self._ends
        value = own if low <= own <= high else float(self._at(np.zeros(1))[0])
        if value != own:
            unit = UNITS[self.name] and f" {UNITS[self.name]}"
            log.warning(
                "the organ's own %s, %g%s, is outside the range from %g to %g; the model begins at %g%s",
                *(self.name, own, unit, low, high, value, unit),
            )

        def at(value: float) -> Organ:
            if self.name == "radius":
                return organ
            return organ.with_law(law_at(organ.law, self.name, value, cells, len(organ.mesh.cells)))

        def member(value: float) -> tuple[float, Any, float]:
            there = at(value)
            if not np.array_equal(there._ties.stiffness, organ._ties.stiffness):
                raise VisceraError(
                    f"bonds are as stiff as the law of their organs asks for, so they change with {self.name}, and a "
                    "reduced model keeps one stiffness of them; make a model for each value"
                )
            return float(value), there._body, float(value) if self.name == "radius" else radius

        return at(value), {
            "name": self.name,
            "range": [low, high],
            "is_logarithmic": self.is_logarithmic,
            "value": float(value),
            "cells": cells.tolist(),
            "members": [member(value) for value in self.values],
            "unseen": [member(value) for value in self.unseen],
        }

    def _with_suited_element(self, organ: Organ) -> Organ:
        """The organ with an element for the whole range: all members have the same, and "P1" locks at its upper end."""
        locks = self.name == "poisson" and self._ends[1] > defaults.LOCKING_POISSON
        if not locks or organ.element != defaults.ELEMENT:
            return organ
        if organ._chosen_element is None:
            return organ._locking_free()
        log.warning(
            "the range of poisson ends at %g, where the element %r locks: forces come out too large; "
            "leave the element out, or name %r",
            self._ends[1],
            organ.element,
            defaults.LOCKING_FREE_ELEMENT,
        )
        return organ

    def own_value(self, law: Law, cells: Indices, radius: float) -> float:
        """The organ's own value. Raises `VisceraError` if it differs between the cells, which would become equal.

        >>> import viscera as vs
        >>> import numpy as np
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> vary = vs.Vary("young", 5e4, 2e5)
        >>> f"{vary.own_value(beam.law, np.arange(len(beam.mesh.cells)), radius=0.05):.0f} Pa"
        '100000 Pa'
        """
        if self.name == "radius":
            return radius
        inside = _of(law, self.name)
        inside = inside[cells] if len(cells) and len(inside) > 1 else inside
        if not np.allclose(inside, inside[0], rtol=1e-9):
            values = f"{inside.min():g} to {inside.max():g} {UNITS[self.name]}".rstrip()
            raise VisceraError(
                f"{self.name} varies in cells of different {self.name}, {values}, which it would make equal; "
                "name a part that has one value, as `part` of Vary, or give these cells one value"
            )
        return float(inside[0])


def of_words(words: Mapping[str, Any]) -> Vary:
    """The range of a table [reduce.vary] of a case.

    >>> of_words({"parameter": "young", "low": 1e3, "high": 1e5}).nodes
    5
    """
    rest = {key: word for key, word in words.items() if key != "parameter"}
    return Vary(words["parameter"], **rest)


def law_at(law: Law, name: str, value: float, cells: Indices, count: int) -> Law:
    """The law of `count` cells with another "young" or "poisson" in some of them, or in all if none are named.

    Young's modulus scales all stresses; Poisson's ratio leaves Young's modulus as it is. Cells that have the value
    already, up to rounding, keep their parameters to the last bit, as in the core (`crates/law/src/varied.rs`), which
    brings the law of a saved model to its value.
    """
    before = np.repeat(law.parameters, count if len(cells) and len(law.parameters) == 1 else 1, axis=0)
    everywhere = before.copy()
    inside = cells if len(cells) else np.arange(len(everywhere))
    changed = from_core(law.name, everywhere[inside])
    if name == "poisson":
        if isinstance(law, Several):
            raise VisceraError(
                "the Poisson's ratio of an organ with laws by place cannot vary; vary its young, or give it one law "
                "with a value of each parameter per cell"
            )
        if not isinstance(law, TwoModuli):
            raise VisceraError(
                f"{type(law).__name__} is not made from a Poisson's ratio alone, but keeps coefficients [Pa] and a "
                "bulk modulus, even where it was given one; vary its young, or take one of the laws made from it: "
                f"{', '.join(OF_TWO_MODULI)}"
            )
        everywhere[inside] = type(law)(young=_of(changed, "young"), poisson=value).parameters
    else:
        columns = np.array(changed.stresses)
        everywhere[np.ix_(inside, columns)] *= (value / _of(changed, "young"))[:, None]
    difference, largest = np.abs(everywhere - before).max(axis=1), np.abs(before).max(axis=1)
    return from_core(law.name, np.where((difference > EQUAL * largest)[:, None], everywhere, before))


def _of(law: Law, name: str) -> Floats:
    """Young's modulus [Pa] or Poisson's ratio at rest, one value or one per cell."""
    if name == "poisson":
        return law.poisson
    shear, bulk = law.core().moduli().T
    return np.asarray(9.0 * bulk * shear / (3.0 * bulk + shear))
