"""Laws in the isochoric invariants or stretches, with a bulk modulus of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike

from viscera.errors import VisceraError
from viscera.law.base import Law
from viscera.law.of_row import OfRow
from viscera.mesh import Floats
from viscera.parameters import bulk_modulus, columns, compressibility, require, shown
from viscera.quantity import Choice


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
    core_names = tuple(f"mooney_rivlin {form}" for form in bulk_moduli_per_alpha)

    def __init__(
        self,
        c1: ArrayLike,
        c2: ArrayLike,
        kappa: ArrayLike | None = None,
        *,
        alpha: ArrayLike | None = None,
        volumetric: str = "J^2-1",
    ) -> None:
        Choice(self.bulk_moduli_per_alpha)(volumetric, "MooneyRivlin: the volumetric form")
        if alpha is not None and kappa is None:
            (penalty,) = columns("MooneyRivlin", alpha=alpha)
            kappa = penalty * self.bulk_moduli_per_alpha[volumetric]
        elif kappa is None or alpha is not None:
            raise VisceraError("MooneyRivlin takes either kappa or alpha")
        first, second, bulk = columns("MooneyRivlin", c1=c1, c2=c2, kappa=kappa)
        require("MooneyRivlin", "c1 + c2", first + second, first + second > 0.0, "must be positive [Pa]")
        require("MooneyRivlin", "the bulk modulus", bulk, bulk > 0.0, "must be positive [Pa]")
        super().__init__(f"mooney_rivlin {volumetric}", np.column_stack([first, second, bulk]))
        self.volumetric: Final = volumetric

    @classmethod
    def _of_columns(cls, name: str, columns: Floats) -> Law:
        return cls(*columns, volumetric=name.removeprefix("mooney_rivlin "))

    def __repr__(self) -> str:
        c1, c2, kappa = (shown(column) for column in self.parameters.T)
        return f"MooneyRivlin(c1={c1}, c2={c2}, kappa={kappa}, volumetric={self.volumetric!r})"


class Yeoh(OfRow):
    """psi = sum_i c_i0 (I1 J^(-2/3) - 3)^i + kappa / 2 (J - 1)^2, i = 1..3: stiffens with stretch.

    c10, c20, c30 [Pa], and kappa (the bulk modulus) [Pa] or poisson, Poisson's ratio at small strain. The shear modulus
    there is 2 c10. Yeoh, Rubber Chem. Technol. 66 (1993) 754. Raises `VisceraError` unless c10 > 0 and kappa > 0.

    >>> Yeoh(c10=500.0, c20=200.0, poisson=0.45)
    Yeoh(c10=500, c20=200, c30=0, kappa=9666.67)
    """

    core_names = ("yeoh",)


class ArrudaBoyce(OfRow):
    """psi = m sum_i C_i lambda_m^(2 - 2 i) (I1'^i - 3^i) + kappa / 2 (J - 1)^2, i = 1..5, with I1' = I1 J^(-2/3).

    C = 1/2, 1/20, 11/1050, 19/7000, 519/673750: the series of eight chains that lock at the stretch lambda_m. mu [Pa]
    is the shear modulus at small strain (m follows from it), kappa [Pa] the bulk modulus, or poisson. Arruda and Boyce,
    J. Mech. Phys. Solids 41 (1993) 389. Raises `VisceraError` unless all are positive.

    >>> ArrudaBoyce(1e3, 1.5, kappa=1e5)
    ArrudaBoyce(mu=1000, lambda_m=1.5, kappa=100000)
    """

    core_names = ("arruda_boyce",)


class VerondaWestmann(OfRow):
    """psi = c1 (exp(c2 (I1' - 3)) - 1) - c1 c2 / 2 (I2' - 3) + kappa / 2 (J - 1)^2: skin.

    I1' = I1 J^(-2/3), I2' = I2 J^(-4/3). c1 [Pa], c2, and kappa (the bulk modulus) [Pa] or poisson. The shear modulus
    at small strain is c1 c2. Veronda and Westmann, J. Biomech. 3 (1970) 111. Raises `VisceraError` unless all are
    positive.

    >>> VerondaWestmann(2e3, 1.5, poisson=0.45)
    VerondaWestmann(c1=2000, c2=1.5, kappa=29000)
    """

    core_names = ("veronda_westmann",)


class Fung(OfRow):
    """psi = mu / (2 b) (exp(b (I1' - 3)) - 1) + kappa / 2 (J - 1)^2, with I1' = I1 J^(-2/3): exponential stiffening.

    mu: shear modulus at small strain [Pa]; b: coefficient in the exponent; kappa (the bulk modulus) [Pa] or poisson.
    Demiray, J. Biomech. 5 (1972) 309; Humphrey, Cardiovascular Solid Mechanics (2002). Raises `VisceraError` unless all
    are positive.

    >>> Fung(mu=1e3, b=4.0, kappa=1e5)
    Fung(mu=1000, b=4, kappa=100000)
    """

    core_names = ("fung",)


class Ogden(Law):
    """psi = sum_p mu_p / alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) + kappa / 2 (J - 1)^2.

    l_i = J^(-1/3) lambda_i are the isochoric principal stretches. mu [Pa] and alpha: one entry for each of up to three
    terms, an entry being a number or an array (m,) over cells; or one number for a single term. kappa (the bulk
    modulus) [Pa] or poisson. The shear modulus at small strain is sum(mu_p alpha_p) / 2: codes that write
    2 mu / alpha^2 in front of the stretches mean mu_p = 2 mu / alpha here. Exact to round-off for isochoric stretches
    from 1/5 to 5. Ogden, Proc. R. Soc. Lond. A 326 (1972) 565. Raises `VisceraError` unless the shear and bulk moduli
    are positive.

    >>> Ogden(mu=[500.0, -100.0], alpha=[3.0, -4.0], poisson=0.45)
    Ogden(mu=[500, -100], alpha=[3, -4], kappa=9183.33)
    """

    core_names = ("ogden",)
    terms: ClassVar[int] = 3

    def __init__(
        self,
        mu: ArrayLike | Sequence[ArrayLike],
        alpha: ArrayLike | Sequence[ArrayLike],
        *,
        kappa: ArrayLike | None = None,
        poisson: ArrayLike | None = None,
    ) -> None:
        moduli, exponents = _terms("mu", mu), _terms("alpha", alpha)
        if len(moduli) != len(exponents):
            raise VisceraError(f"Ogden: {len(moduli)} terms in mu but {len(exponents)} in alpha")
        bulk, given = compressibility("Ogden", kappa, poisson)
        names = [f"mu{p + 1}" for p in range(len(moduli))] + [f"alpha{p + 1}" for p in range(len(moduli))]
        parts = dict(zip(names, [*moduli, *exponents], strict=True))
        *both, given = columns("Ogden", **parts, **{bulk: given})
        moduli, exponents = both[: len(moduli)], both[len(moduli) :]
        for name, exponent in zip(names[len(moduli) :], exponents, strict=True):
            require("Ogden", name, exponent, exponent != 0.0, "must not be zero")
        shear = 0.5 * np.einsum("pm,pm->m", moduli, exponents)
        require("Ogden", "the shear modulus, half the sum of mu alpha,", shear, shear > 0.0, "must be positive [Pa]")
        modulus = bulk_modulus("Ogden", bulk, given, shear)
        absent = self.terms - len(moduli)
        moduli += absent * [np.zeros_like(shear)]
        exponents += absent * [np.ones_like(shear)]
        super().__init__("ogden", np.column_stack([*moduli, *exponents, modulus]))

    @classmethod
    def _of_columns(cls, name: str, columns: Floats) -> Law:
        used = [p for p in range(cls.terms) if columns[p].any()]
        return cls([columns[p] for p in used], [columns[cls.terms + p] for p in used], kappa=columns[-1])

    def __repr__(self) -> str:
        words = [shown(column) for column in self.parameters.T]
        used = [p for p in range(self.terms) if self.parameters[:, p].any()]
        mu, alpha = (", ".join(words[start + p] for p in used) for start in (0, self.terms))
        return f"Ogden(mu=[{mu}], alpha=[{alpha}], kappa={words[-1]})"


def _terms(name: str, values: ArrayLike | Sequence[ArrayLike]) -> list[Any]:
    """The terms of a sum: a number stands for a single one."""
    # The dimension of a list is not asked for: numbers may stand beside arrays over cells.
    is_list = isinstance(values, list | tuple) or (isinstance(values, np.ndarray) and values.ndim > 0)
    terms: list[Any] = list(values) if is_list else [values]  # type: ignore[arg-type]
    if not 1 <= len(terms) <= Ogden.terms:
        raise VisceraError(
            f"Ogden: {name} has {len(terms)} terms; give one to {Ogden.terms}, values per cell as one term: [values]"
        )
    return terms
