"""A stepper or a solved state that a page shows and Python holds, which answers the requests of `live/src/lib.rs`.

So are they shown below a notebook's cell, and a scene by `viscera view`.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera import _core, defaults
from viscera.errors import VisceraError
from viscera.mesh import Floats, Mesh
from viscera.scene import Scene
from viscera.select import Lengths, offset
from viscera.select import point as point_of
from viscera.viewer.holder import Holder, takes
from viscera.viewer.memory import Memory
from viscera.viewer.notebook import Told, told
from viscera.viewer.request import read
from viscera.viewer.rest import Rest
from viscera.viewer.surroundings import Surroundings

if TYPE_CHECKING:
    from viscera.organ import Organ
    from viscera.state import State
    from viscera.stepping.frame import Frame
    from viscera.stepping.hand import Hand
    from viscera.stepping.stepper import Stepper

NOBODY = (0.0, 0.0, 0.0)
FIXED = "the surface is fixed"
"""How the core's sentence begins where there is nothing free to hold."""
ONE_PLACE = float(np.sqrt(1.0 - 0.2**2))
"""Cosine between the weights of two patches above which the core takes them for one (`OVERLAPPING` in `problem.rs`)."""
FRAMES = 20
"""Frames that a touch from Python takes at most to settle."""
MOVING_FRAMES = 500
"""The same with inertia or relaxation, until the organ has come to rest."""
REACH = 0.5
"""A hand of the page stays within this part of the diagonal (`viewer/src/live/live.ts`, `live/src/stage.rs`)."""


class PlayedStepper:
    """A stepper in the hands of the page: at most two, beside those that the notebook has."""

    def __init__(
        self,
        make: Callable[[], Stepper],
        name: str,
        gravity: Sequence[float] | None = None,
        left_out: Sequence[str] = (),
        again: Callable[[], Stepper] | None = None,
        notes: Mapping[str, Any] | None = None,
    ) -> None:
        """Of a stepper, which `make` gives at first, and `again` whenever the page begins anew; by default `make`, too.

        gravity: acceleration (3,) [m/s^2] of the first frame, which the page may turn; without it the page has none to
            choose, and frames have none.
        left_out: kinds of loads that the page says are not applied; notes: what else it says (`viewer/live.py`).
        """
        self._again = again or make
        self.name = name
        self._gravity = gravity
        self._left_out = left_out
        self._notes = notes or {}
        self._hands: list[_Held | None] = [None, None]
        self._holder = Holder()
        self._stressed: set[str] = set()
        self._start(make())

    @property
    def has_all_tools(self) -> bool:
        """Whether it shows the tools that the stepper has now."""
        return self._surroundings.bodies == tuple(self._stepper._tools)

    def model(self) -> bytes:
        """None: the kernel steps."""
        return b""

    def picture(self) -> bytes:
        """The organ as it is, a PNG."""
        from viscera.display import png
        from viscera.output.picture import draw

        mesh = self._organ.mesh
        return png(draw(mesh.points, mesh.surface, self._stepper.displacement))

    def answer(self, point: Lengths, displacement: Lengths) -> Told:
        """Frames with the first hand at a point, displaced from rest, until they have settled and the organ is at rest.

        Raises `VisceraError` for a displacement longer than a hand reaches. It warns where an organ with inertia still
        moves after the last frame, or tissue still relaxes; its force is not trusted. Where it fails or is interrupted,
        the hand holds what it held before.
        """
        place = point_of(point, self._organ.mesh, "contact point")
        push = offset(displacement, self._organ.mesh, "contact displacement")
        self._require_in_reach(push)
        with self._as_before():
            self._act(0, {"grab": place, "move": push})
            frame = self._settled()
            if not self._rest.is_reached:
                still, remedy = ("moves", "damping or a longer") if self._rest.moves else ("relaxes", "a longer")
                warnings.warn(
                    f"the organ still {still} after {MOVING_FRAMES} frames, so the force is not trusted; "
                    f"give the stepper {remedy} time_step, or touch again to go on",
                    stacklevel=3,
                )
        self._holder.view = None
        return told(place, push, self._force(frame, 0), is_sound(frame) and self._rest.is_reached)

    def release(self) -> None:
        """The first hand lets go, and the organ comes to where that leaves it."""
        self._act(0, {"release": True})
        self._settled()

    def let_go(self) -> None:
        """Both hands let go; the organ stays where it is until the next frame."""
        for held in filter(None, self._hands):
            held.hand.release()
        self._hands = [None, None]

    def held(self) -> dict[str, Any]:
        """Who holds the organ, and what each hand holds: for views that show what others do."""
        holder = self._holder.view if any(self._hands) else None
        return {"holder": holder, "hands": [held and held.told() for held in self._hands]}

    def reply(self, request: str, view: str = "") -> str | bytes:
        """The introduction, where nothing is asked for; else a frame, or a sentence that says why there is none.

        view: the name of the view that asks; who takes hold takes the organ from the view that holds it.
        """
        if not request:
            return introduction(
                self._surroundings,
                self.name,
                gravity=self._gravity,
                left_out=self._left_out,
                has_stress=self._stepper._relaxation is None,
                **self._notes,
            )
        try:
            self._follow(read(request), view)
            frame = self._frame()
            if not np.isfinite(frame.displacement).all():
                self._begin()
                frame = self._frame()
            stress = frame.von_mises("nodes") if self._stressed else None
        except (VisceraError, ValueError) as error:
            return json.dumps({"error": str(error)})
        forces = [self._force(frame, k) for k in (0, 1)]
        return packed(self._surroundings, frame, forces, stress, is_at_rest=self._rest.is_reached)

    def _start(self, stepper: Stepper) -> None:
        """A stepper that no hand of the page holds; tools that it gets later are not shown."""
        self._stepper = stepper
        self._organ: Organ = self._stepper._organ
        self._surroundings = Surroundings(self._organ, tuple(self._stepper._tools))
        self._rest = Rest(self._stepper.velocity is not None, _memory(self._stepper))

    def _begin(self) -> None:
        """From rest, with nobody holding the organ."""
        self.let_go()
        before, around = self._stepper, self._surroundings
        self._start(self._again())
        if self._stepper is before:  # pages that are open know nothing of tools that it has got since
            self._surroundings = around

    def _follow(self, request: Mapping[str, Any], view: str) -> None:
        asked = self._holder.may_do(view, request)
        if asked.get("stress") and self._stepper._relaxation is not None:
            raise VisceraError(
                "the stress of tissue that relaxes is not shown: it depends on a past that frames do not hold"
            )
        if takes(asked):
            self._take_over(asked, view)
        if "laws" in asked:
            self._begin()
        self._act(0, asked)
        self._act(1, asked.get("second", {}))
        if self._gravity is not None:
            self._gravity = asked.get("gravity", self._gravity)
        if "stress" in asked:
            (self._stressed.add if asked["stress"] else self._stressed.discard)(view)

    def _take_over(self, asked: Mapping[str, Any], view: str) -> None:
        """The organ is this view's from now on; where it cannot take hold, another one has not let go either."""
        if self._holder.is_another(view):
            for gesture in (asked, asked.get("second", {})):
                if "grab" in gesture:
                    self._patch(gesture["grab"], gesture.get("organ"))
            self.let_go()
        self._holder.view = view

    def _frame(self) -> Frame:
        frame = self._stepper.frame(gravity=self._gravity)
        self._rest.note(frame, bool(self._stepper._hands))
        return frame

    def _settled(self) -> Frame:
        """The frame that has settled and in which the organ is at rest, or the last that it may take."""
        for _ in range(MOVING_FRAMES if self._rest.takes_time else FRAMES):
            frame = self._frame()
            if frame.is_settled and self._rest.is_reached:
                break
        return frame

    @contextmanager
    def _as_before(self) -> Iterator[None]:
        """Where the block fails or is interrupted, the first hand holds what it held, as far displaced."""
        before = self._hands[0]
        move = before and before.hand.displacement
        try:
            yield
        except BaseException:
            if self._hands[0] is not before:
                self._act(0, {"release": True})
                if before:
                    self._act(0, {"grab": before.point, "move": move, "organ": before.organ})
            raise

    def _act(self, index: int, gesture: Mapping[str, Any]) -> None:
        """A hand lets go, takes hold, moves, in this order; where it cannot take hold, it has not let go either."""
        held = self._hands[index]
        patch = self._graspable(index, gesture) if "grab" in gesture else None
        if held and (gesture.get("release") or patch):
            held.hand.release()
            held = self._hands[index] = None
        if patch:
            point = np.asarray(gesture["grab"], float)
            held = self._hands[index] = _Held(self._stepper.grasp(patch), point, gesture.get("organ"))
        if held and "move" in gesture:
            held.hand.displacement = np.asarray(gesture["move"], float)

    def _require_in_reach(self, push: Floats) -> None:
        """Raise `VisceraError` for a displacement (3,) [m] that the page would cut short."""
        length, reach = float(np.linalg.norm(push)), REACH * self._organ.mesh.diagonal
        if length > reach:
            raise VisceraError(
                f"the contact displacement is {_millimetres(length)} mm long, and a hand of the page reaches "
                f"{_millimetres(reach)} mm, {REACH:.0%} of the organ's diagonal; touch less far, "
                "or step without a view: stepper.grasp(...)"
            )

    def _graspable(self, index: int, gesture: Mapping[str, Any]) -> _core.Patch:
        """What a hand takes hold of; raises `VisceraError` if it cannot."""
        patch = self._patch(gesture["grab"], gesture.get("organ"))
        self._require_apart(patch, self._hands[1 - index])
        return patch

    def _patch(self, point: Lengths, name: str | None) -> _core.Patch:
        """What a hand holds: of the organ of a scene that the page names, where several lie on each other."""
        organ, within = self._organ, radius(self._organ)
        if isinstance(organ, Scene) and name is not None:
            organ.organ(name)  # an unknown name is refused as such
        try:
            return organ.patch(point, within, name) if isinstance(organ, Scene) else organ.patch(point, within)
        except VisceraError as error:
            at = ", ".join(map(_millimetres, np.asarray(point)))
            if FIXED in str(error):
                raise VisceraError(f"{FIXED} at the point ({at}) mm; take hold beside it") from error
            raise VisceraError(
                f"there is no free surface within {_millimetres(within)} mm of the point ({at}) mm; take hold elsewhere"
            ) from error

    def _require_apart(self, patch: _core.Patch, other: _Held | None) -> None:
        """Raise `VisceraError` if the other hand holds all but the same, which no frame could move apart."""
        if other is None:
            return
        rows = np.zeros((2, len(self._organ.mesh.points)))
        rows[0, patch.nodes], rows[1, other.hand._nodes] = patch.weights, other.hand._weights
        if rows[0] @ rows[1] > ONE_PLACE * np.prod(np.linalg.norm(rows, axis=1)):
            raise VisceraError("both hands hold the same place; take hold elsewhere")

    def _force(self, frame: Frame, index: int) -> Any:
        held = self._hands[index]
        return frame.reaction(held.hand) if held else NOBODY


@dataclass(frozen=True, eq=False)
class _Held:
    """What a hand of the page holds."""

    hand: Hand
    point: Floats
    """Where it took hold, at rest (3,) [m]."""
    organ: str | None
    """Of a scene, as the page names it."""

    def told(self) -> dict[str, Any]:
        """As a view shows it."""
        named = {} if self.organ is None else {"organ": self.organ}
        return {"point": self.point.tolist(), "displacement": np.asarray(self.hand.displacement).tolist(), **named}


class PlayedState:
    """A solved state, to look at: no hand can move it."""

    def __init__(self, state: State, name: str) -> None:
        self._state = state
        self._name = name
        self._surroundings = Surroundings(state._organ, [tool._at(state.load) for tool, _ in state._tools])

    def model(self) -> bytes:
        """None: there is nothing to evaluate."""
        return b""

    def picture(self) -> bytes:
        """The state as it appears by itself, a PNG."""
        return self._state._repr_png_()[0]

    def answer(self, point: Lengths, displacement: Lengths) -> Told:
        """Refused: to touch the organ, step it."""
        raise VisceraError(
            "a solved state cannot be touched; view a stepper, organ.stepper().view(), or a reduced model"
        )

    def release(self) -> None:
        """Does nothing: there is no touch."""

    def let_go(self) -> None:
        """Does nothing, likewise."""

    def held(self) -> dict[str, Any]:
        """Nothing: nobody holds it."""
        return {}

    def reply(self, request: str, view: str = "") -> str | bytes:
        """The introduction, or the same frame again, with the stress if it is asked for."""
        state = self._state
        if not request:
            return introduction(self._surroundings, self._name, is_still=True)
        try:
            stress = state.von_mises("nodes") if read(request).get("stress", True) else None
        except (VisceraError, ValueError) as error:
            return json.dumps({"error": str(error)})
        return packed(self._surroundings, state, [NOBODY, NOBODY], stress)


def is_sound(frame: Frame) -> bool:
    """Whether the force of a frame may be relied on, as the page marks it (`standing` in `live/specimen.ts`).

    It has settled, the organ is not about to buckle, and no cell has reached the limit of its deformation.
    """
    return frame.is_settled and not frame.is_unstable and frame.cells_at_bound == 0


def _memory(stepper: Stepper) -> Memory | None:
    """What the tissue of a stepper remembers, as if it had just come to where it is; None if it does not relax."""
    if stepper._relaxation is None or stepper._time_step is None:
        return None
    return Memory(*stepper._relaxation, stepper._time_step, stepper.displacement)


def radius(organ: Organ) -> float:
    """Of the contact patch of a hand [m]; in a scene, of that which suits its smallest organ."""
    organs = organ.organs.values() if isinstance(organ, Scene) else [organ]
    return defaults.RADIUS_FRACTION * min(each.mesh.diagonal for each in organs)


def introduction(
    around: Surroundings,
    name: str,
    *,
    gravity: Sequence[float] | None = None,
    left_out: Sequence[str] = (),
    is_still: bool = False,
    has_stress: bool = True,
    **notes: Any,
) -> str:
    """What the page needs before the first frame, as JSON: the organ at rest, and what stands around it."""
    organ = around.organ
    mesh, law = organ.mesh, type(organ.law).__name__
    rows = np.searchsorted(mesh.surface_nodes, mesh.surface)
    parts = {}
    if isinstance(organ, Scene):
        parts = {"organs": list(organ.organs), "organ_of": organ.of_node[mesh.surface_nodes].tolist()}
    return json.dumps(
        {
            "name": name,
            "laws": [law],
            "law": law,
            "diagonal": mesh.diagonal,
            "radius": radius(organ),
            "gravity": gravity,
            "left_out": list(left_out),
            "is_still": is_still,
            "has_stress": has_stress,
            "axes": mesh.axes,
            **notes,
            "rest": mesh.points[mesh.surface_nodes].ravel().tolist(),
            "triangles": rows.ravel().tolist(),
            **parts,
            **around.described(),
        }
    )


def packed(
    around: Surroundings, shown: Frame | State, forces: list[Any], stress: Floats | None, *, is_at_rest: bool = True
) -> bytes:
    """A frame as `live/src/lib.rs` writes it, and before the stress the numbers of what stands around the organ.

    A solved state is a frame that has settled; one of an organ that still moves has not.
    """
    mesh = around.organ.mesh
    _, displacement = shown._from_rest()  # also where a state counts from a scan
    gain = _volume(mesh, displacement) / _volume(mesh, np.zeros_like(displacement)) - 1.0
    facts = [
        *forces[0],
        getattr(shown, "residual", 0.0),
        getattr(shown, "taken", 1.0),
        float(getattr(shown, "is_unstable", False)),
        1e3 * getattr(shown, "seconds", 0.0),
        gain,
        float(getattr(shown, "is_settled", True) and is_at_rest),
        float(getattr(shown, "cells_at_bound", 0)),
        float(getattr(shown, "steps", 0)),
        *forces[1],
    ]
    field = displacement[mesh.surface_nodes].ravel()
    parts = [np.array([1.0]), np.array(facts), field, around.numbers(displacement)]
    if stress is not None:
        parts.append(stress[mesh.surface_nodes])
    return np.concatenate(parts).astype("<f4").tobytes()


def _millimetres(length: float) -> str:
    """A length [m] in millimetres, to a tenth; never -0."""
    return f"{round(1e3 * length, 1) + 0.0:g}"


def _volume(mesh: Mesh, displacement: Floats) -> float:
    """Inside the closed surface: `1/6 sum x0 . (x1 x x2)` [m^3]."""
    a, b, c = ((mesh.points + displacement)[mesh.surface[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
