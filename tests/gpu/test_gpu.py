"""`solver="gpu"` against the processor, on the graphics processor of this machine or on software in its place.

Run by `make test-gpu`, which builds the library. Other builds refuse the solver in a sentence.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera import _core, gpu
from viscera.law import Law
from viscera.solver import GPU

CPU = vs.ConjugateGradients("block_jacobi", max_iterations=GPU.max_iterations)

NEARLY_INCOMPRESSIBLE = vs.NeoHookean(young=1e4, poisson=0.499)

LAWS: list[Law] = [
    vs.Linear(young=1e4, poisson=0.4),
    vs.Corotated(young=1e4, poisson=0.4),
    vs.SaintVenantKirchhoff(young=1e4, poisson=0.3),
    vs.NeoHookean(young=1e4, poisson=0.3),
    NEARLY_INCOMPRESSIBLE,
    vs.StableNeoHookean(young=1e4, poisson=0.45),
    vs.MooneyRivlin(c1=1.4e3, c2=0.3e3, kappa=5e4),
    vs.Yeoh(c10=1.7e3, c20=200.0, c30=50.0, kappa=5e4),
    vs.Ogden(mu=(2e3, -1e3), alpha=(2.0, -2.0), kappa=5e4),
    vs.ArrudaBoyce(3e3, 1.5, kappa=5e4),
    vs.VerondaWestmann(2e3, 1.5, kappa=5e4),
    vs.Fung(mu=3e3, b=4.0, kappa=5e4),
    vs.HolzapfelGasserOgden(3e3, 2e3, 0.7, fibres=np.eye(3)[:2], kappa=5e4),
    vs.StrainEnergy("mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2", mu=3.4e3, lam=3e4),
]

NO_PROGRAM = (vs.Ogden, vs.HolzapfelGasserOgden)
"""Laws whose tangent the kernels do not form: powers of the principal stretches, and fibres."""

Make = Callable[..., vs.Organ]
Block = Callable[[tuple[int, int, int], tuple[float, float, float]], tuple[NDArray[np.float64], NDArray[np.uint32]]]


@pytest.fixture(scope="module")
def device() -> str:
    """The device, or a skip; with VISCERA_GPU set, its absence is a failure."""
    try:
        return gpu.describe()
    except vs.VisceraError as error:
        if os.environ.get("VISCERA_GPU"):
            raise
        pytest.skip(f"NOT TESTED: {error}")


@pytest.fixture
def organ(block: Block) -> Make:
    """A block of tissue held at one end, of any law and element."""

    def make(law: Law, element: str | None = None) -> vs.Organ:
        points, cells = block((4, 2, 2), (0.04, 0.02, 0.02))
        sets = {"wall": np.flatnonzero(points[:, 0] == 0), "end": np.flatnonzero(points[:, 0] > 0.0399)}
        return vs.Organ(vs.mesh(points, cells, sets), law, fixed="wall", element=element)

    return make


def distance(found: NDArray[np.float64], exact: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


@pytest.mark.usefixtures("device")
@pytest.mark.parametrize("element", ["P1", "P1 mean volume"])
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_every_law_ends_where_the_processor_does(
    organ: Make, law: Law, element: str, caplog: pytest.LogCaptureFixture
) -> None:
    body = organ(law, element)
    load = {"end": (0.0, 0.0, -0.004)}
    exact, found = body.solve(force=load), body.solve(force=load, solver="gpu")
    assert found.is_converged, found.message
    assert distance(found.displacement, exact.displacement) < 1e-5
    assert found.tangent_on_device == ("uploaded" if type(law) in NO_PROGRAM else "formed")
    assert exact.tangent_on_device is None
    assert not caplog.records


@pytest.mark.usefixtures("device")
@pytest.mark.parametrize("element", ["P1", "P1 mean volume"])
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_the_tangent_of_the_device_is_that_of_the_processor(organ: Make, law: Law, element: str) -> None:
    """A linear system far from rest: the solution of the processor beyond single precision, to which a wrong tangent
    would not converge, and as many iterations as there to the tolerance of frames."""
    body = organ(law, element)
    state = body.solve(displacement={"end": (0.004, 0.0, -0.006)})
    hand = {"end": (0.005, 0.001, -0.006)}
    frames = []
    for device in ("cpu", "gpu"):
        solver = vs.ConjugateGradients("block_jacobi", 1e-9, 20_000, device=device)
        frames.append(body.stepper(start=state, solver=solver).frame(hand))
    exact, found = frames
    assert found.is_solved
    assert distance(found.displacement - state.displacement, exact.displacement - state.displacement) < 1e-5
    if law is NEARLY_INCOMPRESSIBLE:
        return  # conjugate gradients in single precision take longer there, whoever forms the tangent
    quick = [vs.ConjugateGradients("block_jacobi", 1e-3, 5_000, device=device) for device in ("cpu", "gpu")]
    counts = [body.stepper(start=state, solver=solver).frame(hand).iterations for solver in quick]
    assert abs(counts[1] - counts[0]) <= max(2, 0.1 * counts[0])


@pytest.mark.usefixtures("device")
def test_every_cell_has_its_own_parameters(organ: Make) -> None:
    """Tissues of one law go as parameters of the same program."""
    body = organ(LAWS[3])
    stiff = body.mesh.points[body.mesh.cells].mean(axis=1)[:, 0] > 0.02
    young = np.where(stiff, 4e4, 1e4)
    load = {"end": (0.0, 0.0, -0.004)}
    formula = vs.StrainEnergy("mu/2*(I1 - 3) - mu*log(J) + 5*mu*log(J)**2", mu=young)
    for law in (vs.NeoHookean(young=young, poisson=0.45), formula):
        for element in ("P1", "P1 mean volume"):
            two = vs.Organ(body.mesh, law, fixed="wall", element=element)
            exact, found = two.solve(force=load, solver=CPU), two.solve(force=load, solver="gpu")
            assert found.tangent_on_device == "formed"
            assert abs(found.iterations - exact.iterations) <= 1
            assert distance(found.displacement, exact.displacement) < 1e-5


@pytest.mark.usefixtures("device")
def test_inertia_damping_pressure_and_contact_are_added_on_the_device(organ: Make) -> None:
    """What is no part of the law's tangent goes to the device as blocks, once where it stays."""
    body = organ(vs.NeoHookean(young=1e4, poisson=0.45))
    step = 0.01
    makes: list[tuple[Callable[[Any], vs.Stepper], float]] = [
        (
            lambda solver: body.stepper(
                solver=solver, dynamics="newmark", density=1e3, time_step=step, damping=(1.0, 1e-3)
            ),
            0.0,
        ),
        (lambda solver: body.stepper(solver=solver, relaxation=vs.Prony((0.4,), (0.1,)), time_step=step), 0.0),
        (lambda solver: body.stepper(solver=solver), 200.0),
    ]
    for make, pressure in makes:
        ends = []
        for solver in (CPU, GPU):
            stepper = make(solver)
            load = {"force": {"end": (0.0, 0.0, -0.0005)}, "pressure": {"end": pressure}}
            frames = [stepper.frame(**load) for _ in range(6)]  # type: ignore[arg-type]
            assert all(frame.is_solved for frame in frames)
            ends.append(frames)
        assert ends[1][-1].tangent_on_device == "formed"
        counts = [sum(frame.iterations for frame in frames) for frames in ends]
        # The device sets out from all of the last steps, the processor from the second only where the first is of use.
        assert counts[1] <= 1.1 * counts[0]
        assert distance(ends[1][-1].displacement, ends[0][-1].displacement) < 1e-3


@pytest.mark.usefixtures("device")
def test_a_frame_uploads_the_displacement_and_not_the_tangent(organ: Make) -> None:
    body = organ(vs.NeoHookean(young=1e4, poisson=0.3))
    fibrous = organ(vs.HolzapfelGasserOgden(3e3, 2e3, 0.7, fibres=np.eye(3)[:2], kappa=5e4))
    n = len(body.mesh.points)
    written = []
    for each in (body, fibrous):
        stepper = each.stepper(solver="gpu")
        stepper.frame({"end": (0.0, 0.0, -0.001)})
        before = _core.gpu_traffic()
        frame = stepper.frame({"end": (0.0, 0.0, -0.002)})
        after = _core.gpu_traffic()
        assert frame.tangent_on_device == ("formed" if each is body else "uploaded")
        written.append((after[0] - before[0]) / n)
    # Four vectors in single precision: displacement, guess, right-hand side, solution. And a few words for the kernels.
    assert written[0] < 4 * 12 + 300 / n
    assert written[1] > 5 * written[0]


@pytest.mark.usefixtures("device")
def test_prescribed_points_and_means_of_patches(organ: Make) -> None:
    body = organ(vs.NeoHookean(young=1e4, poisson=0.45), "P2")
    patch = body.patch((0.04, 0.01, 0.01), 0.012)
    for displacement in ({patch: (0.001, 0.0, -0.003)}, {"end": (0.002, 0.0, None)}):
        exact, found = body.solve(displacement=displacement), body.solve(displacement=displacement, solver="gpu")
        assert found.is_converged, found.message
        assert distance(found.displacement, exact.displacement) < 1e-5
        (place,) = displacement
        assert distance(found.reaction(place), exact.reaction(place)) < 1e-4


@pytest.mark.usefixtures("device")
@pytest.mark.parametrize(
    ("mesh", "fixed", "where", "element"),
    [
        (vs.organs.beam, "clamp", "tip", "P1 mean volume"),
        (vs.organs.artery, "bottom", "top", "P1"),
        (vs.organs.liver, "hilum", "tip", "P1"),
        (vs.organs.liver, "hilum", "tip", "P1 mean volume"),
    ],
)
def test_frames_of_every_organ(mesh: Callable[[], vs.Mesh], fixed: str, where: str, element: str) -> None:
    """As many iterations as on the processor within a tenth, and the same end."""
    body = vs.Organ(mesh(), vs.NeoHookean(young=1e4, poisson=0.45), fixed=fixed, element=element)
    hand = {where: (None, None, 0.001)}
    states = [body.solve(displacement={where: (None, None, 0.0005 * k)}) for k in range(3)]
    ends, counts = [], []
    for solver in (CPU, GPU):
        steppers = [body.stepper(start=state, solver=solver) for state in states[:2]]
        frames = [stepper.frame(hand) for stepper in steppers]
        assert all(frame.is_solved for frame in frames)
        counts.append(sum(frame.iterations for frame in frames))
        ends.append([steppers[1].frame(hand) for _ in range(3)][-1].displacement)
    assert counts[0] > 50
    assert abs(counts[1] - counts[0]) <= 0.1 * counts[0]
    assert all(frame.tangent_on_device == "formed" for frame in frames)
    assert distance(ends[1], states[2].displacement) < 1e-5
    assert distance(ends[1], ends[0]) < 1e-5


@pytest.mark.usefixtures("device")
def test_frames_whose_time_is_always_up_come_to_their_end(organ: Make) -> None:
    """A batch of iterations each, from the steps of the frames before; a patch is held by means, a place by points."""
    body = organ(vs.NeoHookean(young=1e4, poisson=0.45))
    for place in (body.patch((0.04, 0.01, 0.01), 0.012), "end"):
        hand = {place: (0.001, 0.0, -0.003)}
        stepper = body.stepper(solver=GPU, budget=1e-9)
        frames = [stepper.frame(hand) for _ in range(60)]
        assert not any(frame.within_budget for frame in frames)
        assert min(frame.residual for frame in frames) < 1e-6
        assert distance(frames[-1].displacement, body.solve(displacement=hand).displacement) < 1e-5


@pytest.mark.usefixtures("device")
def test_a_frame_says_what_single_precision_leaves_and_solves_beyond_it(organ: Make) -> None:
    floors = []
    for poisson in (0.3, 0.49, 0.499):
        body = organ(vs.NeoHookean(young=1e4, poisson=poisson))
        exact = body.stepper().frame({"end": (0.0, 0.0, -0.001)})
        precise = vs.ConjugateGradients("block_jacobi", 1e-9, 5_000, device="gpu")
        frame = body.stepper(solver=precise).frame({"end": (0.0, 0.0, -0.001)})
        assert frame.is_solved
        assert distance(frame.displacement, exact.displacement) < 1e-7
        floors.append(frame.floor)
        assert exact.floor == 0.0
    assert 1e-8 < floors[0] < floors[1] < floors[2] < 1e-3


@pytest.mark.usefixtures("device")
@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
def test_the_same_frames_give_the_same_bits(organ: Make, element: str) -> None:
    body = organ(vs.MooneyRivlin(c1=1.4e3, c2=0.3e3, kappa=5e4), element)
    runs = []
    for _ in range(2):
        stepper = body.stepper(solver="gpu")
        runs.append([stepper.frame({"end": (0.0, 0.0, -0.001 * k)}).displacement for k in range(1, 5)])
    assert np.array_equal(runs[0], runs[1])


@pytest.mark.usefixtures("device")
@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
def test_a_device_lost_between_frames_leaves_them_to_the_processor(
    organ: Make, element: str, caplog: pytest.LogCaptureFixture
) -> None:
    body = organ(vs.NeoHookean(young=1e4, poisson=0.45), element)
    hand = {"end": (0.0, 0.0, -0.001)}
    exact = body.solve(displacement=hand)
    stepper = body.stepper(solver="gpu")
    assert stepper.frame(hand).tangent_on_device == ("uploaded" if element == "P2" else "formed")
    assert not caplog.records
    _core.lose_gpu()
    frames = [stepper.frame(hand) for _ in range(4)]
    assert frames[-1].is_settled
    assert frames[-1].tangent_on_device is None
    assert distance(frames[-1].displacement, exact.displacement) < 1e-3
    assert [record.message for record in caplog.records] == [
        "the graphics processor was lost: it was shut down; continuing on the processor"
    ]
    # The next one is opened anew.
    caplog.clear()
    assert distance(body.solve(displacement=hand, solver="gpu").displacement, exact.displacement) < 1e-5
    assert not caplog.records


@pytest.mark.usefixtures("device")
def test_more_means_than_the_kernels_take_are_left_to_the_processor(
    organ: Make, caplog: pytest.LogCaptureFixture
) -> None:
    body = organ(vs.NeoHookean(young=1e4, poisson=0.45), "P2")
    points = body.mesh.points
    places = points[(points[:, 2] > 0.0199) & (points[:, 0] > 0.004)]
    hands = {body.patch(tuple(place), 0.002): (0.0, 0.0, -0.0005) for place in places}
    assert len(hands) > 16
    caplog.clear()  # the patches are narrow, which is told of them
    exact = body.stepper().frame(hands)
    frame = body.stepper(solver="gpu").frame(hands)
    assert frame.is_solved
    assert distance(frame.displacement, exact.displacement) < 1e-2  # to the tolerance of conjugate gradients
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "the kernels take 48" in caplog.text


@pytest.mark.usefixtures("device")
def test_a_body_too_unequal_for_single_precision_is_left_to_the_processor(
    organ: Make, caplog: pytest.LogCaptureFixture
) -> None:
    """Rounding of the stiff half outweighs what the soft one says of its turning."""
    mesh = organ(LAWS[3]).mesh
    halves = {"x < 50%": vs.NeoHookean(young=1e4, poisson=0.3), "x >= 50%": vs.NeoHookean(young=1e10, poisson=0.3)}
    body = vs.Organ(mesh, halves, fixed="wall")
    load = {"end": (0.002, 0.0, -0.004)}
    exact, found = body.solve(force=load), body.solve(force=load, solver="gpu")
    assert found.is_converged, found.message
    assert distance(found.displacement, exact.displacement) < 1e-5
    assert found.tangent_on_device is None
    [record] = caplog.records
    assert "many times as stiff" in record.message
    assert record.message.endswith("continuing on the processor")


IN_CHUNKS = """
import sys
import numpy as np
import viscera as vs
organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.45), fixed="clamp", element=sys.argv[1])
load = {"tip": (0, 0, -0.1)}
exact = organ.solve(force=load, solver=vs.ConjugateGradients("block_jacobi", max_iterations=5_000))
found = organ.solve(force=load, solver="gpu")
error = np.linalg.norm(found.displacement - exact.displacement) / np.linalg.norm(exact.displacement)
print(found.tangent_on_device, abs(found.iterations - exact.iterations) <= 1, error < 1e-5)
"""


@pytest.mark.usefixtures("device")
@pytest.mark.parametrize("element", ["P1", "P1 mean volume"])
def test_a_device_of_small_bindings_works_in_chunks(element: str) -> None:
    run = [sys.executable, "-c", IN_CHUNKS, element]
    small = os.environ | {"VISCERA_GPU_BINDING": "200000"}
    done = subprocess.run(run, env=small, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["formed", "True", "True"]
    # Too small for anything: the processor takes over.
    tiny = os.environ | {"VISCERA_GPU_BINDING": "1000"}
    done = subprocess.run(run, env=tiny, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["None", "True", "True"]
    assert "not even 32 nodes fit" in done.stderr


WITHOUT_DEVICE = """
import viscera as vs
beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
print(beam.solve(force={"tip": (0, 0, -0.1)}, solver="gpu").status)
"""


@pytest.mark.usefixtures("device")
def test_a_machine_without_a_device_says_so_and_solves(tmp_path: os.PathLike[str]) -> None:
    nothing = {"VK_DRIVER_FILES": str(tmp_path), "VK_ICD_FILENAMES": str(tmp_path)}
    run = [sys.executable, "-c", WITHOUT_DEVICE]
    done = subprocess.run(run, env=os.environ | nothing, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "converged"
    assert done.stderr.startswith("there is no graphics processor to compute on")
    assert done.stderr.strip().endswith("continuing on the processor")


def test_a_build_without_the_library_says_how_to_get_it(
    organ: Make, tmp_path: os.PathLike[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gpu, "LIBRARY", gpu.LIBRARY.__class__(tmp_path) / "libviscera_gpu.so")
    with pytest.raises(vs.VisceraError, match="make GPU=1"):
        organ(LAWS[3]).solve(force={"end": (0, 0, -0.01)}, solver="gpu")


def test_a_library_of_something_else_is_refused(tmp_path: os.PathLike[str]) -> None:
    other = gpu.LIBRARY.__class__(tmp_path) / "other.so"
    other.write_bytes(b"not a library")
    # The library stays loaded, so that another is asked for in a process of its own.
    code = f"from viscera import _core; _core.load_gpu({str(other)!r})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "VisceraError" in done.stderr
    assert "cannot be loaded" in done.stderr


def test_settings_that_do_not_go_together_are_refused() -> None:
    with pytest.raises(vs.VisceraError, match="block_jacobi"):
        vs.ConjugateGradients("lagged_cholesky", device="gpu")
    with pytest.raises(vs.VisceraError, match="'gpv'"):
        vs.ConjugateGradients("block_jacobi", device="gpv")
