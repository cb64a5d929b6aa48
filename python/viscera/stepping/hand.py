"""What holds a place of an organ while a stepper goes on: moved and turned, or pulled by a force and a torque."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.contact.posed import Posed
from viscera.errors import VisceraError
from viscera.mesh import Floats, Indices, Mesh
from viscera.quantity import numbers_of, refused, vector
from viscera.rotation import UNTURNED, angle_between, mean_rotation, spread
from viscera.sealed import read_only
from viscera.select import Lengths, offset

if TYPE_CHECKING:
    from viscera.stepping.stepper import Stepper

ON_A_LINE = 1e-6
"""Places whose second principal extent is a smaller part of the first lie on a line, about which nothing turns them."""
FURTHEST_TURN = 0.5 * np.pi
"""Largest angle [rad] of a turn in one frame."""


class Hand(Posed):
    """A hand, or a pair of forceps, that holds a place of the organ: made by `Stepper.grasp`, ended by `release`.

    It moves and turns what it holds, or pulls at it with a force and a torque. All about its centre, the weighted mean
    of the places `x_i` of its nodes, in axes of the world. `position` is that of the centre, and `rotation` is from the
    shape at the grasp:

    - Node by node, all nodes move as one rigid body: `x_i = position + R r_i`, with the arms `r_i` of the grasp.
    - Of a contact patch, `sum_i w_i x_i = position` is held. Once `turn` or `place(rotation=...)` is called, so is the
      mean rotation R: `sum_i w_i (R r_i) x x_i = 0`, by which R is the polar factor of `sum_i w_i x_i r_i^T`.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> stepper = beam.stepper()
    >>> forceps = stepper.grasp("tip")
    >>> for _ in range(3):
    ...     forceps.move((0, 0, 0.001))
    ...     frame = stepper.frame()
    >>> forceps.release()
    >>> f"{1e3 * frame.displacement[:, 2].max():.1f} mm"
    '3.0 mm'
    """

    _WHAT = "a hand"

    def __init__(self, stepper: Stepper, where: _core.Patch | tuple[int, ...], weights: Floats, name: str) -> None:
        self._stepper = stepper
        self._where = where
        self._name = name
        self._nodes: Indices = np.asarray(where.nodes if isinstance(where, _core.Patch) else where, dtype=np.uint32)
        self._weights = weights
        self._rest = stepper._organ.mesh.points[self._nodes]
        self._holds_turn = not isinstance(where, _core.Patch)
        self._pull: tuple[Floats, Floats] | None = None
        self._told: tuple[Floats, Floats] | None = None
        self._is_holding = True
        places = self._rest + stepper.displacement[self._nodes]
        self._position: Floats = weights @ places
        self._rotation: Floats = read_only(np.array(UNTURNED))
        self._reached = self._rotation
        self._arms = places - self._position

    @property
    def displacement(self) -> Floats:
        """Displacement from rest of what it holds [m]: (3,) of a patch, (k, 3) node by node; for the next frame."""
        if isinstance(self._where, _core.Patch):
            return self.position - self._weights @ self._rest
        return np.asarray(self.position + self._arms @ self.rotation.T - self._rest)

    @displacement.setter
    def displacement(self, value: ArrayLike) -> None:
        self._may("placed")
        if isinstance(self._where, _core.Patch):
            self._position = vector(value, "the displacement of a hand", "m") + self._weights @ self._rest
            return
        given = numbers_of(value)
        if given is None or given.shape not in {(3,), self._rest.shape} or not np.isfinite(given).all():
            raise refused("the displacement of a hand", f"(3,) or {self._rest.shape} finite lengths [m]", value)
        self._take(self._rest + given)

    @property
    def force(self) -> Floats:
        """Force (3,) on the organ [N] in the last frame: that of the support, reversed, if nothing else acts.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> hand = stepper.grasp("tip")
        >>> hand.move((0, 0, -0.01))
        >>> frame = stepper.frame()
        >>> hand.force[2].round(3).item()
        -1.839
        """
        return self._last()[0]

    @property
    def torque(self) -> Floats:
        """Torque (3,) on the organ [N m] in the last frame, about the place its centre had reached.

        Zero while a patch is held without its rotation.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> hand = stepper.grasp("tip")
        >>> hand.turn((0.2, 0, 0))
        >>> frame = stepper.frame()
        >>> hand.torque[0].round(2).item()
        2.38
        """
        return self._last()[1]

    def move(self, by: Lengths) -> None:
        """Move by (x, y, z) [m], or in words such as "2 mm", in the next frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> hand = stepper.grasp("tip")
        >>> hand.move("(0, 0, -1) mm")
        >>> stepper.frame().displacement[beam.mesh.sets["tip"], 2].round(6).min().item()
        -0.001
        """
        self._may("moved")
        self._position = self.position + offset(by, self._stepper._organ.mesh, "motion of a hand")

    def turn(self, by: ArrayLike) -> None:
        """Turn on about its centre by a rotation vector (3,) [rad], in axes of the world, with the next frame.

        A frame turns it by at most a quarter of a full turn, all calls together; more is refused.
        A hand on a patch holds the mean rotation from then on.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> hand = stepper.grasp(beam.patch((1, 0.1, 0.1), radius=0.09))
        >>> for _ in range(5):
        ...     hand.turn((0.1, 0, 0))
        ...     frame = stepper.frame()
        >>> frame.is_settled, frame.torque(hand)[0].round(2).item()
        (True, 5.48)
        """
        turn = vector(by, "the turn of a hand", "rad")
        self._may("turned")
        # By the vector's own length: where they end, turns beyond half a turn look like shorter ones the other way.
        _require_near(float(np.linalg.norm(turn)))
        self._hold_turn()
        turned = self._turned_by(turn)
        _require_near(angle_between(self._rotation_now(), turned))
        self._rotation = read_only(turned)

    def place(self, position: ArrayLike | None = None, rotation: ArrayLike | None = None) -> None:
        """Set the place of its centre (3,) [m] for the next frame, and its rotation from the shape at the grasp: a
        matrix (3, 3) or a rotation vector (3,) [rad].

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> hand = stepper.grasp("tip")
        >>> hand.place((1.0, 0.1, 0.09), rotation=(0, 0.05, 0))
        >>> stepper.frame().is_settled
        True
        """
        self._may("placed")
        placed = self._placed(position)
        if rotation is not None:
            turned = self._turned(rotation)
            self._hold_turn()
            self._rotation = read_only(turned)
        self._position = placed

    def pull(self, force: ArrayLike, torque: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Let a force (3,) [N] and a torque (3,) [N m] move it from the next frame on, until `hold`.

        Both keep their size and direction in axes of the world, the torque about the present centre. The nodes move
        freely: node i carries `w_i force + w_i a x r_i`, with its weight, its present arm `r_i`, and the `a` that makes
        the torque. These forces follow the arms in every iteration. `position` and `rotation` then tell where the hand
        is: its centre, and the mean rotation since the grasp.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10)
        >>> hand = stepper.grasp("tip")
        >>> hand.pull((0, 0, -1.0))
        >>> frame = stepper.frame()
        >>> frame.is_settled, f"{1e3 * frame.displacement[:, 2].min():.1f} mm", hand.force.tolist()
        (True, '-20.2 mm', [0.0, 0.0, -1.0])
        """
        load = vector(force, "the force of a hand", "N"), vector(torque, "the torque of a hand", "N m")
        if not self._is_holding:
            raise VisceraError("a hand that has let go cannot pull; take hold again with Stepper.grasp")
        if load[1].any():
            self._hold_turn()
        self._pull = load

    def hold(self) -> None:
        """Hold what a force has moved where it is now, in the next frame: the organ does not jump.

        The force with which it is held is then that of the pull, if the last frame has settled. A hand on a patch that
        has been turned, by `turn` or by a torque, holds the rotation, too.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper(iterations=10, settled=1e-6)
        >>> hand = stepper.grasp("tip")
        >>> hand.pull((0, 0, -1.0))
        >>> pulled = stepper.frame()
        >>> hand.hold()
        >>> held = stepper.frame()
        >>> hand.force[2].round(4).item(), bool(abs(held.displacement - pulled.displacement).max() < 1e-6)
        (-1.0, True)
        """
        if self._pull is None:
            return
        self._pull = None
        self._follow(self._stepper.displacement)
        # The arms of now: by them the forces that hold are those that have pulled.
        self._take(self._rest + self._stepper.displacement[self._nodes])

    def release(self) -> None:
        """Let go in the next frame.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> stepper = beam.stepper()
        >>> hand = stepper.grasp("tip")
        >>> hand.move((0, 0, -0.001))
        >>> _ = stepper.frame()
        >>> hand.release()
        >>> frame = stepper.frame()
        >>> bool(abs(frame.displacement).max() < 1e-4)  # back at rest, except for the error of one iteration
        True
        """
        self._is_holding = False
        self._stepper._hands = [hand for hand in self._stepper._hands if hand is not self]

    def _is_at(self, where: Any) -> bool:
        """Whether it holds this place: a patch made anew of the same nodes and weights is the same."""
        if not isinstance(self._where, _core.Patch) or not isinstance(where, _core.Patch):
            return bool(self._where == where)
        return np.array_equal(self._nodes, where.nodes) and np.array_equal(self._weights, where.weights)

    def _may(self, verb: str) -> None:
        """Refuses to be moved after it let go, or while a force moves it."""
        if not self._is_holding:
            raise VisceraError(f"a hand that has let go cannot be {verb}; take hold again with Stepper.grasp")
        if self._pull is not None:
            raise VisceraError(f"a hand that a force pulls cannot be {verb}; call its hold() first")

    def _last(self) -> tuple[Floats, Floats]:
        if self._told is None:
            raise VisceraError("the force of a hand is that of the last frame; there is none since it took hold")
        force, torque = self._told
        return read_only(force), read_only(torque)

    def _hold_turn(self) -> None:
        """Refuses what nothing turns; from now on a patch holds its rotation, too, from where it is."""
        if spread(self._weights, self._arms) < ON_A_LINE:
            raise VisceraError(
                f"a hand cannot turn what it holds: of its {len(self._nodes)} nodes, those that count lie on a line; "
                "it takes three nodes that do not: take a larger place or patch"
            )
        if not self._holds_turn:
            self._rotation = self._reached = read_only(self._rotation_now())
            self._holds_turn = True

    def _rotation_now(self) -> Floats:
        places = self._rest + self._stepper.displacement[self._nodes]
        return mean_rotation(self._weights, self._arms, places - self._weights @ places)

    def _follow(self, displacement: Floats) -> None:
        """Takes on the place and the rotation of what it holds."""
        places = self._rest + displacement[self._nodes]
        self._position = self._weights @ places
        if spread(self._weights, self._arms) >= ON_A_LINE:
            self._rotation = self._reached = read_only(mean_rotation(self._weights, self._arms, places - self.position))

    def _take(self, places: Floats) -> None:
        """Takes on these places (k, 3) of its nodes as its shape, in the orientation that it has."""
        self._position = self._weights @ places
        self._arms = (places - self.position) @ self.rotation

    def _arms_turned(self) -> Floats:
        """Where the arms (k, 3) are to point in the next frame."""
        if self.rotation is not self._reached:
            _require_near(angle_between(self._rotation_now(), self.rotation))
        return np.ascontiguousarray(self._arms @ self.rotation.T)

    def _feel(self, displacement: Floats, supports: Floats, carried: dict[Any, tuple[Floats, Floats]]) -> None:
        """Notes its force and its torque in a frame, and where they have moved it."""
        if self._pull is not None:
            self._told = self._pull
            self._follow(displacement)
            return
        self._reached = self.rotation
        if self._where in carried:
            self._told = carried[self._where]
            return
        forces = supports[self._nodes]
        places = self._rest + displacement[self._nodes]
        arms = places - self._weights @ places
        self._told = forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)


def name_of_patch(patch: _core.Patch, mesh: Mesh) -> str:
    """The name of a patch in errors, by its centre at rest."""
    x, y, z = patch.weights @ mesh.points[patch.nodes]
    return f"a contact patch of {len(patch.nodes)} nodes around ({x:.4g}, {y:.4g}, {z:.4g}) m"


def _require_near(angle: float) -> None:
    """Refuses an angle [rad] by which no frame turns a hand."""
    if angle > FURTHEST_TURN:
        raise VisceraError(
            f"a hand is to turn by {np.degrees(angle):.0f} degrees in one frame; "
            f"it can turn by {np.degrees(FURTHEST_TURN):.0f} at most: turn it over several frames"
        )
