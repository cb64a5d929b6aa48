"""The law of arteries: two families of fibres in a soft ground substance."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from viscera.fibres import directions
from viscera.law.base import Law
from viscera.mesh import Floats
from viscera.parameters import bulk_modulus, columns, compressibility, require, shown
from viscera.quantity import Flag


class HolzapfelGasserOgden(Law):
    """psi = c / 2 (I1' - 3) + kappa / 2 (J - 1)^2 + sum_i k1 / (2 k2) (exp(k2 E_i^2) - 1), fibre families i = 1, 2.

    E_i = d (I1' - 3) + (1 - 3 d) (I4_i' - 1), with I1' = I1 J^(-2/3) and I4_i' = |F a_i|^2 J^(-2/3).
    c: shear modulus of the ground substance [Pa]; k1 [Pa] and k2: stiffness of the fibres and how fast they stiffen;
    fibres: the directions a_i (2, 3), or (2, m, 3) over cells, of any length (`helical_fibres` makes them);
    dispersion d from 0 (parallel) to 1/3 (isotropic); kappa (the bulk modulus) [Pa], or poisson, Poisson's ratio of the
    ground substance. Fibres bear no compression: a family counts only where E_i >= 0. A power series cannot follow this
    switch, so a reduced model about rest needs the analytic variant bear_compression=True; statics needs no variant.
    Holzapfel, Gasser and Ogden, J. Elasticity 61 (2000) 1; Gasser, Ogden and Holzapfel, J. R. Soc. Interface 3 (2006)
    15. Raises `VisceraError` for moduli that are not positive, a dispersion outside 0..1/3, and a fibre of length 0.

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
