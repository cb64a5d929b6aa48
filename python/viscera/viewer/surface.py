"""A model as the page needs it: the surface alone. Nothing that the surface shows is lost, half of the bytes are."""

from __future__ import annotations

import json
from typing import Any

from viscera.touch import Touch


def surface_alone(touch: Touch) -> Touch:
    """The model whose only nodes are those of the surface; it has no cells, so it cannot be solved.

    Of a model for a range of a parameter, that of the value it is set to.
    """
    return Touch(touch._model.surface_alone())


def surface_model(touch: Touch, name: str) -> bytes:
    """The model file (bytes) that the page loads, under the name that it shows."""
    return named(surface_alone(touch), name)


def named(touch: Touch, name: str, **notes: Any) -> bytes:
    """The file of a model with the name to show and further notes among what is added to its metadata."""
    user = touch.metadata["user"] if isinstance(touch.metadata["user"], dict) else {}
    return touch._model.with_user(json.dumps({**user, "name": name, **notes})).to_bytes()
