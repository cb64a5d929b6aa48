"""What stands around an organ on the page: rigid bodies in their pose, springs and cables between their ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera.boundary.ties import Link
from viscera.contact.instrument import Instrument
from viscera.contact.shapes import AnyShape, Shape
from viscera.contact.tool import Tool
from viscera.mesh import Floats

if TYPE_CHECKING:
    from viscera.organ import Organ

SIZES = ("radius", "length", "sides", "rounding")


@dataclass(frozen=True)
class Surroundings:
    """The rigid bodies that the organ may touch, and the springs that hold it."""

    organ: Organ
    bodies: Sequence[Instrument | Tool]

    def described(self) -> dict[str, Any]:
        """What does not change from frame to frame: the shape of each body [m], and the number of springs."""
        return {"bodies": [_described(body.shape) for body in self.bodies], "springs": len(self.organ._ties.links)}

    def numbers(self, displacement: Floats) -> Floats:
        """Of each body the position (3,) [m] and the rows of its rotation (9,), of each spring its ends (6,) [m]."""
        poses = [part for body in self.bodies for part in (body.position, body.rotation.ravel())]
        ends = [_ends(link, self.organ.mesh.points, displacement) for link in self.organ._ties.links]
        return np.concatenate([np.empty(0), *poses, *ends])


def _described(shape: AnyShape) -> dict[str, Any]:
    told: dict[str, Any] = {"shape": type(shape).__name__}
    if isinstance(shape, Shape):
        points, triangles = shape.surface
        return {**told, "points": points.ravel().tolist(), "triangles": triangles.ravel().tolist()}
    return told | {name: getattr(shape, name) for name in SIZES if hasattr(shape, name)}


def _ends(link: Link, points: Floats, displacement: Floats) -> Floats:
    """Where the ends of a spring are; the second follows from the first, as it may be a point in space."""
    nodes, weights = (np.array(each) for each in zip(*link.ends, strict=True))
    of_first = weights > 0.0
    first = weights[of_first] @ (points + displacement)[nodes[of_first]]
    return np.concatenate([first, first - link.rest - link.offset(displacement)])
