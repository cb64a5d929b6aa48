"""Constitutive laws with their parameters as the field gives them; the energies themselves live in the compiled core.

A parameter is a number for the whole organ or an array (m,), one value per cell (a stiff nodule in a soft organ).
Invariants: I1 = tr C, I2 = (tr^2 C - tr C^2) / 2, J = det F, with C = F^T F and E = (C - I) / 2.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from inspect import Parameter, Signature
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError, did_you_mean
from viscera.fibres import directions
from viscera.mesh import Floats
from viscera.parameters import bulk_modulus, columns, compressibility, require, shown
from viscera.quantity import Choice, Flag, brief, numbers_of, refused

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "ArrudaBoyce",
    "Corotated",
    "Fung",
    "HolzapfelGasserOgden",
    "Law",
    "Linear",
    "MooneyRivlin",
    "NeoHookean",
    "Ogden",
    "SaintVenantKirchhoff",
    "StableNeoHookean",
    "StrainEnergy",
    "VerondaWestmann",
    "Yeoh",
]

log = logging.getLogger("viscera")

ROWS: dict[str, dict[str, Any]] = {row["name"]: row for row in _core.laws()}
"""What the core knows of each law, by its name there: parameters with meaning, kind, unit, bounds and default."""


class Law:
    """A constitutive law: an energy known to the core by name, and its parameters.

    `parameters` has one row for all cells or one row per cell, in the columns that the core expects.
    """

    core_names: ClassVar[tuple[str, ...]] = ()
    """Its names in the core and in model files."""

    def __init_subclass__(cls) -> None:
        """Raise `VisceraError` for a law written in Python, which the compiled core could not follow."""
        if cls.__module__ != __name__ and (Law in cls.__bases__ or {"energy", "stress", "tangent"} & set(vars(cls))):
            raise VisceraError(
                f"{cls.__name__}: laws are compiled, so the energy of a subclass of Law would not be used; give it as "
                "a formula, StrainEnergy(...), or write it in crates/law/src, as CONTRIBUTING.md shows in 20 lines"
            )

    def __init__(self, name: str, parameters: Floats) -> None:
        self.name = name
        self.parameters = parameters

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

        >>> NeoHookean(young=3e3, poisson=0.45).core().name
        'neo_hookean'
        """
        return _core.Law(self.name, self.parameters)

    @property
    def young(self) -> Floats:
        """Young's modulus at rest [Pa], one value or one per cell: 9 K mu / (3 K + mu)."""
        shear, bulk = self.core().moduli().T
        return np.asarray(9.0 * bulk * shear / (3.0 * bulk + shear))

    @property
    def poisson(self) -> Floats:
        """Poisson's ratio at rest, one value or one per cell: (3 K - 2 mu) / (6 K + 2 mu)."""
        shear, bulk = self.core().moduli().T
        return np.asarray((3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear))

    def energy(self, F: ArrayLike, cell: int = 0) -> Floats:
        """Energy density psi (k,) [J/m^3] of deformation gradients F (k, 3, 3), with the parameters of one cell.

        >>> NeoHookean(young=3e3, poisson=0.45).energy(np.diag([1.1, 1.0, 1.0])[None]).round(2).tolist()
        [52.31]
        """
        return self._of_cell(cell).energy(_gradients(F))

    def stress(self, F: ArrayLike, cell: int = 0) -> Floats:
        """First Piola-Kirchhoff stress P = d psi / dF (k, 3, 3) [Pa].

        >>> NeoHookean(young=3e3, poisson=0.45).stress(np.diag([1.1, 1.0, 1.0])[None]).round(1)[0].tolist()
        [[1004.2, 0.0, 0.0], [0.0, 887.4, 0.0], [0.0, 0.0, 887.4]]
        """
        return self._of_cell(cell).stress(_gradients(F))

    def tangent(self, F: ArrayLike, cell: int = 0) -> Floats:
        """Tangent dP / dF (k, 3, 3, 3, 3) [Pa].

        >>> NeoHookean(young=3e3, poisson=0.45).tangent(np.eye(3)[None])[0, 0, 0, 0, 0].round().item()  # 2 mu + lam
        11379.0
        """
        return self._of_cell(cell).tangent(_gradients(F))

    def curve(self, mode: str, stretch: tuple[float, float] = (0.6, 1.6), cell: int = 0) -> tuple[Floats, Floats]:
        """Stretches (k,) and nominal stress (k,) [Pa] in a homogeneous deformation; see `viscera.curves.curve`.

        >>> stretch, stress = NeoHookean(mu=1e3, lam=1e5).curve("uniaxial", (0.9, 1.2))
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

        stretch: range of stretches, 1 within; cell: whose parameters; a PNG where a path is given.

        >>> figure = NeoHookean(young=3e3, poisson=0.45).plot(Yeoh(c10=500, c20=300, poisson=0.45), path="laws.png")
        """
        from viscera.curves import draw

        return draw([self, *others], stretch=stretch, cell=cell, path=path)

    def _of_cell(self, cell: int) -> _core.Law:
        rows = len(self.parameters)
        if rows > 1 and not 0 <= cell < rows:
            raise VisceraError(f"cell {cell} has no parameters: the law is given for cells 0 to {rows - 1}")
        row = cell if rows > 1 else 0
        return _core.Law(self.name, np.ascontiguousarray(self.parameters[row : row + 1]))


class TwoModuli(Law):
    """The laws with two moduli: Young's modulus and Poisson's ratio, or the Lamé constants."""

    def __init__(
        self,
        *unnamed: ArrayLike,
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
        if unnamed:
            raise VisceraError(
                f"{law} takes its parameters by name, since {brief(unnamed)} could be either pair: "
                "young= and poisson=, or mu= and lam="
            )
        if young is not None and poisson is not None and mu is None and lam is None:
            E, nu = columns(law, young=young, poisson=poisson)
            require(law, "young", E, E > 0.0, "must be positive [Pa]")
            require(law, "poisson", nu, (nu > -1.0) & (nu < 0.5), "must lie above -1 and below 0.5")
            shear, first = E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
        elif mu is not None and lam is not None and young is None and poisson is None:
            shear, first = columns(law, mu=mu, lam=lam)
            require(law, "mu", shear, shear > 0.0, "must be positive [Pa]")
            require(law, "lam", first, first > -2.0 / 3.0 * shear, "must exceed -2 mu / 3 (a positive bulk modulus)")
        else:
            raise VisceraError(f"{law} takes either young and poisson, or mu and lam")
        super().__init__(self.core_names[0], np.column_stack([shear, first]))

    @classmethod
    def _of_columns(cls, name: str, columns: Floats) -> Law:
        return cls(mu=columns[0], lam=columns[1])

    @property
    def mu(self) -> Floats:
        """Shear modulus [Pa], one value or one per cell."""
        return self.parameters[:, 0]

    @property
    def lam(self) -> Floats:
        """First Lamé constant [Pa], one value or one per cell."""
        return self.parameters[:, 1]

    def __repr__(self) -> str:
        return f"{type(self).__name__}(mu={shown(self.mu)}, lam={shown(self.lam)})"


class Linear(TwoModuli):
    """Linear elasticity: psi = mu eps : eps + lam / 2 (tr eps)^2, with eps = sym(F) - I. For small rotations only.

    >>> law = Linear(young=1000.0, poisson=0.25)
    >>> law
    Linear(mu=400, lam=400)
    """

    core_names = ("linear",)


class Corotated(TwoModuli):
    """Linear elasticity in the rotated frame of each cell: psi = mu |S - I|^2 + lam / 2 tr(S - I)^2, with F = R S.

    R is the rotation and S the stretch of the polar decomposition.

    >>> Corotated(young=3e3, poisson=0.45)
    Corotated(mu=1034.48, lam=9310.34)
    """

    core_names = ("corotated",)


class SaintVenantKirchhoff(TwoModuli):
    """psi = mu E : E + lam / 2 (tr E)^2. It weakens in compression and collapses under strong indentation.

    Niroomandi et al., IJNME 96 (2013) 129, section 5.1.

    >>> SaintVenantKirchhoff(young=3e3, poisson=0.45)
    SaintVenantKirchhoff(mu=1034.48, lam=9310.34)
    """

    core_names = ("saint_venant_kirchhoff",)


class NeoHookean(TwoModuli):
    """Compressible neo-Hookean: psi = mu / 2 (I1 - 3) - mu ln J + lam / 2 (ln J)^2.

    Niroomandi et al., IJNME 96 (2013) 129, equation 37.

    >>> NeoHookean(young=0.17e6, poisson=0.48)
    NeoHookean(mu=57432.4, lam=1.37838e+06)
    """

    core_names = ("neo_hookean",)


class StableNeoHookean(TwoModuli):
    """psi = m / 2 (I1 - 3) + l / 2 (J - a)^2 - m / 2 ln(I1 + 1) - psi(rest), with a = 1 + 3 m / (4 l).

    m = 4 mu / 3 and l = lam + 5 mu / 6 make mu and lam, or young and poisson, those of Hooke's law at small strain.
    J <= 0 is allowed: the energy of a cell turned inside out is finite and smooth, and the cell recovers; in exchange
    nothing keeps a cell from being crushed. Smith, de Goes and Kim, ACM Trans. Graph. 37 (2018) 12, equation 14.

    >>> StableNeoHookean(young=3e3, poisson=0.45)
    StableNeoHookean(mu=1034.48, lam=9310.34)
    """

    core_names = ("stable_neo_hookean",)


class OfRow(Law):
    """The laws whose parameters are those of their row in the core, or `poisson` in the place of `kappa`."""

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
        self.volumetric = volumetric

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

    mu: shear modulus at small strain [Pa]; b: how fast it stiffens; kappa (the bulk modulus) [Pa] or poisson. Demiray,
    J. Biomech. 5 (1972) 309; Humphrey, Cardiovascular Solid Mechanics (2002). Raises `VisceraError` unless all are
    positive.

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


class HolzapfelGasserOgden(Law):
    """psi = c / 2 (I1' - 3) + kappa / 2 (J - 1)^2 + sum_i k1 / (2 k2) (exp(k2 E_i^2) - 1), fibre families i = 1, 2.

    E_i = d (I1' - 3) + (1 - 3 d) (I4_i' - 1), with I1' = I1 J^(-2/3) and I4_i' = |F a_i|^2 J^(-2/3).
    c: shear modulus of the ground substance [Pa]; k1 [Pa] and k2: stiffness of the fibres and how fast they stiffen;
    fibres: the directions a_i (2, 3), or (2, m, 3) over cells, of any length (`helical_fibres` makes them);
    dispersion d from 0 (parallel) to 1/3 (isotropic); kappa (the bulk modulus) [Pa], or poisson, Poisson's ratio of the
    ground substance. Fibres bear no compression: a family counts where E_i >= 0, which a power series decides by its
    base state. So the law serves statics; a reduced model about rest needs the analytic variant bear_compression=True.
    Holzapfel, Gasser and Ogden, J. Elasticity 61 (2000) 1; Gasser, Ogden and Holzapfel, J. R. Soc. Interface 3 (2006)
    15. Raises `VisceraError` for moduli that are not positive, a dispersion outside 0..1/3, a fibre of no length.

    >>> HolzapfelGasserOgden(3e3, 2.4e3, 0.84, fibres=[(1, 0, 1), (1, 0, -1)], kappa=1e5)
    HolzapfelGasserOgden(c=3000, k1=2400, k2=0.84, dispersion=0, kappa=100000)
    """

    core_names = ("holzapfel_gasser_ogden", "holzapfel_gasser_ogden both ways")

    def __init__(
        self,
        c: ArrayLike,
        k1: ArrayLike,
        k2: ArrayLike,
        *,
        fibres: ArrayLike,
        dispersion: ArrayLike = 0.0,
        kappa: ArrayLike | None = None,
        poisson: ArrayLike | None = None,
        bear_compression: bool = False,
    ) -> None:
        name = "HolzapfelGasserOgden"
        Flag()(bear_compression, f"{name}: bear_compression")
        bulk, given = compressibility(name, kappa, poisson)
        axes = {f"fibre {family + 1}{axis}": values for family, axis, values in directions(fibres)}
        scalars = {"c": c, "k1": k1, "k2": k2, "dispersion": dispersion, bulk: given}
        *moduli, spread, given, a, b, c_, d, e, f = columns(name, **scalars, **axes)
        for key, column in zip(("c", "k1", "k2"), moduli, strict=True):
            require(name, key, column, column > 0.0, f"must be positive{'' if key == 'k2' else ' [Pa]'}")
        require(name, "dispersion", spread, (spread >= 0.0) & (spread <= 1.0 / 3.0), "must lie between 0 and 1/3")
        modulus = bulk_modulus(name, bulk, given, moduli[0])
        super().__init__(
            "holzapfel_gasser_ogden both ways" if bear_compression else "holzapfel_gasser_ogden",
            np.column_stack([*moduli, spread, modulus, a, b, c_, d, e, f]),
        )

    @classmethod
    def _of_columns(cls, name: str, columns: Floats) -> Law:
        c, k1, k2, dispersion, kappa = columns[:5]
        fibres = np.stack([columns[5:8].T, columns[8:11].T])
        both = name.endswith("both ways")
        return cls(c, k1, k2, fibres=fibres, dispersion=dispersion, kappa=kappa, bear_compression=both)

    @property
    def fibres(self) -> Floats:
        """Unit directions (2, m, 3), m = 1 where they are the same everywhere."""
        return np.stack([self.parameters[:, 5:8], self.parameters[:, 8:11]])

    @property
    def bear_compression(self) -> bool:
        """Whether the fibres bear compression too."""
        return self.name.endswith("both ways")

    def __repr__(self) -> str:
        c, k1, k2, dispersion, kappa = (shown(column) for column in self.parameters.T[:5])
        both = ", bear_compression=True" if self.bear_compression else ""
        return f"HolzapfelGasserOgden(c={c}, k1={k1}, k2={k2}, dispersion={dispersion}, kappa={kappa}{both})"


class StrainEnergy(Law):
    """A strain energy of your own, as a formula: no compiler, and all that the other laws can.

    energy [J/m^3]: text in `I1`, `I2`, `J`, the isochoric `I1bar` = I1 J^(-2/3) and `I2bar` = I2 J^(-4/3), and with
    fibres `I4` and `I6`, |F a|^2 along the first and second direction; `+ - * / **`, `exp`, `log`, `sqrt`, `max`,
    `min`, `step` (1 where positive, else 0), and numbers. Every other name is a parameter: a number, or an array (m,)
    over cells. fibres: two directions (2, 3), or (2, m, 3) over cells.

    Stress, tangent and power series are derived from the formula exactly. The stress at rest must vanish. `young` and
    `poisson` are those at small strain. Raises `VisceraError` for text that is no formula, with the place in it; for a
    parameter without a value; for a stress at rest; for moduli that are not positive. Warns in the log where the energy
    stays bounded as J -> 0, since strong pressure then crushes cells.

    >>> law = StrainEnergy("mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2", mu=1e3, lam=4e3)
    >>> law
    StrainEnergy('mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2', mu=1000, lam=4000)
    >>> float(law.young.round()[0]), float(law.poisson.round(2)[0])
    (2800.0, 0.4)
    """

    prefix: ClassVar[str] = "formula "

    def __init__(self, energy: str, *, fibres: ArrayLike | None = None, **parameters: ArrayLike) -> None:
        if not isinstance(energy, str):
            raise refused(
                "StrainEnergy: the energy", "a formula, such as 'mu/2*(I1bar - 3) + kappa/2*(J - 1)**2'", energy
            )
        self.formula = " ".join(energy.split())
        name = self.prefix + self.formula
        names = _core.law_parameters(name)
        families = sum(key in COMPONENTS for key in names) // 3
        self.names = tuple(names[: len(names) - 3 * families])
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
        if (fibres is None) == (families > 0):
            say = (
                "uses I4 or I6: give two directions, fibres=" if families else "uses no I4 and no I6: leave fibres out"
            )
            raise VisceraError(f"StrainEnergy: the formula {say}")
        axes = {} if fibres is None else {f"fibre {f + 1}{axis}": x for f, axis, x in directions(fibres)}
        used = dict(list(axes.items())[: 3 * families])
        own = columns("StrainEnergy", **{key: parameters[key] for key in self.names}, **used)
        super().__init__(name, np.column_stack(own))
        if not all(self.core().resists_collapse()):
            log.warning(
                "StrainEnergy: the energy stays bounded as J -> 0, so strong pressure can crush cells; a term such as "
                "log(J)**2 resists it"
            )

    @property
    def words(self) -> dict[str, Any]:
        """What makes the law of a single set of parameters, as a case file gives it."""
        row = self.parameters[0].tolist()
        values = {"energy": self.formula, **dict(zip(self.names, row, strict=False))}
        components = row[len(self.names) :]
        return values | ({"fibres": [components[:3], components[-3:]]} if components else {})

    @classmethod
    def _of_columns(cls, name: str, columns: Floats) -> Law:
        names = _core.law_parameters(name)
        families = sum(key in COMPONENTS for key in names) // 3
        own = len(names) - 3 * families
        fibres = None
        if families:
            first = columns[own : own + 3].T
            fibres = np.stack([first, columns[own + 3 :].T if families == 2 else first])
        values = dict(zip(names[:own], columns[:own], strict=True))
        return cls(name.removeprefix(cls.prefix), fibres=fibres, **values)

    @property
    def stresses(self) -> tuple[int, ...]:
        """The parameters that the energy is proportional to together; raises `VisceraError` where there are none."""
        rows, F = self.parameters[:1], _STRAINED
        energy = _core.Law(self.name, rows).energy(F)

        def of(columns: list[int], factor: float) -> Floats:
            scaled = rows.copy()
            scaled[:, columns] *= factor
            return _core.Law(self.name, scaled).energy(F)

        def is_linear(k: int) -> bool:
            try:
                return np.allclose(of([k], 1.02) - energy, energy - of([k], 0.98), rtol=1e-6, atol=1e-13 * energy.max())
            except VisceraError:
                return True  # Not alone, then: stress at rest.

        linear = [k for k in range(len(self.names)) if rows[0, k] != 0.0 and is_linear(k)]
        if not linear or not np.allclose(of(linear, 2.0), 2.0 * energy, rtol=1e-9):
            raise VisceraError(
                f"StrainEnergy({self.formula!r}): which of its parameters scale the energy cannot be told, so no young "
                "can be varied"
            )
        return tuple(linear)

    @property
    def is_analytic(self) -> bool:
        """Whether the formula has no switch (`max`, `min`, `step`), which might turn over at rest."""
        return not any(f"{word}(" in self.formula.replace(" ", "") for word in ("max", "min", "step"))

    def __repr__(self) -> str:
        values = zip(self.names, self.parameters.T, strict=False)
        return f"StrainEnergy({self.formula!r}, {', '.join(f'{key}={shown(column)}' for key, column in values)})"


COMPONENTS = tuple(f"a{family}{axis}" for family in range(2) for axis in "xyz")
"""Columns of the directions of fibres."""
_STRAINED = np.eye(3) + 0.05 * np.sin(np.arange(27.0)).reshape(3, 3, 3)


LAWS: dict[str, type[Law]] = {
    law.__name__: law
    for law in (
        Linear,
        Corotated,
        SaintVenantKirchhoff,
        NeoHookean,
        StableNeoHookean,
        MooneyRivlin,
        Yeoh,
        Ogden,
        ArrudaBoyce,
        VerondaWestmann,
        Fung,
        HolzapfelGasserOgden,
        StrainEnergy,
    )
}


def named(name: str) -> type[Law]:
    """The class of a law by its name in this module, as case files and the command line give it.

    >>> named("NeoHookean")(young=3e3, poisson=0.45)
    NeoHookean(mu=1034.48, lam=9310.34)
    """
    return LAWS[Choice(LAWS)(name, "the law")]


def from_core(name: str, parameters: ArrayLike) -> Law:
    """The law that a model file carries: the core's name and its parameter rows.

    >>> from_core("neo_hookean", [[1e3, 9e3]])
    NeoHookean(mu=1000, lam=9000)
    """
    table = np.atleast_2d(np.asarray(parameters, dtype=float)).T
    kind = next((law for law in LAWS.values() if name in law.core_names), None)
    if name.startswith(StrainEnergy.prefix):
        kind = StrainEnergy
    if kind is None or len(table) != len(_core.law_parameters(name)):
        raise VisceraError(f"the model's law {name!r} with {len(table)} parameters is not known to this version")
    return kind._of_columns(name, table)


def _gradients(F: ArrayLike) -> Floats:
    gradients = numbers_of(F)
    if gradients is None:
        raise refused("deformation gradients", "numbers (k, 3, 3)", F)
    if gradients.ndim != 3 or gradients.shape[1:] != (3, 3):
        raise VisceraError(f"deformation gradients have shape (k, 3, 3), got {gradients.shape}")
    return gradients


def _terms(name: str, values: ArrayLike | Sequence[ArrayLike]) -> list[Any]:
    """The terms of a sum: a number stands for a single one."""
    is_list = isinstance(values, list | tuple | np.ndarray) and np.ndim(values) > 0
    terms: list[Any] = list(values) if is_list else [values]  # type: ignore[arg-type]
    if not 1 <= len(terms) <= Ogden.terms:
        raise VisceraError(
            f"Ogden: {name} has {len(terms)} terms; give one to {Ogden.terms}, values per cell as one term: [values]"
        )
    return terms
