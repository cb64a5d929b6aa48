"""The built-in organs: sizes, shape, sets, and that the generator in the repository makes these very files."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera.inspection import report

ORGANS = {"liver": vs.organs.liver, "artery": vs.organs.artery, "beam": vs.organs.beam}
EVERY = pytest.mark.parametrize("organ", ORGANS.values(), ids=ORGANS)


def dihedral_angles(mesh: vs.Mesh) -> np.ndarray:
    """The six angles of each cell between its faces (m, 6) [degrees]."""
    x = mesh.points[mesh.cells]
    faces = [np.cross(x[:, b] - x[:, a], x[:, c] - x[:, a]) for a, b, c in ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))]
    units = [normal / np.linalg.norm(normal, axis=1, keepdims=True) for normal in faces]
    cosines = [-(units[i] * units[j]).sum(axis=1) for i in range(4) for j in range(i)]
    angles: np.ndarray = np.degrees(np.arccos(np.clip(cosines, -1, 1))).T
    return angles


@EVERY
def test_an_organ_is_sound(organ: Callable[[], vs.Mesh]) -> None:
    mesh = organ()
    facts = report(mesh)
    assert facts["problems"] == []
    assert facts["messages"] == []
    assert facts["parts"] == 1
    assert facts["quality"]["min"] > 0.25
    assert dihedral_angles(mesh).min() > 10


@EVERY
def test_the_surface_is_a_closed_manifold(organ: Callable[[], vs.Mesh]) -> None:
    triangles = organ().surface.astype(int)
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    directed, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 1).all(), "each edge once in each direction"
    assert np.array_equal(directed, np.unique(edges[:, ::-1], axis=0))
    for node in np.unique(triangles):  # the triangles around a node form one fan
        rim = [tuple(np.roll(t, -int(np.argmax(t == node)))[1:]) for t in triangles[(triangles == node).any(axis=1)]]
        following = dict(rim)
        start = here = rim[0][0]
        for step in range(len(rim)):
            here = following[here]
            assert (here == start) == (step == len(rim) - 1)


@EVERY
def test_sets_lie_on_the_surface(organ: Callable[[], vs.Mesh]) -> None:
    mesh = organ()
    for name in mesh.sets:
        assert np.isin(mesh.nodes(name), mesh.surface_nodes).all()


def test_the_size_of_the_liver() -> None:
    liver = vs.organs.liver()
    assert (len(liver.points), len(liver.cells)) == (2613, 11714)
    assert liver.volume == pytest.approx(1.5e-3, rel=1e-4)
    assert np.ptp(liver.bounding_box, axis=0).ravel() == pytest.approx([0.224, 0.145, 0.146], abs=1e-3)
    pairs = liver.points[liver.cells[:, [0, 0, 0, 1, 1, 2]]] - liver.points[liver.cells[:, [1, 2, 3, 2, 3, 3]]]
    lengths = np.linalg.norm(pairs, axis=2)
    assert lengths.max() / lengths.min() < 4, "edges of one size"


def test_the_sets_of_the_liver() -> None:
    liver = vs.organs.liver()
    sizes = {name: len(nodes) for name, nodes in liver.sets.items()}
    assert 60 <= sizes["hilum"] <= 120
    assert 350 <= sizes["anterior"] <= 600
    between = liver.points[liver.nodes("anterior")][:, None] - liver.points[liver.nodes("hilum")]
    assert np.linalg.norm(between, axis=2).min() > 0.015
    center = liver.points.mean(axis=0)
    assert liver.points[liver.nodes("hilum")].mean(axis=0)[1] > center[1], "held from behind"
    assert liver.points[liver.nodes("anterior")].mean(axis=0)[1] < center[1], "touched from in front"
    assert liver.points[liver.nodes("tip"), 0].min() > 0.09, "the tip is at the patient's left"


def test_it_is_a_liver() -> None:
    """A big right lobe tapering to a thin left one, domed above, hollow below."""
    liver = vs.organs.liver()
    x, z = liver.points[:, 0], liver.points[:, 2]
    volumes = np.linalg.det(liver.points[liver.cells[:, 1:]] - liver.points[liver.cells[:, :1]]) / 6
    middles = liver.points[liver.cells].mean(axis=1)
    to_the_right = volumes[middles[:, 0] < 0.02].sum() / volumes.sum()  # of the falciform ligament
    assert 0.65 < to_the_right < 0.9
    height = [np.ptp(z[np.abs(x - place) < 0.012]) for place in (-0.08, -0.03, 0.03, 0.08)]
    assert height[0] > height[2] > height[3]
    corners = liver.points[liver.surface]
    looks_down = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] < 0
    below = np.unique(liver.surface[looks_down])
    in_the_middle = below[np.hypot(*(liver.points[below, :2] - [-0.01, 0.0]).T) < 0.03]
    rim = below[np.hypot(*(liver.points[below, :2] - [-0.01, 0.0]).T) > 0.06]
    assert z[in_the_middle].mean() > z[rim].mean() + 0.01, "the visceral face is hollow"


def test_the_artery() -> None:
    artery = vs.organs.artery()
    assert (len(artery.points), len(artery.cells)) == (402, 1104)
    for name, height in {"bottom": 0.0, "middle": 0.02, "top": 0.04}.items():
        ring = artery.points[artery.nodes(name)]
        assert len(ring) == 24
        assert ring[:, 2] == pytest.approx(np.full(24, height), abs=1e-7)
        radius = np.linalg.norm(ring - ring.mean(axis=0), axis=1)
        assert np.sort(radius) == pytest.approx(np.repeat([0.0025, 0.0035], 12), abs=1e-6)
    assert np.isin(np.arange(len(artery.points)), artery.surface_nodes).all(), "one cell through the wall"
    euler = len(artery.surface_nodes) - len(artery.surface) // 2
    assert euler == 2 - 2 * 2, "a tube with one branch: two handles"


def test_the_beam() -> None:
    beam = vs.organs.beam()
    assert (len(beam.points), len(beam.cells)) == (525, 1920)
    assert beam.volume == pytest.approx(0.04)
    assert {name: len(nodes) for name, nodes in beam.sets.items()} == {"clamp": 25, "tip": 25, "top": 105}
    assert (beam.points[beam.nodes("tip"), 0] == 1).all()


@pytest.mark.parametrize("name", ["beam", "artery"])
def test_the_generator_makes_these_organs(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The liver takes half a minute; `python organs/generate.py` leaves its file unchanged."""
    folder = Path(__file__).parents[2] / "organs"
    monkeypatch.setattr(sys, "path", [str(folder), *sys.path])
    points, cells, sets = runpy.run_path(str(folder / f"{name}.py"))[name]()
    packaged = ORGANS[name]()
    np.testing.assert_allclose(packaged.points, points, rtol=0, atol=1e-7)
    assert np.array_equal(packaged.cells, cells)
    assert all(np.array_equal(packaged.nodes(key), np.unique(nodes)) for key, nodes in sets.items())
