"""What a fit says of itself: intervals beside bounds, parameters not told apart, and a law off the curve of its fit."""

from __future__ import annotations

import numpy as np

import viscera as vs
from viscera.fitting.homogeneous import incompressible_stress
from viscera.mesh import Floats


def noisy(mode: str, law: vs.laws.Law, parameter: Floats, noise: float, seed: int = 0) -> vs.MaterialTest:
    """The law's own curve with Gaussian noise [Pa]."""
    exact = incompressible_stress(law, vs.MaterialTest(mode, parameter, parameter))
    return vs.MaterialTest(mode, parameter, exact + noise * np.random.default_rng(seed).normal(size=len(exact)), mode)


def test_intervals_beside_a_parameter_at_its_bound_hold_the_truth() -> None:
    stretch, truths = np.linspace(0.7, 0.98, 15), {"c10": 500.0, "c20": 100.0}
    law, bands = vs.Yeoh(500.0, 100.0, 50.0, poisson=0.49), []
    for seed in range(150):
        intervals = vs.fit("Yeoh", noisy("uniaxial", law, stretch, 10.0, seed)).intervals
        if intervals["c30"] is None:
            bands.append([intervals[name] for name in truths])
    assert len(bands) > 20
    for told, truth in zip(np.array(bands, dtype=float).transpose(1, 0, 2), truths.values(), strict=True):
        assert np.mean((told[:, 0] <= truth) & (truth <= told[:, 1])) >= 0.93
