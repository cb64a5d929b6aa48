"""Laws in the testing machine: closed forms of incompressible solids, and pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.curves import MODES, curve
from viscera.law import Law

Floats = NDArray[np.float64]
KAPPA = 1e6  # against shear moduli of about 1: incompressible to 1e-5
FIBRES = [(1.0, 1.0, 0.0), (1.0, -1.0, 0.0)]  # both axes are alike


def invariants(stretches: Floats) -> tuple[Floats, Floats]:
    squares = stretches**2
    return squares.sum(axis=0), (1.0 / squares).sum(axis=0)


def mooney_rivlin(stretches: Floats) -> Floats:
    I1, I2 = invariants(stretches)
    return 0.4 * (I1 - 3.0) + 0.1 * (I2 - 3.0)


def yeoh(stretches: Floats) -> Any:
    x = invariants(stretches)[0] - 3.0
    return 0.5 * x + 0.2 * x**2 + 0.1 * x**3


def ogden(stretches: Floats) -> Any:
    terms = [(0.6, 2.6), (0.05, 8.0), (-0.1, -4.2)]
    return np.sum([mu / a * ((stretches**a).sum(axis=0) - 3.0) for mu, a in terms], axis=0)


def artery(stretches: Floats) -> Floats:
    """Both families alike, in the plane of the axes 1 and 2; only where they are stretched."""
    I1, _ = invariants(stretches)
    I4 = 0.5 * (stretches[0] ** 2 + stretches[1] ** 2)
    E = np.maximum(0.1 * (I1 - 3.0) + 0.7 * (I4 - 1.0), 0.0)
    return np.asarray(0.5 * (I1 - 3.0) + 2 * 0.8 / (2 * 0.9) * (np.exp(0.9 * E**2) - 1.0))


PAIRS: list[tuple[Law, Callable[[Floats], Floats]]] = [
    (vs.MooneyRivlin(0.4, 0.1, KAPPA), mooney_rivlin),
    (vs.Yeoh(0.5, 0.2, 0.1, kappa=KAPPA), yeoh),
    (vs.Ogden([0.6, 0.05, -0.1], [2.6, 8.0, -4.2], kappa=KAPPA), ogden),
]
ARTERY = vs.HolzapfelGasserOgden(1.0, 0.8, 0.9, dispersion=0.1, fibres=FIBRES, kappa=KAPPA)
STRETCHES: dict[str, Callable[[Floats], Floats]] = {
    "uniaxial": lambda a: np.array([a, a**-0.5, a**-0.5]),
    "equibiaxial": lambda a: np.array([a, a, a**-2.0]),
    "pure shear": lambda a: np.array([a, np.ones_like(a), 1 / a]),
    "simple shear": lambda a: np.array(
        [a / 2 + np.sqrt(1 + a**2 / 4), np.ones_like(a), -a / 2 + np.sqrt(1 + a**2 / 4)]
    ),
}
"""The principal stretches of an incompressible solid by the parameter of each deformation."""


def power(energy: Callable[[Floats], Floats], mode: str, parameter: Floats) -> Floats:
    """Nominal stress: the energy's derivative by the parameter, by central differences, shared by the driven axes."""
    h = 1e-5
    slope = (energy(STRETCHES[mode](parameter + h)) - energy(STRETCHES[mode](parameter - h))) / (2 * h)
    return np.asarray(slope / len(MODES[mode].driven))


@pytest.mark.parametrize(("law", "energy"), PAIRS, ids=lambda pair: getattr(pair, "name", ""))
@pytest.mark.parametrize("mode", MODES)
def test_curves_are_those_of_the_incompressible_solid(law: Law, energy: Callable[..., Floats], mode: str) -> None:
    parameter, stress = curve(law, mode, (0.0, 1.0) if mode == "simple shear" else (0.7, 1.5))
    assert len(parameter) == len(stress) >= 41
    assert stress == pytest.approx(power(energy, mode, parameter), rel=1e-4, abs=1e-4)


def test_curves_of_an_artery() -> None:
    """In the plane of the fibres, and against the ground substance alone."""
    for mode in ("equibiaxial", "pure shear"):
        parameter, stress = curve(ARTERY, mode, (0.8, 1.4))
        assert stress == pytest.approx(power(artery, mode, parameter), rel=1e-3, abs=1e-3), mode
    bare = vs.HolzapfelGasserOgden(1.0, 1e-9, 0.9, fibres=FIBRES, kappa=KAPPA)
    (_, pulled), (_, soft) = (curve(law, "uniaxial", (0.99, 1.3)) for law in (ARTERY, bare))
    assert pulled[-1] > 1.3 * soft[-1]


def test_a_curve_ends_where_the_law_is_crushed() -> None:
    """Saint Venant-Kirchhoff in equibiaxial tension: no thickness is left at sqrt(1 + (1 - nu) / (2 nu))."""
    parameter, _ = curve(vs.SaintVenantKirchhoff(young=1.0, poisson=0.45), "equibiaxial", (0.9, 2.0))
    assert parameter[-1] == pytest.approx(np.sqrt(1 + 0.55 / 0.9), abs=0.03)


@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "pure shear"])
@pytest.mark.parametrize("stretch", [(0.2, 4.0), (0.02, 6.0)])
def test_a_curve_goes_on_though_what_is_free_moves_far(mode: str, stretch: tuple[float, float]) -> None:
    """A neo-Hookean solid has a state at every stretch; the thickness at 0.02 is 2500 in equibiaxial compression."""
    law = vs.NeoHookean(mu=1e3, lam=5e5)
    parameter, stress = curve(law, mode, stretch)
    assert parameter[[0, -1]].tolist() == list(stretch)
    formula = {  # of the incompressible solid
        "uniaxial": lambda a: a - a**-2,
        "equibiaxial": lambda a: a - a**-5,
        "pure shear": lambda a: a - a**-3,
    }[mode](4.0 if stretch[1] == 4.0 else 6.0)
    assert stress[-1] == pytest.approx(1e3 * formula, rel=0.05)
    assert (np.diff(stress) > 0.0).all()


def test_a_fit_with_a_bulk_modulus_reaches_far_points() -> None:
    """Two points of a compression to a tenth, with nothing between rest and them."""
    law, stretch = vs.NeoHookean(mu=1e3, lam=5e5), [0.1, 1.0]
    parameter, stress = curve(law, "equibiaxial", (0.1, 1.1))
    test = vs.MaterialTest("equibiaxial", stretch, [stress[0], 0.0])
    assert parameter[0] == 0.1
    found = vs.fit(vs.NeoHookean, test, poisson=float(law.poisson[0]), incompressible=False)
    assert found.parameters["mu"] == pytest.approx(1e3, rel=1e-6)


@pytest.mark.parametrize(
    ("mode", "stretch", "words"),
    [
        ("uniaxail", (0.5, 2.0), "did you mean 'uniaxial'"),
        ("uniaxial", (1.1, 2.0), "must hold the state of rest, 1"),
        ("uniaxial", (0.0, 2.0), "stretches must be positive, got 0"),
        ("uniaxial", (0.5,), r"range of a curve must be two finite numbers, such as \(0.6, 1.6\), got \(0.5,\)"),
        ("uniaxial", "ab", "range of a curve must be two finite numbers"),
        ("uniaxial", (0.5, np.inf), "range of a curve must be two finite numbers"),
        (None, (0.5, 2.0), "the deformation None is unknown; known: 'equibiaxial'"),
    ],
)
def test_curves_that_are_refused(mode: Any, stretch: Any, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        curve(vs.NeoHookean(young=1.0, poisson=0.3), mode, stretch)


def test_laws_are_drawn_together(tmp_path: Path) -> None:
    soft, stiff = vs.NeoHookean(young=[1e3, 2e3], poisson=0.4), vs.NeoHookean(young=1e4, poisson=0.4)
    figure = soft.plot(stiff, vs.Yeoh(500.0, poisson=0.4), stretch=(0.8, 1.2), cell=0, path=tmp_path / "laws.png")
    assert (tmp_path / "laws.png").read_bytes().startswith(b"\x89PNG")
    uniaxial = figure.axes[0]
    heights = [np.asarray(line.get_ydata())[-1] for line in uniaxial.lines[:3]]
    assert heights[1] == pytest.approx(10 * heights[0], rel=1e-6)
    assert uniaxial.get_ylabel() == "nominal stress [kPa]"
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[2] == "Yeoh"
    assert labels[0] != labels[1], "two laws of a kind are told apart"
