"""Registration: an organ that was moved and deformed is found again; what nobody can use is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from tests.conftest import coarse_liver, front_of_liver

import viscera as vs
from viscera import _core
from viscera.registration.causes import Causes, Weighing
from viscera.registration.equations import averaged
from viscera.registration.forces import Forces
from viscera.registration.registered import MODEL, SWUNG, band_of, wrong_by_model
from viscera.registration.rigid import (
    Rigid,
    Shape,
    aligned,
    levers,
    rotation_of,
    turns_of,
    vector_of,
    without_rigid,
)

Floats = np.ndarray
MOVED = Rigid(rotation_of(np.array([0.2, -0.1, 0.3])), np.array([0.03, -0.02, 0.04]))
NOISE = 1e-3


@pytest.fixture(scope="module")
def organ() -> vs.Organ:
    return coarse_liver(edge=0.022)


@pytest.fixture(scope="module")
def truth(organ: vs.Organ) -> Floats:
    """Where the nodes are after a load that the registration knows nothing of, and a rigid motion."""
    state = organ.solve(gravity=(4.0, 0.0, 3.0), density=1060.0, throw=True)
    return MOVED(organ.mesh.points + state.displacement)


@pytest.fixture(scope="module")
def cloud(organ: vs.Organ, truth: Floats) -> Floats:
    """Noisy points on what is seen from the front, and some that are not the organ's."""
    rng = np.random.default_rng(3)
    seen = front_of_liver(organ.mesh)
    corners = truth[seen]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = rng.choice(len(seen), size=1500, p=area / area.sum())
    points = np.einsum("ka,kai->ki", rng.dirichlet(np.ones(3), size=1500), corners[chosen])
    points = points + rng.normal(scale=NOISE, size=points.shape)
    points[:60] += rng.uniform(-0.03, 0.03, size=(60, 3))
    return np.asarray(points)


@pytest.fixture(scope="module")
def found(organ: vs.Organ, cloud: Floats) -> vs.Registered:
    return organ.register(cloud, noise=NOISE)


def test_an_organ_is_found_again_where_a_rigid_motion_does_not_explain_it(
    organ: vs.Organ, truth: Floats, found: vs.Registered
) -> None:
    assert found.is_converged, found.message
    error = np.linalg.norm(organ.mesh.points + found.displacement - truth, axis=1)
    best = aligned(organ.mesh.points, truth, np.ones(len(truth)))
    rigid = np.linalg.norm(best(organ.mesh.points) - truth, axis=1)
    assert error.mean() < 0.7 * rigid.mean(), "better than the best rigid motion that there is"
    assert (error < found.band)[found.is_observed].mean() > 0.9


def test_a_human_liver_is_found_again_from_its_front(shared: Path) -> None:
    """A scan gives its shape; the truth has another mesh and another law; 2000 points of its front are seen."""
    path = shared / "scans" / "totalsegmentator_example_seg.nii.gz"
    if not path.exists():
        pytest.skip(f"no human scan {path}; name its folder in VISCERA_SHARED")
    pytest.importorskip("nibabel")
    scan = vs.scan(path)
    mesh, fine = (scan.mesh({"liver": 5}, edge=edge, fixed="label:64") for edge in (0.016, 0.012))
    law = vs.Ogden(mu=500.0, alpha=6.0, poisson=0.46)
    state = vs.Organ(fine, law, fixed="fixed").solve(gravity=(4.0, 0.0, 3.0), density=1060.0, throw=True)
    now = MOVED(fine.points + state.displacement)
    rest = fine.points[fine.surface]
    outward = np.cross(rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0])
    corners = now[fine.surface[outward[:, 1] > 0.2 * np.linalg.norm(outward, axis=1)]]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    rng = np.random.default_rng(0)
    chosen = rng.choice(len(corners), size=2000, p=area / area.sum())
    cloud = np.einsum("ka,kai->ki", rng.dirichlet(np.ones(3), size=2000), corners[chosen])
    cloud = cloud + rng.normal(scale=NOISE, size=cloud.shape)

    found = vs.Organ(mesh, vs.NeoHookean(young=4e3, poisson=0.45), fixed="fixed").register(cloud, noise=NOISE)
    assert found.is_converged, found.message
    at = fine.centroids[::5]
    at, there = (
        x[_core.Locator(mesh.points, mesh.cells).find(at)[0] >= 0] for x in (at, now[fine.cells].mean(axis=1)[::5])
    )
    error = np.linalg.norm(at + found.at(at).displacement - there, axis=1)
    rigid = np.linalg.norm(aligned(at, there, np.ones(len(at)))(at) - there, axis=1)
    assert error.mean() < 0.5 * rigid.mean(), "better than the best rigid motion that there is"
    assert (error < found.band_at(at)).mean() > 0.9


def test_no_array_of_what_was_found_is_written_to(found: vs.Registered) -> None:
    for array in (found.displacement, found.band, found.covariance, found.is_observed, found.rotation):
        assert not array.flags.writeable


def test_residuals_tell_the_organ_from_what_is_not_its(found: vs.Registered) -> None:
    assert np.median(np.abs(found.residual)) < 1.5 * NOISE
    assert found.is_inlier[60:].mean() > 0.97
    assert (~found.is_inlier[:60]).mean() > 0.5


def test_the_shape_found_is_an_equilibrium(organ: vs.Organ, found: vs.Registered) -> None:
    inner = organ._body.internal_force(found.state.displacement)
    free = np.setdiff1d(np.arange(len(inner)), organ.fixed)
    assert np.abs((inner - found.nodal_force)[free]).max() < 1e-5 * np.abs(inner).max()
    rotated = organ.mesh.points + found.state.displacement
    assert np.allclose(organ.mesh.points + found.displacement, rotated @ found.rotation.T + found.translation)


def test_landmarks_say_where_a_cloud_alone_would_not(organ: vs.Organ, truth: Floats) -> None:
    """Points with displacements need no cloud; a landmark is the mean of its set."""
    at = np.linspace(0, len(truth) - 1, 40).astype(int)
    points = (organ.mesh.points[at], truth[at] - organ.mesh.points[at])
    landmarks = {name: truth[organ.mesh.sets[name]].mean(axis=0) for name in ("tip", "hilum")}
    found = organ.register(points=points, landmarks=landmarks, noise=5e-4)
    assert found.is_converged, found.message
    assert list(found.pair_residual)[:3] == ["tip", "hilum", "point 0"]
    assert max(found.pair_residual.values()) < 3e-3
    error = np.linalg.norm(organ.mesh.points + found.displacement - truth, axis=1)
    assert error.mean() < 2e-3
    assert found.coverage == 0.0


def test_a_pressure_is_found_as_the_one_cause(organ: vs.Organ) -> None:
    """It turns the organ far about its fixed nodes, which forces that keep their directions hardly follow."""
    x = organ.mesh.points[organ.mesh.surface_nodes]
    place = organ.mesh.surface_nodes[np.linalg.norm(x - organ.mesh.points[organ.mesh.sets["tip"]][0], axis=1) < 0.07]
    state = organ.solve(pressure=[(place, 900.0)], steps=8, throw=True)
    now = MOVED(organ.mesh.points + state.displacement)
    surface = organ.mesh.surface
    seen = surface[organ.mesh.points[surface].mean(axis=1)[:, 1] < 0.0]
    rng = np.random.default_rng(5)
    points = np.einsum("ka,kai->ki", rng.dirichlet(np.ones(3), size=1500), now[rng.choice(seen, size=1500)])
    points = points + rng.normal(scale=NOISE, size=points.shape)
    found = organ.register(points, noise=NOISE)
    assert found.is_converged, found.message
    error = np.linalg.norm(organ.mesh.points + found.displacement - now, axis=1)
    rigid = np.linalg.norm(aligned(organ.mesh.points, now, np.ones(len(now)))(organ.mesh.points) - now, axis=1)
    assert error.mean() < 0.5 * rigid.mean(), "better than the best rigid motion that there is"
    inner = organ._body.internal_force(found.state.displacement)
    free = np.setdiff1d(np.arange(len(inner)), organ.fixed)
    assert np.abs((inner - found.nodal_force)[free]).max() < 1e-5 * np.abs(inner).max()


def test_what_was_not_seen_is_said(organ: vs.Organ, cloud: Floats) -> None:
    """Without the left lobe in sight, its place is not known; elsewhere it is."""
    right = cloud[MOVED.back(cloud)[:, 0] < 0.0]
    found = organ.register(right, noise=NOISE, start=_matrix(MOVED))
    assert found.status == "partly observed"
    assert "not observed" in found.message
    assert found.band[organ.mesh.sets["tip"]].mean() > 1.5 * np.median(found.band[organ.mesh.points[:, 0] < -0.03])


def test_points_on_one_flat_face_leave_the_organ_free_to_slide(bar: vs.Mesh) -> None:
    """They say how high the face is, and that nobody knows where along it the organ lies."""
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    places = np.random.default_rng(2).uniform(size=(200, 3)) * [0.1, 0.1, 0.0] + [0.0, 0.0, 0.105]
    found = organ.register(places, noise="1 mm")
    assert found.status == "not observed"
    assert not found.is_observed.any()
    assert found.band.min() > bar.diagonal
    assert found.displacement[bar.nodes("z > 99%"), 2] == pytest.approx(0.005, abs=1e-3), "within the noise"


def test_it_can_be_written_probed_and_drawn(organ: vs.Organ, found: vs.Registered, tmp_path: Path) -> None:
    found.write(tmp_path / "found.vtu")
    data = meshio.read(tmp_path / "found.vtu").point_data
    assert np.allclose(data["displacement"], found.displacement)
    assert np.allclose(data["band"], found.band)
    place = organ.mesh.centroids[:3]
    assert np.allclose(found.at(place).displacement, found.displacement[organ.mesh.cells[:3]].mean(axis=1))
    assert found.band_at(place).shape == (3,)
    assert found.plot() is not None


def test_responses_are_those_of_small_forces(organ: vs.Organ) -> None:
    forces = Forces(organ, organ.touchable(organ.mesh.surface_nodes), 12)
    responses = forces.responses(np.zeros_like(organ.mesh.points))
    amplitudes = np.random.default_rng(0).normal(size=len(forces)) * 1e-6
    state = organ.solve(force=forces.nodal(amplitudes), settings={"tolerance": 1e-12})
    expected = responses @ amplitudes
    assert np.abs(state.displacement - expected).max() < 1e-3 * np.abs(expected).max()


def test_responses_about_an_unstable_state_are_those_of_its_tangent() -> None:
    """A thin beam pressed beyond buckling, kept straight: differences of the internal force give the load back."""
    beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    pressed = -0.2 * beam.mesh.points * [1.0, 0.0, 0.0]
    pressed = pressed - pressed[beam.fixed].mean(axis=0)
    pressed[beam.fixed] = 0.0
    compliance = _core.Compliance(beam._body)
    with pytest.raises(vs.VisceraError, match="not positive definite"):
        _core.touch_series(beam._body, [beam.patch(beam.mesh.points[-1], 0.1)], pressed, 1)
    load = np.random.default_rng(0).normal(size=pressed.shape)
    load[beam.fixed] = 0.0
    found = compliance.responses(pressed, load[None])[0]
    h = 1e-7 / np.abs(found).max()
    plus, minus = (beam._body.internal_force(pressed + s * h * found) for s in (1, -1))
    slope = (plus - minus) / (2 * h)
    slope[beam.fixed] = 0.0
    assert np.abs(slope - load).max() < 1e-5 * np.abs(load).max()
    rest = np.zeros_like(pressed)
    fresh = _core.Compliance(beam._body).responses(rest, load[None])
    for _ in range(2):  # by the factor of unstable states, then by that of stable ones again
        assert np.allclose(compliance.responses(rest, load[None]), fresh, atol=1e-9 * np.abs(fresh).max())
    with pytest.raises(vs.VisceraError, match="fields"):
        compliance.responses(pressed, load[None, :-1])


def test_forces_that_turn_with_the_organ_are_in_equilibrium(organ: vs.Organ) -> None:
    """Their linear responses agree with differences, and amplitudes come back turned as the organ is."""
    forces = Forces(organ, organ.touchable(organ.mesh.surface_nodes), 12)
    rest, x, ones = np.zeros_like(organ.mesh.points), organ.mesh.points, np.ones(len(organ.mesh.points))
    given = 0.02 * np.random.default_rng(0).normal(size=len(forces))
    free = np.empty((len(forces), 0))
    u, amplitudes, imbalance = forces.equilibrium(given, rest, rest, rest, free, 10, 1e-8)
    assert imbalance < 1e-8
    turn = aligned(x, x + u, ones).rotation
    assert np.allclose(amplitudes.reshape(-1, 3), given.reshape(-1, 3) @ turn.T)
    assert np.linalg.norm(forces.left(u, amplitudes)) < 1e-6 * np.linalg.norm(forces.nodal(amplitudes))

    responses = forces.responses(u)
    responses = forces.following(responses, amplitudes, turns_of(responses, x, x + u))
    change = 1e-5 * np.random.default_rng(1).normal(size=len(forces))
    plus, minus = (forces.equilibrium(amplitudes + s * change, u, u, u, free, 10, 1e-12)[0] for s in (1, -1))
    expected = 0.5 * (plus - minus)
    assert np.abs(responses @ change - expected).max() < 1e-4 * np.abs(expected).max()


def test_an_organ_is_held_where_it_is_to_be_and_still_in_equilibrium(organ: vs.Organ) -> None:
    """Forces that are given lead elsewhere; a few of them are changed, and no others, until they lead to the goal."""
    forces = Forces(organ, organ.touchable(organ.mesh.surface_nodes), 12)
    rest = np.zeros_like(organ.mesh.points)
    rng = np.random.default_rng(3)
    given, steer = 0.02 * rng.normal(size=len(forces)), 0.2 * rng.normal(size=(len(forces), 3))
    sought = given + steer @ [0.3, -0.2, 0.1]
    free = np.empty((len(forces), 0))
    goal = forces.equilibrium(sought, rest, rest, rest, free, 20, 1e-9)[0]
    u, amplitudes, imbalance = forces.equilibrium(given, rest, rest, goal, steer, 20, 1e-9)
    assert imbalance < 1e-9
    away = forces.equilibrium(given, rest, rest, rest, free, 20, 1e-9)[0]
    assert np.abs(u - goal).max() < 0.1 * np.abs(away - goal).max()
    x = organ.mesh.points
    turn = aligned(x, x + u, np.ones(len(x))).rotation
    changed = (amplitudes.reshape(-1, 3) @ turn).ravel() - given
    assert np.abs(changed - steer @ np.linalg.lstsq(steer, changed)[0]).max() < 1e-9 * np.abs(changed).max()


def test_the_turn_of_an_organ_has_this_derivative() -> None:
    rng = np.random.default_rng(7)
    x, step, h, ones = rng.normal(size=(30, 3)), rng.normal(size=(30, 3)), 1e-6, np.ones(30)
    now = MOVED(x) + 0.3 * rng.normal(size=x.shape)
    plus, minus = (aligned(x, now + s * h * step, ones).rotation for s in (1, -1))
    assert np.allclose(vector_of(plus @ minus.T) / (2 * h), turns_of(step[:, :, None], x, now)[:, 0], atol=1e-7)


def test_what_is_believed_is_the_mean_over_causes_by_their_evidence() -> None:
    """Against each cause written out as further unknowns, with the evidence as the probability of the data."""
    rng = np.random.default_rng(8)
    m, q, size = 5, 2, 0.7
    rows, noise = rng.normal(size=(30, 6 + m + q)), 0.3
    kinds = [rng.normal(size=(m, 4, 1)), rng.normal(size=(m, 2, 3))]
    prior = np.diag([0.0] * 6 + [20.0] * m + [1.0] * q)
    data = rows @ np.concatenate([rng.normal(size=6), 0.5 * kinds[0][:, 2, 0], np.zeros(q)])
    data = data + noise * rng.normal(size=30)
    mean, covariance, _ = Weighing([prior], kinds, [size]).believed(rows.T @ rows / noise**2, rows.T @ data / noise**2)

    logs, means, covariances = [], [], []
    for extra, count in [
        (np.zeros((m, 1)), 1),
        *((kind[:, c], kind.shape[1]) for kind in kinds for c in range(kind.shape[1])),
    ]:
        spread = np.diag([1e4] * 6 + [0.0] * m + [1.0] * q)
        spread[6 : 6 + m, 6 : 6 + m] = np.eye(m) / 20.0 + size**2 * extra @ extra.T
        total = rows @ spread @ rows.T + noise**2 * np.eye(30)
        gain = spread @ rows.T @ np.linalg.inv(total)
        logs.append(-0.5 * (data @ np.linalg.solve(total, data) + np.linalg.slogdet(total)[1]) - np.log(count))
        means.append(gain @ data)
        covariances.append(spread - gain @ rows @ spread)
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    expected = weights @ means
    apart = np.array(means) - expected
    assert np.abs(mean - expected).max() < 1e-3
    assert np.allclose(
        covariance, np.einsum("c,cij->ij", weights, covariances) + (apart.T * weights) @ apart, atol=1e-3
    )


def test_a_pressure_that_moved_the_organ_is_among_the_causes(organ: vs.Organ) -> None:
    """Unit causes move it by 1 m, and a disk of pressure pushes inwards with the force of its area."""
    forces = Forces(organ, organ.touchable(organ.mesh.surface_nodes), 30)
    responses = without_rigid(forces.responses(np.zeros_like(organ.mesh.points)), organ.mesh.points)
    causes = Causes(forces, forces.loaded)
    for kind in causes.at(organ.mesh.points, responses):
        moved = np.tensordot(responses, kind, axes=1)
        assert np.allclose((moved**2).sum(axis=(0, 1)).mean(axis=1) / len(moved), 1.0)
    pressed = causes._pressed(organ.mesh.points)[:, :, 0]
    middles = forces.centres - organ.mesh.points.mean(axis=0)
    inward = -np.einsum(
        "pc,p->c",
        (pressed[:-3].reshape(-1, 3, pressed.shape[1]) * middles[:, :, None]).sum(axis=1),
        np.ones(len(middles)),
    )
    assert (inward > 0.0).mean() > 0.9


def test_the_derivative_of_a_rigid_motion_agrees_with_differences() -> None:
    x = np.random.default_rng(1).normal(size=(5, 3))
    turn, shift, centre, h = np.array([0.3, -0.2, 0.5]), np.array([0.1, 0.2, -0.3]), x.mean(axis=0), 1e-6
    plus, minus = (MOVED.turned(s * h * turn, s * h * shift, centre)(x) for s in (1, -1))
    slope = (levers(x - centre) @ turn + shift) @ MOVED.rotation.T
    assert np.allclose((plus - minus) / (2 * h), slope, atol=1e-8)
    assert np.allclose(MOVED.back(MOVED(x)), x)


def test_the_vector_of_a_rotation_is_found_again() -> None:
    for vector in ([0.3, -1.2, 0.7], [0.0, 3.0, 0.0], [1e-9, 0.0, 0.0], [0.0, 0.0, 0.0]):
        assert np.allclose(vector_of(rotation_of(np.array(vector))), vector, atol=1e-12)
    for axis in ([1.0, 0.0, 0.0], [0.6, 0.0, -0.8], [-0.48, 0.6, 0.64]):
        nearly = (np.pi - 1e-7) * np.array(axis)
        assert np.allclose(vector_of(rotation_of(nearly)), nearly, rtol=0.0, atol=1e-12)
        half = rotation_of(np.pi * np.array(axis))  # about the axis or the opposite one
        assert np.allclose(rotation_of(vector_of(half)), half, rtol=0.0, atol=1e-12)


def test_a_response_without_its_rigid_part_has_none_and_keeps_the_rest() -> None:
    rng = np.random.default_rng(5)
    x, bent = rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    rigid = levers(x) @ rng.normal(size=3) + rng.normal(size=3)
    left = without_rigid(np.stack([rigid, bent, bent + rigid], axis=2), x)
    assert np.abs(left[:, :, 0]).max() < 1e-12
    assert np.allclose(left[:, :, 1], left[:, :, 2])
    assert np.abs(left[:, :, 1].sum(axis=0)).max() < 1e-12
    assert np.abs(np.cross(x, left[:, :, 1]).sum(axis=0)).max() < 1e-12


def test_an_averaged_cloud_keeps_its_weight_and_its_middle() -> None:
    rng = np.random.default_rng(6)
    points, weights = rng.random((300, 3)), rng.random(300)
    weights[:5] = 0.0
    means, total = averaged(points, weights, 0.4)
    assert len(means) == 27
    assert np.isclose(total.sum(), weights.sum())
    assert np.allclose(total @ means, weights @ points)


def test_kabsch_finds_a_motion_and_no_reflection() -> None:
    x = np.random.default_rng(2).normal(size=(6, 3))
    assert np.allclose(aligned(x, MOVED(x), np.ones(6)).rotation, MOVED.rotation)
    assert np.linalg.det(aligned(x, -x, np.ones(6)).rotation) > 0.0


def test_closest_points_have_the_normal_of_their_triangle(organ: vs.Organ) -> None:
    shape = Shape(organ.mesh.points, organ.mesh.surface)
    middle = organ.mesh.points[organ.mesh.surface[:4]].mean(axis=1)
    triangle, _, _, closest, normal = shape.closest(middle + 1e-4 * shape.normals[:4])
    assert triangle.tolist() == [0, 1, 2, 3]
    assert np.allclose(closest, middle)
    assert np.allclose(normal, shape.normals[:4])


def test_the_band_holds_95_percent_of_a_normal_distribution() -> None:
    rng = np.random.default_rng(4)
    for axes in ([1.0, 1.0, 1.0], [1.0, 0.3, 0.1], [1.0, 1.0, 0.01]):
        samples = rng.normal(size=(200_000, 3)) * axes
        band = band_of(np.diag(np.square(axes))[None], np.zeros(1))[0]
        assert abs((np.linalg.norm(samples, axis=1) < band).mean() - 0.95) < 0.01
    assert band_of(np.zeros((1, 3, 3)) + 1e-12 * np.eye(3), np.array([0.01]))[0] > 0.01


def test_a_swing_without_deformation_counts_less_than_a_deformation() -> None:
    x = np.random.default_rng(9).normal(size=(50, 3))
    swing, bent = MOVED(x) - x, 0.1 * x
    assert np.allclose(wrong_by_model(x, swing), SWUNG * np.linalg.norm(swing, axis=1))
    assert (wrong_by_model(x, bent) > MODEL * 0.099 * np.linalg.norm(x - x.mean(axis=0), axis=1)).all()


LINE = np.outer(np.linspace(0.0, 0.2, 50), [1.0, 2.0, 0.5])
CLOUD = np.random.default_rng(0).normal(size=(50, 3)) * 0.1
"""Points on a line, as long as the organ."""


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "nothing was measured"),
        ({"surface": np.empty((0, 3))}, "surface has no points"),
        ({"surface": [[0.0, np.nan, 0.0]] * 30}, "point 0 of surface is not finite"),
        ({"surface": [[0.0, 0.0]] * 30}, r"surface must be an array \(k, 3\)"),
        ({"surface": np.random.default_rng(0).normal(size=(50, 3)) * 100}, "are both in metres"),
        ({"surface": np.random.default_rng(0).normal(size=(9, 3)) * 0.1}, "9 surface points are too few"),
        ({"surface": LINE}, "50 points, lies on one line or in one place, about which the organ may be turned"),
        ({"surface": LINE, "start": np.eye(4)}, "lies on one line or in one place"),
        (
            {"surface": LINE[[0, -1]].repeat(25, axis=0)},
            "2 surface points, beside 48 of weight 0 or repeated, are too few",
        ),
        ({"surface": np.zeros((50, 3))}, "1 surface points, beside 49 of weight 0 or repeated, are too few"),
        (
            {"surface": np.append(LINE, [[0.1, 0, 0]], axis=0), "weights": (np.arange(51) < 50).astype(float)},
            "lies on one line",
        ),
        ({"surface": LINE[[0, -1]]}, "2 surface points are too few"),
        ({"landmarks": {"tipp": (0, 0, 0)}}, "no node set is called 'tipp'; did you mean 'tip'"),
        ({"landmarks": {"tip": (0, 0, np.inf)}}, "landmark 'tip' must be"),
        ({"landmarks": {"tip": (0, 0, 0)}}, "do not fix a rigid motion"),
        ({"points": ([[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]] * 2)}, "1 places but 2 displacements"),
        ({"points": ([[40.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]])}, "outside the organ's box"),
        ({"points": [1.0, 2.0, 3.0]}, "points must be a pair"),
        ({"surface": CLOUD, "noise": 0.0}, "noise must be a number"),
        ({"surface": CLOUD, "noise": "2 mN"}, "noise"),
        ({"surface": CLOUD, "noise": 0.1}, "noise of the surface points is 0.1 m"),
        (
            {"landmarks": {"tip": (0, 0, 0)}, "surface": CLOUD, "landmark_noise": 0.1},
            "noise of landmarks and points is 0.1 m and the organ",
        ),
        ({"surface": CLOUD, "weights": [1.0]}, "weights must be 50"),
        ({"surface": CLOUD, "start": 2 * np.eye(4)}, "no rigid motion"),
        ({"surface": CLOUD, "visible": "nowhere"}, "nowhere"),
    ],
)
def test_what_cannot_be_used_is_refused(organ: vs.Organ, given: dict[str, Any], words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        organ.register(**given)


def _matrix(motion: Rigid) -> Floats:
    return np.block([[motion.rotation, motion.translation[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
