"""What a case file of a scene may hold: its organs, what holds them together, what they touch, and their loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from inspect import Parameter, signature
from typing import Any

from viscera.boundary import bond, spring
from viscera.cases.entries import Key, Length, PerCell, Table, Text, Units, known
from viscera.cases.schema import CASE, LOADS, SETTINGS
from viscera.contact import pair as contact_pair
from viscera.contact import shapes
from viscera.contact import tool as contact
from viscera.errors import VisceraError
from viscera.quantity import Choice, Flag, Number, Vector, brief, numbers_of, refused
from viscera.select import METRIC, in_space, length

SHAPES = {shape.__name__: shape for shape in shapes.SHAPES}
"""Shapes of rigid bodies."""
SIZES = ("radius", "length", "sides", "rounding", "surface")
"""What may be said of the size of a shape."""


class Side:
    """An organ, or a place of it."""

    def __call__(self, value: Any, what: str) -> None:
        if not isinstance(value, str) or "" in value.split("/", 1):
            raise refused(what, self, value)

    def __str__(self) -> str:
        return 'the name of an organ, or with it a place: "liver", "liver/hilum", "liver/x < 10%"'


class Metres:
    """A length in space, where a percentage would be of nothing."""

    def __init__(self, *, low: float | None = None) -> None:
        self.metres = Number("m", above=0) if low is None else Number("m", low=low)

    def __call__(self, value: Any, what: str) -> None:
        if isinstance(value, str) and "%" in value:
            raise refused(what, self, value)
        length(value, None, what, self.metres)

    def __str__(self) -> str:
        return f'{self.metres}; or words such as "12 mm"'


class InSpace:
    """A point in space, or a motion."""

    def __call__(self, value: Any, what: str) -> None:
        in_space(value, what)

    def __str__(self) -> str:
        return f'three lengths, each {METRIC} or words such as "12 mm"; or "(100, 50, 80) mm"'


class Sides:
    """The sides of a box."""

    def __call__(self, value: Any, what: str) -> None:
        if not isinstance(value, list) or len(value) != 3:
            raise refused(what, self, value)
        for side in value:
            Metres()(side, what)

    def __str__(self) -> str:
        return f"three lengths, each {Metres()}"


class Rotation:
    """A rotation vector or a matrix, whose orthogonality the tool checks."""

    vector = Vector("rad")

    def __call__(self, value: Any, what: str) -> None:
        numbers = numbers_of(value)
        if numbers is None or numbers.shape != (3, 3):
            self.vector(value, what)

    def __str__(self) -> str:
        return f"a rotation vector, {self.vector}; or the rows of a rotation matrix"


class Densities:
    """One density for all organs, or one for each."""

    one = PerCell(Number("kg/m^3", above=0))

    def __call__(self, value: Any, what: str) -> None:
        for organ, each in value.items() if isinstance(value, Mapping) else [("", value)]:
            self.one(each, f"{what} of {organ!r}" if organ else what)

    def __str__(self) -> str:
        return f"{self.one}, or a table with one for each organ"


class Organs:
    """The organs by name."""

    def __call__(self, words: Any, what: str) -> None:
        for name, organ in known(words, words, what):
            if not name or "/" in name:
                raise refused("the name of an organ", "words without '/'", name)
            try:
                replace(ORGAN, name=f"{what}.{name}")(organ, name)
            except VisceraError as error:
                raise VisceraError(f"organ {name!r}: {error}") from None
        if not words:
            raise VisceraError("a scene has one organ at least, in a table such as [organs.liver]")

    def __str__(self) -> str:
        return "a table for each organ, `[organs.NAME]`"


class Rows:
    """Tables of one kind, as many as one likes."""

    def __init__(self, row: Table) -> None:
        self.row = row

    def __call__(self, words: Any, what: str) -> None:
        if not isinstance(words, list):
            raise VisceraError(f"{what!r} is a list of tables, each under [{self.row.name}], got {brief(words)}")
        for number, row in enumerate(words, 1):
            try:
                self.row(row, what)
            except VisceraError as error:
                raise VisceraError(f"{error} (number {number} of {what})") from None

    def __str__(self) -> str:
        return f"a table for each, `[{self.row.name}]`"


class Body(Table):
    """A rigid body, whose shape says which sizes it takes."""

    def __call__(self, words: Any, what: str) -> None:
        super().__call__(words, what)
        takes = signature(SHAPES[words["shape"]]).parameters
        for name in SIZES:
            if name in words and name not in takes:
                raise VisceraError(f"a {words['shape']} has no {name!r}{self._takes(takes)}")
            if name in takes and name not in words and takes[name].default is Parameter.empty:
                raise VisceraError(f"the key {name!r} is missing{self._takes(takes)}")
        if ("units" in words) != ("surface" in words):
            raise VisceraError(f"'units' are those of a 'surface'; give both or none{self._takes(takes)}")

    def _takes(self, takes: Mapping[str, Any]) -> str:
        return f" in [{self.name}]; its shape takes {' and '.join(takes) or 'no size'}"


def _ends(kind: str, second: Key) -> dict[str, Key]:
    return {"first": Key(Side(), f"one {kind}", is_required=True), "second": second}


ORGAN = Table(
    "organs.NAME",
    "One organ, where NAME stands for its name. Its further tables are those of a case of one organ, such as "
    "`[organs.liver.material]` and `[organs.liver.supports.PLACE]`. All organs must be of one "
    "element.",
    {
        **{name: CASE.keys[name] for name in ("mesh", "units", "fixed", "supports", "element", "material")},
        "rotation": Key(Rotation(), "turns the mesh about the origin of its file", "none"),
        "position": Key(InSpace(), "where the origin of the mesh file lies", "[0, 0, 0]"),
    },
)
BOND = Table(
    "[bonds]",
    "Two surfaces that hold together wherever they lie on each other at rest: [bonds](scenes.md#several-organs).",
    {
        **_ends("surface", Key(Side(), "the other", is_required=True)),
        "sliding": Key(Flag(), "whether the surfaces may slide along each other", "false"),
        "stiffness": Key(bond.FACTOR, "factor of its stiffness", f"{bond.STIFFNESS:g}"),
        "reach": Key(Length(), "largest distance of faces that hold together; per cent of the smaller organ", '"1%"'),
    },
)
SPRING = Table(
    "[springs]",
    "A [spring or a cable](scenes.md#springs-and-cables) between the means of two places, or from a place to a point.",
    {
        **_ends("place", Key(Side(), "the other", "required, unless there is a `point`")),
        "point": Key(InSpace(), "point in space at which it ends", "none"),
        "stiffness": Key(spring.STIFFNESS, "force per elongation", is_required=True),
        "length": Key(Metres(low=0), "length without force", "the length at rest"),
        "cable": Key(Flag(), "whether it bears no compression", "false"),
    },
)
CONTACT = Table(
    "[contacts]",
    "Two surfaces that may [touch each other](scenes.md#organs-that-touch), of two organs or of one, or one that may "
    "touch itself.",
    {
        **_ends("surface", Key(Side(), "the other", "none: the one touches itself")),
        "reach": Key(
            Length(),
            "distance within which surfaces are looked at; per cent of the smaller organ",
            f'"{contact_pair.REACH}", of one surface "{contact_pair.OWN_REACH}"',
        ),
        "stiffness": Key(contact_pair.FACTOR, "factor of the layer between them", f"{contact.STIFFNESS:g}"),
        "friction": Key(contact.FRICTION, "Coulomb's coefficient", "0"),
    },
)
BODY = Body(
    "[bodies]",
    "A rigid body that all organs may touch, such as a table or a retractor: a [tool](contact.md). A half space is all "
    "that lies below z = 0 in the axes of the body.",
    {
        "shape": Key(Choice(SHAPES), "its shape", is_required=True),
        "radius": Key(Metres(), "radius of a sphere or a capsule"),
        "length": Key(Metres(), "length of the segment of a capsule, along its z axis"),
        "sides": Key(Sides(), "sides of a box"),
        "rounding": Key(Metres(low=0), "radius of the edges of a box", "0"),
        "surface": Key(Text(), "path of the closed surface of a `Shape`, from the folder of the case: STL, OBJ or PLY"),
        "units": Key(Units(), "unit of the surface file", "required with `surface`"),
        "position": Key(InSpace(), "where its origin lies", "[0, 0, 0]"),
        "rotation": Key(Rotation(), "from its axes to those of space", "none"),
        "friction": Key(contact.FrictionOrBonded(), "Coulomb's coefficient", "0"),
        "displacement": Key(InSpace(), "motion in proportion to the load", "[0, 0, 0]"),
        "turn": Key(Vector("rad"), "rotation about its origin in proportion to the load", "[0, 0, 0]"),
        "stiffness": Key(Number(above=0), "factor of the layer between body and organ", f"{contact.STIFFNESS:g}"),
    },
)
SCENE_LOADS = replace(
    LOADS,
    means='Loads on the scene, as those on one organ. A place names its organ first: `"liver/hilum"`, '
    '`"liver/x < 10%"`, or `"liver"` for all of it.',
    keys={**LOADS.keys, "density": replace(LOADS.keys["density"], value=Densities())},
)
SCENE = Table(
    "",
    "Several organs that are solved together, instead of the one organ above. `viscera solve` and `viscera view` take "
    "scenes.",
    {
        "organs": Key(Organs(), "the organs", is_required=True),
        "bonds": Key(Rows(BOND), "surfaces that hold together", "none"),
        "springs": Key(Rows(SPRING), "springs and cables", "none"),
        "contacts": Key(Rows(CONTACT), "surfaces that may touch each other", "none"),
        "bodies": Key(Rows(BODY), "rigid bodies", "none"),
        "loads": Key(SCENE_LOADS, "loads", "no load"),
        "settings": Key(SETTINGS, "settings of the solver"),
    },
)
