"""A parameter that one reduced model covers for a range of values: of the law, or the radius of the contact patch.

The model is solved at Chebyshev's nodes of the range, and its answers are interpolated to any value within.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera.errors import VisceraError, did_you_mean
from viscera.law import Law, TwoModuli, from_core
from viscera.mesh import Floats, Indices, Where

if TYPE_CHECKING:
    from viscera.organ import Organ

PARAMETERS = ("young", "poisson", "radius")


@dataclass(frozen=True)
class Vary:
    """A range of "young" [Pa], "poisson" or the contact "radius" [m], in the whole organ or in a part of it.

    >>> import viscera as vs
    >>> nodes = vs.Vary("young", 1e3, 1e5, nodes=3).values
    >>> [round(float(young)) for young in nodes]
    [1361, 10000, 73456]
    """

    name: str
    low: float
    high: float
    part: Where | None = None
    """Cells whose law it is: a cell set's name, indices, or a predicate on centroids; all of them without."""
    nodes: int = 5
    """Values that are solved; the error falls by a factor with each."""

    def __post_init__(self) -> None:
        """Raise `VisceraError` for an unknown parameter, an empty range, too few or too many nodes."""
        if self.name not in PARAMETERS:
            raise VisceraError(f"cannot vary {self.name!r}; {did_you_mean(str(self.name), PARAMETERS)}")
        if not (np.isfinite([self.low, self.high]).all() and self.low < self.high):
            raise VisceraError(f"the range of {self.name} runs from {self.low} to {self.high}; it must ascend")
        if self.name != "poisson" and self.low <= 0.0:
            raise VisceraError(f"the range of {self.name} begins at {self.low}; it must be positive")
        if not 2 <= self.nodes <= 12:
            raise VisceraError(f"{self.nodes} nodes of {self.name}; take 2 to 12")
        if self.name == "radius" and self.part is not None:
            raise VisceraError("the contact radius belongs to no part of the organ; leave `part` out")

    @property
    def is_logarithmic(self) -> bool:
        """Whether it is interpolated over its logarithm, as suits a stiffness and a length."""
        return self.name != "poisson"

    @property
    def values(self) -> Floats:
        """Chebyshev's nodes of the range, ascending."""
        angles = np.pi * (np.arange(self.nodes)[::-1] + 0.5) / self.nodes
        return self._at(np.cos(angles))

    @property
    def unseen(self) -> Floats:
        """Values between the nodes where a model is measured: both ends, and a middle one."""
        return self._at(np.array([-1.0, np.cos(np.pi * (self.nodes // 2) / self.nodes), 1.0]))

    def _at(self, x: Floats) -> Floats:
        """Values from places in [-1, 1]."""
        low, high = np.log([self.low, self.high]) if self.is_logarithmic else (self.low, self.high)
        value = 0.5 * (low + high) + 0.5 * (high - low) * x
        return np.clip(np.exp(value) if self.is_logarithmic else value, self.low, self.high)

    def family(self, organ: Organ, radius: float) -> tuple[Organ, dict[str, Any]]:
        """The organ at the value it has, or where that is outside the range at the middle, and the core's arguments."""
        cells = np.empty(0, dtype=np.uint32) if self.part is None else organ.mesh.cells_in(self.part)
        own = self.own_value(organ.law, cells, radius)
        value = own if own is not None and self.low <= own <= self.high else float(self._at(np.zeros(1))[0])

        def at(value: float) -> Organ:
            if self.name == "radius":
                return organ
            return organ.with_law(law_at(organ.law, self.name, value, cells, len(organ.mesh.cells)))

        def member(value: float) -> tuple[float, Any, float]:
            return float(value), at(value)._body, float(value) if self.name == "radius" else radius

        return at(value), {
            "name": self.name,
            "range": [float(self.low), float(self.high)],
            "is_logarithmic": self.is_logarithmic,
            "value": float(value),
            "cells": cells.tolist(),
            "members": [member(value) for value in self.values],
            "unseen": [member(value) for value in self.unseen],
        }

    def own_value(self, law: Law, cells: Indices, radius: float) -> float | None:
        """The organ's own value, or None where it is not the same in all the cells."""
        if self.name == "radius":
            return radius
        inside = _of(law, self.name)
        inside = inside[cells] if len(cells) and len(inside) > 1 else inside
        return float(inside[0]) if np.allclose(inside, inside[0], rtol=1e-9) else None


def law_at(law: Law, name: str, value: float, cells: Indices, count: int) -> Law:
    """The law of `count` cells with another "young" or "poisson" in some of them, in all where none are named.

    Young's modulus scales all stresses; Poisson's ratio leaves Young's modulus as it is.
    """
    everywhere = np.repeat(law.parameters, count if len(cells) and len(law.parameters) == 1 else 1, axis=0)
    inside = cells if len(cells) else np.arange(len(everywhere))
    changed = from_core(law.name, everywhere[inside])
    if name == "poisson":
        if not isinstance(law, TwoModuli):
            raise VisceraError(f"{type(law).__name__} is not made from a Poisson's ratio; vary its young")
        everywhere[inside] = type(law)(young=_of(changed, "young"), poisson=value).parameters
    else:
        columns = np.array(law.stresses)
        everywhere[np.ix_(inside, columns)] *= (value / _of(changed, "young"))[:, None]
    return from_core(law.name, everywhere)


def _of(law: Law, name: str) -> Floats:
    """Young's modulus [Pa] or Poisson's ratio at rest, one value or one per cell."""
    if name == "poisson":
        return law.poisson
    shear, bulk = law.core().moduli().T
    return np.asarray(9.0 * bulk * shear / (3.0 * bulk + shear))
