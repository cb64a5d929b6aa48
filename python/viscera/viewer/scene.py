"""A scene for the page, stepped on this machine: by Python, as no page has contact, bonds and springs in itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from viscera.boundary.holding import AT_REST
from viscera.boundary.loads import Density
from viscera.cases.scene_case import SceneCase
from viscera.errors import naming
from viscera.scene import Scene
from viscera.stepping.stepper import Stepper
from viscera.viewer.live import DENSITY, NOWHERE, Reply, left_out
from viscera.viewer.stepped import PlayedStepper

ITERATIONS = 20
"""Largest number of Newton iterations in a frame, as in `live/src/specimen.rs`."""
BUDGET = 8e-3
"""Time [s] after which a frame begins no further iteration."""
DIRECT_CELLS = 5000
"""Number of cells above which the factor of an earlier tangent is kept (docs/solvers.md)."""


@dataclass(frozen=True)
class LiveScene:
    """A scene under gravity; each page gets its own stepper of it."""

    scene: Scene
    name: str
    density: Density
    gravity: Sequence[float]
    left_out: Sequence[str] = ()
    """Kinds of loads of its case that are not applied."""

    def open(self) -> Reply:
        """What answers the requests of one page."""
        return PlayedStepper(self.stepper, self.name, self.gravity, self.left_out).reply

    def stepper(self) -> Stepper:
        """The scene at rest."""
        solver = "cholesky" if len(self.scene.mesh.cells) <= DIRECT_CELLS else "cg"
        return self.scene.stepper(solver=solver, iterations=ITERATIONS, budget=BUDGET, density=self.density)


def live_scene(case: SceneCase, name: str) -> LiveScene:
    """The scene of a case under a name to show; raises `VisceraError` if it cannot be made or stepped."""
    density, gravity = case.loads.get("density") or DENSITY, case.loads.get("gravity") or NOWHERE
    live = LiveScene(case.organ(), name, density, gravity, left_out(case))
    with naming(case.file):
        live.scene._require_held(AT_REST)
        live.stepper()  # what no page could be given, such as a body inside an organ, is refused here
    return live
