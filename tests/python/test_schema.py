"""No case file is taken that says something of the wrong kind, and none ends in a traceback.

Cases are mutated: values, keys and whole tables are replaced by others of every kind that TOML has. What a value of
each key has to be is written down here once more, and more coarsely, to judge what was accepted.
"""

from __future__ import annotations

import copy
import datetime
import math
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import viscera as vs
from viscera.boundary.loads import nodal_forces, prescribed, pressed_faces, traction_forces
from viscera.cases.case import Case, case_of
from viscera.cases.scene_case import SceneCase, any_case_of

MUTATIONS = 10_000
BUILDS = 300
"""Of what was accepted so many are taken on to the organ and its loads."""

CASES: list[dict[str, Any]] = [
    {
        "mesh": "bar.vtu",
        "units": "m",
        "fixed": "root",
        "element": "P1",
        "material": {"law": "NeoHookean", "young": 1e5, "poisson": 0.3, "x > 50%": {"young": 2e5}},
        "loads": {
            "gravity": [0, 0, -9.81],
            "density": 1000,
            "displacement": {"tip": [0.01, "free", "-3 cm"]},
            "force": {"z > 99%": [0, 0, 1.0]},
            "traction": {"y > 99%": [0, 1, 0]},
            "pressure": {"z < 1%": 10},
        },
        "scan": {"gravity": [0, -9.81, 0], "density": 1000, "pressure": {"z < 1%": 5.0}},
        "settings": {
            "steps": 2,
            "newton": {"tolerance": 1e-8, "max_iterations": 20, "max_backtracks": 5, "smallest_step": 0.1},
        },
        "reduce": {
            "touchable": "z > 99%",
            "radius": "15%",
            "depth": 0.01,
            "order": 2,
            "tolerance": 1e-2,
            "pade": True,
            "start": "rest",
            "vary": {"parameter": "young", "part": "x > 50%", "low": 1e5, "high": 2e5, "nodes": 2},
        },
    },
    {
        "mesh": "bar.vtu",
        "units": 1.0,
        "fixed": [0, 1, 2, 3],
        "material": {"law": "Ogden", "mu": [1e3, -50.0], "alpha": [2.0, -4], "poisson": 0.4},
        "reduce": {"vary": {"parameter": "radius", "low": "5%", "high": "20 mm"}},
    },
    {
        "mesh": "bar.vtu",
        "units": "m",
        "fixed": "root",
        "material": {
            "law": "HolzapfelGasserOgden",
            **{"c": 3e3, "k1": 2e3, "k2": 0.8, "kappa": 1e5, "dispersion": 0.1, "bear_compression": True},
            "fibres": {"angle": 30, "axis": [1, 0, 0], "through": [0, 0.05, 0.05]},
        },
    },
    {
        "mesh": "bar.vtu",
        "units": "m",
        "fixed": "root",
        "material": {"law": "MooneyRivlin", "c1": 1e4, "c2": 2e3, "alpha": 1e5, "volumetric": "J-1"},
        "settings": {"newton": {}},
    },
    {
        "mesh": "bar.vtu",
        "units": "m",
        "fixed": "root",
        "material": {"law": "Yeoh", "c10": 500.0, "c20": 200, "c30": 0, "poisson": 0.45},
        "scan": {"gravity": [0, 0, 1], "density": 1000},
        "reduce": {"start": "scan", "pade": False},
    },
]
SCENE: dict[str, Any] = {
    "organs": {
        "lower": {
            "mesh": "bar.vtu",
            "units": "m",
            "fixed": "root",
            "material": {"law": "NeoHookean", "young": 1e5, "poisson": 0.3},
        },
        "upper": {
            "mesh": "bar.vtu",
            "units": "m",
            "position": [0, 0, "10 cm"],
            "supports": {"tip": {"stiffness": 1e6, "tangential": 0}},
            "element": "P1",
            "material": {"law": "Yeoh", "c10": 500.0, "poisson": 0.3},
        },
    },
    "bonds": [{"first": "lower/x > 50%", "second": "upper", "sliding": True, "stiffness": 50, "reach": "2%"}],
    "springs": [
        {"first": "lower/tip", "second": "upper/tip", "stiffness": 10.0, "length": "5 cm", "cable": True},
        {"first": "upper/tip", "point": "(40, 5, 30) cm", "stiffness": 10.0},
    ],
    "contacts": [{"first": "lower/x < 50%", "second": "upper/x < 50%", "reach": 0.01, "stiffness": 30}],
    "bodies": [
        {"shape": "HalfSpace", "position": [0, 0, "-5 cm"], "friction": "bonded", "rotation": [0, 0, 1.5]},
        {"shape": "Box", "sides": ["1 cm", 0.01, 0.02], "rounding": 0.001, "position": [0, 0, 1], "friction": 0.3},
        {"shape": "Capsule", "radius": "1 cm", "length": 0.1, "position": [0, 0, 2], "displacement": [0, 0, "-1 mm"]},
        {"shape": "Sphere", "radius": 0.01, "position": [1, 1, 1], "turn": [0, 0, 1], "stiffness": 20},
    ],
    "loads": {
        "gravity": [0, 0, -9.81],
        "density": {"lower": 1000, "upper": 900.0},
        "displacement": {"upper/x > 99%": [0.01, "free", "-3 cm"]},
        "force": {"lower/tip": [0, 0, 1.0]},
        "traction": {"upper/y > 99%": [0, 1, 0]},
        "pressure": {"upper/z > 99%": 10},
    },
    "settings": {"steps": 2, "solver": "cg", "newton": {"tolerance": 1e-8}},
}
MOMENT = datetime.datetime(2026, 1, 1, tzinfo=datetime.timezone.utc)
VALUES: list[Any] = [
    *(True, False, 0, 1, -1, 2, 7, 10**6, 99999999, 10**400, 0.5, 1.5, -0.0, 1e-300, 1e100, 1e300, math.inf, math.nan),
    *("", "a", "1", "1.0", "yes", "free", "root", "tip", "m", "radius", "poisson", "Linear", "P2", "loads", "\0"),
    *("5%", "12 mm", "-3 cm", "x < 10%", "x <", "1e999%", [], [[]], [1], [True], ["a"], [0, 0], [0, 0, 1], [-1], [81]),
    *([True, False, True], [0, True, 1], ["free", "free", "free"], [1e100, 0, 0], [math.nan, 0, 0], ["0", "0", "1"]),
    *([0, 0, [1]], [[1, 0, 0], [0, 1, 0]], [[1, 0, 0], [0, 1, True]], {}, {"a": 1}, {"tip": True}, {"tip": [0, 0, 1]}),
    *({"x": {"y": {}}}, {"law": "Linear"}, {"young": "1"}, {"root": 1e100}, MOMENT, MOMENT.date(), MOMENT.time()),
]


SCENE_VALUES: list[Any] = [
    *VALUES,
    *("lower", "lower/", "/tip", "lower/tip", "uper/tip", "Sphere", "HalfSpace", "bonded", "1 cm", "(1, 2, 3) mm"),
    *([{}], [{"first": "lower"}], [{"first": "lower", "second": "upper"}], ["1 cm", "1 cm", "5%"], [[1, 0, 0]] * 3),
]


def real(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1e15


def whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 2**32


def vector(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(real, value))


def text(value: Any) -> bool:
    return isinstance(value, str) and value != ""


def place(value: Any) -> bool:
    is_list = isinstance(value, list) and value != []
    return text(value) or (is_list and (all(map(whole, value)) or all(map(text, value))))


def length(value: Any) -> bool:
    return text(value) or (real(value) and value > 0)


def end(value: Any) -> bool:
    return text(value) or real(value)


def metres(value: Any) -> bool:
    return real(value) or (isinstance(value, str) and value in {"0", "5%", "12 mm", "-3 cm", "1 cm"})


def point(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(metres, value))


def components(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(part == "free" or metres(part) for part in value)


def terms(value: Any) -> bool:
    return real(value) or (isinstance(value, list) and 1 <= len(value) <= 3 and all(map(real, value)))


def places(kind: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, dict) and all(map(kind, value.values()))


def fibres(value: Any) -> bool:
    if isinstance(value, dict):
        return fits(value, {"angle": real, "axis": vector, "through": point})
    return isinstance(value, list) and len(value) == 2 and all(map(vector, value))


def fits(table: Any, kinds: dict[str, Any]) -> bool:
    """Whether a table has these keys alone, each of its kind."""
    return isinstance(table, dict) and all(
        name in kinds and (fits(value, kinds[name]) if isinstance(kinds[name], dict) else kinds[name](value))
        for name, value in table.items()
    )


def flag(value: Any) -> bool:
    return isinstance(value, bool)


NUMBERS = ("young", "poisson", "lam", "c1", "c2", "kappa", "c10", "c20", "c30", "c", "k1", "k2", "dispersion")
MATERIAL: dict[str, Any] = {
    **dict.fromkeys(NUMBERS, real),
    **{"law": text, "mu": terms, "alpha": terms, "volumetric": text, "bear_compression": flag, "fibres": fibres},
}
LOADS: dict[str, Any] = {
    "force": places(vector),
    "traction": places(vector),
    "pressure": places(real),
    "gravity": vector,
    "density": real,
}
KINDS: dict[str, Any] = {
    "mesh": text,
    "units": lambda value: text(value) or (real(value) and value > 0),
    "fixed": place,
    "element": text,
    "material": lambda value: all(
        fits(part, MATERIAL) if isinstance(part, dict) and name != "fibres" else fits({name: part}, MATERIAL)
        for name, part in value.items()
    ),
    "loads": {**LOADS, "displacement": places(components)},
    "scan": LOADS,
    "settings": {
        "steps": whole,
        "newton": {"tolerance": real, "max_iterations": whole, "max_backtracks": whole, "smallest_step": real},
    },
    "reduce": {
        **{"touchable": place, "radius": length, "depth": length, "order": whole, "tolerance": real, "pade": flag},
        **{"start": text, "vary": {"parameter": text, "part": place, "low": end, "high": end, "nodes": whole}},
    },
}


def rows(**kinds: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, list) and all(fits(row, kinds) for row in value)


def in_space(value: Any) -> bool:
    return isinstance(value, str) or (isinstance(value, list) and len(value) == 3 and all(map(end, value)))


def side(value: Any) -> bool:
    return isinstance(value, str) and value.partition("/")[0] in {"lower", "upper"} and not value.endswith("/")


def addressed(kind: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: places(kind)(value) and all(map(side, value))


def organs(value: Any) -> bool:
    return isinstance(value, dict) and all(fits(organ, ORGAN) for organ in value.values())


ORGAN: dict[str, Any] = {
    **{name: KINDS[name] for name in ("mesh", "units", "fixed", "element", "material")},
    "supports": places(lambda value: fits(value, {"stiffness": real, "tangential": real})),
    "position": in_space,
}
SCENE_KINDS: dict[str, Any] = {
    "organs": organs,
    "bonds": rows(first=side, second=side, sliding=flag, stiffness=real, reach=length),
    "springs": rows(first=side, second=side, point=in_space, stiffness=real, length=end, cable=flag),
    "contacts": rows(first=side, second=side, stiffness=real, reach=length),
    "bodies": rows(
        **{"shape": text, "radius": length, "length": length, "rounding": end, "sides": in_space, "turn": vector},
        **{"position": in_space, "displacement": in_space, "friction": end, "stiffness": real},
        rotation=lambda value: vector(value) or (isinstance(value, list) and all(map(vector, value))),
    ),
    "loads": {
        **{"force": addressed(vector), "traction": addressed(vector), "pressure": addressed(real), "gravity": vector},
        "displacement": addressed(components),
        "density": lambda value: real(value) or fits(value, {"lower": real, "upper": real}),
    },
    "settings": {**KINDS["settings"], "solver": text},
}


def spots(words: Any) -> Iterator[tuple[Any, Any]]:
    """Every table or list of a case with a key of its own."""
    for key, value in words.items() if isinstance(words, dict) else enumerate(words):
        yield words, key
        if isinstance(value, dict | list):
            yield from spots(value)


def mutated(chance: random.Random, cases: list[dict[str, Any]], values: list[Any]) -> dict[str, Any]:
    """A case with one or two of its entries replaced, taken away or called by another name."""
    words: dict[str, Any] = copy.deepcopy(chance.choice(cases))
    for _ in range(chance.choice((1, 1, 2))):
        table, key = chance.choice(list(spots(words)))
        change = chance.random()
        if isinstance(table, dict) and change < 0.1:
            del table[key]
        elif isinstance(table, dict) and change < 0.2:
            table[chance.choice(["", "a", "young", "mu", "x < 10%", "density", "fibres", "law", "low"])] = table.pop(
                key
            )
        else:
            table[key] = copy.deepcopy(chance.choice(values))
    return words


@pytest.fixture(scope="module")
def folder(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("schema")
    bar.write(folder / "bar.vtu")
    return folder


def test_mutated_cases_are_refused_in_words_or_right(folder: Path) -> None:
    chance = random.Random(15)
    refused, taken = 0, []
    for _ in range(MUTATIONS):
        words = mutated(chance, CASES, VALUES)
        try:
            taken.append(case_of(words, folder))
        except vs.VisceraError:
            refused += 1
        else:
            assert fits(words, KINDS), words
    assert refused > MUTATIONS / 2
    assert len(taken) > MUTATIONS / 20
    for case in chance.sample(taken, BUILDS):
        build(case)


def test_mutated_scenes_are_refused_in_words_or_right(folder: Path) -> None:
    chance = random.Random(16)
    assert isinstance(any_case_of(SCENE, folder), SceneCase)
    assert fits(SCENE, SCENE_KINDS)
    refused, taken = 0, []
    for _ in range(MUTATIONS // 2):
        words = mutated(chance, [SCENE], SCENE_VALUES)
        try:
            case = any_case_of(words, folder)
        except vs.VisceraError:
            refused += 1
        else:
            assert isinstance(case, SceneCase)
            assert fits(words, SCENE_KINDS), words
            taken.append(case)
    assert refused > MUTATIONS / 4
    assert len(taken) > MUTATIONS / 40
    made = sum(map(build, chance.sample(taken, BUILDS // 3)))
    assert made > BUILDS / 10  # most organs of a mutated scene can be made still


def build(case: Case | SceneCase) -> bool:
    """Whether the organ and its loads can be made, in words where they cannot; nothing is solved."""
    try:
        organ = case.organ()
        loads = case.loading()
        prescribed(organ.mesh, organ.fixed, loads["displacement"])
        nodal_forces(organ.mesh, organ.fixed, loads["force"])
        traction_forces(organ.mesh, organ.fixed, loads["traction"])
        pressed_faces(organ.mesh, organ.fixed, loads["pressure"])
    except vs.VisceraError:
        return False
    return True
