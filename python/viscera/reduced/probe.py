"""A rigid probe on a reduced model: a sphere that presses, sticks, slides and lets go, at haptic rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.immutable import Immutable
from viscera.mesh import Floats, Indices
from viscera.quantity import Number, brief, numbers_of, refuse_masked, refused, vector
from viscera.reduced.shape import ReducedShape
from viscera.sealed import read_only
from viscera.select import length

if TYPE_CHECKING:
    from viscera.reduced.touch import Touch

CONTACT_ERROR = _core.CONTACT_ERROR
"""Error of a probe's force, relative to its norm, that comes from the patch in place of the contact (docs/probe.md)."""


class Felt(ReducedShape):
    """What a probe feels at a place: force, torque and the deformed organ.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> touch = beam.reduce("x > 70% and z > 99%", depth="5%", order=3)
    >>> felt = touch.probe(touch.radius).place((0.9, 0.1, 0.2 + touch.radius - 0.01))
    >>> felt.grip, felt.is_trusted, f"{1e3 * felt.gap:.1f} mm"
    ('slides', True, '-10.0 mm')
    """

    def __init__(self, model: Touch, told: dict[str, Any]) -> None:
        self._model, self._push = model, told["push"]
        self.center: Floats = told["center"]
        """Centre (3,) of the sphere [m]."""
        self.force: Floats = told["force"]
        """Force (3,) of the probe on the organ [N]."""
        self.torque: Floats = told["torque"]
        """Torque (3,) on the organ about the centre of the sphere [N m]."""
        self.gap: float = told["gap"]
        """Distance [m] of the sphere from the untouched surface; negative if the sphere has entered it."""
        self.grip: str = told["grip"]
        """What the probe does: "free", "sticks" or "slides"; "inside" if it came into the organ in one step."""
        self.contact_point: Floats = told["contact_point"]
        """The point (3,) [m] of the untouched surface that the probe holds; the nearest if it is free."""
        self.error_estimate: float = told["error_estimate"]
        """Estimated error of the force, relative to its norm; at most 1.

        It is the sum of the estimate of the model and of an error of the contact: `CONTACT_ERROR` of this module, and
        more where the contact, of radius `sqrt(radius * entered)`, is narrower than about two edges of the mesh. It is
        1 where the sphere touches what is fixed.
        """
        self.is_trusted: bool = told["is_trusted"]
        """Whether the force may be relied on."""
        self.reason: str = told["reason"]
        """Why the force is not trusted; empty if it is."""
        self.shape_error_estimate: float = told["shape_error_estimate"]
        """The same estimate for the displacement field."""
        self.is_shape_trusted: bool = told["is_shape_trusted"]
        """Whether the displacement may be relied on."""
        self.shape_reason: str = told["shape_reason"]
        """Why the displacement is not trusted; empty if it is."""
        self._seal()

    @property
    def is_touching(self) -> bool:
        """Whether there is a force."""
        return self.grip in {"sticks", "slides"}

    @cached_property
    def displacement(self) -> Floats:
        """Displacement of all nodes (n, 3) [m], evaluated on first access."""
        if not self.is_touching:
            return read_only(np.zeros((len(self._model.mesh.points), 3)))
        return read_only(self._model._model.evaluate(self.contact_point, self._push, True)["displacement"])

    def _touched(self) -> Indices:
        return self._model.patch(self.contact_point).nodes

    def _solved(self) -> str:
        return "touch.organ().solve(force={touch.patch(felt.contact_point): felt.force})"

    def __repr__(self) -> str:
        trust = "trusted" if self.is_trusted else f"not trusted: {self.reason}"
        return f"Felt({self.grip}, force={np.round(self.force, 4).tolist()} N, {trust})"


class RigidProbe(Immutable):
    """A rigid sphere on a reduced model, with Coulomb friction: made by `Touch.probe`, moved from tick to tick.

    The rotation of the sphere does not matter: it neither rolls nor spins.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> touch = beam.reduce("x > 70% and z > 99%", depth="5%", order=3)
    >>> probe = touch.probe(touch.radius, friction=0.3)
    >>> felt = probe.place((0.9, 0.1, 0.2 + touch.radius - 0.01))  # its centre
    >>> felt = [probe.move((0, 0.0005, 0)) for _ in range(10)][-1]
    >>> along, onto = (felt.force[0] ** 2 + felt.force[1] ** 2) ** 0.5, -felt.force[2]
    >>> felt.grip, f"{along / onto:.2f}"
    ('slides', '0.30')
    >>> probe.move((0, 0, 0.02)).force.tolist()
    [0.0, 0.0, 0.0]
    """

    _others: ClassVar[Mapping[str, str]] = {"position": "`place` and `move` move it"}

    def __init__(
        self,
        touch: Touch,
        radius: float | str | None,
        friction: float,
        tolerance: float,
        stiffness: float | None,
        damping: float,
    ) -> None:
        self._touch = touch
        given = touch.radius if radius is None else length(radius, touch.mesh.diagonal, "the radius of a probe")
        self.radius: Final[float] = given
        self.friction: Final = Number(low=0.0, high=1e3)(friction, "the friction of a probe")
        self._position: Floats | None = None
        self._last: Felt | None = None
        if stiffness is None and damping != 0.0:
            raise VisceraError("a probe without stiffness= has no coupling that damping= could damp")
        coupling = None
        if stiffness is not None:
            above = Number(above=0)(stiffness, "the stiffness of the coupling")
            coupling = above, Number(low=0.0)(damping, "the damping of the coupling")
        share = Number(above=0, high=1)(tolerance, "the tolerance of a probe")
        self._core = _core.Probe(touch._model, self.radius, self.friction, share, coupling)

    @property
    def position(self) -> Floats | None:
        """Centre (3,) of the sphere [m]; None before it is placed."""
        return self._position

    def place(self, position: ArrayLike) -> Felt:
        """Put the centre of the sphere at (3,) [m], and tell what it feels there.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("x > 70% and z > 99%", depth="5%", order=3)
        >>> probe = touch.probe(touch.radius)
        >>> probe.place((0.9, 0.1, 0.5)).grip
        'free'
        """
        return self._felt(self._core.place(vector(position, "the position of a probe", "m").tolist()))

    def move(self, by: ArrayLike) -> Felt:
        """Move the sphere on by (x, y, z) [m], and tell what it feels there.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("x > 70% and z > 99%", depth="5%", order=3)
        >>> probe = touch.probe(touch.radius)
        >>> felt = probe.place((0.9, 0.1, 0.2 + touch.radius))
        >>> bool(probe.move((0, 0, -0.01)).force[2] < -0.5)
        True
        """
        if self.position is None:
            raise VisceraError("a probe must be placed before it is moved: probe.place((x, y, z))")
        return self.place(self.position + vector(by, "the motion of a probe", "m"))

    def follow(self, device: ArrayLike, dt: float) -> Felt:
        """Draw the sphere by its coupling towards a device at (3,) [m], `dt` seconds after the last step.

        The sphere goes where spring, damper and tissue are in balance, by at most a quarter of its radius. The force is
        that of the tissue. Without a coupling the sphere is where the device is. The first step of a new or lifted
        sphere begins outside, and goes at once to the balance of spring and tissue; friction begins after it. In a step
        of no duration, `dt = 0`, the damper takes the sphere along with the device.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("x > 70% and z > 99%", depth="5%", order=3)
        >>> probe = touch.probe(touch.radius, stiffness=500, damping=5)
        >>> above = (0.9, 0.1, 0.2 + touch.radius)
        >>> felt = [probe.follow((above[0], above[1], above[2] - 1e-5 * n), 0.001) for n in range(2000)][-1]
        >>> spring = 500 * (above[2] - 1e-5 * 1999 - felt.center[2])
        >>> bool(abs(felt.force[2] - spring) < 0.01 * abs(spring))
        True
        """
        pose = vector(device, "the position of a device", "m").tolist()
        return self._felt(self._core.follow(pose, Number(low=0.0)(dt, "the time step")))

    def lift(self) -> None:
        """Take the sphere from the organ. The next place is a first one, so it must be outside.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("x > 70% and z > 99%", depth="5%", order=3)
        >>> probe = touch.probe(touch.radius)
        >>> felt = probe.place((0.9, 0.1, 0.2 + touch.radius - 0.01))
        >>> probe.lift()
        >>> probe.place((0.9, 0.1, 0.2)).grip
        'inside'
        """
        self._core.lift()
        self._position = self._last = None

    def _felt(self, told: dict[str, Any]) -> Felt:
        self._last = felt = Felt(self._touch, told)
        self._position = felt.center
        return felt

    def __reduce__(self) -> str:
        """A copy would share what the probe remembers of its touch."""
        raise VisceraError("a probe cannot be copied or pickled; make another one by touch.probe()")

    def __repr__(self) -> str:
        return f"RigidProbe(radius={self.radius:g}, friction={self.friction:g})"


class Probes(Immutable):
    """Several rigid probes on one reduced model that feel each other through the organ (docs/probe.md).

    Each meets the surface as the others leave it. To first order of the displacements this is exact; what large strains
    add is part of the estimate. The probes are made by `Touch.probe`, each with its own radius, friction and coupling.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> touch = beam.reduce("x > 60% and z > 99%", depth="5%", order=3)
    >>> hands = vs.Probes([touch.probe(friction=0.3), touch.probe(friction=0.3)])
    >>> above = 0.2 + touch.radius
    >>> left, right = hands.place([(0.65, 0.1, above - 0.01), (0.9, 0.1, above)])
    >>> left.is_touching, right.is_touching
    (True, False)
    >>> left, right = hands.move([(0, 0, 0), (0, 0, -0.03)])  # reaches the tip, which the other has pressed down
    >>> bool(left.force[2] < 0 and right.force[2] < 0)
    True
    """

    def __init__(self, probes: Sequence[RigidProbe]) -> None:
        if isinstance(probes, RigidProbe) or not isinstance(probes, Sequence):
            raise refused("probes", "a list of probes made by touch.probe()", probes)
        self.probes: Final = tuple(probes)
        if not self.probes:
            raise VisceraError("there are no probes; give at least one, made by touch.probe()")
        for number, probe in enumerate(self.probes):
            if not isinstance(probe, RigidProbe):
                raise VisceraError(f"probe {number} is {probe!r}; make it by touch.probe()")
            if probe in self.probes[:number]:
                raise VisceraError(f"probe {number} is the same as one before it; make one for each hand")
            if probe._touch is not self.probes[0]._touch:
                raise VisceraError(
                    f"probe {number} is on another model than the first; probes of one organ feel each other"
                )
        self._touch = self.probes[0]._touch
        self._core = _core.Probes([probe._core for probe in self.probes])

    def place(self, positions: ArrayLike) -> tuple[Felt, ...]:
        """Put the centres of the spheres at (k, 3) [m], and tell what each feels there.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("x > 60% and z > 99%", depth="5%", order=3)
        >>> hands = vs.Probes([touch.probe(), touch.probe()])
        >>> [felt.grip for felt in hands.place([(0.65, 0.1, 0.5), (0.9, 0.1, 0.5)])]
        ['free', 'free']
        """
        return self._told(self._core.place(self._vectors(positions, "the positions of the probes").tolist()))

    def move(self, by: ArrayLike) -> tuple[Felt, ...]:
        """Move the spheres on by (k, 3) [m], and tell what each feels there.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("x > 60% and z > 99%", depth="5%", order=3)
        >>> hands = vs.Probes([touch.probe(), touch.probe()])
        >>> felt = hands.place([(0.65, 0.1, 0.2 + touch.radius), (0.9, 0.1, 0.2 + touch.radius)])
        >>> [felt.is_touching for felt in hands.move([(0, 0, 0.01), (0, 0, -0.01)])]
        [False, True]
        """
        moved = self._vectors(by, "the motions of the probes")
        for number, probe in enumerate(self.probes):
            if probe.position is None:
                raise VisceraError(f"probe {number} must be placed before it is moved: probes.place([(x, y, z), ...])")
        return self.place(np.array([probe.position for probe in self.probes]) + moved)

    def follow(self, devices: ArrayLike, dt: float) -> tuple[Felt, ...]:
        """Draw the spheres by their couplings towards devices at (k, 3) [m], as `RigidProbe.follow`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="z < 1%")
        >>> touch = beam.reduce("x > 60% and z > 99%", depth="5%", order=3)
        >>> hands = vs.Probes([touch.probe(stiffness=500, damping=5) for _ in range(2)])
        >>> down = [((x, 0.1, 0.2 + touch.radius - 1e-5 * n) for x in (0.65, 0.9)) for n in range(500)]
        >>> left, right = [hands.follow([*devices], 0.001) for devices in down][-1]
        >>> bool(left.force[2] < 0 and right.force[2] < 0)
        True
        """
        poses = self._vectors(devices, "the positions of the devices")
        return self._told(self._core.follow(poses.tolist(), Number(low=0.0)(dt, "the time step")))

    @property
    def displacement(self) -> Floats:
        """Displacement of all nodes (n, 3) [m] under all probes: the sum of what each does alone.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> touch = beam.reduce("x > 60% and z > 99%", depth="5%", order=3)
        >>> hands = vs.Probes([touch.probe(), touch.probe()])
        >>> felt = hands.place([(0.65, 0.1, 0.2 + touch.radius), (0.9, 0.1, 0.2 + touch.radius)])
        >>> felt = hands.move([(0, 0, -0.01), (0, 0, -0.01)])
        >>> bool(hands.displacement[:, 2].min() < -0.01)
        True
        """
        fields = (probe._last.displacement for probe in self.probes if probe._last is not None)
        return sum(fields, np.zeros((len(self._touch.mesh.points), 3)))

    def _vectors(self, values: ArrayLike, name: str) -> Floats:
        refuse_masked(values, name, "vectors (x, y, z) [m]")
        given = numbers_of(values)
        if given is None:
            raise VisceraError(f"{name} are {brief(values)}; give {len(self.probes)} vectors (x, y, z) [m]")
        if given.shape != (len(self.probes), 3):
            raise VisceraError(f"{name} have the shape {given.shape}; give {len(self.probes)} vectors (x, y, z) [m]")
        return np.array([vector(each, f"{name}, number {number}", "m") for number, each in enumerate(given)])

    def _told(self, told: list[dict[str, Any]]) -> tuple[Felt, ...]:
        return tuple(probe._felt(each) for probe, each in zip(self.probes, told, strict=True))

    def __repr__(self) -> str:
        return f"Probes({list(self.probes)})"
