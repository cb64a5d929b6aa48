"""The examples for other people's devices and engines, run against stand-ins for what is not here."""

from __future__ import annotations

import importlib
import re
import shutil
import subprocess
import sys
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs

SOURCES = Path(__file__).resolve().parents[2] / "bindings" / "c"
EXAMPLES = SOURCES / "examples"
Build = Callable[..., Path]


def top(touch: vs.Touch) -> np.ndarray:
    """The touchable point closest to one high above the origin: a corner of the touchable part of the beam."""
    x = touch.mesh.points
    touchable = x[(x[:, 2] == 0.2) & (x[:, 0] > 0.3) & (x[:, 0] < 0.7)]
    return np.asarray(touchable[np.linalg.norm(touchable[:, :2], axis=1).argmin()])


AXES = {"chai3d.cpp": ([1, 0, 2], [-1, 1, 1]), "openhaptics.c": ([0, 2, 1], [1, 1, -1])}


@pytest.mark.parametrize("source", AXES)
def test_a_device_feels_the_force_in_its_own_axes(source: str, touch: vs.Touch, model: Path, build: Build) -> None:
    """A scripted device comes down on its origin and goes 20 mm in; its axes are another order of the mesh's."""
    program = build(f"examples/{source}", flags=(f"-I{SOURCES / 'tests' / 'stand_ins'}", "-Wno-unused-function"))
    done = subprocess.run([program, model], input="\n", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = np.array(done.stdout.split("deepest")[1].replace("last", "").split(), dtype=float)
    order, sign = AXES[source]
    expected = -touch(top(touch), [0, 0, -0.02]).force[order] * sign
    # A tick before the deepest: the hand goes on while the force is on its way.
    np.testing.assert_allclose(found[:3], expected, atol=0.01 * np.linalg.norm(expected))
    assert expected.max() > 1
    assert not found[3:].any(), "off the organ again there is no force"


@contextmanager
def importing(folder: Path) -> Iterator[None]:
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))


@pytest.fixture(scope="module")
def binding() -> Any:
    with importing(EXAMPLES):
        return importlib.import_module("viscera_ctypes")


def test_ctypes_answers_as_the_package_does(binding: Any, touch: vs.Touch, model: Path, shared_library: Path) -> None:
    organ = binding.Organ(binding.load_library(shared_library), model)
    point, push = [0.5, 0.1, 0.2], [0.005, 0.002, -0.02]
    status, answer = organ.touch(point, push)
    assert status == binding.OK
    np.testing.assert_allclose(answer.force, touch(point, push).force, rtol=1e-9)
    np.testing.assert_allclose(answer.stiffness, touch(point, push).stiffness.ravel(), rtol=1e-9)
    drawn = organ.draw(point, push)
    expected = touch.mesh.points[touch.surface_nodes] + touch.surface_displacement(point, push)
    np.testing.assert_allclose(drawn, expected, atol=1e-6)
    assert organ.locate([0.5, 0.1, 0.3])[1] == pytest.approx(0.1)
    organ.close()
    with pytest.raises(ValueError, match=r"nowhere\.viscera"):
        binding.Organ(organ.library, "nowhere.viscera")
    with pytest.raises(ValueError, match="all four must be positive"):
        binding.Guard(organ.library, 1, 1, 0, 1)


class Data:
    """Stands in for a SOFA data field."""

    def __init__(self, value: Any) -> None:
        self.value = np.array(value, dtype=float)

    @contextmanager
    def writeableArray(self) -> Iterator[np.ndarray]:
        yield self.value


class Node:
    """Stands in for a SOFA node: keeps what is added, with the data that it was given."""

    def __init__(self) -> None:
        self.added: dict[str, Any] = {}

    def addChild(self, name: str) -> Any:
        return self.added.setdefault(name, Node())

    def addData(self, name: str, value: Any, **_: Any) -> Any:
        return self.added.setdefault(name, Data(value))

    def addObject(self, kind: Any, **data: Any) -> Any:
        made = types.SimpleNamespace(**{key: Data(value) for key, value in data.items() if key == "position"})
        return self.added.setdefault("controller" if not isinstance(kind, str) else kind, kind if data == {} else made)


class Controller:
    """Stands in for Sofa.Core.Controller."""

    def __init__(self, name: str) -> None:
        self.name = name


def test_a_sofa_scene_draws_and_feels(
    binding: Any, touch: vs.Touch, model: Path, shared_library: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The real controller and library; only SOFA itself is a stand-in."""
    core = types.SimpleNamespace(Controller=Controller)
    monkeypatch.setitem(sys.modules, "Sofa", types.SimpleNamespace(Core=core))
    monkeypatch.setitem(sys.modules, "Sofa.Core", core)
    monkeypatch.setenv("VISCERA_LIBRARY", str(shared_library))
    monkeypatch.setenv("VISCERA_MODEL", str(model))
    with importing(EXAMPLES):
        scene = importlib.import_module("sofa_controller")
    root = Node()
    controller = scene.createScene(root)
    tool, skin = root.added["tool"], root.added["organ"].added["OglModel"]
    place, rest = tool.added["MechanicalObject"].position, skin.position.value.copy()
    start = place.value[0].copy()
    np.testing.assert_allclose(start - top(touch), [0, 0, 0.02], atol=1e-9)
    forces = []
    for depth in [0.01, 0.001, *np.linspace(-0.0005, -0.02, 40), -0.02, -0.02, 0.001]:
        place.value[0] = top(touch) + np.array([0, 0, depth])
        controller.onAnimateBeginEvent({"dt": 0.01})
        forces.append(tool.added["force"].value[0])
        if depth == -0.02:
            pressed = skin.position.value.copy()
    assert not np.any(forces[1]), "not touched yet"
    limit = 3.0
    expected = -touch(top(touch), [0, 0, -0.02]).force
    expected *= min(1.0, limit / np.linalg.norm(expected))
    assert np.linalg.norm(forces[-2]) <= limit * (1 + 1e-9)
    assert np.dot(forces[-2], expected) > 0.9 * np.linalg.norm(forces[-2]) * np.linalg.norm(expected)
    moved = touch.surface_displacement(top(touch), [0, 0, -0.02])
    np.testing.assert_allclose(pressed - rest, moved, atol=2e-6)
    np.testing.assert_allclose(skin.position.value, rest, atol=1e-6)
    sys.modules.pop("sofa_controller")


HEADER = re.sub(r"/\*.*?\*/", "", (SOURCES / "include" / "viscera.h").read_text(), flags=re.DOTALL)
SIZES = {"Vector": 3, "Matrix": 9}


def in_header(struct: str) -> list[tuple[str, str, int]]:
    """Fields of a struct: name, type, count."""
    body = re.search(rf"struct viscera_{struct} {{(.*?)}}", HEADER, re.DOTALL)
    assert body is not None
    fields = re.findall(r"(\w+) (\w+)(?:\[(\d+)\])?;", body[1])
    return [(name, {"uint64_t": "ulong"}.get(kind, kind), int(count or 1)) for kind, name, count in fields]


@pytest.mark.parametrize("name", ["Info", "Answer", "Frame", "Guard"])
def test_structs_of_c_sharp_are_laid_out_as_the_header_says(name: str) -> None:
    source = (EXAMPLES / "Viscera.cs").read_text()
    body = re.search(rf"LayoutKind\.Sequential\)\]\s+public struct {name}\s+{{(.*?)}}", source, re.DOTALL)
    assert body is not None
    fields = re.findall(r"public (\w+) (\w+);", body[1])
    found = [(field, "double" if kind in SIZES else kind, SIZES.get(kind, 1)) for kind, field in fields]
    assert found == in_header(name.lower())


def test_functions_of_c_sharp_are_those_of_the_header() -> None:
    source = (EXAMPLES / "Viscera.cs").read_text()
    sharp = re.findall(r"extern (\w+) (viscera_\w+)\(([^)]*)\);", source)
    assert len(sharp) > 10
    kinds = {"UIntPtr": "size_t", "IntPtr": "viscera_model", "Status": "int32_t", "GuardMode": "int32_t"}
    kinds |= {"Vector": "double", "byte": "char", "uint": "uint32_t"}
    kinds |= {name: f"viscera_{name.lower()}" for name in ("Answer", "Frame", "Guard")} | {"Info": "viscera_info_t"}
    for result, name, parameters in sharp:
        declared = re.search(rf"^([\w *]+?)\b{name}\(([^)]*)\);", HEADER, re.MULTILINE)
        assert declared is not None, name
        assert kinds.get(result, result) == declared[1].strip(), name
        in_c = [p for p in declared[2].split(",") if p.strip() != "void"]
        in_sharp = [p for p in parameters.split(",") if p.strip()]
        assert len(in_c) == len(in_sharp), name
        for c_parameter, parameter in zip(in_c, in_sharp, strict=True):
            words = parameter.replace("[]", "").split()
            kind = kinds.get(words[-2], words[-2])
            assert kind in c_parameter.replace("uint8_t", "char"), (name, parameter, c_parameter)
            is_pointer = "*" in c_parameter or "[" in c_parameter
            assert is_pointer == (words[0] in ("in", "out", "ref") or "[]" in parameter or words[-2] == "IntPtr")
            assert words[0] != "in" or "const" in c_parameter, (name, parameter)
    assert re.search(r"AbiVersion = (\d+)", source)[1] == re.search(r"ABI_VERSION (\d+)", HEADER)[1]  # type: ignore[index]


def test_c_sharp_compiles(tmp_path: Path) -> None:
    if shutil.which("mcs") is None:
        pytest.skip("no C# compiler called mcs")
    library = f"-out:{tmp_path / 'Viscera.dll'}"
    command = ["mcs", "-target:library", "-langversion:7.2", library, str(EXAMPLES / "Viscera.cs")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
