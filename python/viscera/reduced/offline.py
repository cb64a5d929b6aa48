"""The off-line stage on the workers of an executor: a task is one region, whose batch comes back as the core wrote it.

The calling process assembles the model from the batches. It is the same, bit by bit, as that of a reduction in one
process, as long as all processors are of one kind.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from functools import cached_property
from typing import TYPE_CHECKING, Any

from viscera.cluster import spread
from viscera.reduced.checkpoint import Batches
from viscera.reduced.regions import positions_of, regions_of, stand_in

if TYPE_CHECKING:
    from viscera.organ import Organ
    from viscera.reduced.vary import Vary


class Offline:
    """A reduction in the form that workers receive: `Organ.reduce` with its arguments resolved."""

    def __init__(self, organ: Organ, vary: Vary | None, settings: Mapping[str, Any]) -> None:
        self.organ, self.vary, self.settings = organ, vary, settings
        preload = settings["preload"]
        points = organ.mesh.points if preload is None else organ.mesh.points + preload
        self.regions = regions_of(organ.mesh.surface, points, settings["touchable"])

    def __getstate__(self) -> dict[str, Any]:
        """Without the bodies, which each worker makes itself."""
        return {name: value for name, value in vars(self).items() if name != "members"}

    @cached_property
    def members(self) -> tuple[Organ, dict[str, Any] | None]:
        """The organ that is reduced, and those at the values of a parameter."""
        return (self.organ, None) if self.vary is None else self.vary.family(self.organ, self.settings["radius"])

    def solve(self, region: int) -> bytes:
        """The batch of one region."""
        alone = _Alone([stand_in(each) for number, each in enumerate(self.regions) if number != region])
        organ, family = self.members
        try:
            organ._body.reduce(
                **self.settings,
                family=family,
                metadata="{}",
                on_progress=lambda done, total, stage: None,
                batches=alone,
            )
        except _Solved as solved:
            return solved.batch
        raise AssertionError("a reduction ended before its region was solved")

    def batches(
        self, executor: Executor, kept: Batches | None, progress: Callable[[int, int, str], None] | None
    ) -> list[bytes]:
        """All batches: kept ones, and those that the workers solve, each of which is kept when it arrives."""
        found = [] if kept is None else kept.finished()
        done = {tuple(positions_of(batch)) for batch in found}
        missing = [number for number, region in enumerate(self.regions) if tuple(region) not in done]
        sizes = [len(self.regions[number]) for number in missing]
        total = sum(map(len, self.regions))

        def attend() -> None:
            if progress:
                progress(total - sum(sizes), total, "solve")

        for task, batch in spread(Offline.solve, self, missing, executor, attend):
            found.append(batch)
            if kept is not None:
                kept.keep(batch)
            sizes[task] = 0
        return found


class Finished:
    """A complete set of batches, from which the core assembles the model."""

    def __init__(self, batches: list[bytes]) -> None:
        self._batches = batches

    def finished(self) -> list[bytes]:
        """All of them."""
        return self._batches

    def keep(self, batch: bytes) -> None:
        """Nothing is left to keep."""


class _Solved(Exception):
    """Ends the reduction of a worker."""

    def __init__(self, batch: bytes) -> None:
        super().__init__("the region is solved")
        self.batch = batch


class _Alone(Finished):
    """Stand-ins for all regions but one."""

    def keep(self, batch: bytes) -> None:
        """The one that was asked for."""
        raise _Solved(batch)
