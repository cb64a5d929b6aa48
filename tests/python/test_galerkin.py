"""Several touches at once: the Galerkin model against full solutions, and what it refuses."""

from __future__ import annotations

import copy
import os
import pickle
import signal
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Timer
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.output import state as statefile
from viscera.reduced.galerkin import Galerkin

LEFT, RIGHT = (0.3, 0.05, 0.1), (0.15, 0.04, 0.1)
PUSHES = np.array([[0.004, 0.0, -0.010], [-0.003, 0.002, -0.012]])


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.4), fixed="root", element="P1")


@pytest.fixture(scope="module")
def touch(organ: vs.Organ) -> vs.Touch:
    return organ.reduce(lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.05), radius=0.07, depth=0.02, order=3)


@pytest.fixture(scope="module")
def fingers(touch: vs.Touch) -> Galerkin:
    return touch.galerkin(tolerance=0.005)


def relative(value: Any, truth: Any) -> float:
    return float(np.linalg.norm(value - truth) / np.linalg.norm(truth))


def test_two_touches_are_what_the_full_organ_answers_and_more_than_their_sum(
    fingers: Galerkin, touch: vs.Touch, organ: vs.Organ
) -> None:
    held = fingers.solve([(LEFT, PUSHES[0]), (RIGHT, PUSHES[1])])
    patches = [touch.patch(LEFT), touch.patch(RIGHT)]
    full = organ.solve(displacement=dict(zip(patches, PUSHES, strict=True)))
    forces = np.array([full.reaction(patch) for patch in patches])
    assert held.is_converged
    assert held.status == "converged"
    assert relative(held.displacement, full.displacement) < 0.02
    assert relative(held.force, forces) < 0.03
    assert held.shape_error_estimate == pytest.approx(relative(held.displacement, full.displacement), rel=0.2)
    assert held.error_estimate == pytest.approx(relative(held.force, forces), rel=0.2)
    summed = touch(LEFT, PUSHES[0]).displacement + touch(RIGHT, PUSHES[1]).displacement
    assert relative(summed, full.displacement) > 0.2


def test_snapshots_take_what_the_series_miss_into_the_basis(touch: vs.Touch, organ: vs.Organ) -> None:
    pushes = 1.4 * PUSHES
    without, snapshots = (touch.galerkin(snapshots=count).grasp([LEFT, RIGHT]) for count in (0, 40))
    assert snapshots.modes > without.modes
    full = organ.solve(displacement=dict(zip(snapshots.patches, pushes, strict=True)))
    error, held = relative(without.solve(pushes).displacement, full.displacement), snapshots.solve(pushes)
    assert relative(held.displacement, full.displacement) < 0.7 * error


def test_a_grasp_that_does_not_wait_answers_at_once_and_learns(touch: vs.Touch, organ: vs.Organ) -> None:
    pushes = 1.4 * PUSHES
    fingers = touch.galerkin(snapshots=40)
    series, trained = touch.galerkin().grasp([LEFT, RIGHT]), fingers.grasp([LEFT, RIGHT])
    grasp = fingers.grasp([LEFT, RIGHT], wait=False)
    at_once = grasp.solve(pushes).displacement
    if grasp.snapshots == 0:  # a machine with much else to do may come to the touch when all is learned
        assert grasp.modes == series.modes
        assert at_once == pytest.approx(series.solve(pushes).displacement, rel=1e-6, abs=1e-9)
    grasp.wait()
    assert not grasp.is_training
    assert (grasp.modes, grasp.snapshots) == (trained.modes, trained.snapshots)
    full = organ.solve(displacement=dict(zip(grasp.patches, pushes, strict=True)))
    error = relative(series.solve(pushes).displacement, full.displacement)
    # From the field that the series had: the hand has not let go meanwhile.
    assert relative(grasp.solve(pushes, from_last=True).displacement, full.displacement) < 0.7 * error


def test_an_interrupt_ends_taking_hold(touch: vs.Touch) -> None:
    fingers = touch.galerkin(depth=0.05, snapshots=200, tolerance=1e-3)  # a second of snapshots, and more
    Timer(0.1, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        fingers.grasp([LEFT, RIGHT])
    assert fingers.grasp([LEFT]).modes > 0


def test_a_wrong_answer_is_learned(touch: vs.Touch, organ: vs.Organ) -> None:
    pushes = 2.0 * PUSHES
    grasp = touch.galerkin(depth=0.05).grasp([LEFT, RIGHT])
    full = organ.solve(displacement=dict(zip(grasp.patches, pushes, strict=True)))
    before = relative(grasp.solve(pushes).displacement, full.displacement)
    assert grasp.add_snapshot()
    assert relative(grasp.solve(pushes).displacement, full.displacement) < 0.5 * before
    assert not grasp.add_snapshot()
    by_itself = touch.galerkin(snapshots=24).grasp([LEFT, RIGHT], wait=False)
    with pytest.raises(vs.VisceraError, match="by itself"):
        by_itself.add_snapshot()


def test_threads_may_ask_one_grasp(fingers: Galerkin) -> None:
    grasp, shares = fingers.grasp([LEFT, RIGHT]), np.linspace(0.1, 1.0, 40)
    alone = [grasp.solve(share * PUSHES).energy for share in shares]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda share: grasp.solve(share * PUSHES).energy, shares))
    assert together == pytest.approx(alone, rel=1e-6)


def test_a_thread_that_takes_hold_elsewhere_meanwhile_changes_no_answer(touch: vs.Touch) -> None:
    """It does so at the worst moment: just when this one has found that it holds the right places."""
    galerkin = touch.galerkin(snapshots=0)
    points, push = (LEFT, RIGHT), (0.0, 0.0, -0.004)
    one, other = ([(point, push)] for point in points)
    expected = galerkin.solve(one).force
    own, elsewhere = galerkin.grasp([points[0]]), galerkin.grasp([points[1]])

    class Found:
        """The grasp of this thread; who has looked at its points finds another one in its place."""

        solve = own.solve

        @property
        def points(self) -> np.ndarray:
            galerkin._last = elsewhere
            return own.points

    galerkin._last = Found()  # type: ignore[assignment]
    assert galerkin.solve(one).force == pytest.approx(expected, rel=1e-6)
    assert galerkin.solve(other).force != pytest.approx(expected, rel=1e-3)


def test_the_means_of_the_patches_are_the_displacements(fingers: Galerkin) -> None:
    grasp = fingers.grasp([LEFT, RIGHT])
    held = grasp.solve(PUSHES)
    for patch, push in zip(grasp.patches, PUSHES, strict=True):
        assert patch.weights @ held.displacement[patch.nodes] == pytest.approx(push, rel=1e-6)


def test_an_answer_keeps_its_field_when_the_hand_moves_on(fingers: Galerkin) -> None:
    grasp = fingers.grasp([LEFT, RIGHT])
    first = grasp.solve(PUSHES)
    later = grasp.solve(0.5 * PUSHES, from_last=True, stiffness=False)
    assert later.stiffness is None
    assert first.stiffness is not None
    assert first.stiffness.shape == (6, 6)
    assert np.linalg.norm(later.displacement) < 0.8 * np.linalg.norm(first.displacement)
    assert grasp.solve(PUSHES).displacement == pytest.approx(first.displacement, rel=1e-4, abs=1e-7)


def test_the_same_points_are_grasped_once(fingers: Galerkin) -> None:
    fingers.solve([(LEFT, PUSHES[0]), (RIGHT, PUSHES[1])])
    grasp = fingers._last
    fingers.solve([(LEFT, PUSHES[1]), (RIGHT, PUSHES[0])])
    assert fingers._last is grasp
    fingers.solve([(LEFT, PUSHES[0])])
    assert fingers._last is not grasp


def test_beyond_the_depth_of_training_nothing_is_trusted(fingers: Galerkin, touch: vs.Touch) -> None:
    held = fingers.solve([(LEFT, (0, 0, -1.2 * touch.depth)), (RIGHT, (0, 0, 0))])
    assert not held.is_trusted
    assert "more than in training" in held.reason
    assert "not trusted" in repr(held)


def test_a_gentle_touch_is_trusted(fingers: Galerkin) -> None:
    held = fingers.solve([(LEFT, 0.1 * PUSHES[0]), (RIGHT, 0.1 * PUSHES[1])])
    assert held.is_trusted, held
    assert max(held.error_estimate, held.shape_error_estimate) < 0.01
    assert ", trusted" in repr(held)


@pytest.mark.parametrize(
    ("touches", "words"),
    [
        ([], "no touch"),
        ([(LEFT, PUSHES[0]), ((0.3, 0.05, 1.0), PUSHES[1])], "contact 1"),
        ([(LEFT, PUSHES[0]), (LEFT, PUSHES[1])], "so close"),
        ([(LEFT, (0.0, np.nan, 0.0))], "contact displacement"),
        ([((0.3, 0.05), PUSHES[0])], "contact point"),
        (3, r"touches must be pairs \(point, displacement\), got 3"),
        ([(LEFT,)], "touches must be pairs"),
    ],
)
def test_bad_touches_are_refused_in_a_sentence(fingers: Galerkin, touches: Any, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        fingers.solve(touches)


def test_a_search_that_runs_out_of_time_goes_on_in_the_next(fingers: Galerkin, tmp_path: Path) -> None:
    grasp = fingers.grasp([LEFT, RIGHT])
    whole = grasp.solve(PUSHES)
    late = grasp.solve(PUSHES, budget=0.0)
    assert late.stiffness is None, "it belongs to an equilibrium"
    assert (late.status, late.iterations, late.is_converged) == ("out of time", 1, False)
    assert not late.is_trusted
    assert "time" in late.reason
    late.write(tmp_path / "late.vtu")
    assert statefile.read(tmp_path / "late.vtu").doubt == "not_converged"
    whole.write(tmp_path / "whole.vtu")
    assert statefile.read(tmp_path / "whole.vtu").doubt == ""
    steps = [grasp.solve(PUSHES, from_last=True, budget=0.0) for _ in range(20)]
    assert steps[-1].is_converged
    assert relative(steps[-1].force, whole.force) < 1e-4
    assert grasp.solve(PUSHES, budget=10.0).is_converged
    assert grasp.solve(PUSHES, budget=1e19).is_converged, "more seconds than the clock can count"
    for budget in (-1.0, float("nan"), float("inf"), "x", True):
        with pytest.raises(vs.VisceraError, match="budget"):
            grasp.solve(PUSHES, budget=budget)  # type: ignore[arg-type]


def test_a_model_of_low_order_serves_several_touches_by_default(organ: vs.Organ) -> None:
    low = organ.reduce(lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.05), radius=0.07, depth=0.02, order=2)
    touches = [(LEFT, 0.1 * PUSHES[0]), (RIGHT, 0.1 * PUSHES[1])]
    held = low.galerkin().solve(touches)
    assert held.is_converged
    assert held.force == pytest.approx(low.galerkin(order=2).solve(touches).force, rel=1e-9)


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_grasp_says_what_to_keep_instead(fingers: Galerkin, again: Callable[[Any], Any]) -> None:
    for made in (fingers, fingers.grasp([LEFT]), fingers.solve([(LEFT, PUSHES[0])])):
        with pytest.raises(vs.VisceraError, match="neither copied nor pickled; keep the touch"):
            again(made)


def test_a_grasp_is_displaced_in_words_too(fingers: Galerkin) -> None:
    grasp = fingers.grasp([LEFT, RIGHT])
    by_numbers = grasp.solve(PUSHES)
    for words in (
        [["4 mm", 0, "-10 mm"], PUSHES[1]],
        ["(4, 0, -10) mm", "(-3, 2, -12) mm"],
        np.array([["4 mm", "0", "-10 mm"], ["-3 mm", "2 mm", "-12 mm"]]),
    ):
        assert grasp.solve(words).force == pytest.approx(by_numbers.force, rel=1e-4)
    assert grasp.superposed(["(4, 0, -10) mm", PUSHES[1]]) == pytest.approx(grasp.superposed(PUSHES), abs=1e-12)
    assert fingers.solve(np.array([[LEFT, PUSHES[0]], [RIGHT, PUSHES[1]]])).force == pytest.approx(by_numbers.force)


@pytest.mark.parametrize(
    ("displacements", "words"),
    [
        ([["1 ell", 0, 0], PUSHES[1]], "unit 'ell' is unknown"),
        ([PUSHES[0], [0, "1 mm"]], "the displacement of contact 1 must be three lengths"),
        ([PUSHES[0], [0, 0, True]], "the displacement of contact 1 must be three finite numbers"),
        ("(0, 0, -1) cm", "displacements must be .* for each of the 2 contacts"),
        (None, "displacements must be .* for each of the 2 contacts, got None"),
    ],
)
def test_bad_displacements_are_refused_in_a_sentence(fingers: Galerkin, displacements: Any, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        fingers.grasp([LEFT, RIGHT]).solve(displacements)


def test_bad_settings_are_refused_in_a_sentence(touch: vs.Touch, fingers: Galerkin) -> None:
    for order in (9, 2.5, True):
        with pytest.raises(vs.VisceraError, match=f"order must be a whole number from 1 to 3, got {order}"):
            touch.galerkin(order=order)  # type: ignore[arg-type]
    for tolerance in (2.0, None, "x"):
        with pytest.raises(vs.VisceraError, match="tolerance must be a number above 0 and below 1"):
            touch.galerkin(tolerance=tolerance)  # type: ignore[arg-type]
    for depth in (-1.0, 0.0, np.nan, np.inf, True, 2000, 1.01 * touch.mesh.diagonal, "5 m"):
        with pytest.raises(
            vs.VisceraError, match=r"depth must be above 0 and below [\d.]+ m, the diagonal of the organ, got"
        ):
            touch.galerkin(depth=depth)
    with pytest.raises(vs.VisceraError, match="depth 'deep' is not a length"):
        touch.galerkin(depth="deep")
    for snapshots in (-1, 1000, 2.5, True):
        with pytest.raises(vs.VisceraError, match=f"snapshots must be a whole number from 0 to 200, got {snapshots}"):
            touch.galerkin(snapshots=snapshots)  # type: ignore[arg-type]
    with pytest.raises(vs.VisceraError, match="one \\(3,\\) for each of the 2 contacts"):
        fingers.grasp([LEFT, RIGHT]).solve(PUSHES[:1])
    with pytest.raises(vs.VisceraError, match="must be \\(k, 3\\)"):
        fingers.grasp([[0.1, 0.2]])
    with pytest.raises(vs.VisceraError, match="contact points must be"):
        fingers.grasp([LEFT, (0.1, 0.2)])
    with pytest.raises(vs.VisceraError, match="no contact; give at least one"):
        fingers.grasp(np.zeros((0, 3)))


def test_points_of_a_grasp_in_words_are_those_of_a_touch(fingers: Galerkin) -> None:
    """A list of three texts is three points where each is one, and one where each is a coordinate."""
    alone = np.array([LEFT])
    for words in ("(300, 50, 100) mm", ["30 cm", 0.05, "100%"], ["(300, 50, 100) mm"], [["30 cm", "5 cm", "10 cm"]]):
        assert fingers.grasp(words).points == pytest.approx(alone)
    three = ["(150, 40, 100) mm", "(225, 50, 100) mm", "(300, 50, 100) mm"]
    expected = np.array([RIGHT, (0.225, 0.05, 0.1), LEFT])
    assert fingers.grasp(three).points == pytest.approx(expected)
    assert fingers.grasp(np.array(three)).points == pytest.approx(expected)
    assert fingers.grasp([RIGHT, *three[1:]]).points == pytest.approx(expected)
    with pytest.raises(vs.VisceraError, match="contact point 1: 'far' is not a length"):
        fingers.grasp([LEFT, ("far", 0.0, 0.0)])
    with pytest.raises(vs.VisceraError, match="contact point 0 must be three lengths"):
        fingers.grasp(["30 cm", 0.05])


@pytest.mark.parametrize(
    ("push", "is_climbed"),
    [(((0, 0, -0.02), (0, 0, -0.006)), False), (((0, 0, -0.1), (0, 0, 0.05)), True)],
    ids=["from rest", "in load steps"],
)
def test_a_fresh_search_finds_what_a_hand_that_walks_there_does(
    bar: vs.Mesh, push: tuple[tuple[float, ...], ...], is_climbed: bool
) -> None:
    """Near each other in nearly incompressible tissue: the superposed series is far off, and one search not enough."""
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.499), fixed="root")
    touch = organ.reduce("z > 99% and x > 40%", depth="10%", order=3)
    grasp, pushes = touch.galerkin().grasp([(0.2, 0.05, 0.1), (0.25, 0.05, 0.1)]), np.array(push)
    assert np.linalg.norm(grasp.superposed(pushes)) > 2.0 * np.linalg.norm(grasp.solve(pushes).displacement)
    fresh = grasp.solve(pushes)
    assert fresh.is_converged
    assert (fresh.iterations > 41) == is_climbed  # as many as one search may take
    walked = [grasp.solve(share * pushes, from_last=True) for share in np.linspace(0.05, 1.0, 20)][-1]
    assert walked.is_converged
    assert fresh.energy == pytest.approx(walked.energy, rel=1e-6)
    late = grasp.solve(pushes, budget=0.0)  # climbs on from tick to tick
    assert late.status == "out of time"
    for _ in range(1000):
        late = grasp.solve(pushes, budget=1e-3, from_last=True)
        if late.is_converged:
            break
    assert late.energy == pytest.approx(walked.energy, rel=1e-6)


def test_a_model_from_a_file_serves_several_touches_too(fingers: Galerkin, touch: vs.Touch, tmp_path: Path) -> None:
    touch.save(tmp_path / "bar.viscera")
    touches = [(LEFT, PUSHES[0]), (RIGHT, PUSHES[1])]
    read = vs.load(tmp_path / "bar.viscera").galerkin(tolerance=0.005)
    assert read.solve(touches).force == pytest.approx(fingers.solve(touches).force, rel=1e-9)


@pytest.mark.parametrize(("element", "poisson"), [("P1 mean volume", 0.49), ("P2", 0.4)])
def test_every_element_serves_several_touches(bar: vs.Mesh, element: str, poisson: float, tmp_path: Path) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=poisson), fixed="root", element=element)
    made = organ.reduce(lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.05), radius=0.07, depth=0.02, order=3)
    made.save(tmp_path / "bar.viscera")
    touch = vs.load(tmp_path / "bar.viscera")
    grasp = touch.galerkin(tolerance=0.005).grasp([LEFT, RIGHT])
    held, patches = grasp.solve(PUSHES), grasp.patches
    full = organ.solve(displacement=dict(zip(patches, PUSHES, strict=True)))
    forces = np.array([full.reaction(patch) for patch in patches])
    assert held.is_converged
    assert relative(held.displacement, full.displacement) < 0.02
    assert relative(held.force, forces) < 0.03
    assert held.shape_error_estimate == pytest.approx(relative(held.displacement, full.displacement), rel=0.2)
    assert held.error_estimate == pytest.approx(relative(held.force, forces), rel=0.2)


def test_several_touches_start_from_a_load_that_stays(organ: vs.Organ) -> None:
    hanging = organ.solve(gravity=(0, 0, -9.81), density=3000)
    touch = organ.reduce(lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.05), radius=0.07, depth=0.02, order=3, start=hanging)
    seen = [touch.mesh.points[np.argmin(np.linalg.norm(touch.rest.points - x, axis=1))] for x in (LEFT, RIGHT)]
    grasp = touch.galerkin(tolerance=0.005).grasp(seen)
    held, patches = grasp.solve(PUSHES), grasp.patches
    means = np.array([hanging.displacement[patch.nodes].T @ patch.weights for patch in patches])
    full = organ.solve(
        displacement=dict(zip(patches, means + PUSHES, strict=True)),
        gravity=(0, 0, -9.81),
        density=3000,
        start=hanging,
    )
    forces = np.array([full.reaction(patch) for patch in patches])
    assert np.linalg.norm(means, axis=1).min() > 0.002, "the organ sags"
    assert relative(held.displacement, full.displacement - hanging.displacement) < 0.02
    assert relative(held.force, forces) < 0.03
    assert np.linalg.norm(grasp.solve(np.zeros((2, 3))).force) < 1e-6 * np.linalg.norm(forces)
