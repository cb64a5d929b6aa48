"""Equilibrium paths: the rational form of a series, and continuation against Newton."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera._core import vector_pade
from viscera.law import Law
from viscera.path import Expansion


def test_pade_is_exact_where_the_truth_is_rational() -> None:
    # u(a) = u0 + a (v + a w) / Q(a) with Q = (1 - a)(1 + a / 2) = 1 - a / 2 - a^2 / 2: Taylor diverges beyond a = 1.
    u0, v, w = np.random.default_rng(0).standard_normal((3, 6))
    u1, u2 = v, w + v / 2
    series = np.array([u0, u1, u2, u2 / 2 + u1 / 2])
    a = 2.0
    truth = u0 + a * (v + a * w) / ((1 - a) * (1 + a / 2))
    assert vector_pade(series, a) == pytest.approx(truth, rel=1e-10)


def test_dependent_coefficients_fall_back_to_the_polynomial() -> None:
    series = np.outer([1.0, 0.5, 0.25, 0.125], np.ones(5))
    assert vector_pade(series, 0.5) == pytest.approx((series * 0.5 ** np.arange(4)[:, None]).sum(axis=0))


def test_an_expansion_knows_its_range() -> None:
    expansion = Expansion(np.zeros((3, 2, 3)), np.array([0.0, 1.0, 0.0]), 0.5, 0.4, 1e-8, is_stable=True)
    assert expansion.at(0.25)[0] == pytest.approx(0.25)
    with pytest.raises(vs.VisceraError, match=r"0 <= a <= 0.5, not at 0.7"):
        expansion.at(0.7)
    with pytest.raises(vs.VisceraError, match=r"the parameter a of an expansion must be a number .*, got 'x'"):
        expansion.at("x")  # type: ignore[arg-type]


@pytest.mark.parametrize("parameter", ["load", "arc length"])
def test_a_path_ends_where_newton_does(bar: vs.Mesh, parameter: str) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    force = {"tip": (0.0, 0.0, -8.0)}
    path = organ.path(force=force, parameter=parameter, until=1.0, tolerance=1e-8)
    load, displacement = path.curve(5)
    assert load[0] == 0.0
    assert load[-1] >= 1.0 - 1e-9
    full = organ.solve(force={"tip": (0.0, 0.0, -8.0 * load[-1])})
    assert full.max_displacement > 0.1, "far beyond the linear range"
    error = np.linalg.norm(displacement[-1] - full.displacement) / np.linalg.norm(full.displacement)
    assert error < 1e-5


def test_a_path_goes_on_where_a_correction_would_turn_a_cell_inside_out() -> None:
    """Under a load far beyond any use, corrections at the end of a long expansion leave the law's domain."""
    beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    path = beam.path(force={"tip": (0.0, 0.0, -1.0)}, parameter="load", until=1e5, max_expansions=40)
    load, displacement = path.curve(3)
    assert load[-1] >= 1e5 * (1.0 - 1e-9), path.message
    full = beam.solve(force={"tip": (0.0, 0.0, -load[-1])})
    assert np.linalg.norm(displacement[-1] - full.displacement) < 1e-4 * np.linalg.norm(full.displacement)


def test_paths_that_are_refused(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    with pytest.raises(vs.VisceraError, match="parameter 'time' is unknown; known: 'arc length', 'load'"):
        organ.path(force={"tip": (0, 0, -1)}, parameter="time")
    for order in (1, 31):
        with pytest.raises(vs.VisceraError, match=f"order must be a whole number from 2 to 30, got {order}"):
            organ.path(force={"tip": (0, 0, -1)}, order=order)
    path = organ.path(force={"tip": (0, 0, -1)}, order=30)
    samples: Any
    for samples in (-1, 1, "a"):
        with pytest.raises(vs.VisceraError, match="samples must be a whole number from 2"):
            path.curve(samples)


USED_UP = "allow more of them (max_expansions), a higher order or a larger tolerance"
FIBRES = [(1.0, 0.3, 0.0), (1.0, -0.3, 0.0)]
SWITCHES = [
    vs.HolzapfelGasserOgden(3e3, 2.4e3, 0.84, fibres=FIBRES, kappa=3e4),
    vs.StrainEnergy(
        "mu/2*(I1bar - 3) + kappa/2*log(J)**2 + k/2*max(I4 - 1, 0)**2", fibres=FIBRES, mu=3e3, kappa=3e4, k=5e3
    ),
]


@pytest.mark.parametrize("law", SWITCHES, ids=["fibres", "max"])
def test_a_path_crosses_the_switches_of_a_law(law: Law) -> None:
    organ = vs.Organ(vs.organs.beam(), law, fixed="clamp", element="P1")
    force = {"tip": (0.0, 0.0, -0.2)}
    path = organ.path(force=force)
    load, displacement = path.curve(3)
    full = organ.solve(force=force)
    assert load[-1] == pytest.approx(1.0, rel=1e-9)
    assert displacement[-1] == pytest.approx(full.displacement, abs=1e-4 * full.max_displacement)
    assert max(expansion.residual for expansion in path.expansions) <= 1e-6, "the tolerance of the path"
    inside = int(np.argmax(load >= 0.3))
    full = organ.solve(force={"tip": (0.0, 0.0, -0.2 * load[inside])})
    assert displacement[inside] == pytest.approx(full.displacement, abs=1e-4 * full.max_displacement)


def test_a_path_that_switches_end_says_so() -> None:
    organ = vs.Organ(vs.organs.beam(), SWITCHES[0], fixed="clamp", element="P1")
    with pytest.raises(vs.VisceraError, match="of 1 after 3 expansions; allow more expansions or a larger tolerance"):
        organ.path(force={"tip": (0.0, 0.0, -0.2)}, max_expansions=3)


def test_a_path_says_why_it_ends_early(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    load = {"tip": (0, 0, -4.0)}
    short, whole = organ.path(force=load, order=2, max_expansions=3), organ.path(force=load)
    assert not short.is_complete
    assert short.load < 0.9
    assert repr(short) == f"Path(3 expansions, load {short.load:.3g}, {short.message})"
    assert short.message.endswith(f"after 3 expansions; {USED_UP}")
    assert whole.is_complete
    assert whole.message == ""
    assert whole.load == pytest.approx(1.0)


@pytest.mark.parametrize("order", [8, 10, 15])
def test_no_limit_point_is_stable(block: Any, order: int) -> None:
    """A pressed column of Saint Venant and Kirchhoff's law: its load has a maximum, where the tangent is singular."""
    mesh = vs.mesh(*block((6, 2, 2), (1.0, 0.2, 0.2)))
    organ = vs.Organ(mesh, vs.SaintVenantKirchhoff(young=1e5, poisson=0.3), fixed="x < 1%")
    path = organ.path(force={"x > 99%": (-400.0, 1.0, 0.0)}, order=order)
    assert path.load == pytest.approx(0.2183, abs=1e-3)
    assert not path.expansions[-1].is_stable
    assert path.message.endswith("unstable or singular there; an arc length passes limit points")


def test_a_path_by_arc_length_that_ends_beyond_a_limit_point_says_why(cube: vs.Mesh) -> None:
    organ = vs.Organ(cube, vs.SaintVenantKirchhoff(young=1e5, poisson=0.3), fixed="bottom")
    path = organ.path(force={"top": (0.0, 0.0, -300.0)}, parameter="arc length", max_expansions=3)
    assert not path.expansions[-1].is_stable
    assert path.message.endswith(f"after 3 expansions; {USED_UP}")


def test_a_path_by_arc_length_that_finds_no_way_on_advises_no_arc_length(block: Any) -> None:
    organ = vs.Organ(
        vs.mesh(*block((6, 2, 2), (1.0, 0.2, 0.2))), vs.SaintVenantKirchhoff(young=1e5, poisson=0.3), fixed="x < 1%"
    )
    path = organ.path(force={"x > 99%": (-400.0, 1.0, 0.0)}, order=8, parameter="arc length")
    assert len(path.expansions) < path.max_expansions
    assert path.message.endswith(
        "unstable or singular there; another path may begin there, to which a small force aside leads"
    )
