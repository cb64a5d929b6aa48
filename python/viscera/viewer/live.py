"""A case for the page that drives it in real time: packed once, then stepped on this machine or in the page itself.

The stepper, the requests that it follows and the frames that it answers are one piece of Rust (`live/`); here it is
only given an organ and the laws to compare.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from websockets.sync.server import ServerConnection

from viscera import _core, defaults, law
from viscera.case import Case
from viscera.loads import density_per_cell
from viscera.support import require_held

DENSITY = 1000.0
"""Of tissue [kg/m^3], for a case that names none."""
PAGE_UNKNOWNS = 10_000
"""A page steps organs with so many degrees of freedom at tens of frames a second; larger ones, this machine."""


DTYPES = {"float64": "F64", "uint32": "U32"}

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class LiveCase:
    """An organ and the laws it may be given, as `live/src/case.rs` reads them."""

    data: bytes
    unknowns: int
    """Degrees of freedom of the organ."""

    @property
    def fits_a_page(self) -> bool:
        """Whether a page can step it by itself."""
        return self.unknowns <= PAGE_UNKNOWNS


def live_case(case: Case, name: str) -> LiveCase:
    """Pack a case under a name to show; raises `VisceraError` where it cannot be stepped."""
    case.require_unloaded("view")
    organ = case.organ()
    mesh = organ.mesh
    require_held(mesh, organ.fixed, organ.fixed[:0], [])
    laws = matched(organ.law)
    arrays: Arrays = {
        "points": mesh.points[: mesh.n_corners],
        "cells": mesh.cells,
        "fixed": organ.fixed,
        "density": density_per_cell(mesh, case.loads.get("density", DENSITY)),
        **{kind: choice.parameters for kind, choice in laws.items()},
    }
    about = {
        "name": name,
        "law": type(organ.law).__name__,
        "laws": {kind: choice.name for kind, choice in laws.items()},
        "element": organ.element,
        "radius": defaults.RADIUS_FRACTION * mesh.diagonal,
        "diagonal": mesh.diagonal,
        "gravity": [float(g) for g in case.loads.get("gravity") or (0, 0, 0)],
    }
    live = LiveCase(pack(about, arrays), mesh.points.size)
    _core.Live(live.data)
    return live


def matched(own: law.Law) -> dict[str, law.Law]:
    """The case's law, and the others with its shear and bulk modulus at rest."""
    shear, bulk = own.core().moduli().T
    lame = {"mu": shear, "lam": bulk - 2.0 / 3.0 * shear}
    laws = {
        kind.__name__: kind(**lame) for kind in (law.Linear, law.Corotated, law.SaintVenantKirchhoff, law.NeoHookean)
    }
    rubber = law.MooneyRivlin(c1=shear / 4.0, c2=shear / 4.0, kappa=bulk)
    return {**laws, "MooneyRivlin": rubber, type(own).__name__: own}


def converse(case: LiveCase) -> Callable[[ServerConnection], None]:
    """A handler of web sockets: each page gets its own organ."""

    def handle(connection: ServerConnection) -> None:
        live = _core.Live(case.data)
        connection.send(live.describe())
        for message in connection:
            if not isinstance(message, str):
                connection.close(1003, "requests are text")
                return
            try:
                connection.send(live.answer(message))
            except ValueError as error:
                connection.send(json.dumps({"error": str(error)}))

    return handle


def pack(metadata: dict[str, Any], arrays: Arrays) -> bytes:
    """Metadata and arrays as safetensors bytes."""
    header: dict[str, Any] = {"__metadata__": {"viscera": json.dumps(metadata)}}
    end = 0
    # Widest numbers first, as everything then lies aligned.
    ordered = sorted(arrays.items(), key=lambda item: -item[1].itemsize)
    for name, array in ordered:
        offsets = [end, end + array.nbytes]
        header[name] = {"dtype": DTYPES[array.dtype.name], "shape": list(array.shape), "data_offsets": offsets}
        end += array.nbytes
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    little = (np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes() for _, array in ordered)
    return struct.pack("<Q", len(text)) + text + b"".join(little)
