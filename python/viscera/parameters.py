"""Parameters of laws as users give them: numbers or one value per cell, checked in one place."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera.errors import VisceraError
from viscera.mesh import Floats
from viscera.quantity import LARGEST, numbers_of, refused


def columns(law: str, /, **parameters: ArrayLike) -> list[Floats]:
    """The parameters as arrays of one common length: 1, or the number of cells."""
    given = {name: _numbers(law, name, values) for name, values in parameters.items()}
    for name, values in given.items():
        if values.ndim != 1 or values.size == 0:
            raise VisceraError(f"{law}: {name} is one number or an array (m,), got shape {values.shape}")
        require(law, name, values, np.isfinite(values), "must be finite")
        require(law, name, values, np.abs(values) <= LARGEST["Pa"], f"must not exceed {LARGEST['Pa']:g} in size")
    lengths = {name: len(values) for name, values in given.items() if len(values) > 1}
    if len(set(lengths.values())) > 1:
        raise VisceraError(f"{law}: per-cell parameters have different lengths: {lengths}")
    return [np.ascontiguousarray(values) for values in np.broadcast_arrays(*given.values())]


def _numbers(law: str, name: str, values: ArrayLike) -> Floats:
    numbers = numbers_of(values)
    if numbers is None:
        raise refused(f"{law}: {name}", "one number or an array (m,)", values)
    return np.atleast_1d(numbers)


def compressibility(law: str, kappa: ArrayLike | None, poisson: ArrayLike | None) -> tuple[str, ArrayLike]:
    """Which of the two was given, and its value."""
    if kappa is not None and poisson is None:
        return "kappa", kappa
    if poisson is not None and kappa is None:
        return "poisson", poisson
    raise VisceraError(f"{law} takes either kappa [Pa] or poisson")


def bulk_modulus(law: str, name: str, given: Floats, shear: Floats) -> Floats:
    """The bulk modulus [Pa], itself or from Poisson's ratio and the shear modulus."""
    if name == "kappa":
        require(law, name, given, given > 0.0, "must be positive [Pa]")
        return given
    require(law, name, given, (given > -1.0) & (given < 0.5), "must lie above -1 and below 0.5")
    return 2.0 / 3.0 * shear * (1.0 + given) / (1.0 - 2.0 * given)


def require(law: str, name: str, values: Floats, holds: NDArray[np.bool_], demand: str) -> None:
    """Raise `VisceraError` naming the law, the parameter, the first cell where the demand fails, and the value."""
    if not holds.all():
        cell = int(np.argmin(holds))
        where = f" of cell {cell}" if len(values) > 1 else ""
        raise VisceraError(f"{law}: {name}{where} is {values[cell]:g}; it {demand}")


def shown(values: Floats) -> str:
    """One number, or the range over the cells."""
    low, high = values.min(), values.max()
    return f"{low:g}" if low == high else f"{low:g}..{high:g}"
