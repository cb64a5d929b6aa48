"""The laws with two moduli."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from viscera.errors import VisceraError
from viscera.law.base import Law
from viscera.mesh import Floats
from viscera.parameters import columns, require, shown
from viscera.quantity import brief


class TwoModuli(Law):
    """Base of the laws with two moduli: Young's modulus and Poisson's ratio, or the Lamé constants."""

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
    J <= 0 is allowed: the energy of an inverted cell is finite and smooth, and the cell recovers. In exchange, nothing
    keeps a cell from being crushed. Smith, de Goes and Kim, ACM Trans. Graph. 37 (2018) 12, equation 14.

    >>> StableNeoHookean(young=3e3, poisson=0.45)
    StableNeoHookean(mu=1034.48, lam=9310.34)
    """

    core_names = ("stable_neo_hookean",)
