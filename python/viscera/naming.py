"""Names that tell things apart."""

from __future__ import annotations

from collections.abc import Sequence


def told_apart(names: Sequence[str], numbers: Sequence[int]) -> list[str]:
    """The names, those that are equal with the thing's number behind; numbers are different.

    >>> told_apart(["lesion", "liver", "lesion"], [3, 4, 7])
    ['lesion (3)', 'liver', 'lesion (7)']
    """
    numbered = [f"{name} ({number})" for name, number in zip(names, numbers, strict=True)]
    found = [name if names.count(name) == 1 else other for name, other in zip(names, numbered, strict=True)]
    # A thing may be called "lesion (3)" from the beginning.
    return found if len(set(found)) == len(found) else numbered
