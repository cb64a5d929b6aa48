"""Tetrahedra from surfaces: what is filled, healed, turned, told and refused."""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.scans.meshing import least_angles

VOXEL = 0.003


def box(low: float, high: float) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Points and outward triangles of a cube, turned so that no face lies along a grid."""
    points = np.array(list(np.ndindex(2, 2, 2))) * (high - low) + low
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [[q[0], q[k], q[k + 1]] for q in quads for k in (1, 2)]
    turn, _ = np.linalg.qr([[1.0, 0.3, 0.2], [-0.2, 1.0, 0.4], [0.1, -0.5, 1.0]])
    return points @ (turn * np.linalg.det(turn)).T, np.array(triangles, dtype=np.uint32)


def test_a_surface_is_filled(tmp_path: Path) -> None:
    points, triangles = box(-40.0, 40.0)
    meshio.write(tmp_path / "box.stl", meshio.Mesh(points, [("triangle", triangles.astype(np.int64))]))
    mesh = vs.mesh_surface(tmp_path / "box.stl", edge="10 mm", units="mm")
    assert mesh.messages == ()
    assert mesh.volume == pytest.approx(0.08**3, rel=1e-3)
    assert least_angles(mesh.points, mesh.cells).min() > 8.0
    corners = np.stack([points.min(axis=0), points.max(axis=0)])
    assert np.allclose(mesh.bounding_box, 1e-3 * corners, atol=4e-3), "corners are rounded"


def test_holes_overlaps_and_turned_triangles_are_healed_and_told() -> None:
    points, triangles = box(-0.04, 0.04)
    whole = vs.mesh_surface((points, triangles), edge=0.012).volume
    assert whole == pytest.approx(0.08**3, rel=1e-3)
    turned = vs.mesh_surface((points, triangles[:, ::-1]), edge=0.012)
    assert turned.messages == ("turned the surface round: its triangles looked inward",)
    assert turned.volume == pytest.approx(whole, rel=1e-3)
    more, faces = box(0.0, 0.07)
    two = vs.mesh_surface((np.concatenate([points, more]), np.concatenate([triangles, faces + 8])), edge=0.012)
    told = re.search(r"parts of the surface overlap in ([\d.]+) ml; they are joined", " ".join(two.messages))
    assert told is not None
    assert float(told[1]) == pytest.approx(1e6 * 0.04**3, rel=0.02)
    assert two.volume == pytest.approx(0.08**3 + 0.07**3 - 0.04**3, rel=0.01)
    assert two.facts["n_parts"] == 1


def ball_surface(radius: float) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Points and outward triangles of a ball: an octahedron, whose triangles are quartered four times."""
    points = np.concatenate([np.eye(3), -np.eye(3)])
    corners = points[[[i, j, k] for i in (0, 3) for j in (1, 4) for k in (2, 5)]]
    for _ in range(4):
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = a + b, b + c, c + a
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        corners = np.concatenate([np.stack(part, axis=1) for part in parts])
        corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    is_inward = np.linalg.det(corners) < 0.0
    corners[is_inward] = corners[is_inward, ::-1]
    points, numbers = np.unique(corners.reshape(-1, 3).round(12), axis=0, return_inverse=True)
    return radius * points, numbers.reshape(-1, 3).astype(np.uint32)


@pytest.mark.parametrize("odd", [1, 200, 1100, 2000])
def test_triangles_that_face_different_ways_are_turned_and_told(odd: int) -> None:
    points, triangles = ball_surface(0.03)
    whole = vs.mesh_surface((points, triangles), edge=0.008)
    assert whole.messages == ()
    chosen = np.random.default_rng(0).choice(len(triangles), odd, replace=False)
    mixed = triangles.copy()
    mixed[chosen] = mixed[chosen, ::-1]
    mesh = vs.mesh_surface((points, mixed), edge=0.008)
    assert mesh.volume == pytest.approx(whole.volume, rel=1e-3)
    fewer = min(odd, len(triangles) - odd)
    assert mesh.messages[0] == f"turned {fewer} of 2048 triangles that faced another way than those around them"
    assert len(mesh.messages) == (1 if fewer == odd else 2), "and then the whole surface"


def test_the_inside_of_a_cavity_stays_inward() -> None:
    points, triangles = ball_surface(0.03)
    hollow = np.concatenate([triangles, triangles[:, ::-1] + len(points)])
    hollow[[7, 4000]] = hollow[[7, 4000], ::-1]
    places = np.concatenate([points, 0.5 * points])
    mesh = vs.mesh_surface((places, hollow), edge=0.006)
    assert mesh.messages == ("turned 2 of 4096 triangles that faced another way than those around them",)
    assert mesh.volume == pytest.approx(7 / 8 * 4 / 3 * np.pi * 0.03**3, rel=0.01)


def test_a_surface_with_one_side_is_told() -> None:
    """A ball beside a Moebius strip, whose triangles cannot all face one way."""
    points, triangles = ball_surface(0.03)
    n, angle = 24, np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    half = np.stack([np.cos(angle / 2) * np.cos(angle), np.cos(angle / 2) * np.sin(angle), np.sin(angle / 2)], axis=1)
    middle = 0.02 * np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=1) + [0.08, 0.0, 0.0]
    strip = np.stack([middle - 0.004 * half, middle + 0.004 * half], axis=1).reshape(-1, 3)
    first = 2 * np.arange(n)
    quads = np.stack([first, first + 1, first + 2, first + 3], axis=1)
    quads[-1, 2:] = [1, 0]  # half a turn
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [2, 1, 3]]]) + len(points)
    mesh = vs.mesh_surface((np.concatenate([points, strip]), np.concatenate([triangles, faces])), edge=0.008)
    assert mesh.messages[0].startswith("the triangles of the surface cannot all face one way")
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.03**3, rel=0.02)


def test_points_that_no_triangle_names_do_not_count() -> None:
    points, triangles = box(-0.04, 0.04)
    mesh = vs.mesh_surface((points, triangles), edge=0.012)
    more = vs.mesh_surface((np.concatenate([[[900.0, 0.0, 0.0]], points]), triangles + 1), edge=0.012)
    assert np.array_equal(mesh.points, more.points)
    assert np.array_equal(mesh.cells, more.cells)


def test_a_ball_with_a_hole_is_closed() -> None:
    """A hole of 4 % of a ball's surface: the winding number closes it with a shallow cap."""
    ball = vs.Scan(np.linalg.norm(np.indices((30, 30, 30)) - 14.5, axis=0) < 11.0, VOXEL * np.eye(3, 4))
    mesh = ball.mesh(1, edge=0.006)
    middles = mesh.points[mesh.surface].mean(axis=1)
    height = (middles[:, 2] - 14.5 * VOXEL) / (11.0 * VOXEL)
    open_surface = mesh.surface[height < 0.92]
    healed = vs.mesh_surface((mesh.points, open_surface), edge=0.008)
    assert any("the surface is open at" in message for message in healed.messages)
    assert healed.volume == pytest.approx(mesh.volume, rel=0.02)
    assert healed.facts["n_parts"] == 1


@pytest.mark.parametrize(
    ("surface", "words"),
    [
        ((np.zeros((3, 3)), np.array([[0, 1, 2]])), "is longer than 'organ'"),
        ((np.zeros((3, 2)), np.array([[0, 1, 2]])), "points"),
        ((np.zeros((3, 3)), np.array([[0, 1, 5]])), "names a point that is not one of 3"),
        (np.zeros((3, 3)), r"a surface is a file's path, or a pair: points \(n, 3\) and triangles \(t, 3\)"),
        (None, r"a surface is a file's path, or a pair"),
        ((np.zeros((3, 3)), np.array([["a", "b", "c"]])), r"triangles \(t, 3\) of whole numbers"),
        ((np.zeros((3, 3)), np.array([[0.0, 1.0, np.nan]])), r"triangles \(t, 3\) of whole numbers"),
        ((np.zeros((3, 3)), np.array([[0.0, 1.0, 1e30]])), "names a point that is not one of 3"),
        ((np.zeros((3, 3)), np.array([[0.0, 1.0, 1.5]])), r"triangles \(t, 3\) of whole numbers"),
        ((np.zeros((3, 3)), [[0, 1, 2], [0, 1]]), r"triangles \(t, 3\) of whole numbers"),
        (([["a", "b", "c"]], np.array([[0, 0, 0]])), r"a surface needs points \(n, 3\) of numbers"),
        ("missing.stl", "no such file"),
        ("surface.docx", "no such file|unknown surface format"),
    ],
)
def test_surfaces_that_are_none_are_refused(surface: object, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        vs.mesh_surface(surface, edge=0.01)  # type: ignore[arg-type]


def test_progress_that_cannot_be_called_is_refused() -> None:
    with pytest.raises(vs.VisceraError, match=r"progress must be a function of .done, total, stage., or None, got 3"):
        vs.mesh_surface((np.zeros((3, 3)), np.array([[0, 1, 2]])), edge=0.01, progress=3)  # type: ignore[arg-type]
