"""The laws as families to fit: coefficients that the energy is linear in, exponents that it is not, and their bounds.

For given exponents a fit of the coefficients is a linear least-squares problem with bounds, solved exactly; only the
exponents are searched (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from viscera.errors import VisceraError, did_you_mean
from viscera.law import (
    ArrudaBoyce,
    Fung,
    Law,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    SaintVenantKirchhoff,
    StableNeoHookean,
    VerondaWestmann,
    Yeoh,
)
from viscera.mesh import Floats

INFINITE = float("inf")
LEAST_EXPONENT = 1e-3
"""Size of an exponent of Ogden's law that the fit would take to zero. The stress is then within 1e-3 of its limit, that
of the logarithmic strain; the energy, a difference over the square of the exponent, keeps half of its digits."""
NEXT_TO_ZERO = 1e-5
"""Size of such an exponent in a trial, whose energy nothing asks for."""

Make = Callable[[Floats, Floats, float], Law]
"""Coefficients, exponents and Poisson's ratio to a law."""


@dataclass(frozen=True)
class Family:
    """A law with parameters to be found."""

    name: str
    coefficients: tuple[str, ...]
    """Parameters that the energy is linear in [Pa]; for those `of_products` the fit has their products with exponents.
    """
    make: Make
    coefficient_bounds: tuple[tuple[float, float], ...]
    exponents: tuple[str, ...] = ()
    """The other parameters."""
    exponent_bounds: tuple[tuple[float, float], ...] = ()
    starts: Sequence[Sequence[float]] = field(default_factory=lambda: [[]])
    """Exponents to begin the search with."""
    of_products: bool = False
    """Whether the coefficients of a fit are the products of the law's own with its exponents: of Ogden's `mu_p alpha_p`
    the stress is a smooth function of the exponents, also where they change their sign."""
    admits: Callable[[Floats], bool] | None = None
    """Whether the law takes the best coefficients although they lie beyond their bounds; of none, it never does."""

    @property
    def names(self) -> tuple[str, ...]:
        """All parameters."""
        return (*self.coefficients, *self.exponents)

    def basis(self, exponents: Floats, poisson: float) -> list[tuple[Law, Law | None]]:
        """Laws whose stresses, the second's taken from the first's, are those of unit coefficients."""
        first, *others = np.eye(len(self.coefficients))
        base = self.make(first, exponents, poisson)
        return [(base, None), *((self.make(first + other, exponents, poisson), base) for other in others)]

    def settled(self, exponents: Floats) -> Floats:
        """Exponents of a law for those of a fit: no product is divided by next to nothing."""
        return _off_zero(exponents, LEAST_EXPONENT) if self.of_products else exponents

    def own(self, coefficients: Floats, exponents: Floats) -> Floats:
        """The law's own parameters (p,) for coefficients and exponents of a fit."""
        return np.concatenate([coefficients / exponents if self.of_products else coefficients, exponents])

    def of_vanishing(self, intervals: Mapping[str, tuple[float, float] | None]) -> dict[str, str]:
        """Coefficients of a term whose exponent may be zero by its interval, and that exponent, by name.

        There a test determines the product of both, and nothing of the coefficient alone.
        """
        pairs = zip(self.coefficients, self.exponents, strict=True) if self.of_products else ()
        bands = ((coefficient, exponent, intervals[exponent]) for coefficient, exponent in pairs)
        return {
            coefficient: exponent
            for coefficient, exponent, band in bands
            if band is not None and band[0] <= LEAST_EXPONENT and band[1] >= -LEAST_EXPONENT
        }

    def in_own(self, derivatives: Floats, own: Floats) -> Floats:
        """Derivatives (points, p) in the law's own parameters, from those in coefficients and exponents of a fit."""
        if not self.of_products:
            return derivatives
        (moduli, exponents), (by_product, by_exponent) = np.split(own, 2), np.split(derivatives, 2, axis=1)
        return np.column_stack([by_product * exponents, by_exponent + by_product * moduli])


def family(law: type[Law] | str, terms: int | None = None) -> Family:
    """The family of a law by its class or name; `terms` of Yeoh's cubic (1 to 3) or of Ogden's sum (1 to 3)."""
    name = law if isinstance(law, str) else getattr(law, "__name__", repr(law))
    if name not in FAMILIES:
        raise VisceraError(f"no law {name!r} to fit; {did_you_mean(name, FAMILIES)}")
    largest, default, build = FAMILIES[name]
    is_whole = isinstance(terms, int | np.integer) and not isinstance(terms, bool)
    if terms is not None and largest == 1 and terms != 1:
        raise VisceraError(f"{name} has no terms to choose; leave terms={terms} out")
    if terms is not None and (not is_whole or terms not in range(1, largest + 1)):
        raise VisceraError(f"{name} has 1 to {largest} terms, got {terms}")
    return build(terms or default)


def _shear_and_bulk(mu: float, poisson: float) -> dict[str, float]:
    return {"mu": mu, "lam": 2.0 * mu * poisson / (1.0 - 2.0 * poisson)}


def _neo_hookean(_: int) -> Family:
    make: Make = lambda c, _, nu: NeoHookean(**_shear_and_bulk(c[0], nu))  # noqa: E731
    return Family("NeoHookean", ("mu",), make, ((0.0, INFINITE),))


def _saint_venant_kirchhoff(_: int) -> Family:
    make: Make = lambda c, _, nu: SaintVenantKirchhoff(**_shear_and_bulk(c[0], nu))  # noqa: E731
    return Family("SaintVenantKirchhoff", ("mu",), make, ((0.0, INFINITE),))


def _mooney_rivlin(_: int) -> Family:
    def make(c: Floats, _: Floats, nu: float) -> Law:
        shear = 2.0 * (c[0] + c[1])
        return MooneyRivlin(c[0], c[1], kappa=2.0 / 3.0 * shear * (1.0 + nu) / (1.0 - 2.0 * nu), volumetric="J-1")

    # Fits to compression often have a negative c1; the law takes it while the shear modulus is positive. Else both are
    # kept positive; a millipascal is none in any tissue.
    bounds = ((1e-3, INFINITE), (0.0, INFINITE))
    return Family("MooneyRivlin", ("c1", "c2"), make, bounds, admits=lambda c: float(c.sum()) > 1e-3)


def _yeoh(terms: int) -> Family:
    names = ("c10", "c20", "c30")[:terms]
    bounds = ((0.0, INFINITE), (-INFINITE, INFINITE), (0.0, INFINITE))[:terms]
    return Family("Yeoh", names, lambda c, _, nu: Yeoh(*c, poisson=nu), bounds)


def _ogden(terms: int) -> Family:
    """Every mu_p alpha_p positive: sufficient for stability (Hill 1978)."""

    def make(products: Floats, alpha: Floats, nu: float) -> Law:
        alpha = _off_zero(alpha, NEXT_TO_ZERO)
        return Ogden(list(products / alpha), list(alpha), poisson=nu)

    grid = (-8.0, -3.0, 2.0, 5.0, 12.0)
    alphas = tuple(f"alpha{p + 1}" for p in range(terms))
    return Family(
        "Ogden",
        tuple(f"mu{p + 1}" for p in range(terms)),
        make,
        ((0.0, INFINITE),) * terms,
        alphas,
        ((-30.0, 30.0),) * terms,
        [list(alpha) for alpha in combinations(grid, terms)],
        of_products=True,
    )


def _off_zero(exponents: Floats, least: float) -> Floats:
    """The exponents, those of a smaller size moved to the least."""
    return np.where(np.abs(exponents) < least, np.copysign(least, exponents), exponents)


def _stable_neo_hookean(_: int) -> Family:
    make: Make = lambda c, _, nu: StableNeoHookean(**_shear_and_bulk(c[0], nu))  # noqa: E731
    return Family("StableNeoHookean", ("mu",), make, ((0.0, INFINITE),))


def _exponential(
    law: type[ArrudaBoyce | VerondaWestmann | Fung], names: tuple[str, str], bounds: tuple[float, float]
) -> Family:
    """One modulus, and one number that says how fast the tissue stiffens."""
    low, high = bounds
    return Family(
        law.__name__,
        names[:1],
        lambda c, stiffening, nu: law(c[0], stiffening[0], poisson=nu),
        ((0.0, INFINITE),),
        names[1:],
        (bounds,),
        [[float(start)] for start in np.geomspace(max(low, 0.05), high / 2.0, 4)],
    )


FAMILIES: dict[str, tuple[int, int, Callable[[int], Family]]] = {
    "NeoHookean": (1, 1, _neo_hookean),
    "SaintVenantKirchhoff": (1, 1, _saint_venant_kirchhoff),
    "MooneyRivlin": (1, 1, _mooney_rivlin),
    "Yeoh": (3, 3, _yeoh),
    "Ogden": (3, 2, _ogden),
    "StableNeoHookean": (1, 1, _stable_neo_hookean),
    "ArrudaBoyce": (1, 1, lambda _: _exponential(ArrudaBoyce, ("mu", "lambda_m"), (1.0, 20.0))),
    "VerondaWestmann": (1, 1, lambda _: _exponential(VerondaWestmann, ("c1", "c2"), (1e-3, 100.0))),
    "Fung": (1, 1, lambda _: _exponential(Fung, ("mu", "b"), (1e-3, 100.0))),
}
