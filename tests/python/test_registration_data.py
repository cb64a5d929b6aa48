"""Registration by what counts: weights, units and sizes of what was measured, and whether the organ fits it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.conftest import coarse_liver, front_of_liver

import viscera as vs
from viscera.registration import observed
from viscera.registration.rigid import Rigid, rotation_of, spread

Floats = np.ndarray
MOVED = Rigid(rotation_of(np.array([0.2, -0.1, 0.3])), np.array([0.03, -0.02, 0.04]))
NOISE = 1e-3
WAYS = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.0, -0.5, 1.0]])
"""The organ reaches farthest in these directions where it has landmarks."""


@pytest.fixture(scope="module")
def organ() -> vs.Organ:
    return coarse_liver(edge=0.025)


@pytest.fixture(scope="module")
def truth(organ: vs.Organ) -> Floats:
    """Where the nodes are after a load that the registration knows nothing of, and a rigid motion."""
    state = organ.solve(gravity=(2.0, 0.0, 1.5), density=1060.0, throw=True)
    return MOVED(organ.mesh.points + state.displacement)


@pytest.fixture(scope="module")
def cloud(organ: vs.Organ, truth: Floats) -> Floats:
    return points_on_front(organ, truth, NOISE)


def points_on_front(organ: vs.Organ, truth: Floats, noise: float) -> Floats:
    """Points (800, 3) [m] on all of the front."""
    rng = np.random.default_rng(3)
    seen = front_of_liver(organ.mesh)
    points = np.einsum("ka,kai->ki", rng.dirichlet(np.ones(3), size=800), truth[rng.choice(seen, size=800)])
    return np.asarray(points + rng.normal(scale=noise, size=points.shape))


@pytest.fixture(scope="module")
def found(organ: vs.Organ, cloud: Floats) -> vs.Registered:
    return organ.register(cloud, noise=NOISE)


def test_points_of_weight_0_change_nothing_and_their_residuals_are_told(
    organ: vs.Organ, cloud: Floats, found: vs.Registered
) -> None:
    """More points on a tool than on the organ, mixed with them."""
    rng = np.random.default_rng(5)
    tool = rng.uniform(-0.1, 0.1, size=(1000, 3)) + (cloud.mean(axis=0) - [0.0, 0.3, 0.0])
    order = rng.permutation(1800)
    counts = order < 800
    mixed = np.concatenate([cloud, tool])[order]
    with_tool = organ.register(mixed, weights=counts.astype(float), noise=NOISE)
    alone = organ.register(mixed[counts], noise=NOISE)
    assert np.array_equal(with_tool.displacement, alone.displacement)
    assert np.array_equal(with_tool.band, alone.band)
    assert with_tool.status == alone.status
    assert with_tool.coverage == alone.coverage
    assert np.array_equal(with_tool.residual[counts], alone.residual)
    assert np.array_equal(with_tool.is_inlier[counts], alone.is_inlier)
    assert np.abs(with_tool.residual[~counts]).min() > 0.05
    assert not with_tool.is_inlier[~counts].any()
    assert np.abs(alone.displacement - found.displacement).max() < 1e-3, "the order of points hardly matters"


def test_points_of_little_weight_hardly_pull(organ: vs.Organ, cloud: Floats, found: vs.Registered) -> None:
    """A sheet over the organ, of more points than the organ's own."""
    sheet = np.repeat(cloud, 2, axis=0) + MOVED.rotation @ [0.0, -0.02, 0.02]
    weights = np.concatenate([np.ones(len(cloud)), np.full(len(sheet), 1e-3)])
    with_sheet = organ.register(np.concatenate([cloud, sheet]), weights=weights, noise=NOISE)
    assert with_sheet.is_converged, with_sheet.message
    assert np.linalg.norm(with_sheet.displacement - found.displacement, axis=1).max() < 3e-3
    assert with_sheet.is_inlier[: len(cloud)].mean() > 0.95
    assert with_sheet.is_inlier[len(cloud) :].mean() < 0.05


def test_too_few_points_count(organ: vs.Organ, cloud: Floats) -> None:
    with pytest.raises(vs.VisceraError, match="19 surface points, beside 781 of weight 0, are too few"):
        organ.register(cloud, weights=(np.arange(800) < 19).astype(float))


def test_the_spread_is_that_of_the_median_and_weights_count_like_copies() -> None:
    rng = np.random.default_rng(0)
    for count in (1, 2, 9, 10, 400):
        residual, copies = rng.normal(size=count), rng.integers(0, 4, size=count)
        copies[0] = 1
        assert spread(residual, np.ones(count)) == pytest.approx(1.4826 * np.median(np.abs(residual)))
        repeated = np.repeat(residual, copies)
        assert spread(residual, copies.astype(float)) == pytest.approx(1.4826 * np.median(np.abs(repeated)))


@pytest.mark.parametrize("scale", [1.0, 0.02])
def test_landmarks_fix_the_motion_of_an_organ_of_any_size(
    organ: vs.Organ, truth: Floats, cloud: Floats, scale: float
) -> None:
    """Turned much farther than the search goes: without the landmarks it could not be found."""
    mesh = organ.mesh
    marks = {name: [int((mesh.points @ way).argmax())] for name, way in zip("abcd", WAYS, strict=True)}
    small = vs.Organ(vs.mesh(scale * mesh.points, mesh.cells).with_sets(**mesh.sets, **marks), organ.law, fixed="hilum")
    turn = rotation_of(np.array([0.8, 1.6, 2.4]))
    now, points = scale * truth @ turn.T, scale * cloud @ turn.T
    landmarks = {name: now[node[0]] for name, node in marks.items()}
    for surface in (None, points):
        found = small.register(surface, landmarks=landmarks, noise=scale * NOISE)
        assert found.is_converged, found.message
        error = np.linalg.norm(small.mesh.points + found.displacement - now, axis=1)
        assert error.mean() < (0.02 if surface is None else 0.002) * scale
        assert max(found.pair_residual.values()) < 3.0 * scale * NOISE
        assert (found.misfit is None) == (surface is None)
    size = small.mesh.diagonal
    line = small.mesh.points.mean(axis=0) + size * np.array([[-0.2, 0.0, 0.0], [0.0, 0.005, 0.0], [0.2, 0.0, 0.0]])
    with pytest.raises(vs.VisceraError, match="3 landmarks and points do not fix a rigid motion"):
        small.register(points=(line, 0.0 * line), noise=scale * NOISE)


@pytest.mark.parametrize("factor", [1000.0, 100.0, 25.4, 1e-3])
@pytest.mark.parametrize("names", [("tip",), ("tip", "hilum"), ("tip", "hilum", "left", "right")])
def test_landmarks_in_another_unit_than_the_cloud_are_refused(
    organ: vs.Organ, truth: Floats, cloud: Floats, factor: float, names: tuple[str, ...]
) -> None:
    """One is known by its distance from the cloud, several by those from each other too."""
    x = organ.mesh.points
    mesh = organ.mesh.with_sets(left=[int(x[:, 1].argmin())], right=[int(x[:, 2].argmax())])
    table = np.array([0.8, 0.2, 0.4])  # from the origin of the theatre's axes
    marks = {name: table + truth[mesh.sets[name]].mean(axis=0) for name in names}
    given: dict[str, Any] = {"mesh": mesh, "surface": table + cloud, "weights": None, "points": None, "noise": NOISE}
    observed(landmarks=marks, landmark_noise=NOISE, **given)
    with pytest.raises(vs.VisceraError, match=r"'(tip|hilum|left|right)' was measured .* are both in metres"):
        observed(landmarks={name: factor * place for name, place in marks.items()}, landmark_noise=NOISE, **given)


def test_points_in_another_unit_are_refused_without_a_cloud_too(organ: vs.Organ, truth: Floats) -> None:
    at = organ.mesh.points[::40]
    moved = truth[::40] - at
    given: dict[str, Any] = {
        "mesh": organ.mesh,
        "weights": None,
        "landmarks": None,
        "noise": NOISE,
        "landmark_noise": NOISE,
    }
    observed(surface=None, points=(at, moved), **given)
    with pytest.raises(vs.VisceraError, match=r"'point [0-9]+' was measured .* are both in metres"):
        observed(surface=None, points=(at, 1e3 * moved), **given)


def test_landmarks_of_what_is_much_deformed_are_taken() -> None:
    """A beam's ends that almost meet, or lie twice as far apart, and two landmarks lost in their noise."""
    mesh = vs.organs.beam()
    middle = np.linalg.norm(mesh.points - mesh.points.mean(axis=0), axis=1).argsort()[:2]
    mesh = mesh.with_sets(here=middle[:1], there=middle[1:])
    cloud = np.random.default_rng(0).uniform(-0.5, 0.5, size=(100, 3))
    for marks in (
        {"clamp": (0.0, 0.0, 0.0), "tip": (0.1, 0.0, 0.0)},
        {"clamp": (0.0, 0.0, 0.0), "tip": (2.0, 0.0, 0.0)},
        {"here": (0.0, 0.0, 0.0), "there": (0.3, 0.0, 0.0)},
    ):
        assert observed(mesh, cloud, None, marks, None, NOISE, NOISE).labels == tuple(marks)


def test_a_cloud_that_the_organ_does_not_fit_is_told(
    organ: vs.Organ, truth: Floats, cloud: Floats, found: vs.Registered
) -> None:
    """A mirrored one, one that is too large, and one that is noisier than was said.

    The motion is told of the last two: the search for it takes most of the time.
    """
    assert 0.7 < (found.misfit or 0.0) < 1.3
    assert not found.is_poor_fit
    middle, noise = cloud.mean(axis=0), np.random.default_rng(1).normal(scale=2.5 * NOISE, size=cloud.shape)
    mirrored = points_on_front(organ, truth, 0.5 * NOISE) * [-1.0, 1.0, 1.0]
    large = middle + 1.4 * (cloud - middle)
    start = np.block([[MOVED.rotation, MOVED.translation[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
    for wrong, told, near in ((mirrored, 0.5, None), (large, 1.0, start), (cloud + noise, 1.0, start)):
        poor = organ.register(wrong, noise=told * NOISE, start=near)
        assert poor.is_poor_fit, poor.misfit
        assert poor.status in ("poor fit", "not converged")
        assert not poor.is_converged or "do not trust the band" in poor.message


def test_a_noise_that_weights_tell_of_is_no_misfit(organ: vs.Organ, cloud: Floats) -> None:
    """Half of the points have four times the noise, and a sixteenth of the weight; 30 % of all are outliers."""
    rng = np.random.default_rng(2)
    noisy = cloud.copy()
    noisy[::2] += np.sqrt(15.0) * rng.normal(scale=NOISE, size=noisy[::2].shape)
    noisy[:240] += rng.uniform(-0.03, 0.03, size=(240, 3))
    weights = np.where(np.arange(len(cloud)) % 2, 1.0, 1.0 / 16.0)
    told = organ.register(noisy, weights=weights, noise=NOISE)
    assert told.is_converged, told.message
    assert (told.misfit or 9.0) < 1.3


def test_a_landmark_that_does_not_fit_is_named() -> None:
    """It lies 40 mm beside its place; a misfit is of the surface alone, and the status of what was seen."""
    beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    places = beam.mesh.points[::20]
    tip = np.add(beam.mesh.points[beam.mesh.sets["tip"]].mean(axis=0), [0.0, 0.0, 0.1])
    given: dict[str, Any] = {"points": (places, 0.0 * places + [0.0, 0.0, 0.1]), "noise": NOISE}
    off = {"tip": np.add(tip, [0.04, 0.0, 0.0])}
    wrong = beam.register(landmarks=off, **given)
    assert wrong.status == "converged"
    left = f"{1e3 * wrong.pair_residual['tip']:.3g}"
    assert wrong.message.startswith("landmarks and points that do not fit, ")
    assert f"'tip' by {left} mm, with a noise of 1 mm" in wrong.message
    assert "check where they were measured, or state a larger noise" in wrong.message
    said = beam.register(landmarks=off, landmark_noise=0.03, **given)
    assert "do not fit" not in said.message
