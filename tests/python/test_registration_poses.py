"""What the data do not tell: a slide along a face, and other poses of an organ that looks alike from several sides."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import viscera as vs
from viscera.registration import observed
from viscera.registration.normals import MOST, agreement, normals_of
from viscera.registration.rigid import QUARTERS, Rigid, Shape, turned

Floats = np.ndarray
NOISE = 5e-4


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    """A square bar, which looks alike from four sides."""
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")


@pytest.fixture(scope="module")
def corner(bar: vs.Mesh) -> Floats:
    """Points on the upper side, on one beside it, and on the free end of the bar at rest."""
    rng = np.random.default_rng(0)
    middles = bar.points[bar.surface].mean(axis=1)
    seen = bar.surface[(middles[:, 2] > 0.099) | (middles[:, 1] < 0.001) | (middles[:, 0] > 0.399)]
    points = np.einsum("ka,kai->ki", rng.dirichlet(np.ones(3), 300), bar.points[rng.choice(seen, 300)])
    return np.asarray(points + rng.normal(scale=NOISE, size=points.shape))


def test_the_rim_of_a_face_does_not_say_where_the_organ_lies_along_it(organ: vs.Organ) -> None:
    """Points on the middle of one face, which the start has slid to the end of the bar: noise puts some of them onto
    the end and the sides."""
    rng = np.random.default_rng(4)
    face = rng.uniform([0.12, 0.0, 0.1], [0.32, 0.1, 0.1], size=(300, 3)) + rng.normal(scale=NOISE, size=(300, 3))
    found = organ.register(face, noise=NOISE)
    assert found.status == "not observed"
    assert found.band.min() > organ.mesh.diagonal


def test_poses_that_fit_as_well_are_told_and_their_nodes_not_observed(organ: vs.Organ, corner: Floats) -> None:
    """A quarter turn about its axis takes two sides of the bar onto two others."""
    found = organ.register(corner, noise=NOISE)
    assert len(found.rivals)
    assert "poses fit the data about equally" in found.message
    gap = np.linalg.norm(found.rivals - found.displacement, axis=2).max(axis=0)
    assert (found.band >= gap).all()
    assert found.is_observed.mean() < 0.05
    assert np.linalg.norm(found.displacement, axis=1).max() < 2e-3, "of all it is the one that turns the organ least"


def test_a_start_says_which_pose_is_right(organ: vs.Organ, corner: Floats) -> None:
    found = organ.register(corner, noise=NOISE, start=np.eye(4))
    assert not len(found.rivals)
    assert found.is_observed.mean() > 0.95
    assert "poses" not in found.message
    assert (np.linalg.norm(found.displacement, axis=1) < found.band)[found.is_observed].all()


def test_a_box_is_turned_to_all_poses_in_which_it_looks_alike(block: Callable[..., tuple[Floats, Floats]]) -> None:
    """A box of three different sides looks alike in three more poses: half turns about its axes."""
    points, cells = block((4, 3, 2), (0.4, 0.25, 0.15))
    mesh = vs.mesh(points, cells)
    rng = np.random.default_rng(0)
    cloud = np.einsum("ka,kai->ki", rng.dirichlet(np.ones(3), 400), points[rng.choice(mesh.surface, 400)])
    seen = observed(mesh, cloud, None, None, None, NOISE, NOISE)
    found = turned(Shape(mesh.points, mesh.surface), seen, Rigid(np.eye(3), np.zeros(3)))
    assert sorted(np.diag(motion.rotation).round(6).tolist() for motion in found) == [
        [-1.0, -1.0, 1.0],
        [-1.0, 1.0, -1.0],
        [1.0, -1.0, -1.0],
    ]


def test_the_rotations_of_a_cube_are_23_besides_none() -> None:
    assert len({turn.tobytes() for turn in QUARTERS}) == 23
    assert all(np.array_equal(turn @ turn.T, np.eye(3)) and np.linalg.det(turn) == 1.0 for turn in QUARTERS)


def test_a_cloud_has_normals_where_a_plane_fits_it() -> None:
    rng = np.random.default_rng(3)
    plane = np.column_stack([rng.uniform(size=(80, 2)), 1e-3 * rng.normal(size=80)])
    assert (np.abs(normals_of(plane)[:, 2]) > 0.98).all()
    assert not normals_of(rng.normal(size=(60, 3)))[:20].all(axis=1).all(), "a blob has none in most places"
    assert not normals_of(plane[:5]).any(), "nor have a few points"


def test_a_large_cloud_has_the_normals_of_points_drawn_from_it() -> None:
    sphere = np.random.default_rng(5).normal(size=(MOST + 1500, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    normals = normals_of(sphere + 7.0)
    assert len(normals) == len(sphere)
    assert (np.abs(np.einsum("ki,ki->k", normals, sphere)) > 0.95).all()


def test_points_count_where_their_face_faces_as_the_cloud_does() -> None:
    up, aside, half, none = np.eye(3)[2], np.eye(3)[0], np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0), np.zeros(3)
    faces, cloud = np.array([up, up, aside, up, aside]), np.array([up, -up, up, half, none])
    assert agreement(faces, cloud).tolist() == [1.0, 1.0, 0.0, 1.0, 1.0]
