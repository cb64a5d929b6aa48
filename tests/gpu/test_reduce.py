"""`reduce(solver="gpu")` against the processor, on this machine's graphics processor or on software in its place."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera import _core, gpu
from viscera.law import Law

NEO_HOOKEAN = vs.NeoHookean(young=1e4, poisson=0.45)
SMALL: dict[str, Any] = {"radius": 0.006, "depth": 0.002, "order": 3}


@pytest.fixture(scope="module", autouse=True)
def device() -> str:
    """The device, or a skip; with VISCERA_GPU set, its absence is a failure."""
    try:
        return gpu.describe()
    except vs.VisceraError as error:
        if os.environ.get("VISCERA_GPU"):
            raise
        pytest.skip(f"NOT TESTED: {error}")


def organ(law: Law, element: str) -> vs.Organ:
    """A beam held at one end, touchable at the other."""
    beam = vs.organs.beam()
    return vs.Organ(vs.mesh(0.1 * beam.points, beam.cells, beam.sets), law, fixed="clamp", element=element)


def fields(touch: vs.Touch) -> list[NDArray[np.float64]]:
    """Forces and displacements of a few touches."""
    beam = vs.organs.beam()
    places = [touch.locate(point) for point in 0.1 * beam.points[beam.sets["tip"]][::5]]
    answers = [touch(place, 0.002 * np.array(d)) for place in places for d in ((0, 0, -0.7), (0.5, -0.4, 0.3))]
    return [np.vstack([answer.force, answer.displacement]) for answer in answers]


def difference(found: vs.Touch, exact: vs.Touch) -> float:
    pairs = zip(fields(found), fields(exact), strict=True)
    parts = [(a - b, b) for a, b in pairs]
    return max(
        float(np.abs(off[rows]).max() / np.abs(of[rows]).max()) for off, of in parts for rows in (0, slice(1, None))
    )


@pytest.mark.parametrize("element", ["P1", "P1 mean volume"])
@pytest.mark.parametrize(
    "law",
    [
        NEO_HOOKEAN,
        vs.SaintVenantKirchhoff(young=1e4, poisson=0.3),
        vs.MooneyRivlin(c1=1.4e3, c2=0.3e3, kappa=5e4),
        vs.StrainEnergy("mu/2*(I1bar - 3) + kappa/2*log(J)**2", mu=3.4e3, kappa=3e4),
    ],
    ids=str,
)
def test_models_agree_with_those_of_the_processor(law: Law, element: str, caplog: pytest.LogCaptureFixture) -> None:
    body = organ(law, element)
    before = _core.gpu_traffic()[2]
    found = body.reduce("tip", solver="gpu", **SMALL)
    assert _core.gpu_traffic()[2] > before, "the device was not asked"
    assert 0 < difference(found, body.reduce("tip", **SMALL)) < 1e-5
    assert not caplog.records


def test_tissues_a_loaded_shape_and_a_family() -> None:
    body = organ(NEO_HOOKEAN, "P1 mean volume")
    young = np.where(body.mesh.points[body.mesh.cells].mean(axis=1)[:, 0] > 0.05, 2e4, 1e4)
    two = vs.Organ(body.mesh, vs.NeoHookean(young=young, poisson=0.45), fixed="clamp", element="P1 mean volume")
    state = two.solve(force={"tip": (0.0, 0.0, -0.02)})
    vary = vs.Vary("young", 5e3, 2e4, nodes=2)
    for owner, more in ((two, {"start": state}), (body, {"vary": vary})):
        found, exact = (owner.reduce("tip", solver=solver, **SMALL, **more) for solver in ("gpu", "cholesky"))
        assert 0 < difference(found, exact) < 1e-5


def test_the_same_model_gives_the_same_bits() -> None:
    body = organ(NEO_HOOKEAN, "P1 mean volume")
    models = [body.reduce("tip", solver="gpu", **SMALL) for _ in range(2)]
    first, second = (fields(model) for model in models)
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


def test_a_device_lost_on_the_way_leaves_the_rest_to_the_processor(caplog: pytest.LogCaptureFixture) -> None:
    body = organ(NEO_HOOKEAN, "P1")

    def lose(done: int, total: int, stage: str) -> None:
        if stage == "solve" and done == 0:
            _core.lose_gpu()

    found = body.reduce("tip", solver="gpu", progress=lose, **SMALL)
    assert difference(found, body.reduce("tip", **SMALL)) < 1e-5
    assert [record.message for record in caplog.records] == [
        "the graphics processor was lost: it was shut down; continuing on the processor"
    ]


@pytest.mark.parametrize(
    ("law", "element", "why"),
    [
        (NEO_HOOKEAN, "P2", 'the element is "P2"'),
        (vs.Corotated(young=1e4, poisson=0.4), "P1", "no function of invariants"),
        (vs.Ogden(mu=(2e3,), alpha=(2.0,), kappa=5e4), "P1", "powers of the principal stretches"),
    ],
    ids=str,
)
def test_what_has_no_kernels_is_left_to_the_processor(
    law: Law, element: str, why: str, caplog: pytest.LogCaptureFixture
) -> None:
    body = organ(law, element)
    least = {**SMALL, "order": 2}
    found = body.reduce("tip", solver="gpu", **least)
    assert difference(found, body.reduce("tip", **least)) == 0
    [record] = caplog.records
    assert why in record.message
    assert record.message.endswith("continuing on the processor")


def test_a_checkpoint_of_the_processor_is_another_case(tmp_path: Path) -> None:
    """Batches of the two differ in their last digits; a model holds those of one."""
    whole, kept = organ(NEO_HOOKEAN, "P1"), tmp_path / "beam.batches"
    least = {**SMALL, "order": 2}

    def stop(done: int, total: int, stage: str) -> None:
        if done > 0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        whole.reduce(checkpoint=kept, progress=stop, **least)
    assert kept.exists()
    with pytest.warns(UserWarning, match="another case"):
        whole.reduce(checkpoint=kept, solver="gpu", **least)


def test_settings_that_do_not_go_together_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    body = organ(NEO_HOOKEAN, "P1")
    with ThreadPoolExecutor(1) as executor, pytest.raises(vs.VisceraError, match="leave one of the two out"):
        body.reduce("tip", solver="gpu", executor=executor, **SMALL)
    with pytest.raises(vs.VisceraError, match="solver"):
        body.reduce("tip", solver="cg", **SMALL)
    monkeypatch.setattr(gpu, "LIBRARY", tmp_path / "libviscera_gpu.so")
    with pytest.raises(vs.VisceraError, match="make GPU=1"):
        body.reduce("tip", solver="gpu", **SMALL)


def test_a_case_file_asks_for_it(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    body = organ(NEO_HOOKEAN, "P1")
    reduction = {"touchable": "tip", "radius": 0.006, "depth": 0.002, "order": 3, "solver": "gpu"}
    case = body.to_case(tmp_path / "beam.toml", reduction=reduction)
    before = _core.gpu_traffic()[2]
    case.reduce(case.organ())
    assert _core.gpu_traffic()[2] > before
    assert not caplog.records
