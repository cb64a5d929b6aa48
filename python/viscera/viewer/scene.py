"""A scene, or an organ with elastic supports, for the page, stepped on this machine by Python.

No page has contact, bonds, springs and supports in itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from viscera.boundary.holding import AT_REST
from viscera.boundary.loads import Density
from viscera.cases.case import Case
from viscera.cases.scene_case import SceneCase
from viscera.errors import naming
from viscera.organ import Organ
from viscera.stepping.stepper import Stepper
from viscera.viewer.live import Reply, left_out, notes_of, weight
from viscera.viewer.stepped import PlayedStepper

ITERATIONS = 20
"""Largest number of Newton iterations in a frame, as in `live/src/specimen.rs`."""
BUDGET = 8e-3
"""Time [s] after which a frame begins no further iteration."""
DIRECT_CELLS = 5000
"""Number of cells above which the factor of an earlier tangent is kept (docs/solvers.md)."""


@dataclass(frozen=True)
class LiveScene:
    """A scene or an organ under gravity; each page gets its own stepper of it."""

    organ: Organ
    name: str
    density: Density
    gravity: Sequence[float]
    left_out: Sequence[str] = ()
    """Kinds of loads of its case that are not applied."""
    notes: Mapping[str, Any] = field(default_factory=dict)
    """What the page says of it."""

    def open(self) -> Reply:
        """What answers the requests of one page."""
        return PlayedStepper(self.stepper, self.name, self.gravity, self.left_out, notes=self.notes).reply

    def stepper(self) -> Stepper:
        """The organs at rest."""
        solver = "cholesky" if len(self.organ.mesh.cells) <= DIRECT_CELLS else "cg"
        return self.organ.stepper(solver=solver, iterations=ITERATIONS, budget=BUDGET, density=self.density)


def live_scene(case: Case | SceneCase, name: str) -> LiveScene:
    """What a case is of, under a name to show; raises `VisceraError` if it cannot be made or stepped."""
    if isinstance(case, Case):
        with naming(case.file):
            case.require_unloaded("view")
    with naming(case.file):
        density, gravity = weight(case)
    organ = case.organ()
    live = LiveScene(organ, name, density, gravity, left_out(case), notes_of(organ.mesh, case))
    with naming(case.file):
        live.organ._require_held(AT_REST)
        live.stepper()  # what no page could be given, such as a body inside an organ, is refused here
    return live
