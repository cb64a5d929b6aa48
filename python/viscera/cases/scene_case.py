"""A case file with several organs: a scene with its loads and settings, in the words of the Python API.

    [organs.liver]                # as many as one likes, each in the words of a case of one organ
    mesh = "liver.vtu"
    units = "mm"
    fixed = "hilum"
    [organs.liver.material]
    law = "NeoHookean"
    young = 5e3
    poisson = 0.45

    [[contacts]]                  # also [[bonds]], [[springs]], [[bodies]]
    first = "liver"
    second = "stomach/x < 30%"    # a place of an organ

    [loads]
    gravity = [0, 0, -9.81]
    density = {liver = 1060, stomach = 1000}
    force."liver/z > 90%" = [0, 0, -2.0]

`scene_schema` defines the keys and their values.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from viscera.boundary.bond import Bond
from viscera.boundary.spring import Spring
from viscera.cases.case import Case, Solvable, case_of, read_words
from viscera.cases.scene_schema import SCENE, SHAPES, SIZES, Side
from viscera.contact.pair import ContactPair
from viscera.contact.shapes import AnyShape, HalfSpace, Shape
from viscera.contact.tool import Contact, Tool
from viscera.errors import VisceraError, did_you_mean, naming
from viscera.mesh import Mesh
from viscera.organ import Organ
from viscera.rotation import rotation_matrix
from viscera.scans.meshing import read_surface
from viscera.scene import Scene
from viscera.select import in_space
from viscera.state import State

WHENCE = {"folder", "file"}
"""What a case has beside its words."""
Row = Mapping[str, Any]
"""A table of a bond, a spring, a contact pair or a body."""


@dataclass(frozen=True)
class SceneCase(Solvable):
    """A case file of a scene as read and checked; lengths and places are not resolved yet.

    It offers what a `Case` does for a solve: `organ`, `loading`, `solve` and `reactions`.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> case = vs.Scene({"beam": beam}).to_case("scene.toml", loads={"force": {"beam/tip": (0, 0, -10.0)}})
    >>> list(case.organs), case.loads
    (['beam'], {'force': {'beam/tip': [0, 0, -10.0]}})
    """

    organs: Mapping[str, Mapping[str, Any]]
    bonds: Sequence[Row] = field(default_factory=list)
    springs: Sequence[Row] = field(default_factory=list)
    contacts: Sequence[Row] = field(default_factory=list)
    bodies: Sequence[Row] = field(default_factory=list)
    loads: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    folder: Path = Path()
    file: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        """Raise `VisceraError` naming the first key that a scene does not have, or an organ that it does not have."""
        SCENE({each.name: getattr(self, each.name) for each in fields(self) if each.name not in WHENCE}, "a scene")
        for name, words in self.organs.items():
            self._organ_case(name)
            rotation_matrix(words.get("rotation"), f"the rotation of the organ {name!r}")
        for place, of in self._placed():
            self._split(place, of)
        density = self.loads.get("density", {})
        if isinstance(density, Mapping):
            for name in density:
                self._split(name, "the density")
            for name in self.organs if density else ():
                if name not in density:
                    raise VisceraError(f"density in [loads] has none for the organ {name!r}")
        self._between()

    def organ(self) -> Scene:
        """The scene. Each place that the case names becomes a set of its organ's mesh, such as "liver/x < 10%".

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> vs.Scene({"beam": beam}).to_case("scene.toml").organ()
        Scene(beam: 525 points, 0 bodies, 0 bonds)
        """
        with naming(self.file):
            bonds, contacts, bodies = self._between(self.folder)
            return Scene(self._organs(), bodies, bonds, contacts)

    def _organs(self) -> dict[str, Organ]:
        named: dict[str, list[tuple[str, str]]] = {name: [] for name in self.organs}
        for place, of in self._placed():
            name, where = self._split(place, of)
            named[name] += [(where, of)] if where else []
        organs = {}
        for name, words in self.organs.items():
            case = self._organ_case(name)
            with naming(f"organ {name!r}"):
                organs[name] = case._organ(_moved(case._mesh(), words), named[name])
        return organs

    @property
    def files(self) -> list[Path]:
        """The files that the case reads: those of the meshes of its organs, and of the surfaces of its bodies.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> [path.name for path in vs.Scene({"beam": beam}).to_case("scene.toml").files]
        ['scene_beam_mesh.vtu']
        """
        meshes = [path for name in self.organs for path in self._organ_case(name).files]
        return [*meshes, *(self.folder / body["surface"] for body in self.bodies if "surface" in body)]

    def reactions(self, organ: Scene, state: State) -> dict[str, list[float]]:
        """Total force (3,) [N] at each place that holds or moves an organ, by its name in the case.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = vs.Scene({"beam": beam}).to_case("scene.toml", loads={"force": {"beam/tip": (0, 0, -10.0)}})
        >>> scene = case.organ()
        >>> {place: round(force[2], 3) for place, force in case.reactions(scene, case.solve(scene)).items()}
        {'beam/clamp': 10.0}
        """
        found = {}
        for name, words in self.organs.items():
            own = organ.organ(name)
            for place, support in zip(words.get("supports", {}), own.supports, strict=True):
                found[f"{name}/{place}"] = state.support_force(support).tolist()
            if (fixed := words.get("fixed")) is not None:
                place = fixed if isinstance(fixed, str) else "fixed"
                found[f"{name}/{place}"] = state.reaction(organ._numbers[name][own.fixed]).tolist()
        moved = {place: state.reaction(place).tolist() for place in self.loads.get("displacement", {})}
        return {**found, **moved}

    def facts(self, organ: Scene, state: State) -> dict[str, Any]:
        """How far each organ moves, and the forces between them: of bonds, springs, contact pairs and bodies.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = vs.Scene({"beam": beam}).to_case("scene.toml", loads={"force": {"beam/tip": (0, 0, -10.0)}})
        >>> scene = case.organ()
        >>> f"{case.facts(scene, case.solve(scene))['organs']['beam']['max_displacement']:.4f}"
        '0.1999'
        """
        springs = organ.bonds[len(self.bonds) :]
        return {
            "organs": {name: {"max_displacement": _size(state[name].displacement)} for name in self.organs},
            "bonds": [
                {**_ends(words), "force": state.support_force(bond)}
                for words, bond in zip(self.bonds, organ.bonds, strict=False)
            ],
            "springs": [
                {**_ends(words), "force": state.support_force(spring)}
                for words, spring in zip(self.springs, springs, strict=True)
            ],
            "contacts": [
                {**_ends(words), **_contact(state.contact(pair))}
                for words, pair in zip(self.contacts, organ.contacts, strict=True)
            ],
            "bodies": [
                {"number": number, "shape": words["shape"], **_contact(state.contact(body))}
                for number, (words, body) in enumerate(zip(self.bodies, organ.bodies, strict=True), 1)
            ],
        }

    def _organ_case(self, name: str) -> Case:
        """One organ as a case of its own, where its mesh file has it."""
        words = {key: word for key, word in self.organs[name].items() if key not in {"position", "rotation"}}
        with naming(f"organ {name!r}"):
            return Case(**words, folder=self.folder)

    def _placed(self) -> Iterator[tuple[str, str]]:
        """Every place that the case addresses, and what names it."""
        yield from super()._placed()
        for table in ("bonds", "springs", "contacts"):
            for row in getattr(self, table):
                yield from ((row[end], f"[[{table}]]") for end in ("first", "second") if end in row)

    def _split(self, place: str, of: str) -> tuple[str, str]:
        """Organ and place of words such as "liver/x < 10%"; the place is empty for the whole organ."""
        Side()(place, f"a place of {of}")
        name, _, where = place.partition("/")
        if name not in self.organs:
            raise VisceraError(f"{place!r} of {of}: no organ is called {name!r}; {did_you_mean(name, self.organs)}")
        return name, where

    def _between(self, folder: Path | None = None) -> tuple[list[Bond | Spring], list[ContactPair], list[Tool]]:
        """Bonds and springs, contact pairs, bodies; without a folder, no file of a surface is read."""
        bonds = [Bond(*_sides(row), **_rest(row)) for row in self.bonds]
        springs = [
            Spring(row["first"], row.get("second"), **_in_metres(_rest(row), ("point",))) for row in self.springs
        ]
        contacts = [ContactPair(*_sides(row), **_rest(row)) for row in self.contacts]
        bodies = []
        for number, row in enumerate(self.bodies, 1):
            with naming(f"number {number} of bodies"):
                bodies.append(_body(row, folder))
        return [*bonds, *springs], contacts, bodies


def read_any(path: str | os.PathLike[str]) -> Case | SceneCase:
    """Read a CASE.toml; raises `VisceraError` with the file and the key that is wrong or missing.

    A file with `[organs.NAME]` is a scene.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> _ = beam.to_case("beam.toml", loads={"gravity": (0, 0, -9.81), "density": 1000.0})
    >>> vs.case("beam.toml").loads
    {'gravity': [0, 0, -9.81], 'density': 1000.0}
    """
    return read_words(path, any_case_of)


def any_case_of(words: Mapping[str, Any], folder: Path = Path(), file: str = "") -> Case | SceneCase:
    """A case or a scene's case from the words of its file; raises `VisceraError` naming the key that is wrong."""
    if "organs" not in words:
        return case_of(words, folder, file)
    SCENE(words, "a scene")  # unknown keys, which a `SceneCase` has no place for
    return SceneCase(**words, folder=folder, file=file)


def _sides(row: Row) -> list[Any]:
    """The sides of a bond or a contact pair."""
    return [row[end] for end in ("first", "second") if end in row]


def _ends(row: Row) -> dict[str, Any]:
    """What a bond, a spring or a contact pair lies between."""
    return _in_metres({end: row[end] for end in ("first", "second", "point") if end in row}, ("point",))


def _rest(row: Row) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name not in {"first", "second"}}


def _in_metres(row: Row, vectors: Sequence[str]) -> dict[str, Any]:
    """The same with these vectors in metres."""
    return {name: in_space(value, name) if name in vectors else value for name, value in row.items()}


def _body(row: Row, folder: Path | None) -> Tool:
    shape: AnyShape
    if "surface" not in row:
        shape = SHAPES[row["shape"]](**{name: row[name] for name in SIZES if name in row})
    else:
        shape = HalfSpace() if folder is None else _shape(folder / row["surface"], row["units"])
    rest = {name: value for name, value in row.items() if name not in {"shape", "units", *SIZES}}
    return Tool(shape, **_in_metres(rest, ("position", "displacement")))


def _shape(path: Path, units: str | float) -> Shape:
    try:
        return Shape(read_surface(path, units))
    except VisceraError as error:
        raise VisceraError(str(error) if str(path) in str(error) else f"{path}: {error}") from error


def _moved(plain: Mesh, words: Row) -> Mesh:
    """The mesh turned about its origin, and that at a position."""
    position, rotation = words.get("position"), words.get("rotation")
    if position is None and rotation is None:
        return plain
    points = plain.points @ rotation_matrix(rotation).T
    points = points + (0.0 if position is None else in_space(position, "position"))
    points.flags.writeable = False  # a mesh that was checked stays so
    return replace(plain, points=points)


def _contact(contact: Contact) -> dict[str, Any]:
    return {"force": contact.force, "torque": contact.torque, "area": contact.area, "gap": contact.gap}


def _size(displacement: Any) -> float:
    return float(np.linalg.norm(displacement, axis=1).max())
