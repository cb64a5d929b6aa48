"""Locking in the field's own tests, of which docs/elements.md prints more: Cook's membrane, its pressure, inf-sup."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

NEARLY_INCOMPRESSIBLE = 0.4999


def test_cooks_membrane_rises_to_one_value_but_for_p1(locking: ModuleType) -> None:
    """By refinement two elements of different kind lead to one limit; what they have in common is only the law."""
    rises = {
        element: np.array([locking.cook(element, NEARLY_INCOMPRESSIBLE, n)[0] for n in sizes])
        for element, sizes in (("P1", (8, 16, 32)), ("P1 mean volume", (8, 16, 32)), ("P2", (4, 8, 16)))
    }

    def limit(coarse: float, middle: float, fine: float) -> float:
        """Of a geometric series (Aitken)."""
        return fine + (fine - middle) ** 2 / (2 * middle - coarse - fine)

    ours, quadratic = limit(*rises["P1 mean volume"]), limit(*rises["P2"])
    assert ours == pytest.approx(quadratic, rel=5e-3)
    errors = 1 - rises["P1 mean volume"] / ours
    assert (errors[1:] < errors[:-1] / 2).all(), f"errors {errors} halve at least"
    assert errors[-1] < 0.03
    assert rises["P1"][-1] < 0.36 * ours, "and this one is locked on the finest mesh"


def test_its_pressure_is_even_where_cells_share_their_volume(locking: ModuleType) -> None:
    """A checkerboard would stay as the mesh is refined; a smooth pressure nears those around as the square of size."""
    shared = [locking.cook("P1 mean volume", NEARLY_INCOMPRESSIBLE, n)[1] for n in (8, 16, 32)]
    assert shared[0] < 0.05
    assert shared[1] < shared[0] / 3
    assert shared[2] < shared[1] / 3
    assert locking.cook("P1", NEARLY_INCOMPRESSIBLE, 16)[1] > 0.5, "cell by cell it is nothing but a checkerboard"


def test_demands_on_the_volume_leave_room_to_move(locking: ModuleType) -> None:
    """A third as many demands as displacements is what the continuum asks; linear cells alone ask for most of them."""
    free, demands, coarse = locking.inf_sup("P1 mean volume", 2)
    assert 3 * demands < free
    free, demands, fine = locking.inf_sup("P1 mean volume", 4)
    assert 3 * demands < free
    assert 0.4 < fine / coarse < 0.7, "it is not inf-sup stable, as docs/elements.md says"
    free, demands, locked = locking.inf_sup("P1", 4)
    assert 3 * demands > 2 * free
    assert 2 * locked < fine
