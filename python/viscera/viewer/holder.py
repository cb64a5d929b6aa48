"""Which of several views of one widget holds the organ: the one that took hold last. The others see what it does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from viscera.viewer.request import HAND

TAKING = ("grab", "laws")
"""What takes the organ from whoever holds it: to take hold, and to begin anew."""


class Holder:
    """The view that holds the organ, by its name; None where Python holds it, or nobody."""

    def __init__(self) -> None:
        self.view: str | None = None

    def is_another(self, view: str) -> bool:
        """Whether the organ is in the hands of another view."""
        return self.view not in (None, view)

    def may_do(self, view: str, asked: Mapping[str, Any]) -> dict[str, Any]:
        """What of a request of a view is followed: who does not hold the organ moves no hand of it.

        Where Python holds it, a view may let go.
        """
        if self.view == view or takes(asked):
            return dict(asked)
        kept = () if self.is_another(view) else ("release",)
        first = {name: value for name, value in asked.items() if name not in ("second", *HAND) or name in kept}
        second = {name: value for name, value in asked.get("second", {}).items() if name in kept}
        return {**first, "second": second}


def takes(asked: Mapping[str, Any]) -> bool:
    """Whether a request takes hold of the organ by either hand, or begins anew."""
    return any(word in gesture for gesture in (asked, asked.get("second", {})) for word in TAKING)
