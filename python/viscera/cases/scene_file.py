"""A scene written as a case: CASE.toml, with the mesh of each organ in a file beside it."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from viscera import _core
from viscera.boundary.loads import Where, name_of
from viscera.boundary.spring import Spring
from viscera.cases.casefile import Places, organ_words, plain, solve_words, target_of
from viscera.cases.scene_case import SceneCase, any_case_of, read_any
from viscera.cases.scene_schema import SIZES
from viscera.contact.shapes import Shape
from viscera.contact.tool import Tool
from viscera.errors import VisceraError
from viscera.files.atomic import followed, replacing
from viscera.mesh import Where as Nodes

if TYPE_CHECKING:
    from viscera.boundary.bond import Bond
    from viscera.contact.pair import ContactPair
    from viscera.scene import Scene


def write(
    scene: Scene,
    path: str | os.PathLike[str],
    *,
    loads: Mapping[str, Any] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> SceneCase:
    """The case of `Scene.to_case`, written and read back."""
    import tomli_w

    target = target_of(path)
    places = _ScenePlaces(scene)
    real = followed(target)
    files = _mesh_files(real.stem, scene)
    words: dict[str, Any] = {
        "organs": {name: organ_words(organ, places.organs[name], files[name]) for name, organ in scene.organs.items()},
        "bonds": [_bond(bond, places) for bond in scene.bonds if not isinstance(bond, Spring)],
        "springs": [_spring(spring, places) for spring in scene.bonds if isinstance(spring, Spring)],
        "contacts": [_pair(pair, places) for pair in scene.contacts],
        "bodies": [_body(body) for body in scene.bodies],
        **solve_words(loads, settings, places),
    }
    words = {name: plain(word) for name, word in words.items() if word}
    any_case_of(words)  # refused before anything is written
    for name, file in files.items():
        places.organs[name].mesh.write(real.with_name(file))
    with replacing(target) as scratch:
        scratch.write_text(tomli_w.dumps(words), encoding="utf-8")
    written = read_any(target)
    assert isinstance(written, SceneCase)
    return written


class _ScenePlaces:
    """The words for places of a scene, by those of its organs."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.mesh = scene.mesh
        self.organs = {name: Places(organ.mesh) for name, organ in scene.organs.items()}

    def side(self, side: tuple[str, Nodes | None], name: str) -> str:
        """An organ and a place of its surface."""
        organ, where = side
        return organ if where is None else f"{organ}/{self.organs[organ].of(where, name)}"

    def of(self, where: Where, name: str) -> str:
        """A place in the numbering of the scene, all of which is in one organ."""
        if isinstance(where, _core.Patch):
            raise VisceraError("a case file has no word for a contact patch; load a set, or give its nodes")
        nodes = self.mesh.nodes(where)
        if isinstance(where, str) and where in self.mesh.sets:
            return where
        for organ, own in self._scene._numbers.items():
            if np.isin(nodes, own).all():
                order = np.argsort(own)
                local = order[np.searchsorted(own, nodes, sorter=order)]
                return f"{organ}/{self.organs[organ].word(np.sort(local).astype(np.uint32), name)}"
        raise VisceraError(f"{name_of(where)} spans several organs; a case file addresses places of one organ each")


def _mesh_files(stem: str, scene: Scene) -> dict[str, str]:
    """The name of the mesh file of each organ; what a file name may not hold is left out of it."""
    files: dict[str, str] = {}
    for number, name in enumerate(scene.organs, 1):
        file = f"{stem}_{re.sub(r'[^A-Za-z0-9_-]+', '_', name)}_mesh.vtu"
        taken = {each.lower() for each in files.values()}  # some file systems know no case
        files[name] = f"{stem}_{number}_mesh.vtu" if file.lower() in taken else file
    return files


def _bond(bond: Bond, places: _ScenePlaces) -> dict[str, Any]:
    sides = _sides(bond, places, "bonded")
    return {**sides, "sliding": bond.sliding, "stiffness": bond.stiffness, "reach": bond.reach}


def _pair(pair: ContactPair, places: _ScenePlaces) -> dict[str, Any]:
    own = {"reach": pair.reach, "stiffness": pair.stiffness, "friction": pair.friction}
    return {**_sides(pair, places, "touching"), **own}


def _sides(pair: Bond | ContactPair, places: _ScenePlaces, name: str) -> dict[str, str]:
    return {end: places.side(side, name) for end, side in zip(("first", "second"), pair.sides, strict=False)}


def _spring(spring: Spring, places: _ScenePlaces) -> dict[str, Any]:
    words: dict[str, Any] = {"first": places.of(spring.first, "spring")}
    if spring.second is not None:
        words["second"] = places.of(spring.second, "spring")
    length = spring.on(places.mesh).length
    words |= {"point": spring.point, "stiffness": spring.stiffness, "length": length, "cable": spring.cable}
    return {name: word for name, word in words.items() if word is not None}


def _body(body: Tool) -> dict[str, Any]:
    shape = type(body.shape).__name__
    if isinstance(body.shape, Shape):
        raise VisceraError(f"the surface of the body {body!r} is in no file; write it, and name it in the case by hand")
    sizes = {name: getattr(body.shape, name) for name in SIZES if hasattr(body.shape, name)}
    words = {
        "position": body.position,
        "rotation": body.rotation,
        "friction": body.friction,
        "displacement": body.displacement,
        "turn": body.turn,
        "stiffness": body.stiffness,
    }
    return {"shape": shape, **sizes, **words}
