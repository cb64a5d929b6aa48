"""A material test: a homogeneous deformation and the nominal stress measured in it."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from viscera.curves import MODES
from viscera.errors import VisceraError, did_you_mean
from viscera.mesh import Floats
from viscera.quantity import brief, numbers_of, refuse_masked
from viscera.sealed import Sealed

SMALLEST_STRETCH, LARGEST_STRETCH = 0.05, 20.0
"""The softest silicones tear at a stretch of about ten."""


@dataclass(frozen=True, init=False, eq=False)
class MaterialTest(Sealed):
    """One measured curve.

    mode: "uniaxial" (tension and compression), "equibiaxial", "pure shear" or "simple shear".
    stretch (k,): the stretch, 1 at rest; in simple shear the amount of shear, 0 at rest.
    stress (k,): the nominal stress [Pa], force over rest area; negative in compression.

    Raises `VisceraError` for a mode that is not known, curves of different lengths, values that are not finite, and
    stretches below 0.05 or above 20.

    >>> import viscera as vs
    >>> test = vs.MaterialTest("uniaxial", [0.8, 0.9, 1.1, 1.2], [-725, -340, 280, 494], "cylinder")
    >>> test
    MaterialTest('cylinder': uniaxial, 4 points, stretch 0.8 to 1.2)
    """

    mode: str
    stretch: Floats
    stress: Floats
    name: str

    def __init__(self, mode: str, stretch: ArrayLike, stress: ArrayLike, name: str = "test") -> None:
        if not isinstance(mode, str) or mode not in MODES:
            raise VisceraError(f"{name}: no deformation is called {brief(mode)}; {did_you_mean(str(mode), MODES)}")
        values = {"mode": mode, "name": name}
        curves = {"stretch": _curve(name, "stretch", stretch), "stress": _curve(name, "stress", stress)}
        for what, value in {**values, **curves}.items():
            object.__setattr__(self, what, value)
        self._seal()
        if len(self.stretch) != len(self.stress):
            raise VisceraError(f"{self.name}: {len(self.stretch)} stretches but {len(self.stress)} stresses")
        if len(self.stretch) < 2:
            raise VisceraError(f"{self.name}: a curve needs at least two points, got {len(self.stretch)}")
        if self.mode != "simple shear" and self.stretch.min() < SMALLEST_STRETCH:
            row = int(self.stretch.argmin())
            raise VisceraError(
                f"{self.name}: stretch {self.stretch[row]:g} in row {row}; stretches are lengths over rest lengths, "
                f"1 at rest and at least {SMALLEST_STRETCH}"
            )
        if self.stretch.max() > LARGEST_STRETCH:
            row, parameter = int(self.stretch.argmax()), MODES[self.mode].parameter
            raise VisceraError(
                f"{self.name}: {parameter} {self.stretch[row]:g} in row {row}, where nothing soft goes beyond "
                f"{LARGEST_STRETCH:g}; give lengths in metres or with their unit, and per cent over 100"
            )

    @classmethod
    def from_force(
        cls,
        mode: str,
        displacement: ArrayLike,
        force: ArrayLike,
        *,
        length: float,
        area: float,
        compression: bool = False,
        name: str = "test",
    ) -> MaterialTest:
        """A test from what the machine recorded.

        displacement (k,) [m] of the grips and force (k,) [N]; length [m]: rest length between the grips (in simple
        shear the thickness sheared); area [m^2]: rest cross-section. With `compression` both are counted positive in
        compression, as most machines do: stretch = 1 - displacement / length, stress = -force / area.

        >>> import viscera as vs
        >>> recorded = [0.0, 0.003, 0.006], [0.0, 1.2, 2.9]  # m, N
        >>> vs.MaterialTest.from_force("uniaxial", *recorded, length=0.03, area=2e-3, compression=True)
        MaterialTest('test': uniaxial, 3 points, stretch 0.8 to 1)
        """
        for what, value in (("length", length), ("area", area)):
            if isinstance(value, bool) or not isinstance(value, Real) or not 0.0 < value < float("inf"):
                raise VisceraError(f"{name}: the specimen's {what} is {value}; it must be positive")
        sign = -1.0 if compression else 1.0
        strain = sign * _curve(name, "displacement", displacement) / length
        return cls(
            mode, strain if mode == "simple shear" else 1.0 + strain, sign * _curve(name, "force", force) / area, name
        )

    @property
    def n_points(self) -> int:
        """Number of measured points."""
        return len(self.stretch)

    def __repr__(self) -> str:
        low, high = self.stretch.min(), self.stretch.max()
        parameter = MODES[self.mode].parameter
        return f"MaterialTest({self.name!r}: {self.mode}, {self.n_points} points, {parameter} {low:.3g} to {high:.3g})"


def _curve(name: str, what: str, values: ArrayLike) -> Floats:
    refuse_masked(values, f"{name}: {what}", "a list of numbers")
    curve = numbers_of(values)
    if curve is None:
        raise VisceraError(f"{name}: {what} is no list of numbers that a float can hold, got {brief(values)}")
    if curve.ndim != 1:
        raise VisceraError(f"{name}: {what} has shape {curve.shape}; give one value for each point, (k,)")
    if not np.isfinite(curve).all():
        row = int(np.argmin(np.isfinite(curve)))
        raise VisceraError(f"{name}: {what} is {curve[row]} in row {row}; it must be finite")
    return curve
