"""Laws that are fully described by their row in the core."""

from __future__ import annotations

from inspect import Parameter, Signature
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.law.base import ROWS, Law
from viscera.mesh import Floats
from viscera.parameters import bulk_modulus, columns, compressibility, require, shown


class OfRow(Law):
    """Base of the laws whose parameters are those of their row in the core, or `poisson` instead of `kappa`."""

    __signature__: ClassVar[Signature]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        given = [
            Parameter(
                p["name"],
                Parameter.POSITIONAL_OR_KEYWORD,
                default=Parameter.empty if p["default"] is None else p["default"],
            )
            for p in cls._row()["parameters"]
            if p["name"] != "kappa"
        ]
        bulk = [Parameter(name, Parameter.KEYWORD_ONLY, default=None) for name in ("kappa", "poisson")]
        cls.__signature__ = Signature([*given, *bulk])

    @classmethod
    def _row(cls) -> dict[str, Any]:
        return ROWS[cls.core_names[0]]

    def __init__(self, *unnamed: ArrayLike, **named: ArrayLike) -> None:
        """The parameters of the docstring, in its order or by name, and kappa [Pa] or poisson by name.

        Raises `VisceraError` for a parameter outside its bounds.
        """
        law = type(self).__name__
        try:
            given = self.__signature__.bind(*unnamed, **named)
        except TypeError as error:
            raise VisceraError(f"{law}: {error}; it takes {', '.join(self.__signature__.parameters)}") from None
        given.apply_defaults()
        bulk, value = compressibility(law, given.arguments.pop("kappa"), given.arguments.pop("poisson"))
        *own, value = columns(law, **given.arguments, **{bulk: value})
        rows = [p for p in self._row()["parameters"] if p["name"] != "kappa"]
        for p, column in zip(rows, own, strict=True):
            _within(law, p, column)
        # The shear modulus depends on no bulk modulus.
        stiff = _core.Law(self.core_names[0], np.column_stack([*own, np.ones_like(value)]))
        modulus = bulk_modulus(law, bulk, value, stiff.moduli()[:, 0])
        super().__init__(self.core_names[0], np.column_stack([*own, modulus]))

    @classmethod
    def _of_columns(cls, name: str, columns: Floats) -> Law:
        *own, kappa = columns
        return cls(*own, kappa=kappa)

    def __repr__(self) -> str:
        names = [p["name"] for p in self._row()["parameters"]]
        words = [f"{name}={shown(column)}" for name, column in zip(names, self.parameters.T, strict=True)]
        return f"{type(self).__name__}({', '.join(words)})"


def _within(law: str, parameter: dict[str, Any], column: Floats) -> None:
    """Raise `VisceraError` for values outside the bounds of the core's row."""
    unit = "" if parameter["unit"] == "1" else f" [{parameter['unit']}]"
    if parameter["above"] is not None:
        require(law, parameter["name"], column, column > parameter["above"], f"must be positive{unit}")
    if parameter["low"] is not None:
        low, high = parameter["low"], parameter["high"]
        require(
            law, parameter["name"], column, (column >= low) & (column <= high), f"must lie between {low:g} and {high:g}"
        )
