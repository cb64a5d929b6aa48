"""One Newton iteration a frame."""

from __future__ import annotations

import signal
import sys
import threading
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.errors import VisceraError


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.4), fixed="root")


def test_a_waiting_hand_finds_the_full_solution(organ: vs.Organ) -> None:
    target = {"tip": (None, None, -0.05)}
    exact = organ.solve(displacement=target, gravity=(0, 0, -9.81), density=1000)
    stepper = organ.stepper({"tip": (None, None, 0)})
    for share in np.minimum(np.arange(1, 16) / 8, 1):
        frame = stepper.frame({"tip": (None, None, -0.05 * share)}, gravity=(0, 0, -9.81), density=1000)
    assert frame.residual < 1e-9
    assert frame.taken == 1.0
    assert not frame.is_unstable
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-10)
    assert frame.reaction("root") == pytest.approx(exact.reaction("root"), abs=1e-6)


def test_a_grasped_patch_tells_its_force(organ: vs.Organ) -> None:
    patch = organ.patch((0.4, 0.05, 0.1), radius=0.06)
    exact = organ.solve(displacement={patch: (0, 0, -0.02)})
    stepper = organ.stepper({patch: (0, 0, 0)})
    for _ in range(8):
        frame = stepper.frame({patch: (0, 0, -0.02)})
    assert frame.reaction(patch) == pytest.approx(exact.reaction(patch), rel=1e-6)


@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
def test_without_a_matrix_every_element_carries_the_same_loads(bar: vs.Mesh, element: str) -> None:
    law = vs.NeoHookean(young=2e5, poisson=0.4)
    organ = vs.Organ(bar, law, fixed="root", element=element)
    loads: dict[str, Any] = {"pressure": {"tip": 2e3}, "gravity": (0, 0, -9.81), "density": 1000}
    exact = organ.solve(**loads, throw=True)
    solver = vs.ConjugateGradients("block_jacobi", 1e-6, 2000, matrix_free=True)
    again = organ.solve(**loads, solver=solver, throw=True)
    assert again.displacement == pytest.approx(exact.displacement, abs=1e-8 * bar.diagonal)


def test_turning_gravity_turns_the_organ(organ: vs.Organ) -> None:
    """The patient turns: from lying to the side, the organ settles where a full solution from rest ends."""
    stepper = organ.stepper({})
    for _ in range(8):
        stepper.frame({}, gravity=(0, 0, -9.81), density=300)
    for _ in range(12):
        frame = stepper.frame({}, gravity=(0, -9.81, 0), density=300)
    exact = organ.solve(gravity=(0, -9.81, 0), density=300)
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-9)


SOLVERS = [
    "cholesky",
    "cg",
    *(vs.ConjugateGradients(p, 1e-4) for p in ("block_jacobi", "incomplete_cholesky")),
    vs.ConjugateGradients("multigrid", 1e-4),
    vs.ConjugateGradients("block_jacobi", 1e-4, matrix_free=True),
]


@pytest.mark.parametrize("solver", SOLVERS, ids=str)
def test_every_solver_settles_in_the_same_place(organ: vs.Organ, solver: str | vs.ConjugateGradients) -> None:
    patch = organ.patch((0.4, 0.05, 0.1), radius=0.06)
    exact = organ.solve(displacement={patch: (0, 0, -0.02)})
    again = organ.solve(displacement={patch: (0, 0, -0.02)}, solver=solver)
    assert again.is_converged
    assert again.displacement == pytest.approx(exact.displacement, abs=1e-9)
    stepper = organ.stepper({patch: (0, 0, 0)}, solver=solver)
    for _ in range(12):
        frame = stepper.frame({patch: (0, 0, -0.02)})
    assert frame.is_solved
    assert (frame.iterations == 0) == (solver == "cholesky")
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-9)
    assert frame.reaction(patch) == pytest.approx(exact.reaction(patch), rel=1e-6)


def test_a_motion_that_goes_on_is_followed_ahead(organ: vs.Organ) -> None:
    """After a few frames one iteration leaves far less, for hands and for tools, by any solver."""
    far = organ.mesh.points[organ.mesh.nodes("tip")]
    above = far[far[:, 2].argmax()] + np.array((0, 0, 0.0201))
    for solver in ("cholesky", "cg"):
        left: dict[bool, list[float]] = {}
        for extrapolate in (True, False):
            hand = organ.stepper(solver=solver, extrapolate=extrapolate)
            pushed = [hand.frame({"tip": (None, None, -0.002 * n)}).residual for n in range(1, 9)]
            pressed = organ.stepper(solver=solver, iterations=20, settled=1e-7, extrapolate=extrapolate)
            tool = pressed.tool(vs.Sphere(0.02), position=above)
            steps = []
            for _ in range(8):
                tool.move((0, 0, -0.0005))
                steps.append(pressed.frame().steps)
            left[extrapolate] = [max(pushed[4:]), sum(steps)]
        assert left[True][0] < 0.2 * left[False][0]
        assert left[True][1] < left[False][1]


def test_hands_grasp_and_let_go(organ: vs.Organ) -> None:
    """A hand takes a place as it is, moves it, lets it go; another is named frame by frame."""
    stepper = organ.stepper(density=1000)
    for _ in range(10):
        hanging = stepper.frame(gravity=(0, 0, -9.81))
    hand = stepper.grasp("tip")
    still = stepper.frame(gravity=(0, 0, -9.81))
    assert still.displacement == pytest.approx(hanging.displacement, abs=1e-8)
    assert still.reaction("tip") == pytest.approx(np.zeros(3), abs=1e-5)
    for _ in range(5):
        hand.move((0, 0, -0.002))
        frame = stepper.frame(gravity=(0, 0, -9.81))
    tip = organ.mesh.nodes("tip")
    assert frame.displacement[tip] - hanging.displacement[tip] == pytest.approx(
        np.tile([0, 0, -0.01], (len(tip), 1)), abs=1e-12
    )
    assert frame.reaction("tip")[2] < -0.1
    assert frame.positions == pytest.approx(organ.mesh.points + frame.displacement)
    hand.release()
    for _ in range(10):
        frame = stepper.frame(gravity=(0, 0, -9.81))
    assert frame.displacement == pytest.approx(hanging.displacement, abs=1e-9)
    held = stepper.frame({"tip": (None, None, 0.001)})
    assert held.displacement[tip, 2] == pytest.approx(0.001)
    assert stepper.frame().displacement[tip, 2] == pytest.approx(0.001)  # stays where it was put
    for _ in range(10):
        free = stepper.frame({})
    assert abs(free.displacement).max() < 1e-9


def test_a_budget_is_kept_and_its_price_told(organ: vs.Organ) -> None:
    solver = vs.ConjugateGradients("block_jacobi", tolerance=1e-6, max_iterations=5)
    few = organ.stepper(solver=solver).frame({"tip": (0, 0, -0.01)})
    assert few.iterations == 5
    assert not few.is_solved
    assert few.residual > 1e-3
    late = organ.stepper(solver="multigrid", budget=1e-9).frame({"tip": (0, 0, -0.01)})
    assert not late.within_budget
    assert not late.is_solved
    assert late.seconds > 1e-9
    easy = organ.stepper(solver="cg", budget=100.0).frame({"tip": (0, 0, -0.01)})
    assert easy.within_budget
    assert easy.is_solved


def test_where_assembly_takes_the_whole_budget_the_organ_moves_nevertheless_and_the_frame_says_so(
    organ: vs.Organ,
) -> None:
    # As on a machine that is too slow: an iteration a frame, late each time, and at rest where a patient frame is.
    pull = {"tip": (0, 0, -1.0)}
    stepper = organ.stepper(solver="cg", iterations=20, budget=1e-9)
    frame = stepper.frame(force=pull)
    assert (frame.iterations, frame.within_budget) == (1, False)
    for _ in range(9):
        frame = stepper.frame(force=pull)
        assert not frame.within_budget
    enough = organ.stepper(solver="cg", iterations=20, budget=100.0).frame(force=pull)
    assert enough.is_settled
    assert frame.is_settled
    assert frame.displacement == pytest.approx(enough.displacement, abs=1e-3 * np.abs(enough.displacement).max())


def test_a_frame_says_whether_its_forces_can_be_relied_on(organ: vs.Organ) -> None:
    push = {"tip": (0, 0, -0.05)}
    exact = organ.solve(displacement=push).reaction("tip")
    hasty = organ.stepper().frame(push)
    assert hasty.steps == 1
    assert not hasty.is_settled
    assert hasty.residual > 1e-3
    assert np.linalg.norm(hasty.reaction("tip") - exact) > 0.02 * np.linalg.norm(exact)
    patient = organ.stepper(iterations=20)
    settled = patient.frame(push)
    assert 1 < settled.steps < 20
    assert settled.is_settled
    assert settled.residual <= 1e-3
    assert settled.reaction("tip") == pytest.approx(exact, abs=0.01 * np.linalg.norm(exact))
    assert patient.frame(push).steps == 1  # as good as it was, and one iteration better
    tight = organ.stepper(iterations=20, settled=1e-9).frame(push)
    assert tight.residual <= 1e-9
    assert tight.steps > settled.steps


def test_hands_held_back_are_not_settled(organ: vs.Organ) -> None:
    frame = organ.stepper(settled=0.999).frame({"tip": (-0.7, 0, 0)})
    assert frame.taken < 1.0
    assert not frame.is_settled


def test_no_iteration_begins_that_the_budget_does_not_hold(organ: vs.Organ) -> None:
    frame = organ.stepper(iterations=50, settled=1e-12, budget=1e-9).frame({"tip": (0, 0, -0.05)})
    assert frame.steps == 1
    assert not frame.within_budget
    endless = organ.stepper(iterations=3, settled=1e-12, budget=1e300).frame({"tip": (0, 0, -0.05)})
    assert endless.steps == 3
    assert endless.within_budget


def test_a_frame_is_a_line(organ: vs.Organ) -> None:
    stepper = organ.stepper(iterations=20)
    assert repr(stepper.frame({"tip": (0, 0, -0.01)})).endswith("taken 1, settled)")
    few = organ.stepper(solver=vs.ConjugateGradients("block_jacobi", tolerance=1e-6, max_iterations=5), budget=1e-9)
    line = repr(few.frame({"tip": (0, 0, -0.01)}))
    assert line.startswith("Frame(residual ")
    assert line.endswith("not settled, linear system not solved, over budget)")


def test_a_stepper_works_for_one_thread_at_a_time(organ: vs.Organ) -> None:
    stepper, start, refusals = organ.stepper(iterations=20, settled=1e-15), threading.Barrier(4), []

    def step() -> None:
        start.wait()
        for n in range(30):
            try:
                stepper.frame({"tip": (0, 0, -0.0001 * n)})
            except Exception as error:  # whatever it is, the test wants to see it
                refusals.append(error)

    threads = [threading.Thread(target=step) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert refusals
    for error in refusals:
        assert isinstance(error, VisceraError)
        assert "this stepper is at work in another thread; give every thread one of its own" in str(error)
    assert np.isfinite(stepper.frame({"tip": (0, 0, -0.01)}).displacement).all()


def test_a_jump_is_cut_back_and_said(organ: vs.Organ) -> None:
    frame = organ.stepper().frame({"tip": (-0.7, 0, 0)})
    assert frame.taken < 1.0
    assert np.isfinite(frame.displacement).all()
    assert np.isfinite(frame.energy)


@pytest.mark.parametrize("dynamics", ["newmark", "backward_euler"])
def test_an_organ_let_go_swings_and_comes_to_rest(organ: vs.Organ, dynamics: str) -> None:
    start = organ.solve(displacement={"tip": (None, None, -0.03)})
    settings: dict[str, Any] = {"start": start, "dynamics": dynamics, "density": 1000, "time_step": 0.005}
    swinging = organ.stepper(**settings)
    energies = []
    for _ in range(60):
        frame = swinging.frame()
        energies.append(frame.energy + frame.kinetic_energy)
    assert max(energies) < 1.02 * start.energy
    assert (min(energies) > 0.95 * start.energy) == (dynamics == "newmark")
    assert swinging.velocity is not None
    damped = organ.stepper(**settings, damping=(20.0, 0.01), mass="consistent")
    for _ in range(150):
        frame = damped.frame()
    assert frame.energy + frame.kinetic_energy < 1e-2 * start.energy


def test_gravity_pulls_with_the_weight(organ: vs.Organ) -> None:
    """At rest under damping, the root carries the weight; at the first instant, nothing does."""
    stepper = organ.stepper(dynamics="newmark", density=300, time_step=0.01, damping=(30.0, 0.01))
    weight = 300 * organ.mesh.volume * 9.81
    for _ in range(300):
        frame = stepper.frame(gravity=(0, -9.81, 0))
    assert frame.reaction("root")[1] == pytest.approx(weight, rel=1e-3)
    assert frame.residual < 1e-4


def test_a_held_organ_relaxes(organ: vs.Organ) -> None:
    """What is held keeps its shape, since all of its stress fades alike, and its force follows Prony's curve."""
    patch = organ.patch((0.4, 0.05, 0.1), radius=0.06)
    exact = organ.solve(displacement={patch: (0, 0, -0.02)})
    g, tau, step = np.array([0.3, 0.4]), np.array([0.05, 0.5]), 0.01
    stepper = organ.stepper(time_step=step, relaxation=vs.Prony(g.tolist(), tau.tolist()), iterations=6, settled=1e-9)
    for n in range(100):
        frame = stepper.frame({patch: (0, 0, -0.02)})
        share = 1 - (g * (1 + np.expm1(-step / tau) * tau / step * np.exp(-n * step / tau))).sum()
        assert frame.reaction(patch) == pytest.approx(share * exact.reaction(patch), rel=1e-6)
    assert share < 0.45
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-9)


def test_bad_words_are_answered_in_one_sentence(organ: vs.Organ) -> None:
    moving: dict[str, Any] = {"dynamics": "newmark", "density": 1000, "time_step": 0.01}
    settings: dict[str, Any]
    for settings, words in (
        ({"time_step": -0.01, "dynamics": "newmark", "density": 1000}, "time_step must be a number from 1e-12"),
        ({"time_step": 1e-160, "dynamics": "newmark", "density": 1000}, "time_step must be a number from 1e-12"),
        ({"dynamics": "newmark", "time_step": 0.01}, "dynamics needs a density"),
        ({"dynamics": "newmark", "density": 1000}, "need a time_step"),
        ({"time_step": 0.01}, "has no effect without dynamics"),
        ({"damping": (1.0, 0.0)}, "damping has no effect"),
        ({"mass": "consistent", "density": 1000}, "mass='consistent' has no effect without dynamics"),
        ({"solver": "choleski"}, "did you mean 'cholesky'"),
        ({"solver": "pardiso"}, "known: 'auto', 'cg', 'cholesky'"),
        ({"budget": 0.0}, "budget must be a number above 0"),
        ({"iterations": 0}, "iterations must be a whole number from 1"),
        ({"settled": 0.0}, "settled, a relative residual, must be a number above 0 and below 1"),
        ({"settled": np.nan}, "settled, a relative residual, must be a number above 0 and below 1"),
        ({**moving, "dynamics": "newmrk"}, "did you mean 'newmark'"),
        ({**moving, "mass": "heavy"}, "the mass 'heavy' is unknown; known: 'consistent', 'lumped'"),
        ({**moving, "damping": (-1.0, 0.0)}, "not negative"),
        ({**moving, "density": -1000}, "density must be a number above 0"),
    ):
        with pytest.raises(VisceraError, match=words):
            organ.stepper(**settings)
    with pytest.raises(VisceraError, match="did you mean 'block_jacobi'"):
        vs.ConjugateGradients("block-jacobi")
    with pytest.raises(VisceraError, match="above 0 and below 1"):
        vs.ConjugateGradients(tolerance=0.0)
    with pytest.raises(VisceraError, match='matrix_free=True leaves none; choose preconditioner="block_jacobi"'):
        vs.ConjugateGradients(matrix_free=True)
    with pytest.raises(VisceraError, match="2 beta >= gamma"):
        vs.Newmark(beta=0.1)
    with pytest.raises(VisceraError, match="sum below 1"):
        vs.Prony([0.6, 0.5], [1.0, 1.0])
    with pytest.raises(VisceraError, match="no solver is called"):
        organ.solve(solver="lu")
    with pytest.raises(VisceraError, match=r"ConjugateGradients\('lagged_cholesky'\) or \"cg\""):
        organ.solve(solver="lagged_cholesky")
    with pytest.raises(VisceraError, match=r"ConjugateGradients\('block_jacobi'\)$"):
        organ.stepper(solver="block_jacobi")


@pytest.mark.parametrize(
    ("words", "metres"),
    [
        (("-1 cm", 0, 0), (-0.01, 0, 0)),
        (("-1 cm", None, None), (-0.01, None, None)),
        ((None, "free", "-10 mm"), (None, None, -0.01)),
    ],
)
def test_lengths_of_frames_may_be_words(organ: vs.Organ, words: Any, metres: Any) -> None:
    for named in ({"tip": words}, [("tip", words)]):
        frames = [organ.stepper(iterations=10).frame(given) for given in (named, {"tip": metres})]
        assert np.array_equal(frames[0].displacement, frames[1].displacement)
    stepper = organ.stepper({"tip": words}, iterations=10)
    assert np.array_equal(stepper.frame({"tip": words}).displacement, frames[1].displacement)


def test_what_a_word_leaves_free_is_let_go(organ: vs.Organ) -> None:
    stepper = organ.stepper({"tip": (0.01, 0, 0)}, iterations=20)
    stepper.frame({"tip": (0.01, 0, 0)})
    frame = stepper.frame({"tip": ("free", 0, 0)})
    assert abs(frame.displacement).max() < 1e-6


def test_bad_frames_are_refused_and_change_nothing(organ: vs.Organ) -> None:
    stepper = organ.stepper({"tip": (None, None, 0)}, density=1000)
    before = stepper.frame({"tip": (None, None, -0.01)}).displacement
    frame: dict[str, Any]
    for frame, words in (
        ({"displacement": {"tip": (None, None, np.nan)}}, "finite"),
        ({"displacement": {"tip": (0, 0)}}, "displacement of 'tip' must be three lengths"),
        ({"displacement": {"root": (0, 0, 0.01)}}, "all nodes of 'root' are fixed"),
        ({"displacement": {"tipp": (0, 0, 0.01)}}, "did you mean 'tip'"),
        ({"force": {"tip": (0, 0, np.inf)}}, "finite"),
        ({"gravity": (0, 0, -9.81), "density": 1000}, "has a density already"),
        ({"gravity": (0, 0)}, "three finite numbers"),
    ):
        with pytest.raises(VisceraError, match=words):
            stepper.frame(**frame)
    with pytest.raises(VisceraError, match="all nodes of 'root' are fixed"):
        stepper.grasp("root")
    with pytest.raises(VisceraError, match="density"):
        organ.stepper().frame(gravity=(0, 0, -9.81))
    with pytest.raises(VisceraError, match="without dynamics"):
        stepper.velocity = np.zeros_like(before)
    assert (stepper.displacement == before).all()


def test_velocities_and_starts_that_cannot_be_are_refused(organ: vs.Organ) -> None:
    shape = organ.mesh.points.shape
    stepper = organ.stepper(density=1000, time_step=0.01, dynamics="newmark")
    wrong: Any
    for wrong in ({}, np.full(shape, 1j), np.zeros(shape[::-1]), "fast", True):
        with pytest.raises(VisceraError, match=r"velocity must be an array .* of numbers \[m/s\], got"):
            stepper.velocity = wrong
    too_fast = np.zeros(shape)
    too_fast[3, 1] = 1e160
    with pytest.raises(VisceraError, match="the velocity of node 3 must be three finite numbers"):
        stepper.velocity = too_fast
    with pytest.raises(VisceraError, match="start: the displacement of node 3 must be three finite numbers"):
        organ.stepper(start=too_fast)
    assert stepper.velocity is not None
    assert not stepper.velocity.any()


@pytest.mark.skipif(sys.platform == "win32", reason="its Ctrl-C goes to the whole console")
def test_ctrl_c_ends_a_frame_of_many_iterations() -> None:
    """The organ is as before the frame: it has not settled after its thousand iterations."""
    liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=4e3, poisson=0.48), fixed="hilum")
    stepper = liver.stepper(iterations=1000, settled=1e-300)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.2, signal.raise_signal, [signal.SIGINT])
    try:
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            stepper.frame(gravity=(0, 0, -9.81), density=1060)
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)
    assert np.array_equal(stepper.displacement, np.zeros_like(liver.mesh.points))
