"""A stepper that begins anew: the same object, which scripts go on using, with the organ at rest and without a past."""

from __future__ import annotations

from typing import TYPE_CHECKING

from viscera import _core

if TYPE_CHECKING:
    from viscera.stepping.stepper import Stepper


def begin_anew(stepper: Stepper) -> Stepper:
    """The stepper with its organ at rest: no displacement, no velocity, nothing that tissue remembers.

    Its settings, hands and tools stay. In the next frame hands hold what they hold, where they are, and tools come
    from where they were made, outside the organ, to where they are.
    """
    core = _core.Stepper(stepper._organ._body, start=None, **stepper._settings)
    core.grasp(stepper._motion.dofs, stepper._motion.patches)
    for tool in stepper._tools:
        tool._number = core.add_tool(tool._tool._spec())
        core.place_tool(tool._number, tool.rotation.tolist(), tool.position.tolist())
    stepper._core, stepper._pressure = core, {}
    return stepper
