"""An organ for the page that drives it in real time: packed once, then stepped on this machine or in the page itself.

The stepper, the requests that it follows and the frames that it answers are one piece of Rust (`live/`); here it is
only given an organ and the laws to compare.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from websockets.sync.server import ServerConnection

from viscera import _core, defaults, law
from viscera.boundary.holding import IN_PAGE
from viscera.boundary.loads import density_per_cell
from viscera.cases.case import PLACED, Case, _require_density
from viscera.cases.scene_case import SceneCase
from viscera.errors import VisceraError, naming
from viscera.mesh import Mesh
from viscera.organ import Organ
from viscera.quantity import refused
from viscera.reduced.touch import Touch

DENSITY = 1000.0
"""Density of tissue [kg/m^3], by which the page's own gravity pulls where a case has no gravity and names none."""
NOWHERE = (0.0, 0.0, 0.0)
"""No gravity [m/s^2]."""
PAGE_UNKNOWNS = 10_000
"""Degrees of freedom up to which a page steps an organ, at tens of frames a second; this machine steps larger ones."""


DTYPES = {"float64": "F64", "uint32": "U32"}

Arrays = dict[str, NDArray[Any]]
Reply = Callable[[str], str | bytes]
"""Answers a request of a page by words or a frame; and one that asks for nothing by the introduction."""


class Steppable(Protocol):
    """What a page can be given to drive."""

    def open(self) -> Reply:
        """What answers the requests of one page: each has its own organ."""


@dataclass(frozen=True)
class LiveCase:
    """An organ and the laws to choose from, as `live/src/case.rs` reads them."""

    data: bytes
    unknowns: int
    """Degrees of freedom of the organ."""
    notes: Mapping[str, Any]
    """What the page says of it and no stepper needs; it is among the bytes, too."""

    @property
    def fits_a_page(self) -> bool:
        """Whether the organ is small enough for a page to step it by itself."""
        return self.unknowns <= PAGE_UNKNOWNS

    def open(self) -> Reply:
        """What answers the requests of one page."""
        live = _core.Live(self.data)
        introduction = json.dumps({**json.loads(live.describe()), **self.notes})

        def reply(request: str) -> str | bytes:
            try:
                return live.answer(request) if request else introduction
            except ValueError as error:
                return json.dumps({"error": str(error)})

        return reply


def live_case(case: Case | SceneCase, name: str) -> LiveCase:
    """Pack a case under a name to show; raises `VisceraError` if no page can step it."""
    require_for_a_page(case)
    if not isinstance(case, Case):
        raise refused("what a page steps", "a case of one organ, as viscera.case reads it", case)
    with naming(case.file):
        case.require_unloaded("view")
        density, gravity = weight(case)
        organ = case.organ()
        organ._require_held(IN_PAGE)
    return _packed(
        organ,
        name,
        matched(organ.law),
        radius=defaults.RADIUS_FRACTION * organ.mesh.diagonal,
        density=density,
        gravity=gravity,
        left_out=left_out(case),
        notes=notes_of(organ.mesh, case),
    )


def weight(case: Case | SceneCase) -> tuple[Any, Sequence[float]]:
    """Density and gravity of a case; raises `VisceraError` for gravity without a density.

    A case with neither is given the density of tissue, for the gravity that the page may choose.
    """
    density = _density(case)
    _require_density(case.loads, density, "loads")
    return DENSITY if density is None else density, case.loads.get("gravity") or NOWHERE


def _density(case: Case | SceneCase) -> Any:
    """That of a case; None where it names none."""
    density = case.loads.get("density")
    return None if isinstance(density, Mapping) and not density else density


def notes_of(mesh: Mesh, case: Case | SceneCase | None = None) -> dict[str, Any]:
    """What a page says of an organ: the axes of its scan, and a density [kg/m^3] that its case does not name."""
    assumed = case is not None and _density(case) is None
    return {"axes": mesh.axes, "assumed_density": DENSITY if assumed else None}


def left_out(case: Case | SceneCase) -> list[str]:
    """The kinds of loads of a case that its page does not apply."""
    return [kind for kind in PLACED if case.loads.get(kind)]


def is_for_this_machine(case: Case | SceneCase) -> bool:
    """Whether Python steps a case: a scene, or an organ with elastic supports, which no page can step."""
    return isinstance(case, SceneCase) or (isinstance(case, Case) and bool(case.supports))


def require_for_a_page(case: Case | SceneCase) -> None:
    """Raise `VisceraError` for a case whose contact, bonds, springs or supports no page can step."""
    if is_for_this_machine(case):
        what = "a scene" if isinstance(case, SceneCase) else "an organ with elastic supports"
        raise VisceraError(
            f"{what} is stepped on this machine, by `viscera view` without --export; the page to export is that of a "
            "case of one organ without supports, or of a reduced model"
        )


def first_case(touch: Touch, name: str) -> LiveCase | None:
    """The organ of a model, for a page to step until the model has arrived; None if no page can step it.

    The same organ, law and contact patch as the model's, touchable where the model is. A model about a preload or
    without its cells has none, nor has one with elastic supports.
    """
    is_large = touch.mesh.points.size > PAGE_UNKNOWNS
    if is_large or touch.preload is not None or not len(touch._model.array("cells")):
        return None
    organ = touch.organ()
    if organ.supports:
        return None
    nodes = touch.surface_nodes
    touchable = np.searchsorted(nodes, touch.touchable_triangles).astype(np.uint32)
    own = {type(organ.law).__name__: organ.law}
    live = _packed(
        organ,
        name,
        own,
        radius=touch.radius,
        density=DENSITY,
        gravity=NOWHERE,
        touchable=touchable,
        notes=notes_of(organ.mesh),
    )
    return live if live.fits_a_page else None


def _packed(
    organ: Organ,
    name: str,
    laws: Mapping[str, law.Law],
    *,
    radius: float,
    density: ArrayLike,
    gravity: Sequence[float],
    notes: Mapping[str, Any],
    left_out: Sequence[str] = (),
    **more: NDArray[Any],
) -> LiveCase:
    mesh = organ.mesh
    arrays: Arrays = {
        "points": mesh.points[: mesh.n_corners],
        "cells": mesh.cells,
        "fixed": organ.fixed,
        "density": density_per_cell(mesh, density),
        **{kind: choice.parameters for kind, choice in laws.items()},
        **more,
    }
    about = {
        "name": name,
        "law": type(organ.law).__name__,
        "laws": {kind: choice.name for kind, choice in laws.items()},
        "element": organ.element,
        "radius": radius,
        "diagonal": mesh.diagonal,
        "gravity": [float(g) for g in gravity],
        "left_out": list(left_out),
    }
    live = LiveCase(pack(about, arrays, notes), mesh.points.size, notes)
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


def converse(steppable: Steppable) -> Callable[[ServerConnection], None]:
    """A handler of web sockets: each page gets its own organ."""

    def handle(connection: ServerConnection) -> None:
        reply = steppable.open()
        connection.send(reply(""))
        for message in connection:
            if not isinstance(message, str):
                connection.close(1003, "requests are text")
                return
            connection.send(reply(message))

    return handle


def pack(metadata: dict[str, Any], arrays: Arrays, notes: Mapping[str, Any]) -> bytes:
    """Metadata, arrays and notes for the page alone as safetensors bytes."""
    header: dict[str, Any] = {"__metadata__": {"viscera": json.dumps(metadata), "page": json.dumps(dict(notes))}}
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
