"""Constitutive laws with their parameters as the field gives them; the energies themselves live in the compiled core.

A parameter is a number for the whole organ or an array (m,), one value per cell (a stiff nodule in a soft organ).
Invariants: I1 = tr C, I2 = (tr^2 C - tr C^2) / 2, J = det F, with C = F^T F and E = (C - I) / 2.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera import _core
from viscera.errors import VisceraError, did_you_mean
from viscera.mesh import Floats

__all__ = ["Corotated", "Law", "Linear", "MooneyRivlin", "NeoHookean", "SaintVenantKirchhoff"]


class Law:
    """A constitutive law: an energy known to the core by name, and its parameters.

    `parameters` has one row for all cells or one row per cell, in the columns that the core expects.
    """

    def __init__(self, name: str, parameters: Floats) -> None:
        self.name = name
        self.parameters = parameters

    def core(self) -> _core.Law:
        """This law as the compiled core knows it."""
        return _core.Law(self.name, self.parameters)

    @property
    def poisson(self) -> Floats:
        """Poisson's ratio at rest, one value or one per cell: (3 K - 2 mu) / (6 K + 2 mu)."""
        shear, bulk = self.core().moduli().T
        return np.asarray((3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear))

    def energy(self, F: ArrayLike, cell: int = 0) -> Floats:
        """Energy density psi (k,) [J/m^3] of deformation gradients F (k, 3, 3), with the parameters of one cell."""
        return self._of_cell(cell).energy(_gradients(F))

    def stress(self, F: ArrayLike, cell: int = 0) -> Floats:
        """First Piola-Kirchhoff stress P = d psi / dF (k, 3, 3) [Pa]."""
        return self._of_cell(cell).stress(_gradients(F))

    def tangent(self, F: ArrayLike, cell: int = 0) -> Floats:
        """Tangent dP / dF (k, 3, 3, 3, 3) [Pa]."""
        return self._of_cell(cell).tangent(_gradients(F))

    def _of_cell(self, cell: int) -> _core.Law:
        rows = len(self.parameters)
        if rows > 1 and not 0 <= cell < rows:
            raise VisceraError(f"cell {cell} has no parameters: the law is given for cells 0 to {rows - 1}")
        row = cell if rows > 1 else 0
        return _core.Law(self.name, np.ascontiguousarray(self.parameters[row : row + 1]))


class _Isotropic(Law):
    """The laws with two moduli: Young's modulus and Poisson's ratio, or the Lamé constants."""

    core_name: ClassVar[str]

    def __init__(
        self,
        *,
        young: ArrayLike | None = None,
        poisson: ArrayLike | None = None,
        mu: ArrayLike | None = None,
        lam: ArrayLike | None = None,
    ) -> None:
        """Young's modulus [Pa] and Poisson's ratio, or the Lamé constants mu and lam [Pa].

        mu = E / (2 (1 + nu)),  lam = E nu / ((1 + nu) (1 - 2 nu)).
        Raises `VisceraError` unless E > 0 and -1 < nu < 0.5, or mu > 0 and lam > -2 mu / 3.
        """
        law = type(self).__name__
        if young is not None and poisson is not None and mu is None and lam is None:
            E, nu = _columns(law, young=young, poisson=poisson)
            _require(law, "young", E, E > 0.0, "must be positive [Pa]")
            _require(law, "poisson", nu, (nu > -1.0) & (nu < 0.5), "must lie above -1 and below 0.5")
            shear, first = E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
        elif mu is not None and lam is not None and young is None and poisson is None:
            shear, first = _columns(law, mu=mu, lam=lam)
            _require(law, "mu", shear, shear > 0.0, "must be positive [Pa]")
            _require(law, "lam", first, first > -2.0 / 3.0 * shear, "must exceed -2 mu / 3 (a positive bulk modulus)")
        else:
            raise VisceraError(f"{law} takes either young and poisson, or mu and lam")
        super().__init__(self.core_name, np.column_stack([shear, first]))

    @property
    def mu(self) -> Floats:
        """Shear modulus [Pa], one value or one per cell."""
        return self.parameters[:, 0]

    @property
    def lam(self) -> Floats:
        """First Lamé constant [Pa], one value or one per cell."""
        return self.parameters[:, 1]

    def __repr__(self) -> str:
        return f"{type(self).__name__}(mu={_shown(self.mu)}, lam={_shown(self.lam)})"


class Linear(_Isotropic):
    """Linear elasticity: psi = mu eps : eps + lam / 2 (tr eps)^2, with eps = sym(F) - I. For small rotations only.

    >>> law = Linear(young=1000.0, poisson=0.25)
    >>> law
    Linear(mu=400, lam=400)
    """

    core_name = "linear"


class Corotated(_Isotropic):
    """Linear elasticity in the rotated frame of each cell: psi = mu |S - I|^2 + lam / 2 tr(S - I)^2, with F = R S.

    R is the rotation and S the stretch of the polar decomposition.
    """

    core_name = "corotated"


class SaintVenantKirchhoff(_Isotropic):
    """psi = mu E : E + lam / 2 (tr E)^2. It weakens in compression and collapses under strong indentation.

    Niroomandi et al., IJNME 96 (2013) 129, section 5.1.
    """

    core_name = "saint_venant_kirchhoff"


class NeoHookean(_Isotropic):
    """Compressible neo-Hookean: psi = mu / 2 (I1 - 3) - mu ln J + lam / 2 (ln J)^2.

    Niroomandi et al., IJNME 96 (2013) 129, equation 37.

    >>> NeoHookean(young=0.17e6, poisson=0.48)
    NeoHookean(mu=57432.4, lam=1.37838e+06)
    """

    core_name = "neo_hookean"


class MooneyRivlin(Law):
    """psi = c1 (I1 J^(-2/3) - 3) + c2 (I2 J^(-4/3) - 3) + alpha / 2 W^2, with W = J^2 - 1, J - 1 or ln J.

    c1, c2, and kappa (the small-strain bulk modulus) or alpha (the penalty of a perturbed Lagrangian), all in [Pa];
    `volumetric` names W. Since J^2 - 1 = 2 (J - 1) + ..., kappa = 4 alpha for W = J^2 - 1, and kappa = alpha for the
    other two. The shear modulus at small strain is 2 (c1 + c2).

    Raises `VisceraError` unless c1 + c2 > 0 and kappa > 0.

    >>> MooneyRivlin(c1=1.343e5, c2=0.335e5, alpha=4.167e6)
    MooneyRivlin(c1=134300, c2=33500, kappa=1.6668e+07, volumetric='J^2-1')
    """

    bulk_moduli_per_alpha: ClassVar[dict[str, float]] = {"J^2-1": 4.0, "J-1": 1.0, "ln J": 1.0}

    def __init__(
        self,
        c1: ArrayLike,
        c2: ArrayLike,
        kappa: ArrayLike | None = None,
        *,
        alpha: ArrayLike | None = None,
        volumetric: str = "J^2-1",
    ) -> None:
        if volumetric not in self.bulk_moduli_per_alpha:
            advice = did_you_mean(volumetric, self.bulk_moduli_per_alpha)
            raise VisceraError(f"MooneyRivlin: unknown volumetric form {volumetric!r}; {advice}")
        if alpha is not None and kappa is None:
            kappa = np.asarray(alpha, dtype=float) * self.bulk_moduli_per_alpha[volumetric]
        elif kappa is None or alpha is not None:
            raise VisceraError("MooneyRivlin takes either kappa or alpha")
        first, second, bulk = _columns("MooneyRivlin", c1=c1, c2=c2, kappa=kappa)
        _require("MooneyRivlin", "c1 + c2", first + second, first + second > 0.0, "must be positive [Pa]")
        _require("MooneyRivlin", "the bulk modulus", bulk, bulk > 0.0, "must be positive [Pa]")
        super().__init__(f"mooney_rivlin {volumetric}", np.column_stack([first, second, bulk]))
        self.volumetric = volumetric

    def __repr__(self) -> str:
        c1, c2, kappa = (_shown(column) for column in self.parameters.T)
        return f"MooneyRivlin(c1={c1}, c2={c2}, kappa={kappa}, volumetric={self.volumetric!r})"


LAWS: dict[str, type[Law]] = {
    law.__name__: law for law in (Linear, Corotated, SaintVenantKirchhoff, NeoHookean, MooneyRivlin)
}


def named(name: str) -> type[Law]:
    """The class of a law by its name in this module, as case files and the command line give it."""
    if name not in LAWS:
        raise VisceraError(f"unknown law {name!r}; {did_you_mean(name, LAWS)}")
    return LAWS[name]


def from_core(name: str, parameters: ArrayLike) -> Law:
    """The law that a model file carries: the core's name and its parameter rows."""
    columns = np.atleast_2d(np.asarray(parameters, dtype=float)).T
    if name.startswith("mooney_rivlin ") and len(columns) == 3:
        return MooneyRivlin(*columns, volumetric=name.removeprefix("mooney_rivlin "))
    for law in (Linear, Corotated, SaintVenantKirchhoff, NeoHookean):
        if law.core_name == name and len(columns) == 2:
            return law(mu=columns[0], lam=columns[1])
    raise VisceraError(f"the model's law {name!r} with {len(columns)} parameters is not known to this version")


def _gradients(F: ArrayLike) -> Floats:
    gradients = np.ascontiguousarray(F, dtype=float)
    if gradients.ndim != 3 or gradients.shape[1:] != (3, 3):
        raise VisceraError(f"deformation gradients have shape (k, 3, 3), got {gradients.shape}")
    return gradients


def _columns(law: str, **parameters: ArrayLike) -> list[Floats]:
    """The parameters as arrays of one common length: 1, or the number of cells."""
    columns = {name: np.atleast_1d(np.asarray(values, dtype=float)) for name, values in parameters.items()}
    for name, values in columns.items():
        if values.ndim != 1 or values.size == 0:
            raise VisceraError(f"{law}: {name} is one number or an array (m,), got shape {values.shape}")
        _require(law, name, values, np.isfinite(values), "must be finite")
    lengths = {name: len(values) for name, values in columns.items() if len(values) > 1}
    if len(set(lengths.values())) > 1:
        raise VisceraError(f"{law}: per-cell parameters have different lengths: {lengths}")
    return [np.ascontiguousarray(values) for values in np.broadcast_arrays(*columns.values())]


def _require(law: str, name: str, values: Floats, holds: NDArray[np.bool_], demand: str) -> None:
    if not holds.all():
        cell = int(np.argmin(holds))
        where = f" of cell {cell}" if len(values) > 1 else ""
        raise VisceraError(f"{law}: {name}{where} is {values[cell]:g}; it {demand}")


def _shown(values: Floats) -> str:
    low, high = values.min(), values.max()
    return f"{low:g}" if low == high else f"{low:g}..{high:g}"
