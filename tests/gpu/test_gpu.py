"""`solver="gpu"` against the processor, on the graphics processor of this machine or on software in its place.

Run by `make test-gpu`, which builds the extension with the feature `gpu`. Other builds refuse the solver in a sentence.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

import viscera as vs
from viscera import _core

GPU = vs.ConjugateGradients("block_jacobi", max_iterations=5_000, device="gpu")
CPU = vs.ConjugateGradients("block_jacobi", max_iterations=5_000)

LAWS = [
    vs.Linear(young=1e4, poisson=0.4),
    vs.Corotated(young=1e4, poisson=0.4),
    vs.SaintVenantKirchhoff(young=1e4, poisson=0.3),
    vs.NeoHookean(young=1e4, poisson=0.3),
    vs.NeoHookean(young=1e4, poisson=0.45),
    vs.NeoHookean(young=1e4, poisson=0.49),
    vs.NeoHookean(young=1e4, poisson=0.499),
    vs.MooneyRivlin(c1=1.4e3, c2=0.3e3, kappa=5e4),
    vs.Yeoh(c10=1.7e3, c20=200.0, c30=50.0, kappa=5e4),
    vs.Ogden(mu=(2e3, -1e3), alpha=(2.0, -2.0), kappa=5e4),
]


@pytest.fixture(scope="module")
def device():
    """The device, or a skip; with VISCERA_GPU set, its absence is a failure."""
    if not hasattr(_core, "gpu"):
        pytest.skip("this build has no graphics processor in it (make GPU=1)")
    try:
        return _core.gpu()
    except vs.VisceraError as error:
        if os.environ.get("VISCERA_GPU"):
            raise
        pytest.skip(f"NOT TESTED: {error}")


@pytest.fixture
def organ(block):
    """A block of tissue held at one end, of any law and element."""

    def make(law, element=None):
        points, cells = block((4, 2, 2), (0.04, 0.02, 0.02))
        mesh = vs.mesh(points, cells, sets={"wall": np.flatnonzero(points[:, 0] == 0)})
        chosen = {} if element is None else {"element": element}
        return vs.Organ(mesh, law, fixed="wall", **chosen)

    return make


def end_of(organ):
    return np.flatnonzero(organ.mesh.points[:, 0] > 0.0399)


def distance(a, b):
    return np.linalg.norm(a - b) / np.linalg.norm(b)


@pytest.mark.skipif(hasattr(_core, "gpu"), reason="this build has a graphics processor in it")
def test_a_build_without_it_says_how_to_get_it(organ):
    with pytest.raises(vs.VisceraError, match="make GPU=1"):
        organ(vs.NeoHookean(young=1e4, poisson=0.3)).solve(force={(1,): (0, 0, -0.01)}, solver="gpu")


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_every_law_ends_where_the_processor_does(device, organ, law):
    body = organ(law)
    load = {tuple(end_of(body)): (0.0, 0.0, -0.004)}
    exact = body.solve(force=load)
    found = body.solve(force=load, solver="gpu")
    assert found.is_converged, found.message
    assert "the processor did it" not in found.message
    assert distance(found.displacement, exact.displacement) < 1e-5


@pytest.mark.parametrize("element", ["P1 mean volume", "P2"])
def test_every_element_does_so(device, organ, element):
    body = organ(vs.NeoHookean(young=1e4, poisson=0.49), element)
    load = {tuple(end_of(body)): (0.0, 0.0, -0.004)}
    exact, found = body.solve(force=load), body.solve(force=load, solver="gpu")
    assert found.is_converged, found.message
    assert distance(found.displacement, exact.displacement) < 1e-5


def test_prescribed_points_and_means_of_patches(device, organ):
    body = organ(vs.NeoHookean(young=1e4, poisson=0.45))
    patch = body.patch((0.04, 0.01, 0.01), 0.012)
    for displacement in ({patch: (0.001, 0.0, -0.003)}, {tuple(end_of(body)): (0.002, 0.0, None)}):
        exact, found = body.solve(displacement=displacement), body.solve(displacement=displacement, solver="gpu")
        assert found.is_converged, found.message
        assert distance(found.displacement, exact.displacement) < 1e-5
    assert np.allclose(
        body.solve(displacement={patch: (0.001, 0.0, -0.003)}, solver="gpu").reaction(patch),
        body.solve(displacement={patch: (0.001, 0.0, -0.003)}).reaction(patch),
        rtol=1e-4,
        atol=1e-7,
    )


def test_frames_take_as_many_iterations_and_settle_at_the_same_place(device, organ):
    body = organ(vs.NeoHookean(young=1e4, poisson=0.45))
    hand = tuple(end_of(body))
    ends = []
    for solver in (CPU, GPU):
        stepper = body.stepper({hand: (0.0, 0.0, 0.0)}, solver=solver)
        frames = [stepper.frame({hand: (0.0, 0.0, -0.0005 * min(k, 6))}) for k in range(1, 11)]
        ends.append((frames[-1].displacement, sum(frame.iterations for frame in frames)))
        assert frames[-1].is_settled
        assert all(frame.is_solved for frame in frames)
    (exact, on_cpu), (found, on_gpu) = ends
    assert distance(found, exact) < 1e-5
    assert abs(on_gpu - on_cpu) <= 0.1 * on_cpu + 2


def test_the_same_frames_give_the_same_bits(device, organ):
    body = organ(vs.MooneyRivlin(c1=1.4e3, c2=0.3e3, kappa=5e4))
    hand = tuple(end_of(body))
    runs = []
    for _ in range(2):
        stepper = body.stepper({hand: (0.0, 0.0, 0.0)}, solver="gpu")
        runs.append([stepper.frame({hand: (0.0, 0.0, -0.001 * k)}).displacement for k in range(1, 5)])
    assert np.array_equal(runs[0], runs[1])


def test_a_device_lost_between_frames_leaves_the_frames_to_the_processor(device, organ, caplog):
    body = organ(vs.NeoHookean(young=1e4, poisson=0.45))
    hand = tuple(end_of(body))
    stepper = body.stepper({hand: (0.0, 0.0, 0.0)}, solver="gpu")
    stepper.frame({hand: (0.0, 0.0, -0.001)})
    _core.lose_gpu()
    frames = [stepper.frame({hand: (0.0, 0.0, -0.001)}) for _ in range(4)]
    assert frames[-1].is_settled
    exact = body.solve(displacement={hand: (0.0, 0.0, -0.001)})
    assert distance(frames[-1].displacement, exact.displacement) < 1e-3
    said = [record.message for record in caplog.records if "graphics processor was lost" in record.message]
    assert len(said) == 1
    # The next one is opened anew.
    assert "the processor did it" not in body.solve(displacement={hand: (0.0, 0.0, -0.001)}, solver="gpu").message


def test_settings_that_do_not_go_together_are_refused():
    with pytest.raises(vs.VisceraError, match="block_jacobi"):
        vs.ConjugateGradients("lagged_cholesky", device="gpu")
    with pytest.raises(vs.VisceraError, match="'gpv' is unknown"):
        vs.ConjugateGradients("block_jacobi", device="gpv")
