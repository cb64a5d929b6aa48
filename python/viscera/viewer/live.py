"""A case stepped in real time for the page: the organ under one or two laws, in the same hand and the same gravity.

Over a web socket the page sends one JSON object for each frame it wants, and gets the frame as one binary message:
little-endian float32, `[bodies, then for each: force x y z [N], residual, part of the step taken, unstable (0 or 1),
milliseconds, relative change of volume, displacement of the surface nodes (3 s) [m]]`. A request that cannot be read is
answered by `{"error": sentence}`, and nothing changes.

    {"laws": ["NeoHookean", "Linear"]}   the laws, one or two; both start from rest
    {"grab": [x, y, z]}                  take hold of the surface at a point at rest [m]
    {"move": [x, y, z]}                  displacement of the hand [m]
    {"release": true}                    let go
    {"gravity": [x, y, z]}               acceleration [m/s^2]
    {}                                   another frame
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from time import perf_counter
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from websockets.sync.server import ServerConnection

from viscera import _core, defaults, law
from viscera.case import Case
from viscera.errors import VisceraError, did_you_mean
from viscera.mesh import Floats, Mesh
from viscera.organ import Organ
from viscera.state import State
from viscera.stepper import Frame

DENSITY = 1000.0
"""Of tissue [kg/m^3], for a case that names none."""


class Specimen:
    """One organ under one law, held by nothing but its supports and at most one hand."""

    def __init__(self, organ: Organ, density: Any) -> None:
        self._organ, self._density = organ, density
        self._patch: _core.Patch | None = None
        self._stepper = organ.stepper({})
        self._frame: Frame | None = None
        self._rest_volume = volume(organ.mesh.points, organ.mesh.surface)

    def hold(self, point: Floats | None, radius: float) -> None:
        """Take hold of the surface at a point, or let go."""
        self._patch = None if point is None else self._organ.patch(point, radius)
        # What a frame and a state have in common is where the nodes are.
        start = cast(State, self._frame) if self._frame is not None else None
        self._stepper = self._organ.stepper({} if self._patch is None else {self._patch: (0, 0, 0)}, start=start)

    def held_displacement(self) -> Floats:
        """Mean displacement of the contact patch (3,) as it is [m]."""
        if self._frame is None or self._patch is None:
            return np.zeros(3)
        return np.asarray(self._patch.weights @ self._frame.displacement[self._patch.nodes])

    def step(self, displacement: Floats, gravity: Floats) -> NDArray[np.float32]:
        """One Newton iteration; the numbers of the protocol."""
        began = perf_counter()
        held = {} if self._patch is None else {self._patch: tuple(displacement)}
        weight: dict[str, Any] = {"gravity": gravity, "density": self._density} if gravity.any() else {}
        frame = self._frame = self._stepper.frame(held, **weight)
        force = np.zeros(3) if self._patch is None else frame.reaction(self._patch)
        mesh = self._organ.mesh
        gain = volume(mesh.points + frame.displacement, mesh.surface) / self._rest_volume - 1
        milliseconds = 1e3 * (perf_counter() - began)
        facts = [*force, frame.residual, frame.taken, float(frame.is_unstable), milliseconds, gain]
        return np.concatenate([facts, frame.displacement[mesh.surface_nodes].ravel()]).astype(np.float32)


class Live:
    """What one page sees: its specimens, its hand, its gravity."""

    def __init__(self, case: Case, name: str) -> None:
        self._case, self._name = case, name
        self._organ = case.organ()
        self.mesh: Mesh = self._organ.mesh
        self.radius = defaults.RADIUS_FRACTION * self.mesh.diagonal
        self.laws = matched(self._organ.law)
        self._density = case.loads.get("density", DENSITY)
        self._gravity = np.asarray(case.loads.get("gravity", (0, 0, 0)), float)
        self._displacement = np.zeros(3)
        self._specimens = [self._specimen(type(self._organ.law).__name__)]

    def describe(self) -> dict[str, Any]:
        """What the page has to know before the first frame."""
        rows = np.searchsorted(self.mesh.surface_nodes, self.mesh.surface)
        return {
            "name": self._name,
            "laws": sorted(self.laws),
            "law": type(self._organ.law).__name__,
            "diagonal": self.mesh.diagonal,
            "radius": self.radius,
            "gravity": self._gravity.tolist(),
            "rest": self.mesh.points[self.mesh.surface_nodes].ravel().tolist(),
            "triangles": rows.ravel().tolist(),
        }

    def answer(self, message: str) -> bytes:
        """The frame that a request asks for; raises `VisceraError` where it cannot be read."""
        for word, value in read(message).items():
            self._requests()[word](value)
        bodies = [specimen.step(self._displacement, self._gravity) for specimen in self._specimens]
        numbers = np.concatenate([[len(bodies)], *bodies]).astype("<f4")
        return numbers.tobytes() if np.isfinite(numbers).all() else self._again()

    def _requests(self) -> dict[str, Callable[[Any], None]]:
        return {
            "laws": self._choose,
            "grab": self._grab,
            "move": self._move,
            "release": lambda _: self._release(),
            "gravity": self._turn,
        }

    def _choose(self, names: Any) -> None:
        if not isinstance(names, list) or not 1 <= len(names) <= 2:
            raise VisceraError(f"laws are a list of one or two names, got {names!r}")
        unknown = next((name for name in names if not isinstance(name, str) or name not in self.laws), None)
        if unknown is not None:
            raise VisceraError(f"no law is called {unknown!r}; {did_you_mean(str(unknown), self.laws)}")
        self._specimens = [self._specimen(name) for name in names]
        self._displacement = np.zeros(3)

    def _grab(self, point: Any) -> None:
        at = triple("grab", point)
        for specimen in self._specimens:
            specimen.hold(at, self.radius)
        self._displacement = self._specimens[0].held_displacement()

    def _move(self, displacement: Any) -> None:
        d = triple("move", displacement)
        size, limit = float(np.linalg.norm(d)), 0.5 * self.mesh.diagonal
        self._displacement = d * min(1.0, limit / size) if size > 0 else d

    def _release(self) -> None:
        for specimen in self._specimens:
            specimen.hold(None, self.radius)
        self._displacement = np.zeros(3)

    def _turn(self, gravity: Any) -> None:
        self._gravity = np.clip(triple("gravity", gravity), -100.0, 100.0)

    def _specimen(self, name: str) -> Specimen:
        organ = self._organ
        return Specimen(Organ(organ.mesh, self.laws[name], fixed=organ.fixed), self._density)

    def _again(self) -> bytes:
        """A frame without numbers: the organ begins anew."""
        self._specimens = [Specimen(specimen._organ, self._density) for specimen in self._specimens]
        self._displacement, self._gravity = np.zeros(3), np.zeros(3)
        return self.answer("{}")


def matched(own: law.Law) -> dict[str, law.Law]:
    """The case's law, and the others with its shear and bulk modulus at rest."""
    shear, bulk = own.core().moduli().T
    lame = {"mu": shear, "lam": bulk - 2.0 / 3.0 * shear}
    laws = {
        kind.__name__: kind(**lame) for kind in (law.Linear, law.Corotated, law.SaintVenantKirchhoff, law.NeoHookean)
    }
    rubber = law.MooneyRivlin(c1=shear / 4.0, c2=shear / 4.0, kappa=bulk)
    return {**laws, "MooneyRivlin": rubber, type(own).__name__: own}


def read(message: str) -> dict[str, Any]:
    """A request, its words checked."""
    try:
        words = json.loads(message)
    except (ValueError, RecursionError) as error:
        raise VisceraError(f"a request is a JSON object: {error}") from None
    if not isinstance(words, dict):
        raise VisceraError(f"a request is a JSON object, got {type(words).__name__}")
    known = ("laws", "grab", "move", "release", "gravity")
    unknown = next((word for word in words if word not in known), None)
    if unknown is not None:
        raise VisceraError(f"unknown request {unknown!r}; {did_you_mean(unknown, known)}")
    return words


def triple(name: str, value: Any) -> Floats:
    """Three finite numbers."""
    is_numbers = isinstance(value, list) and len(value) == 3 and all(isinstance(x, int | float) for x in value)
    if not is_numbers or not all(abs(x) < 1e6 and math.isfinite(x) for x in value):
        raise VisceraError(f"{name} takes three finite numbers, got {str(value)[:80]}")
    return np.array(value, float)


def volume(points: Floats, triangles: NDArray[np.uint32]) -> float:
    """Volume [m^3] inside a closed surface: V = 1/6 sum x0 . (x1 x x2)."""
    a, b, c = (points[triangles[:, k]] - points[0] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def converse(case: Case, name: str) -> Callable[[ServerConnection], None]:
    """A handler of web sockets: each page gets its own organ; a case that cannot be stepped is refused at once."""
    Live(case, name)

    def handle(connection: ServerConnection) -> None:
        live = Live(case, name)
        connection.send(json.dumps(live.describe()))
        for message in connection:
            if not isinstance(message, str):
                connection.close(1003, "requests are text")
                return
            try:
                connection.send(live.answer(message))
            except ValueError as error:
                connection.send(json.dumps({"error": str(error)}))

    return handle
