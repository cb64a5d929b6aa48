"""A law of your own, as a formula."""

from __future__ import annotations

import logging
import re
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError, did_you_mean
from viscera.fibres import directions
from viscera.law.base import Law
from viscera.mesh import Floats
from viscera.parameters import columns, shown
from viscera.quantity import refused

log = logging.getLogger("viscera")

COMPONENTS = tuple(f"a{family}{axis}" for family in range(2) for axis in "xyz")
"""Names of the columns with the directions of fibres."""
OF_FIBRES = re.compile(r"\bI[46]\b")
"""The invariants of fibres in a formula."""


class StrainEnergy(Law):
    """A strain energy of your own, as a formula. It needs no compiler and can be used like every other law.

    energy [J/m^3]: text in `I1`, `I2`, `J`, the isochoric `I1bar` = I1 J^(-2/3) and `I2bar` = I2 J^(-4/3), and with
    fibres `I4` and `I6`, |F a|^2 along the first and second direction; `+ - * / **`, `exp`, `log`, `sqrt`, `max`,
    `min`, `step` (1 where positive, else 0), and numbers. Every other name is a parameter: a number, or an array (m,)
    over cells. fibres: two directions (2, 3), or (2, m, 3) over cells.

    Stress, tangent and power series are derived from the formula exactly. The stress at rest must vanish. `young` and
    `poisson` are those at small strain. Raises `VisceraError` for text that is not a formula (the error shows where),
    for a parameter without a value, for a stress at rest, and for moduli that are not positive. A warning is logged,
    once for a law, if the energy stays bounded as J -> 0, since strong pressure then crushes cells.

    >>> law = StrainEnergy("mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2", mu=1e3, lam=4e3)
    >>> law
    StrainEnergy('mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2', mu=1000, lam=4000)
    >>> float(law.young.round()[0]), float(law.poisson.round(2)[0])
    (2800.0, 0.4)
    """

    prefix: ClassVar[str] = "formula "

    def __init__(self, energy: str | None = None, /, *, fibres: ArrayLike | None = None, **parameters: Any) -> None:
        if energy is None:  # by its name, as case files give it; beside a formula, that is the name of a parameter
            energy = parameters.pop("energy", None)
        if not isinstance(energy, str):
            raise refused(
                "StrainEnergy: the energy", "a formula, such as 'mu/2*(I1bar - 3) + kappa/2*(J - 1)**2'", energy
            )
        # Half a letter of UTF-16 is no text for the core, which says of its escape where it stands.
        written = energy.encode("utf-8", "backslashreplace").decode("utf-8")
        name = self.prefix + " ".join(written.split())
        families = self._take_name(name)
        if "fibres" in self.names:
            raise VisceraError("StrainEnergy: 'fibres' names the directions of fibres; call the parameter otherwise")
        for key in parameters:
            if key not in self.names:
                raise VisceraError(
                    f"StrainEnergy: the formula has no parameter {key!r}; {did_you_mean(key, self.names)}"
                )
        missing = [key for key in self.names if key not in parameters]
        if missing:
            raise VisceraError(
                f"StrainEnergy: the formula has a parameter {missing[0]!r}; give its value, {missing[0]}="
            )
        if fibres is None and families > 0:
            raise VisceraError("StrainEnergy: the formula uses I4 or I6: give two directions, fibres=")
        # With a coefficient of 0, as for a comparison without fibres, it names what it does not use.
        if fibres is not None and not OF_FIBRES.search(self.formula):
            raise VisceraError("StrainEnergy: the formula uses no I4 and no I6: leave fibres out")
        axes = {} if fibres is None else {f"fibre {f + 1}{axis}": x for f, axis, x in directions(fibres)}
        used = dict(list(axes.items())[: 3 * families])
        own = columns("StrainEnergy", **{key: parameters[key] for key in self.names}, **used)
        super().__init__(name, np.column_stack(own))
        # Here alone: whoever made the law is told, and not again for what is computed with it.
        if not all(self.core().resists_collapse()):
            log.warning(
                "StrainEnergy: the energy stays bounded as J -> 0, so strong pressure can crush cells; a term such as "
                "log(J)**2 resists it"
            )

    @property
    def words(self) -> dict[str, Any]:
        """The arguments that make the law from a single set of parameters, as in a case file."""
        if taken := next((name for name in self.names if name in {"law", "energy"}), None):
            raise VisceraError(f"StrainEnergy: {taken!r} is a key of every case file; call the parameter otherwise")
        row = self.parameters[0].tolist()
        values = {"energy": self.formula, **dict(zip(self.names, row, strict=False))}
        components = row[len(self.names) :]
        return values | ({"fibres": [components[:3], components[-3:]]} if components else {})

    @classmethod
    def _of_columns(cls, name: str, columns: Floats) -> Law:
        law = cls.__new__(cls)
        law._take_name(name)
        Law.__init__(law, name, columns.T.copy())
        law.core()  # refuses parameters that the formula has no sound energy for
        return law

    def _take_name(self, name: str) -> int:
        """Keep the formula and the names of its parameters; the number of families of fibres, 0 to 2, comes back."""
        self.formula = name.removeprefix(self.prefix)
        names = _core.law_parameters(name)
        families = sum(key in COMPONENTS for key in names) // 3
        self.names = tuple(names[: len(names) - 3 * families])
        return families

    @property
    def stresses(self) -> tuple[int, ...]:
        """The parameters to which, together, the energy is proportional; raises `VisceraError` if there are none."""
        return tuple(self.core().stresses())

    @property
    def is_analytic(self) -> bool:
        """Whether the formula is without `max`, `min` and `step`, which might switch at rest."""
        return not any(f"{word}(" in self.formula.replace(" ", "") for word in ("max", "min", "step"))

    def __repr__(self) -> str:
        values = zip(self.names, self.parameters.T, strict=False)
        return f"StrainEnergy({self.formula!r}, {', '.join(f'{key}={shown(column)}' for key, column in values)})"
