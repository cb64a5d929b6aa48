"""Tractions and follower pressure: balance, closed forms of pressurised vessels, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.mesh import Where

Floats = NDArray[np.float64]
SOFT = vs.NeoHookean(young=1e5, poisson=0.3)
INNER, OUTER = 0.01, 0.016
KUHN = np.array([[0, 1, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 3, 2, 7], [0, 6, 4, 7], [0, 5, 1, 7]])


@pytest.fixture(scope="module")
def clamped(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, SOFT, fixed="root")


def test_a_traction_is_a_force_per_area(clamped: vs.Organ) -> None:
    by_traction = clamped.solve(traction={"tip": (100.0, 0.0, -200.0)})
    by_force = clamped.solve(force={"tip": (1.0, 0.0, -2.0)})
    assert by_traction.displacement == pytest.approx(by_force.displacement, abs=1e-12)
    assert by_traction.reaction("root") == pytest.approx([-1.0, 0.0, 2.0], rel=1e-7, abs=1e-8)


def test_reactions_carry_what_the_pressure_leaves(clamped: vs.Organ) -> None:
    """The force of a uniform pressure is that of the flat cap with the surface's rim, wherever the surface goes."""
    state = clamped.solve(pressure={lambda x: x[:, 2] > 0.0999: 300.0})
    assert state.is_converged
    shape = clamped.mesh.points + state.displacement
    top = clamped.mesh.surface[(clamped.mesh.points[clamped.mesh.surface, 2] > 0.0999).all(axis=1)]
    a, b, c = shape[top].transpose(1, 0, 2)
    load = -300.0 * np.cross(b - a, c - a).sum(axis=0) / 2
    assert state.reaction("root") == pytest.approx(-load, rel=1e-6, abs=1e-8)
    assert load[0] < 0.1 * load[2] < 0, "it follows: bent down, the top is pushed back as well"


def test_places_that_overlap_add_up(clamped: vs.Organ) -> None:
    once = clamped.solve(pressure={"tip": 500.0})
    twice = clamped.solve(pressure={"tip": 200.0, lambda x: x[:, 0] > 0.399: 300.0})
    assert twice.displacement == pytest.approx(once.displacement, abs=1e-12)


def test_a_free_rim_converges_too(clamped: vs.Organ) -> None:
    """The load has no potential there, and the tangent is unsymmetric; Newton's convergence is quadratic as ever."""
    state = clamped.solve(pressure={"tip": -3e3, lambda x: x[:, 2] > 0.0999: 200.0})
    assert state.status == "converged"
    before, last = state.residuals[-1][-2:]
    assert last < 1e3 * before**2 + 1e-12
    assert state.iterations < 12


def tube(n_radial: int, n_around: int) -> vs.Mesh:
    """A thick tube along z, one layer high, with its set `lumen`."""
    height = OUTER / n_around
    r = np.linspace(INNER, OUTER, n_radial + 1)
    angle = 2 * np.pi * np.arange(n_around) / n_around
    points = np.array([[x * np.cos(t), x * np.sin(t), z] for z in (0.0, height) for t in angle for x in r])
    number = np.arange(len(points)).reshape(2, n_around, n_radial + 1)
    wrapped = np.concatenate([number, number[:, :1]], axis=1)
    corners = [wrapped[k, j : j + n_around, i : i + n_radial].ravel() for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    cells = np.stack(corners, axis=-1)[:, KUHN].reshape(-1, 4)
    return vs.mesh(points, cells, {"lumen": number[:, :, 0].ravel()})


def inner_radius(mesh: vs.Mesh, pressure: float) -> float:
    """Half the mean inner diameter in plane strain [m]; three components hold the ring and bear nothing."""
    organ = vs.Organ(mesh, SOFT, fixed=[int(mesh.nodes("lumen")[0])])
    plane: dict[Where, Any] = {tuple(range(len(mesh.points))): (None, None, 0.0)}
    far = int(mesh.nodes("lumen")[len(mesh.nodes("lumen")) // 4])
    plane[(far,)] = (None, 0.0, None)
    state = organ.solve(displacement=plane, pressure={"lumen": pressure}, throw=True)
    ring = (mesh.points + state.displacement)[mesh.nodes("lumen")]
    ring = ring[: len(ring) // 2]
    across = ring - np.roll(ring, len(ring) // 2, axis=0)
    return float(np.linalg.norm(across, axis=1).mean() / 2)


def tube_pressure(moved: float) -> float:
    """The pressure [Pa] that moves the inner radius of the tube there, in plane strain.

    Equilibrium dP_r/dR + (P_r - P_t)/R = 0 for the radius r(R), shot from the inside to no stress outside.
    """
    mu, lam = float(SOFT.mu[0]), float(SOFT.lam[0])

    def stress(along: float, across: float) -> float:
        return float(mu * (along - 1 / along) + lam * np.log(along * across) / along)

    def slope(R: float, y: Floats) -> Floats:
        radial, hoop = y[1], y[0] / R
        by_radial = mu * (1 + 1 / radial**2) + lam * (1 - np.log(radial * hoop)) / radial**2
        by_hoop = lam / (radial * hoop)
        push = (stress(radial, hoop) - stress(hoop, radial)) / R
        return np.array([radial, (-push - by_hoop * (radial - hoop) / R) / by_radial])

    def outer_stress(start: float, steps: int = 200) -> float:
        h, y = (OUTER - INNER) / steps, np.array([moved, start])
        for R in INNER + h * np.arange(steps):
            k1 = slope(R, y)
            k2 = slope(R + h / 2, y + h / 2 * k1)
            k3 = slope(R + h / 2, y + h / 2 * k2)
            k4 = slope(R + h, y + h * k3)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return stress(y[1], y[0] / OUTER)

    low, high = 0.3, 1.5
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if outer_stress(middle) > 0.0 else (middle, high)
    return -stress(low, moved / INNER) / (moved / INNER)


def test_an_inflated_tube_is_the_closed_form() -> None:
    """Linear cells: the error falls with the square of their size."""
    moved = 1.25 * INNER
    pressure = tube_pressure(moved)
    errors = [inner_radius(tube(n, 12 * n), pressure) / moved - 1 for n in (2, 4, 8)]
    assert abs(errors[2]) < 0.005
    rates = np.log2(np.array(errors[:2]) / errors[1:])
    assert rates == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
def test_every_element_takes_surface_loads(cube: vs.Mesh, element: str) -> None:
    """Hydrostatic pressure on all sides and as a traction: a dilatation that every element holds exactly."""
    law = vs.NeoHookean(young=1e5, poisson=0.3)
    organ = vs.Organ(cube, law, fixed=[0], element=element)
    sides: dict[Any, float] = {lambda x, k=k, s=s: x[:, k] == s: 2e4 for k in range(3) for s in (0.0, 0.1)}
    axes: dict[Any, Any] = {
        lambda x: (x == [0.1, 0.0, 0.0]).all(axis=1): (None, 0.0, 0.0),
        lambda x: (x == [0.0, 0.1, 0.0]).all(axis=1): (None, None, 0.0),
    }
    state = organ.solve(displacement=axes, pressure=sides)
    shrunk = state.displacement[(organ.mesh.points == 0.1).all(axis=1)][0, 0] / 0.1 + 1
    assert state.displacement == pytest.approx((shrunk - 1) * organ.mesh.points, abs=1e-10)
    stress = law.stress(shrunk * np.eye(3)[None])[0]
    assert stress == pytest.approx(-2e4 * shrunk**2 * np.eye(3), abs=1e-4)
    sheared = organ.solve(displacement=axes, traction={"top": (0, 0, -50.0), "bottom": (0, 0, 50.0)})
    lateral = organ.solve(displacement=axes, force={"top": (0, 0, -0.5), "bottom": (0, 0, 0.5)})
    assert sheared.displacement == pytest.approx(lateral.displacement, abs=1e-12)


@pytest.mark.parametrize(
    ("loads", "words"),
    [
        ({"pressure": {"tip": np.nan}}, "pressure on 'tip' must be a number"),
        ({"pressure": {"tip": (0, 0, 1)}}, "pressure on 'tip' must be a number"),
        ({"pressure": {"tpi": 1.0}}, "did you mean 'tip'"),
        ({"pressure": {"root": 1.0}}, "all nodes of 'root' are fixed: a pressure there would move nothing"),
        ({"pressure": {(80,): 1.0}}, "a set of 1 nodes holds no whole triangle of the surface"),
        ({"traction": {"tip": 1.0}}, "traction on 'tip' must be three finite numbers"),
        ({"traction": {"tip": (0, 0, np.inf)}}, "traction on 'tip' must be three finite numbers"),
        ({"traction": {(80,): (0, 0, 1)}}, "so a traction has nothing to act on"),
        ({"traction": {"root": (0, 0, 1)}}, "all nodes of 'root' are fixed"),
    ],
)
def test_surface_loads_that_are_refused(clamped: vs.Organ, loads: dict[str, Any], words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        clamped.solve(**loads)


@pytest.mark.parametrize(("rims", "frames"), [(("top",), 45), (("top", "bottom", "branch"), 18)])
def test_frames_under_pressure_find_the_full_solution(rims: tuple[str, ...], frames: int) -> None:
    """Quadratically where all rims are held; where one is free, the tangent lacks the unsymmetric part of the load."""
    mesh = vs.organs.artery()
    organ = vs.Organ(mesh, SOFT, fixed=np.concatenate([mesh.nodes(rim) for rim in rims]))
    exact = organ.solve(pressure={"lumen": 1e3}, throw=True)
    stepper = organ.stepper()
    for share in np.minimum(np.arange(1, frames + 1) / 10, 1):
        frame = stepper.frame(pressure={"lumen": 1e3 * share})
    assert frame.residual < 1e-10
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-9 * mesh.diagonal)
    assert frame.reaction("top") == pytest.approx(exact.reaction("top"), abs=1e-8)


def test_tractions_act_in_frames_and_along_paths(clamped: vs.Organ) -> None:
    loads: dict[str, Any] = {"traction": {"tip": (100.0, 0.0, -200.0)}, "force": {"tip": (0.0, 1.0, 0.0)}}
    exact = clamped.solve(**loads)
    stepper = clamped.stepper()
    for _ in range(8):
        frame = stepper.frame(**loads)
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-9)
    _, displacement = clamped.path(**loads, tolerance=1e-8).curve(2)
    assert displacement[-1] == pytest.approx(exact.displacement, abs=1e-7)


def test_a_heart_beats(clamped: vs.Organ) -> None:
    """A pressure that changes with every frame, on a closed surface; when it rests, so does the organ, where it was."""
    stepper = clamped.stepper()
    everywhere = tuple(range(len(clamped.mesh.points)))
    for phase in np.linspace(0, 2 * np.pi, 41):
        frame = stepper.frame(pressure={everywhere: 1e4 * (1.5 - np.cos(phase))})
    assert frame.residual < 1e-3, "left behind a moving load"
    exact = clamped.solve(pressure={everywhere: 5e3})
    assert frame.displacement == pytest.approx(exact.displacement, abs=5e-3 * exact.max_displacement)
    for _ in range(7):
        frame = stepper.frame()
    assert np.abs(frame.displacement).max() < 1e-12


def test_a_sudden_pressure_keeps_the_energy(clamped: vs.Organ) -> None:
    """On a closed surface p V is its potential: with Newmark's rule strain, motion and it have one sum."""
    everywhere = tuple(range(len(clamped.mesh.points)))
    stepper = clamped.stepper(dynamics="newmark", time_step=2e-4, density=1000)
    rest, sums, exchanged = _volume(clamped.mesh, 0.0 * clamped.mesh.points), [], 0.0
    for _ in range(200):
        frame = stepper.frame(pressure={everywhere: 2e3})
        work = 2e3 * (rest - _volume(clamped.mesh, frame.displacement))
        sums.append(frame.energy + frame.kinetic_energy - work)
        exchanged = max(exchanged, work)
    assert np.abs(sums).max() < 1e-2 * exchanged


def _volume(mesh: vs.Mesh, displacement: Floats) -> float:
    corners = (mesh.points + displacement)[mesh.cells]
    return float(np.linalg.det(corners[:, 1:] - corners[:, :1]).sum() / 6)


@pytest.mark.parametrize("parameter", ["load", "arc length"])
def test_a_path_under_pressure_ends_where_newton_does(parameter: str) -> None:
    organ = vs.Organ(vs.organs.artery(), SOFT, fixed="top")
    load, displacement = organ.path(pressure={"lumen": 1e3}, parameter=parameter, tolerance=1e-8).curve(3)
    assert load[-1] == pytest.approx(1.0, abs=1e-6)
    exact = organ.solve(pressure={"lumen": 1e3 * load[-1]}, throw=True)
    assert displacement[-1] == pytest.approx(exact.displacement, abs=1e-5 * exact.max_displacement)


def test_a_dome_snaps_through_under_pressure(dome: vs.Mesh) -> None:
    """By arc length past two limit points; between them, where nothing is stable, Newton's method stays put as well."""
    organ = vs.Organ(dome, SOFT, fixed="rim", element="P2")
    path = organ.path(pressure={"top": 60.0}, parameter="arc length", order=12, tolerance=1e-5)
    load, _ = path.curve(6)
    falling = np.flatnonzero(np.diff(load) < 0)
    assert load[falling[0]] > 1.5 * load[falling[-1] + 1], "it snaps through"
    assert load[-1] == pytest.approx(1.0)
    stable = []
    for expansion in path.expansions[1:]:
        there = organ.solve(pressure={"top": 60.0 * expansion.load[0]}, start=expansion.displacement[0])
        assert there.displacement == pytest.approx(expansion.displacement[0], abs=1e-7)
        stable.append(there.status == "converged")
    assert stable[0]
    assert stable[-1]
    assert not all(stable)


def test_loads_of_a_frame_and_of_a_path_are_refused_alike(clamped: vs.Organ) -> None:
    with pytest.raises(vs.VisceraError, match="pressure on 'tip' must be a number"):
        clamped.stepper().frame(pressure={"tip": np.inf})
    with pytest.raises(vs.VisceraError, match="did you mean 'tip'"):
        clamped.path(pressure={"tpi": 1.0})
    with pytest.raises(vs.VisceraError, match="the load is zero; there is no path to follow"):
        clamped.path(pressure={"tip": 0.0})


def test_a_contact_patch_takes_a_force_instead(clamped: vs.Organ) -> None:
    patch = clamped.patch((0.4, 0.05, 0.1), radius=0.06)
    with pytest.raises(vs.VisceraError, match="a contact patch takes a force"):
        clamped.solve(pressure={patch: 1.0})
