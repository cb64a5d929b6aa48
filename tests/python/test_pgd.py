"""Paper A's separated series: against the exact one, against Newton, between positions, and out to ParaView."""

from __future__ import annotations

import pickle
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

import viscera as vs
from viscera.pgd import Newton, Pgd, error_analysis

LOAD = 6.0


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")


@pytest.fixture(scope="module")
def top(bar: vs.Mesh) -> np.ndarray:
    return np.flatnonzero((bar.points[:, 2] == 0.1) & (bar.points[:, 0] > 0))


@pytest.fixture(scope="module")
def direct(organ: vs.Organ, top: np.ndarray) -> Pgd:
    return organ.pgd(top, load=LOAD, order=5, tolerance=None)


@pytest.fixture(scope="module")
def greedy(organ: vs.Organ, top: np.ndarray) -> Pgd:
    return organ.pgd(top, load=LOAD, order=5, tolerance=1e-6, stagnation=1e-3, max_iterations=60)


def relative(u: np.ndarray, exact: np.ndarray) -> float:
    return float(np.linalg.norm(u - exact) / np.linalg.norm(exact))


def test_the_separated_series_is_the_exact_one(direct: Pgd, greedy: Pgd, top: np.ndarray) -> None:
    assert direct.positions.tolist() == top.tolist()
    assert direct.counts == [len(top)] * 5
    assert all(order.G.shape == (len(order.F), len(top)) for order in greedy.orders)
    assert greedy.errors(direct).max() < 1e-4
    assert all(len(order.sizes) == len(order.iterations) == len(order.F) for order in greedy.orders)
    assert greedy.seconds > 0


def test_its_orders_are_those_of_a_path(organ: vs.Organ, direct: Pgd, top: np.ndarray) -> None:
    node = int(top[-1])
    series = organ.path(force=direct.force(node), order=5, max_expansions=1).expansions[0].displacement
    assert direct.series(node) == pytest.approx(series, rel=1e-8, abs=1e-12)


def test_it_approaches_newton_as_the_order_grows(organ: vs.Organ, direct: Pgd, top: np.ndarray) -> None:
    node, a = int(top[-2]), 0.3
    exact = organ.solve(force=direct.force(node, a)).displacement
    errors = [relative(direct.displacement(node, a, order=order), exact) for order in range(1, 6)]
    assert all(low < high / 2 for high, low in pairwise(errors))
    assert relative(direct.displacement(node, a, pade=True), exact) < errors[-1]


def test_a_load_pushes_in_and_may_be_spread(organ: vs.Organ, top: np.ndarray) -> None:
    points = organ.mesh.points
    node = int(top[np.argmin(np.linalg.norm(points[top] - (0.2, 0.05, 0.1), axis=1))])
    point, patch = (organ.pgd(top, load=LOAD, order=1, radius=radius) for radius in (0.0, 0.07))
    assert point.displacement(node)[node, 2] < 0
    assert point.force(node)[node] == pytest.approx((0, 0, -LOAD))
    spread = patch.force(node)
    assert spread.sum(axis=0) == pytest.approx((0, 0, -LOAD))
    assert np.count_nonzero(spread[:, 2]) > 1
    assert patch.displacement(node)[node, 2] > point.displacement(node)[node, 2]


def test_between_positions_it_is_interpolated(direct: Pgd, top: np.ndarray) -> None:
    points, triangles = direct.mesh.points, direct.mesh.surface
    corners = triangles[np.isin(triangles, top).all(axis=1)][0]
    shares = np.array([0.2, 0.3, 0.5])
    blend = sum(share * direct.displacement(int(node)) for share, node in zip(shares, corners, strict=True))
    assert direct.displacement(shares @ points[corners]) == pytest.approx(blend, rel=1e-9, abs=1e-15)
    node = int(corners[0])
    assert direct.displacement(points[node]) == pytest.approx(direct.displacement(node), rel=1e-9, abs=1e-15)


def test_projection_needs_fewer_pairs_for_the_same_field(direct: Pgd, greedy: Pgd) -> None:
    for model in (direct, greedy):
        few = model.project(0.02)
        assert all(a < b for a, b in zip(few.counts, model.counts, strict=True))
        for ours, exact in zip(few.orders, model.orders, strict=True):
            gap = model.weights @ (ours.table() - exact.table()) ** 2
            size = model.weights @ exact.table() ** 2
            assert 0 < gap.sum() <= 0.02**2 * size.sum()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"terms": 3}, r"terms must be several whole numbers, such as \(1, 10, 100\), got 3"),
        ({"terms": "12"}, "terms must be several whole numbers"),
        ({"terms": (0,)}, "each of terms must be a whole number"),
        ({"terms": ("a",)}, "each of terms must be a whole number"),
        ({"orders": (1.5,)}, "each of orders must be a whole number"),
    ],
)
def test_error_analysis_says_what_it_wants(direct: Pgd, given: dict[str, Any], words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        error_analysis(direct, direct, **given)


def test_error_analysis_is_a_table(organ: vs.Organ, direct: Pgd, top: np.ndarray) -> None:
    best = direct.project(0.0)
    table = error_analysis(best, direct, terms=(1, 4, 16), orders=(1, 5), loads=(0.2,))
    assert set(table) == {"terms", "order", "load", "mean_error", "worst_error"}
    assert {len(column) for column in table.values()} == {6}
    highest = table["mean_error"][table["order"] == 5]
    assert (np.diff(highest) < 0).all()
    assert (table["mean_error"] <= table["worst_error"]).all()
    full = error_analysis(direct, Newton(organ, direct), terms=(len(top),), loads=(0.2,), positions=[int(top[-1])])
    assert (np.diff(full["worst_error"]) < 0).all(), "every order brings it closer to Newton"


def test_modes_and_paths_read_back(greedy: Pgd, tmp_path: Path, top: np.ndarray) -> None:
    few = greedy.truncated(3)
    listing, *files = few.write(tmp_path / "modes")
    assert re.findall(r'timestep="([\d.]+)" file="(.*?)"', listing.read_text()) == [
        (f"{i + 1}.0", file.name) for i, file in enumerate(files)
    ]
    second = meshio.read(files[1])
    assert second.points == pytest.approx(few.mesh.points)
    assert second.point_data["F_4"] == pytest.approx(few.orders[3].F[1])
    assert second.point_data["G_4"][top] == pytest.approx(few.orders[3].G[1])
    assert not np.delete(second.point_data["G_4"], top).any()
    _, first, last = few.write_path(tmp_path / "path", [int(top[0]), few.mesh.points[top[-1]]], 0.5)
    assert meshio.read(first).point_data["displacement"] == pytest.approx(few.displacement(int(top[0]), 0.5))
    assert meshio.read(last).point_data["displacement"] == pytest.approx(few.displacement(int(top[-1]), 0.5))


def test_what_is_refused(organ: vs.Organ, direct: Pgd, top: np.ndarray, tmp_path: Path) -> None:
    cases = [
        ({"load": 0.0}, "load 0 N; it must be finite and not zero"),
        ({"load": float("nan")}, "load must be a number"),
        ({"load": 1.0, "order": 0}, "order must be a whole number from 1 to 15, got 0"),
        ({"load": 1.0, "order": 16}, "from 1 to 15, got 16"),
        ({"load": 1.0, "tolerance": 2.0}, "tolerance must be a number above 0 and below 1, got 2.0"),
        ({"load": 1.0, "stagnation": 0.0}, "stagnation must be"),
        ({"load": 1.0, "max_terms": 0}, "max_terms must be"),
        ({"load": 1.0, "radius": -1.0}, "radius -1 m"),
    ]
    for settings, words in cases:
        with pytest.raises(ValueError, match=words):
            organ.pgd(top, **settings)  # type: ignore[arg-type]
    inner = int(np.setdiff1d(np.arange(len(organ.mesh.points)), top)[0])
    with pytest.raises(vs.VisceraError, match=f"node {inner} is no load position"):
        direct.displacement(inner)
    with pytest.raises(vs.VisceraError, match="from the load positions"):
        direct.displacement((0.2, 0.05, -0.5))
    with pytest.raises(vs.VisceraError, match="order must be a whole number from 1 to 5, got 6"):
        direct.displacement(int(top[0]), order=6)
    with pytest.raises(vs.VisceraError, match=r"the pairs of each order that stay must be a whole number .*, got 0"):
        direct.truncated(0)
    with pytest.raises(vs.VisceraError, match=r"tolerance must be a number from 0 and below 1, got 1.0"):
        direct.project(1.0)
    with pytest.raises(vs.VisceraError, match="different meshes or positions"):
        direct.errors(organ.pgd(top[top > top[2]], load=LOAD, order=1))


def test_only_models_of_one_load_on_one_organ_are_compared(organ: vs.Organ, direct: Pgd, top: np.ndarray) -> None:
    softer = organ.with_law(vs.NeoHookean(young=5e4, poisson=0.3))
    longer = organ.with_mesh(vs.mesh(2.0 * organ.mesh.points, organ.mesh.cells))
    for other, words in (
        (organ.pgd(top, load=2 * LOAD, order=5), "of different loads, 6 and 12 N"),
        (organ.pgd(top, load=LOAD, order=5, radius=0.06), "of different radii, 0 and 0.06 m"),
        (softer.pgd(top, load=LOAD, order=5), r"of different laws, NeoHookean\(.*\) and NeoHookean\(.*\); make both"),
        (longer.pgd(top, load=LOAD, order=5), "different meshes or positions"),
        (organ.pgd(top, load=LOAD, order=1), "both models are summed must be a whole number from 1 to 1, got 5"),
    ):
        with pytest.raises(vs.VisceraError, match=words):
            direct.errors(other)


def test_a_folder_that_cannot_be_written_to_is_refused(direct: Pgd, tmp_path: Path, top: np.ndarray) -> None:
    few, taken = direct.truncated(1), tmp_path / "taken"
    taken.write_text("a file", encoding="utf-8")
    for write in (few.write, lambda folder: few.write_path(folder, [int(top[0])])):
        with pytest.raises(vs.VisceraError, match=r"taken: no folder can be made there .a file has that name"):
            write(taken)
        with pytest.raises(vs.VisceraError, match=r"the folder '.*nodir' does not exist; create it first"):
            write(tmp_path / "nodir" / "modes")
    assert not (tmp_path / "nodir").exists()


@pytest.mark.parametrize(
    "law",
    [
        vs.HolzapfelGasserOgden(1e4, 8e3, 1.1, fibres=[(1, 0.5, 0), (1, -0.5, 0)], poisson=0.4),
        vs.StrainEnergy("mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2 + mu*max(J - 1, 0)**2", mu=1e4, lam=1e4),
    ],
)
def test_a_law_without_a_series_about_rest_is_refused(bar: vs.Mesh, law: vs.laws.Law) -> None:
    with pytest.raises(vs.VisceraError, match=r"no power series (about rest|at the point)"):
        vs.Organ(bar, law, fixed="root").pgd("tip", load=1.0, order=2)


@pytest.mark.parametrize("tolerance", [0.05, None])
def test_orders_without_pairs_answer_all_questions(bar: vs.Mesh, tolerance: float | None, tmp_path: Path) -> None:
    """Of a linear law nothing is left beyond the first order; exact orders of zeros have no pairs once projected."""
    organ = vs.Organ(bar, vs.Linear(young=1e5, poisson=0.3), fixed="root")
    made = organ.pgd("tip", load=LOAD, order=3, tolerance=tolerance)
    few = made.project(0.0)
    assert few.counts[1:] == [0, 0]
    assert few.orders[2].F.shape == (0, *bar.points.shape)
    node = int(made.positions[0])
    first = made.displacement(node, 0.5, order=1)
    assert np.abs(first).max() > 0
    for model in (made, few, made.truncated(100), few.truncated(100), pickle.loads(pickle.dumps(few))):
        for pade in (False, True):
            assert model.displacement(node, 0.5, pade=pade) == pytest.approx(first, rel=1e-9, abs=1e-15)
        assert not model.series(node)[2:].any()
        assert model.errors(made).max() < 1e-9
        assert model.project(0.1).displacement(node, 0.5).shape == first.shape
        assert len(model.write(tmp_path / "modes")) == 1 + max(model.counts)
        _, file = model.write_path(tmp_path / "path", [node], 0.5)
        assert meshio.read(file).point_data["displacement"] == pytest.approx(first, rel=1e-9, abs=1e-15)
    table = error_analysis(few, made, terms=(1, 100), loads=(0.5,), positions=[node])
    assert (table["worst_error"][-1] < 1e-9).all()


def test_supports_alone_hold_an_organ(bar: vs.Mesh) -> None:
    bed = vs.ElasticSupport("root", stiffness=1e7)
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), supports=[bed])
    model = organ.pgd("tip", load=0.5, order=6, tolerance=None)
    node = int(model.positions[0])
    assert relative(model.displacement(node), Newton(organ, model).displacement(node)) < 1e-4


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda m, o: m.displacement(m.positions[0], order=1.5), "order must be a whole number from 1 to 5, got 1.5"),
        (lambda m, o: m.series(m.positions[0], order=True), "order must be a whole number from 1 to 5, got True"),
        (lambda m, o: m.truncated(1.5), "the pairs of each order that stay must be a whole number .*, got 1.5"),
        (lambda m, o: m.project("5%"), "tolerance must be a number from 0 and below 1, got '5%'"),
        (lambda m, o: m.errors(m, a="1"), "the load factor a must be a number .*, got '1'"),
        (lambda m, o: m.errors(m, order=1.5), "order must be a whole number from 1 to 5, got 1.5"),
        (lambda m, o: m.errors(o), "the model to compare with must be a Pgd, as Organ.pgd returns it, got Organ"),
    ],
)
def test_what_is_asked_of_a_series_is_checked(organ: vs.Organ, direct: Pgd, ask: Any, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        ask(direct, organ)


@pytest.mark.parametrize("factor", [float("nan"), float("inf"), "x", None])
def test_a_load_factor_is_a_number(direct: Pgd, factor: Any) -> None:
    for ask in (direct.displacement, direct.force):
        with pytest.raises(vs.VisceraError, match="load factor a must be"):
            ask(int(direct.positions[0]), factor)
