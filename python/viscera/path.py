"""An equilibrium path as a chain of power series, summed in a Padé form, which reaches beyond their radius."""

from __future__ import annotations

import os
import pathlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from viscera import _core
from viscera.errors import VisceraError
from viscera.mesh import Floats
from viscera.quantity import Number, Whole
from viscera.sealed import Sealed

if TYPE_CHECKING:
    from viscera.organ import Organ


SAMPLES = Whole(2, 10_000)
"""Of an expansion: its ends at least."""
PARAMETER = Number()
"""Of an expansion: a finite number, within its range."""


@dataclass(frozen=True, eq=False)
class Expansion(Sealed):
    """One section of a path: u(a) = sum_p a^p u_p, and a series of the load, for 0 <= a <= range."""

    displacement: Floats
    """u_p (order + 1, n, 3) [m]; u_0 is the equilibrium the expansion starts from."""
    load: Floats
    """Load factors (order + 1,)."""
    range: float
    """Largest a of the Padé form."""
    taylor_range: float
    """Largest a of the polynomial itself."""
    residual: float
    """Force residual at the end of the range, relative to the load."""
    is_stable: bool
    """Whether the equilibrium at the end of the range is stable: the tangent there has no negative eigenvalue, and the
    path does not end there because it becomes singular."""

    def at(self, a: float) -> tuple[float, Floats]:
        """Load factor and displacement (n, 3) [m] at the parameter a, by the vector Padé form."""
        a = PARAMETER(a, "the parameter a of an expansion")
        if not 0.0 <= a <= self.range * (1.0 + 1e-12):
            raise VisceraError(f"the expansion holds for 0 <= a <= {self.range:g}, not at {a:g}")
        series = np.column_stack([self.displacement.reshape(len(self.displacement), -1), self.load])
        value = _core.vector_pade(np.ascontiguousarray(series), a)
        return float(value[-1]), value[:-1].reshape(self.displacement.shape[1:])


@dataclass(frozen=True, eq=False)
class Path:
    """The expansions of a path, in order; each starts where the one before it ends."""

    expansions: list[Expansion]
    organ: Organ = field(repr=False)
    """The organ whose path it is."""
    until: float = 1.0
    """The load factor that was asked for."""
    parameter: str = "load"
    """The path parameter: "load" or "arc length"."""
    max_expansions: int = 50
    """How many expansions it was allowed."""

    @property
    def load(self) -> float:
        """Load factor at the end of the path."""
        last = self.expansions[-1]
        return last.at(last.range)[0]

    @property
    def is_complete(self) -> bool:
        """Whether the path reaches the load that was asked for."""
        return self.load >= self.until * (1.0 - 1e-9)

    @property
    def message(self) -> str:
        """Why the path ends before that load; empty if it does not.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> path = beam.path(force={"tip": (0, 0, -10.0)}, order=3, max_expansions=2)
        >>> path.is_complete, path.message.partition(";")[2]
        (False, ' allow more of them (max_expansions), a higher order or a larger tolerance')
        """
        if self.is_complete:
            return ""
        count = len(self.expansions)
        end = f"the path ends at load {self.load:.3g} of {self.until:g} after {count} expansions"
        if count >= self.max_expansions:
            return f"{end}; allow more of them (max_expansions), a higher order or a larger tolerance"
        remedy = (
            "an arc length passes limit points"
            if self.parameter == "load"
            else "another path may begin there, to which a small force aside leads"
        )
        return f"{end}, unstable or singular there; {remedy}"

    def __repr__(self) -> str:
        words = [f"{len(self.expansions)} expansions", f"load {self.load:.3g}", self.message]
        return f"Path({', '.join(filter(None, words))})"

    def curve(self, samples: int = 10) -> tuple[Floats, Floats]:
        """Load factors (k,) and displacements (k, n, 3) [m] at equal steps of a within every expansion."""
        samples = SAMPLES(samples, "samples")
        points = [expansion.at(a) for expansion in self.expansions for a in np.linspace(0.0, expansion.range, samples)]
        return np.array([load for load, _ in points]), np.array([u for _, u in points])

    def write(self, path: str | os.PathLike[str], samples: int = 10) -> list[pathlib.Path]:
        """Writes the shapes of `curve` as a series, see `viscera.write_series`; all paths written.

        The time of a shape is its load factor, or its number if the load does not rise all along the path.
        """
        from viscera.series import write_series

        loads, shapes = self.curve(samples)
        first = np.arange(len(loads)) % samples > 0  # an expansion begins where the one before it ends
        first[0] = True
        loads, shapes = loads[first], shapes[first]
        times = loads if (np.diff(loads) > 0.0).all() else np.arange(len(loads))
        moments = [(float(time), self.organ.moved(shape)) for time, shape in zip(times, shapes, strict=True)]
        return write_series(path, moments)
