"""The check itself: its touches, its errors, its verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import viscera as vs
from viscera.reduced.check import Check, Row, _summary, allowed_error, check, surface_points, unit_vectors


@pytest.fixture(scope="module")
def touch(bar: vs.Mesh) -> vs.Touch:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    return organ.reduce(lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.16), radius=0.07, depth=0.02, order=3)


@pytest.fixture(scope="module")
def result(touch: vs.Touch) -> Check:
    return check(touch, touches=4, seed=1, depths=["1%", "4%"])


def test_every_touch_is_asked_at_every_depth(touch: vs.Touch, result: Check) -> None:
    rows = result.rows
    assert [row.depth_fraction for row in rows] == [0.01, 0.04] * 4
    for row in rows:
        assert np.linalg.norm(row.displacement) == pytest.approx(row.depth_fraction * touch.mesh.diagonal)
        assert row.is_converged
        assert row.displacement_error is not None
        assert row.displacement_error < 0.02


def test_an_error_is_the_distance_from_the_full_solution(touch: vs.Touch, result: Check) -> None:
    row = result.rows[1]
    patch = touch.patch(row.point)
    full = touch.organ().solve(displacement={patch: row.displacement})
    answer = touch(row.point, row.displacement)
    error = np.linalg.norm(answer.displacement - full.displacement) / np.linalg.norm(full.displacement)
    assert row.displacement_error == pytest.approx(error, rel=1e-5)
    force_error = np.linalg.norm(answer.force - full.reaction(patch)) / np.linalg.norm(full.reaction(patch))
    assert row.force_error == pytest.approx(force_error, rel=1e-5)


def test_worst_and_median_are_of_the_rows(result: Check) -> None:
    deep = [row.displacement_error or 0.0 for row in result.rows if row.depth_fraction == 0.04]
    summary = result.depths[1]
    assert summary.worst["displacement_error"] == max(deep)
    assert summary.median["displacement_error"] == np.median(deep)
    assert set(result.to_json()) >= {"touches", "worst", "median"}
    assert set(result.to_json()["touches"][0]) >= {
        "point", "displacement", "depth_fraction", "displacement_error", "force_error", "estimate", "is_trusted",
    }  # fmt: skip
    assert len(result.table().splitlines()) == 2 + 2 * len(result.depths)


def test_the_same_seed_asks_the_same(touch: vs.Touch, result: Check) -> None:
    again = check(touch, touches=1, seed=1, depths=["1%"])
    other = check(touch, touches=1, seed=2, depths=["1%"])
    assert again.rows[0].point != other.rows[0].point
    assert check(touch, touches=1, seed=1, depths=["1%"]).rows == again.rows


def test_contact_points_cover_the_surface_by_area(touch: vs.Touch) -> None:
    points = surface_points(touch, 20_000, np.random.default_rng(0))
    assert points[:, 2] == pytest.approx(0.1)
    assert points[:, :2].min(axis=0) == pytest.approx([0.2, 0.0], abs=2e-3)
    assert points.mean(axis=0) == pytest.approx([0.3, 0.05, 0.1], abs=1e-3)
    assert points[:, 0].std() == pytest.approx(0.2 / np.sqrt(12), rel=0.02)


def test_directions_cover_the_sphere() -> None:
    vectors = unit_vectors(20_000, np.random.default_rng(0))
    assert np.linalg.norm(vectors, axis=1) == pytest.approx(1.0)
    assert vectors.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.02)
    assert (vectors**2).mean(axis=0) == pytest.approx([1 / 3] * 3, abs=0.01)


def test_default_depths_stop_at_the_models_own(touch: vs.Touch) -> None:
    deepest = touch.depth / touch.mesh.diagonal
    assert deepest < 0.05
    assert {row.depth_fraction for row in check(touch, touches=1).rows} == {deepest}
    for depths in (["10%"], [0.0], [-0.01], []):
        with pytest.raises(vs.VisceraError, match="the model's own depth"):
            check(touch, touches=1, depths=depths)
    with pytest.raises(vs.VisceraError, match="touches must be a whole number from 1 to 1000000, got 0"):
        check(touch, touches=0)


def row(error: float | None, depth: float, *, is_trusted: bool) -> Row:
    return Row([0.0] * 3, [0.0] * 3, depth, error, error, 0.0, is_trusted, error is not None, "")


def test_the_limits() -> None:
    assert [allowed_error(f) for f in (0.01, 0.05, 0.0501, 0.1, 0.2)] == [0.01, 0.01, 0.05, 0.05, 0.05]
    assert row(0.009, 0.05, is_trusted=True).is_within_limits
    assert not row(0.011, 0.05, is_trusted=True).is_within_limits
    assert row(0.011, 0.05, is_trusted=False).is_within_limits
    assert row(None, 0.05, is_trusted=True).is_within_limits


def test_a_truth_that_newton_cannot_find_is_reported_not_dropped(
    touch: vs.Touch, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("viscera.reduced.check.PATIENCE", {"max_iterations": 1, "smallest_step": 0.9})
    result = check(touch, touches=2, depths=["4%"])
    assert [row.is_converged for row in result.rows] == [False, False]
    assert result.rows[0].displacement_error is None
    assert (result.overall.touches, result.overall.converged) == (2, 0)
    assert result.verdict == "nothing could be checked"
    assert not result.is_passed


def test_no_trusted_answer_is_nothing_to_pass_by(result: Check) -> None:
    def judged(*answers: tuple[float | None, bool]) -> str:
        rows = [row(error, 0.04, is_trusted=is_trusted) for error, is_trusted in answers]
        return replace(result, rows=rows, overall=_summary(rows, None)).verdict

    right, wrong, doubted, unknown = (0.001, True), (0.5, True), (0.001, False), (None, True)
    assert judged(right, doubted, doubted) == "passed"
    assert judged(doubted, doubted) == "nothing could be checked"
    assert judged(right, unknown) == "passed"
    assert judged(right, unknown, unknown) == "nothing could be checked", "most full solutions did not converge"
    assert judged(doubted, unknown) == "nothing could be checked", "the trusted one has no truth beside it"
    assert judged(wrong, unknown, unknown) == "failed"


def test_the_share_of_trusted_answers_is_of_all(result: Check) -> None:
    rows = [row(0.001, 0.04, is_trusted=True), row(None, 0.04, is_trusted=True), row(0.1, 0.04, is_trusted=False)]
    assert replace(result, rows=rows).to_json()["trusted_share"] == pytest.approx(2 / 3)


def test_what_the_progress_callback_raises_stops_the_check(touch: vs.Touch) -> None:
    def stop(done: int, total: int, stage: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check(touch, touches=50, progress=stop)
