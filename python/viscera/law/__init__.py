"""Constitutive laws with their parameters as the field gives them; the energies themselves live in the compiled core.

A parameter is a number for the whole organ or an array (m,), one value per cell (a stiff nodule in a soft organ).
Invariants: I1 = tr C, I2 = (tr^2 C - tr C^2) / 2, J = det F, with C = F^T F and E = (C - I) / 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.law.base import ROWS, Law
from viscera.law.formula import StrainEnergy
from viscera.law.holzapfel_gasser_ogden import HolzapfelGasserOgden
from viscera.law.isochoric import ArrudaBoyce, Fung, MooneyRivlin, Ogden, VerondaWestmann, Yeoh
from viscera.law.of_row import OfRow
from viscera.law.several import Several
from viscera.law.two_moduli import Corotated, Linear, NeoHookean, SaintVenantKirchhoff, StableNeoHookean, TwoModuli
from viscera.quantity import Choice

__all__ = [
    "LAWS",
    "OF_TWO_MODULI",
    "ROWS",
    "ArrudaBoyce",
    "Corotated",
    "Fung",
    "HolzapfelGasserOgden",
    "Law",
    "Linear",
    "MooneyRivlin",
    "NeoHookean",
    "OfRow",
    "Ogden",
    "SaintVenantKirchhoff",
    "Several",
    "StableNeoHookean",
    "StrainEnergy",
    "TwoModuli",
    "VerondaWestmann",
    "Yeoh",
    "from_core",
    "named",
]

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
OF_TWO_MODULI = tuple(name for name, law in LAWS.items() if issubclass(law, TwoModuli))
"""Laws that are made from Young's modulus and Poisson's ratio."""


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
    kind = next((law for law in (StrainEnergy, Several) if name.startswith(law.prefix)), kind)
    if kind is None or len(table) != len(_core.law_parameters(name)):
        raise VisceraError(f"the model's law {name!r} with {len(table)} parameters is not known to this version")
    return kind._of_columns(name, table)
