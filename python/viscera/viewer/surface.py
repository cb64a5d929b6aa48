"""A model as the page needs it: its surface and those of parts within. It shows the same with half of the bytes."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from viscera.mesh import Indices
from viscera.quantity import refused
from viscera.reduced.parts import inner_parts
from viscera.reduced.touch import Touch
from viscera.reduced.vary import UNITS


def surface_alone(touch: Touch) -> Touch:
    """The model whose only nodes are those of the surface and of the parts within; it has no cells to be solved.

    Of a model for a range of a parameter, that of the value it is set to. What is within is listed in its notes, as
    triangles between the rows of `surface_nodes`. A model that has no cells is returned as it is. Raises `VisceraError`
    for what is no reduced model.
    """
    if not isinstance(touch, Touch):
        raise refused("what this page shows", "a reduced model, such as organ.reduce(...)", touch)
    if not len(touch._model.array("cells")):
        return touch
    parts = inner_parts(touch.mesh)
    inside = np.unique(np.concatenate([touch.surface_nodes, *(triangles.ravel() for triangles in parts.values())]))
    rows = {name: np.searchsorted(inside, triangles).ravel().tolist() for name, triangles in parts.items()}
    shown = {
        "inside": [{"name": name, "triangles": listed} for name, listed in rows.items()],
        "axes": touch.mesh.axes,
        # The page may then multiply all stiffnesses: springs that hold the organ would stay as they are.
        "is_stress_free": touch.preload is None and not len(touch._model.array("tie_stiffness")),
        **_setting(touch),
        **_unloaded(touch, inside),
    }
    others = {name: note for name, note in touch._notes.items() if name not in ("sets", "cell_sets")}
    return Touch(touch._model.surface_alone(inside.tolist()).with_user(json.dumps({**others, **shown})))


def _setting(touch: Touch) -> dict[str, Any]:
    """The parameter of a model for a range of one, at its value; empty for other models."""
    parameter = touch.metadata.get("parameter")
    if parameter is None:
        return {}
    name = parameter["name"]
    return {"parameter": {"name": name, "unit": UNITS[name], "value": touch.value, "range": parameter["range"]}}


def _unloaded(touch: Touch, nodes: Indices) -> dict[str, Any]:
    """Where nodes (s,) are without the preload, from where strain counts; empty for models about rest."""
    if touch.preload is None:
        return {}
    # In single precision, as the page has all positions.
    places = (touch.points - touch.preload)[nodes]
    return {"unloaded": [float(f"{x:.7g}") for x in places.ravel()]}


def surface_model(touch: Touch, name: str) -> bytes:
    """The model file (bytes) that the page loads, under the name that it shows."""
    return named(surface_alone(touch), name)


def named(touch: Touch, name: str, **notes: Any) -> bytes:
    """The file of a model with the name to show and further notes among what is added to its metadata."""
    return touch._model.with_user(json.dumps({**touch._notes, "name": name, **notes})).to_bytes()
