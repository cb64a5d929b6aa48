"""The web version of a model: the surface alone, with fewer modes, below a given size; and its measured error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viscera.errors import VisceraError
from viscera.reduced.check import surface_points
from viscera.reduced.touch import Touch
from viscera.viewer.surface import named, surface_alone

LIMIT = 25_000_000
"""Largest web version [bytes]."""
TOLERANCES = (0.002, 0.003, 0.005, 0.007, 0.01, 0.015, 0.02, 0.03, 0.05)
"""Tried from the first: errors of the field at full depth, relative to it, root mean square over directions."""
TOUCHES = 200


@dataclass(frozen=True)
class WebModel:
    """The bytes of the web version and its distance from the full model."""

    data: bytes
    modes: int
    worst_error: float
    """|u - u_full| / |u_full| over the nodes that the page has: the worst of random touches at full depth."""
    touches: int


def web_model(touch: Touch, name: str, limit: int = LIMIT) -> WebModel:
    """The most accurate web version below `limit` bytes; raises `VisceraError` if even the coarsest is larger."""
    surface = surface_alone(touch)
    for tolerance in TOLERANCES:
        small = surface.compressed(tolerance)
        if len(named(small, name)) < 0.98 * limit:
            worst = _worst_error(touch, surface, small)
            data = named(small, name, web={"worst_error": worst, "touches": TOUCHES})
            return WebModel(data, small.summary()["modes"], worst, TOUCHES)
    raise VisceraError(f"no web version of this model is below {limit / 1e6:.0f} MB; reduce it with fewer positions")


def _worst_error(touch: Touch, surface: Touch, small: Touch) -> float:
    rng = np.random.default_rng(0)
    worst = 0.0
    for point in surface_points(touch, TOUCHES, rng):
        direction = rng.normal(size=3)
        push = touch.depth * direction / np.linalg.norm(direction)
        full = surface.surface_displacement(point, push)
        difference = np.linalg.norm(small.surface_displacement(point, push) - full)
        worst = max(worst, float(difference / np.linalg.norm(full)))
    return worst
