"""What may hold an organ depends on what is computed: an error about one that floats advises what is open there."""

from __future__ import annotations

from dataclasses import dataclass

ALONE = "prescribed displacements hold it in a solve alone"


@dataclass(frozen=True)
class Holding:
    """What holds an organ in a computation, in the words of an error."""

    means: str
    """As in "hold it by ..."."""
    hint: str
    """Of an organ that nothing holds: what else there is, or why what it has does not do."""


IN_SOLVE = Holding(
    "fixed nodes, prescribed displacements, elastic supports (in a case file `fixed`, `displacement`, `supports`), or "
    "bonds of a scene",
    "if contact alone holds it, give it a support too weak to matter, such as ElasticSupport('x > -1%', 1e-3)",
)
IN_FRAMES = Holding(
    "fixed nodes, hands, elastic supports, or bonds of a scene",
    "with inertia it may be free: give the stepper dynamics=, density= and time_step=",
)
AT_REST = Holding("fixed nodes, elastic supports (in a case file `fixed` or `supports`), or bonds of a scene", ALONE)
"""Of what takes no prescribed displacements."""
BY_NODES = Holding("fixed nodes (in a case file `fixed`)", f"{ALONE}, and elastic supports do not count here yet")
"""Of what takes neither these nor supports."""
IN_PAGE = Holding(BY_NODES.means, f"{ALONE}, and elastic supports (`supports`) in `viscera view`")
"""Of what a page steps by itself: `viscera view` steps an organ with supports on this machine."""
