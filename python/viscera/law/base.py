"""What every law offers: energy, stress, tangent, moduli at rest and curves; and the core's description of each law."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.immutable import Immutable
from viscera.mesh import Floats
from viscera.quantity import Whole, numbers_of, refused

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROWS: dict[str, dict[str, Any]] = {row["name"]: row for row in _core.laws()}
"""What the core knows of each law, by its name there: parameters with meaning, kind, unit, bounds and default."""
CELL = Whole(0, 2**32 - 1)
"""Number of a cell; the core counts them in 32 bits."""


class Law(Immutable):
    """A constitutive law: an energy known to the core by name, and its parameters.

    `parameters` has one row for all cells or one row per cell, in the columns that the core expects.
    """

    core_names: ClassVar[tuple[str, ...]] = ()
    """Its names in the core and in model files."""

    def __init_subclass__(cls) -> None:
        """Raise `VisceraError` for a law written in Python, which the compiled core could not follow."""
        if cls.__module__.rpartition(".")[0] != __package__ and (
            Law in cls.__bases__ or {"energy", "stress", "tangent"} & set(vars(cls))
        ):
            raise VisceraError(
                f"{cls.__name__}: laws are compiled, so the energy of a subclass of Law would not be used; give it as "
                "a formula, StrainEnergy(...), or write it in crates/law/src, as CONTRIBUTING.md shows in 20 lines"
            )

    def __init__(self, name: str, parameters: Floats) -> None:
        self.name: Final = name
        """Its name in the core."""
        self.parameters: Final = parameters
        """(1, p) or (m, p), read-only."""

    @classmethod
    def _of_columns(cls, name: str, columns: Floats) -> Law:
        """The law that the core calls `name`, from its parameters column by column."""
        raise NotImplementedError

    @property
    def stresses(self) -> tuple[int, ...]:
        """The columns of `parameters` that are stresses: the energy is proportional to them together."""
        return tuple(k for k, p in enumerate(ROWS[self.name]["parameters"]) if p["kind"] == "stress")

    @property
    def is_analytic(self) -> bool:
        """Whether the energy is analytic at rest, as power series about it assume."""
        return bool(ROWS[self.name]["is_analytic"])

    def core(self) -> _core.Law:
        """This law as the compiled core knows it.

        >>> import viscera as vs

        >>> vs.NeoHookean(young=3e3, poisson=0.45).core().name
        'neo_hookean'
        """
        return _core.Law(self.name, self.parameters)

    @property
    def young(self) -> Floats:
        """Young's modulus at rest [Pa], one value or one per cell: 9 K mu / (3 K + mu).

        mu is the least shear modulus: of a law with fibres that of the matrix between them.
        """
        shear, bulk = self.core().moduli().T
        return np.asarray(9.0 * bulk * shear / (3.0 * bulk + shear))

    @property
    def poisson(self) -> Floats:
        """Poisson's ratio at rest, one value or one per cell: (3 K - 2 mu) / (6 K + 2 mu), with `mu` as in `young`."""
        shear, bulk = self.core().moduli().T
        return np.asarray((3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear))

    def energy(self, F: ArrayLike, cell: int = 0) -> Floats:
        """Energy density psi (k,) [J/m^3] of deformation gradients F (k, 3, 3), with the parameters of one cell.

        Not a number, or infinite, where the law has no energy, as most have none at det F <= 0.

        >>> import viscera as vs

        >>> vs.NeoHookean(young=3e3, poisson=0.45).energy(np.diag([1.1, 1.0, 1.0])[None]).round(2).tolist()
        [52.31]
        """
        return self._of_cell(cell).energy(_gradients(F))

    def stress(self, F: ArrayLike, cell: int = 0) -> Floats:
        """First Piola-Kirchhoff stress P = d psi / dF (k, 3, 3) [Pa].

        It may have a value where the energy has none: that of `-mu*log(J)` is `-mu cof F / J`, also at det F < 0.

        >>> import viscera as vs

        >>> vs.NeoHookean(young=3e3, poisson=0.45).stress(np.diag([1.1, 1.0, 1.0])[None]).round(1)[0].tolist()
        [[1004.2, 0.0, 0.0], [0.0, 887.4, 0.0], [0.0, 0.0, 887.4]]
        """
        return self._of_cell(cell).stress(_gradients(F))

    def tangent(self, F: ArrayLike, cell: int = 0) -> Floats:
        """Tangent dP / dF (k, 3, 3, 3, 3) [Pa].

        >>> import viscera as vs

        >>> vs.NeoHookean(young=3e3, poisson=0.45).tangent(np.eye(3)[None])[0, 0, 0, 0, 0].round().item()  # 2 mu + lam
        11379.0
        """
        return self._of_cell(cell).tangent(_gradients(F))

    def curve(self, mode: str, stretch: tuple[float, float] = (0.6, 1.6), cell: int = 0) -> tuple[Floats, Floats]:
        """Stretches (k,) and nominal stress (k,) [Pa] in a homogeneous deformation; see `viscera.curves.curve`.

        >>> import viscera as vs

        >>> stretch, stress = vs.NeoHookean(mu=1e3, lam=1e5).curve("uniaxial", (0.9, 1.2))
        >>> round(float(stress[-1]))
        504
        """
        from viscera.curves import curve

        return curve(self, mode, stretch, cell)

    def plot(
        self,
        *others: Law,
        stretch: tuple[float, float] = (0.6, 1.6),
        cell: int = 0,
        path: str | os.PathLike[str] | None = None,
    ) -> Figure:
        """Nominal stress in uniaxial, equibiaxial and planar tension and in simple shear, beside that of other laws.

        stretch: range of stretches, which includes 1; cell: whose parameters to take; path: write a PNG file there.

        >>> import viscera as vs

        >>> soft, stiffening = vs.NeoHookean(young=3e3, poisson=0.45), vs.Yeoh(c10=500, c20=300, poisson=0.45)
        >>> figure = soft.plot(stiffening, path="laws.png")
        """
        from viscera.curves import draw

        return draw([self, *others], stretch=stretch, cell=cell, path=path)

    def _of_cell(self, cell: int) -> _core.Law:
        """The law of one cell; a law with one row has it for every cell, so that it is drawn beside one with many."""
        number, rows = CELL(cell, "the cell"), len(self.parameters)
        if rows > 1 and number >= rows:
            raise VisceraError(f"cell {number} has no parameters: the law is given for cells 0 to {rows - 1}")
        row = number if rows > 1 else 0
        return _core.Law(self.name, np.ascontiguousarray(self.parameters[row : row + 1]))


def _gradients(F: ArrayLike) -> Floats:
    gradients = numbers_of(F)
    if gradients is None:
        raise refused("deformation gradients", "numbers (k, 3, 3)", F)
    if gradients.ndim != 3 or gradients.shape[1:] != (3, 3):
        raise VisceraError(f"deformation gradients have shape (k, 3, 3), got {gradients.shape}")
    return gradients
