"""A SOFA scene (SofaPython3) with an organ that is a reduced model: SOFA moves the tool, Viscera answers and draws.

    VISCERA_LIBRARY=libviscera.so VISCERA_MODEL=liver.viscera runSofa -l SofaPython3 sofa_controller.py

Metres and newtons. The tool is any object with a `position`: here one that the mouse drags, in a laboratory the
`positionDevice` of a haptic driver, whose `inputForceFeedback` is then given as `feedback`. The controller runs once
per simulation step, which is not 1 kHz: a motor wants the C loop of haptic.c, with this one as the slow thread.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import Sofa.Core
from viscera_ctypes import OFF_SURFACE, Guard, Organ, load_library


class VisceraController(Sofa.Core.Controller):  # type: ignore[misc]
    """Presses `organ` with `tool`, writes its surface to `visual` and the force on the hand to `feedback`."""

    def __init__(self, organ: Organ, guard: Guard, tool: Any, visual: Any, feedback: Any) -> None:
        Sofa.Core.Controller.__init__(self, name="viscera")
        self.organ, self.guard = organ, guard
        self.tool, self.visual, self.feedback = tool, visual, feedback
        self.touches, self.contact, self.outward = False, np.zeros(3), np.zeros(3)
        self.at = self.tool_position()

    def tool_position(self) -> np.ndarray:
        return np.array(self.tool.position.value[0][:3], dtype=float)

    def onAnimateBeginEvent(self, event: dict[str, float]) -> None:
        at = self.tool_position()
        moved, self.at = at - self.at, at
        distance = 0.0
        if not self.touches:
            self.contact, distance = self.organ.locate(at)
        away = at - self.contact
        # Found on the other side of the point it was closest to outside: it has gone in there, and sticks.
        self.touches = bool(away @ self.outward < 0)
        if not self.touches and distance > 0:
            self.outward = away / distance
        status, force = OFF_SURFACE, np.zeros(3)
        if self.touches:
            status, answer = self.organ.touch(self.contact, away)
            force = np.array(answer.force)
        on_organ = self.guard.step(force, status, moved, event["dt"])
        self.feedback.value = [(-on_organ).tolist()]
        surface = self.organ.draw(self.contact, away if self.touches else np.zeros(3))
        with self.visual.position.writeableArray() as positions:
            positions[:] = surface


def createScene(root: Any) -> Any:
    library = load_library(os.environ["VISCERA_LIBRARY"])
    organ = Organ(library, os.environ["VISCERA_MODEL"])
    guard = Guard(library, force_limit=3, rate_limit=100, watchdog=0.1, fade=0.2)
    guard.keep_passive(energy_limit=0.01, damping=2)

    root.addObject("RequiredPlugin", pluginName=["Sofa.Component.StateContainer", "Sofa.GL.Component.Rendering3D"])
    root.addObject("DefaultAnimationLoop")
    root.dt = 0.01
    above, _ = organ.locate([0, 0, 10])
    pen = root.addChild("tool")
    tool = pen.addObject("MechanicalObject", position=[[above[0], above[1], above[2] + 0.02]], showObject=True)
    feedback = pen.addData(name="force", type="vector<Vec3d>", value=[[0.0, 0.0, 0.0]], help="on the hand [N]")
    skin = root.addChild("organ")
    visual = skin.addObject("OglModel", position=organ.positions.tolist(), triangles=organ.triangles.tolist())
    controller = VisceraController(organ, guard, tool, visual, feedback)
    return root.addObject(controller)
