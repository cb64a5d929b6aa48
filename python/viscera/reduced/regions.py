"""Which positions a batch of a reduction holds, as the core cuts and writes them: `reduced/{positions,solve}.rs`.

The core solves the regions that it is given no batch of. So a worker that is to solve one of them is given a stand-in,
a batch without numbers, for each of the others, and its reduction ends as soon as its own is done. A model never holds
a stand-in, and whatever region is lacking in the end, the core solves then: what is said here decides who solves what,
not what comes out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viscera.mesh import Floats, Indices

LARGEST = 16
"""Positions of a region at most."""
EMPTY = b"\0"
"""An empty list, as postcard writes it."""


def regions_of(surface: Indices, points: Floats, touchable: Indices) -> list[list[int]]:
    """The positions of each region: numbers of the touchable nodes that make whole triangles of the surface (t, 3)."""
    nodes = np.unique(surface[np.isin(surface, touchable).all(axis=1)])
    return _halved(np.arange(len(nodes)), points[nodes])


def _halved(members: NDArray[np.int64], points: Floats) -> list[list[int]]:
    """Split at the median of the longest extent, until regions are small."""
    if len(members) <= LARGEST:
        return [sorted(members.tolist())]
    extents = np.ptp(points[members], axis=0).tolist()
    axis = max(range(3), key=lambda k: (extents[k], k))
    along = points[members, axis]
    # Of equal coordinates the lower position comes first; -0 comes before 0.
    ordered = members[np.lexsort((members, ~np.signbit(along), along))]
    middle = len(members) // 2
    return _halved(ordered[:middle], points) + _halved(ordered[middle:], points)


def stand_in(positions: list[int]) -> bytes:
    """A batch of a region without numbers: modes, scales, members; positions; edges, answers."""
    return 3 * EMPTY + _varint(len(positions)) + b"".join(map(_varint, positions)) + 2 * EMPTY


def positions_of(batch: bytes) -> list[int]:
    """The positions of a batch; empty if its bytes are none."""
    try:
        return _Batch(batch).positions()
    except IndexError:
        return []


class _Batch:
    """A batch read from its start."""

    def __init__(self, batch: bytes) -> None:
        self._bytes = np.frombuffer(batch, dtype=np.uint8)
        self._at = 0

    def positions(self) -> list[int]:
        self._skip_integers(self._integer())  # modes
        self._skip_floats()  # scales
        for _ in range(self._integer()):  # members: amplitudes of positions and of edges, and two lists of errors
            for _ in range(2):
                for _ in range(self._integer()):
                    self._skip_floats()
            for _ in range(2):
                self._skip_floats()
        return [self._integer() for _ in range(self._integer())]

    def _integer(self) -> int:
        value, shift = 0, 0
        while True:
            byte = int(self._bytes[self._at])
            self._at += 1
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
            shift += 7

    def _skip_integers(self, count: int) -> None:
        if count:
            self._at += int(np.flatnonzero(self._bytes[self._at : self._at + 5 * count] < 0x80)[count - 1]) + 1

    def _skip_floats(self) -> None:
        count = self._integer()
        self._at += 4 * count


def _varint(value: int) -> bytes:
    """Seven bits a byte, the lowest first."""
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])
