"""Points that are there several times are one measurement, not several."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.conftest import coarse_liver, front_of_liver

import viscera as vs
from viscera.registration.measured import read_cloud

Floats = np.ndarray
NOISE = 1e-3
COPIES = 20


@pytest.fixture(scope="module")
def organ() -> vs.Organ:
    return coarse_liver(edge=0.025)


@pytest.fixture(scope="module")
def cloud(organ: vs.Organ) -> Floats:
    """Points (400, 3) [m] on the front of the organ, bent by a load."""
    rng = np.random.default_rng(3)
    state = organ.solve(gravity=(2.0, 0.0, 1.5), density=1060.0, throw=True)
    now, seen = organ.mesh.points + state.displacement, front_of_liver(organ.mesh)
    points = np.einsum("ka,kai->ki", rng.dirichlet(np.ones(3), size=400), now[rng.choice(seen, size=400)])
    return np.asarray(points + rng.normal(scale=NOISE, size=points.shape))


@pytest.fixture(scope="module")
def found(organ: vs.Organ, cloud: Floats) -> vs.Registered:
    return organ.register(cloud, noise=NOISE)


def test_repeated_points_are_no_more_evidence_and_have_a_result_each(
    organ: vs.Organ, cloud: Floats, found: vs.Registered, tmp_path: Path
) -> None:
    """Copies have the same errors: taken for several measurements, they would look like a shape that does not fit."""
    repeated = np.repeat(cloud, COPIES, axis=0)
    np.savetxt(tmp_path / "cloud.csv", repeated, "%.17g", delimiter=",", header="x,y,z", comments="")
    weights = np.tile(np.linspace(0.0, 1.0, COPIES), len(cloud))  # the largest counts
    again = organ.register(read_cloud(tmp_path / "cloud.csv"), weights=weights, noise=NOISE)
    assert found.is_converged, found.message
    assert (again.status, again.message) == (found.status, found.message)
    assert np.array_equal(again.displacement, found.displacement)
    assert np.array_equal(again.band, found.band)
    assert (again.misfit, again.systematic_residual) == (found.misfit, found.systematic_residual)
    assert np.array_equal(again.residual, np.repeat(found.residual, COPIES))
    assert np.array_equal(again.is_inlier, np.repeat(found.is_inlier, COPIES))


def test_repeated_points_do_not_make_a_few_many(organ: vs.Organ, cloud: Floats) -> None:
    with pytest.raises(vs.VisceraError, match="10 surface points, beside 190 of weight 0 or repeated, are too few"):
        organ.register(np.repeat(cloud[:10], COPIES, axis=0), noise=NOISE)
