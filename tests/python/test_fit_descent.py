"""The search of a fit within bounds: against known minima, on bounds, along a curved valley, past trials that fail."""

from __future__ import annotations

import numpy as np
import pytest

from viscera.fitting.descent import least
from viscera.mesh import Floats

OPEN = np.full(2, np.inf)


def rosenbrock(x: Floats) -> tuple[Floats, Floats]:
    """Its valley `x2 = x1^2` is curved; the minimum is (1, 1)."""
    return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]), np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])


def test_a_curved_valley_is_followed_to_its_end() -> None:
    np.testing.assert_allclose(least(rosenbrock, np.array([-1.2, 1.0]), -OPEN, OPEN), 1.0, rtol=1e-9)


def test_a_minimum_on_a_bound_is_on_it_and_the_other_value_the_best_there() -> None:
    """On `x1 = 1/2` the error is least at `x2 = 1/4`."""
    found = least(rosenbrock, np.array([-1.2, 1.0]), -OPEN, np.array([0.5, np.inf]))
    assert found[0] == 0.5
    assert found[1] == pytest.approx(0.25, rel=1e-9)


def test_a_value_leaves_the_bound_that_it_starts_on() -> None:
    found = least(rosenbrock, np.array([0.0, 0.0]), np.zeros(2), OPEN)
    np.testing.assert_allclose(found, 1.0, rtol=1e-9)


def test_units_play_no_part() -> None:
    units = np.array([1e6, 1e-4])

    def scaled(x: Floats) -> tuple[Floats, Floats]:
        error, derivatives = rosenbrock(x / units)
        return error, derivatives / units

    np.testing.assert_allclose(least(scaled, np.array([-1.2, 1.0]) * units, -OPEN, OPEN), units, rtol=1e-9)


def test_a_trial_that_fails_is_taken_back() -> None:
    """Where `x1 > 1.5` there is no answer, and the first steps go there."""
    failures = list[float]()

    def residual(x: Floats) -> tuple[Floats, Floats]:
        if x[0] > 1.5:
            failures.append(x[0])
            return np.full(1, 1e3), np.zeros((1, 2))
        return np.array([np.tanh(x[0] - 1.0) + 0.0 * x[1]]), np.array([[np.cosh(x[0] - 1.0) ** -2.0, 0.0]])

    found = least(residual, np.array([-0.5, 3.0]), -OPEN, OPEN)
    assert failures
    assert found[0] == pytest.approx(1.0, abs=1e-9)
    assert found[1] == 3.0  # nothing depends on it
