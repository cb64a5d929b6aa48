"""What a model file holds of its organ and of the series: mesh, preload, touchable surface, lengths and order."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cached_property
from math import comb
from typing import Any

import numpy as np

from viscera import _core
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh, known
from viscera.reduced.notes import cell_sets, node_sets, require_own
from viscera.sealed import read_only


class Stored:
    """The arrays and the metadata of a model file; `Touch` says what they are for."""

    def __init__(self, model: _core.Model) -> None:
        self._model = model
        self.metadata: dict[str, Any] = json.loads(model.metadata)

    def summary(self) -> dict[str, Any]:
        """The model in numbers: positions, terms of the series, modes, and the errors measured off-line.

        `errors` are relative to the norm of the field, at the worst of the points that were tried; `worst_error` is the
        largest of them.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("tip", depth="2%", order=2)
        >>> summary = touch.summary()
        >>> summary["positions"], summary["terms"], bool(summary["worst_error"] < 0.01)
        (25, 9, True)
        """
        errors: dict[str, float] = self.metadata["errors"]
        return {
            "positions": len(self._model.array("positions")),
            "terms": comb(self.order + 3, 3) - 1,
            "modes": len(self._model.array("mode_scale")),
            "errors": errors,
            "worst_error": max(errors.values()),
        }

    @cached_property
    def points(self) -> Floats:
        """Nodes (n, 3) [m] before a touch; those of the surface alone in a model without cells."""
        return read_only(self._model.array("points"))

    @cached_property
    def mesh(self) -> Mesh:
        """The mesh in the shape before a touch, with its cell sets, and with midpoints if the element has them.

        Under a preload it lies where a scan shows it if that is the state of `Organ.unloaded`; else it `is_unloaded`.
        """
        if self.preload is None:
            return self.rest
        is_as_scanned = self._notes.get("starts_as_scanned", False)
        return replace(self.rest, points=self.points, is_unloaded=not is_as_scanned)

    @cached_property
    def rest(self) -> Mesh:
        """The mesh at rest: `mesh`, unless the model has a preload."""
        cells = self._model.array("cells")
        if not len(cells):
            raise VisceraError(
                "this model has no cells: it was written for a page, which needs none. It answers touches given in "
                "metres; for the mesh and what lies inside take the file that it was exported from"
            )
        free = self.points if self.preload is None else self.points - self.preload
        corners = free[: int(cells.max()) + 1]
        sets, parts = self._sets
        more = {"axes": self._notes.get("axes", ""), "is_unloaded": self._notes.get("is_unloaded", False)}
        linear = replace(known(corners, cells, sets, parts), **more)
        return linear.quadratic() if self.element == "P2" else linear

    @cached_property
    def _sets(self) -> tuple[dict[str, Indices], dict[str, Indices]]:
        """The sets of corners and those of cells; none in a model without cells."""
        cells = self._model.array("cells")
        if not len(cells):
            return {}, {}
        return node_sets(self._notes, int(cells.max()) + 1), cell_sets(self._notes, len(cells))

    def _require_own_notes(self) -> None:
        """Raises `VisceraError` for a file that keeps something else where the package keeps sets, axes and flags."""
        require_own(self._notes)
        _ = self._sets

    @property
    def _notes(self) -> dict[str, Any]:
        """What the writer of the file has added to the metadata."""
        user = self.metadata.get("user")
        return user if isinstance(user, dict) else {}

    @cached_property
    def preload(self) -> Floats | None:
        """Displacement (n, 3) [m] from rest under the dead load that acts during the touches; None without one."""
        displacement: Floats = self._model.array("preload")
        return read_only(displacement) if len(displacement) else None

    @cached_property
    def surface_nodes(self) -> Indices:
        """Indices (k,) of the surface nodes."""
        return read_only(self._model.array("surface_nodes").astype(np.uint32))

    @cached_property
    def touchable_triangles(self) -> Indices:
        """Triangles (t, 3) of the surface that may be touched."""
        positions, triangles = self._model.array("positions"), self._model.array("touchable")
        return read_only(positions[triangles].astype(np.uint32))

    @cached_property
    def _touchable(self) -> _core.Surface:
        return _core.Surface(self.points, self.touchable_triangles)

    @property
    def element(self) -> str:
        """The element of the full organ."""
        return str(self.metadata.get("element", "P1"))

    @property
    def parameter(self) -> dict[str, Any] | None:
        """The parameter that the model covers a range of: `name`, `value`, `range`; None for a model without one."""
        parameter = self.metadata.get("parameter")
        return None if parameter is None else {key: parameter[key] for key in ("name", "value", "range")}

    @property
    def value(self) -> float | None:
        """The value that the model's parameter is set to; None for a model without a parameter."""
        return None if self.parameter is None else float(self.parameter["value"])

    @property
    def radius(self) -> float:
        """Radius of the contact patch [m]."""
        return float(self.metadata["radius"])

    @property
    def depth(self) -> float:
        """Largest contact displacement [m] that the model was built for."""
        return float(self.metadata["depth"])

    @property
    def order(self) -> int:
        """Total order of the series in the contact displacement."""
        return int(self.metadata["order"])
