"""The C library against Python: programs in C and C++, linked to the shared and to the static library, and run."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import viscera as vs

Block = Callable[..., tuple[np.ndarray, np.ndarray]]
Build = Callable[..., Path]
# Of an answer, by how its reason starts.
STATUS = {"displaced": 1, "the estimated error": 2, "between the values": 2, "": 0}
SOURCES = Path(__file__).resolve().parents[2] / "bindings" / "c"


def run(program: Path, *arguments: object) -> str:
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, f"exit {done.returncode}: {done.stdout}{done.stderr}"
    return done.stdout


def write_answers(touch: vs.Touch, path: Path) -> None:
    """Touches all over the top, shallow to too deep, with what Python answers to them."""
    random = np.random.default_rng(0)
    nodes = touch.surface_nodes
    statuses = set()
    with path.open("w") as file:
        for depth in np.linspace(0.05, 1.3, 20) * touch.depth:
            point = np.array([random.uniform(0.35, 0.65), random.uniform(0.02, 0.18), 0.2])
            direction = random.normal(size=3) * (1, 1, 0.3) - (0, 0, 1)
            push = depth * direction / np.linalg.norm(direction)
            answer = touch(point, push)
            reasons = (answer.reason, answer.shape_reason)
            status, shape = (next(c for start, c in STATUS.items() if why.startswith(start)) for why in reasons)
            statuses.add((status, shape))
            moved = touch.mesh.points[nodes] + touch.surface_displacement(point, push)
            np.savetxt(file, [[*point, *push]], fmt="%.17g", newline=" ")
            file.write(f"{status} {shape} ")
            estimates = np.array([answer.error_estimate, answer.shape_error_estimate])
            numbers = [answer.force, answer.stiffness.ravel(), estimates, moved.ravel()]
            np.savetxt(file, [np.concatenate(numbers)], fmt="%.17g")
    assert {(0, 0), (1, 1)} <= statuses, "some touches are trusted and some too deep"


@pytest.mark.parametrize("linkage", ["shared", "static"])
def test_a_haptic_loop_in_c_answers_as_python_does(
    touch: vs.Touch, model: Path, build: Build, linkage: str, tmp_path: Path
) -> None:
    write_answers(touch, tmp_path / "answers.txt")
    output = run(build("examples/haptic.c", linkage=linkage), model, tmp_path / "answers.txt")
    assert "20 touches; largest difference from Python" in output
    assert len(re.findall(r"the hand feels", output)) == 12


def test_the_comparison_sees_a_wrong_answer(touch: vs.Touch, model: Path, build: Build, tmp_path: Path) -> None:
    answers = tmp_path / "answers.txt"
    write_answers(touch, answers)
    words = answers.read_text().split(" ")
    force = np.array(words[8:11], dtype=float)  # the first, after six numbers and two statuses
    words[8] = str(force[0] + 3e-6 * np.abs(force).max())
    answers.write_text(" ".join(words))
    program = build("examples/haptic.c", linkage="shared")
    assert subprocess.run([program, model, answers], capture_output=True).returncode == 1


def test_a_probe_in_c_feels_what_it_feels_in_python(touch: vs.Touch, model: Path, build: Build, tmp_path: Path) -> None:
    probe, lines = touch.probe(friction=0.3), []
    statuses = {"free": 3, "inside": 10, "sticks": 0, "slides": 0}
    for n in range(60):
        center = (0.45 + 0.001 * max(n - 20, 0), 0.1, 0.2 + touch.radius + 0.001 - 0.001 * min(n, 20))
        felt = probe.place(center)
        lines.append([*center, statuses[felt.grip], *felt.force, *felt.torque])
    assert len({line[3] for line in lines}) == 2
    assert felt.is_trusted
    assert felt.grip == "slides"
    np.savetxt(tmp_path / "poses.txt", lines, fmt=["%.17g"] * 3 + ["%d"] + ["%.17g"] * 6)
    output = run(build("examples/probe.c", linkage="shared"), model, tmp_path / "poses.txt")
    assert "60 poses; largest difference from Python" in output
    assert len(re.findall(r"the hand feels", output)) == 8


def test_two_probes_in_c_feel_what_they_feel_in_python(
    touch: vs.Touch, model: Path, build: Build, tmp_path: Path
) -> None:
    hands, lines = vs.Probes([touch.probe(friction=0.3), touch.probe(friction=0.3)]), []
    for n in range(40):
        entered = 0.0005 * n - 0.002
        centers = [(0.41, 0.1, 0.2 + touch.radius - entered), (0.59, 0.1, 0.2 + touch.radius - 1.7 * entered)]
        felt = hands.place(centers)
        told = [[3 if not one.is_touching else 0 if one.is_trusted else 2, *one.force] for one in felt]
        lines.append([*np.ravel(centers), *np.ravel(told)])
    assert all(one.is_touching for one in felt)
    np.savetxt(tmp_path / "poses.txt", lines, fmt=["%.17g"] * 6 + 2 * (["%d"] + ["%.17g"] * 3))
    output = run(build("tests/probes.c", linkage="shared"), model, tmp_path / "poses.txt")
    assert "40 poses of two; largest difference from Python" in output


def write_inside(touch: vs.Touch, points: np.ndarray, path: Path) -> None:
    """Touches of a family at several values, with what Python answers to them inside."""
    random = np.random.default_rng(1)
    low, high = touch.metadata["parameter"]["range"]
    with path.open("w") as file:
        file.write(f"{len(points)} ")
        np.savetxt(file, points, fmt="%.17g")
        for value in (low, 0.3 * low + 0.7 * high, high):
            at = touch.at(value)
            for share in (0.2, 0.7, 1.2):
                point = np.array([random.uniform(0.4, 0.6), random.uniform(0.05, 0.15), 0.2])
                direction = random.normal(size=3) - (0, 0, 1)
                push = share * touch.depth * direction / np.linalg.norm(direction)
                answer = at(point, push)
                reasons = (answer.reason, answer.shape_reason)
                statuses = [next(c for start, c in STATUS.items() if why.startswith(start)) for why in reasons]
                np.savetxt(file, [[value, *point, *push]], fmt="%.17g", newline=" ")
                file.write("{} {} ".format(*statuses))
                single = np.array([answer.error_estimate, answer.shape_error_estimate, answer.energy])
                inside = [answer.at(points).displacement.ravel(), answer.displacement.ravel()]
                np.savetxt(
                    file, [np.concatenate([answer.force, answer.stiffness.ravel(), single, *inside])], fmt="%.17g"
                )


@pytest.fixture(scope="module", params=["young", "radius of a quadratic element"])
def family(
    request: pytest.FixtureRequest, block: Block, tmp_path_factory: pytest.TempPathFactory
) -> tuple[vs.Touch, Path]:
    """A beam of few cells for a range of stiffness, or of the radius of its touches."""
    is_stiffness = request.param == "young"
    beam = vs.mesh(*block((10, 2, 2) if is_stiffness else (5, 1, 1), (1.0, 0.2, 0.2)))
    element = "P1" if is_stiffness else "P2"
    organ = vs.Organ(beam, vs.NeoHookean(young=1e5, poisson=0.3), fixed="x < 1%", element=element)
    vary = vs.Vary("young", 8e4, 1.5e5, nodes=3) if is_stiffness else vs.Vary("radius", 0.1, 0.12, nodes=2)
    touch = organ.reduce("z > 99% and x > 35% and x < 65%", radius=0.1, depth=0.02, order=3, vary=vary)
    path = tmp_path_factory.mktemp("family") / "beam.viscera"
    touch.save(path)
    return touch, path


def test_inside_and_in_another_tissue_c_answers_as_python_does(
    family: tuple[vs.Touch, Path], build: Build, tmp_path: Path
) -> None:
    touch, path = family
    points = np.array([[0.5, 0.1, 0.15], [0.41, 0.02, 0.2], [0.0, 0.0, 0.0], [0.77, 0.13, 0.04]])
    write_inside(touch, points, tmp_path / "answers.txt")
    output = run(build("tests/inside.c", linkage="shared"), path, tmp_path / "answers.txt")
    assert "9 touches; largest difference from Python" in output
    if touch.element == "P1":
        run(build("tests/inside.cpp"), path)


def test_misuse_is_told_by_a_status(model: Path, build: Build) -> None:
    assert run(build("tests/refusals.c", linkage="shared"), model) == "0 faults\n"


def test_the_header_and_frames_in_cpp(model: Path, build: Build) -> None:
    run(build("tests/millimetres.cpp"), model)


def test_the_wrapper_and_a_probe_in_cpp(model: Path, build: Build) -> None:
    run(build("tests/wrapper.cpp"), model)


def test_topology_is_that_of_the_model(touch: vs.Touch, model: Path, libraries: Path) -> None:
    """The whole interface through ctypes, without a compiler: rows of positions and triangles belong together."""
    import ctypes as c

    library = c.CDLL(str(next(libraries.glob("libviscera.so*"), libraries / "libviscera.dylib")))
    handle = c.c_void_p()
    assert library.viscera_load_file(os.fsencode(model), c.byref(handle), None, c.c_size_t(0)) == 0
    triangles = np.zeros_like(touch.mesh.surface, dtype=np.uint32)
    nodes = np.zeros(len(touch.surface_nodes), dtype=np.uint32)
    into = [triangles.ctypes.data_as(c.c_void_p), c.c_size_t(triangles.size)]
    status = library.viscera_surface_topology(handle, *into, nodes.ctypes.data_as(c.c_void_p), c.c_size_t(nodes.size))
    library.viscera_free(handle)
    assert status == 0
    assert nodes.tolist() == touch.surface_nodes.tolist()
    assert nodes[triangles].tolist() == touch.mesh.surface.tolist()


RUST_TYPES = {
    **{"double": "f64", "float": "f32", "char": "c_char", "size_t": "usize"},
    **{"int32_t": "i32", "uint8_t": "u8", "uint32_t": "u32", "uint64_t": "u64"},
    **{f"viscera_{name.lower()}": name for name in ("Model", "Answer", "Frame", "Guard", "Probe", "Probes", "Felt")},
    **{f"viscera_{name.lower()}": name for name in ("Places", "Parameter", "Hands", "Grasp", "Held")},
    "viscera_info_t": "Info",
    "viscera_sampling": "SamplingSettings",
    "viscera_grasp_state": "GraspState",
    "viscera_search": "SearchFacts",
    "viscera_go_on": "GoOn",
    "void": "c_void",
}


def rust_type(declaration: str) -> str:
    """The Rust type of a C parameter or result: `const double point[3]` is `*const f64`."""
    base = next(word for word in re.findall(r"\w+", declaration) if word != "const")
    if declaration.split() == ["void"]:
        return ""
    pointers = declaration.count("*") + declaration.count("[")
    kind = "*const " if declaration.lstrip().startswith("const") else "*mut "
    return kind * pointers + RUST_TYPES[base]


def declarations() -> str:
    headers = "".join((SOURCES / "include" / name).read_text() for name in ("viscera.h", "viscera_hands.h"))
    return re.sub(r"/\*.*?\*/", "", headers, flags=re.DOTALL)


def sources() -> str:
    return "".join(path.read_text() for path in sorted((SOURCES / "src").rglob("*.rs")))


def test_the_headers_declare_what_the_libraries_export() -> None:
    header, rust = declarations(), sources()
    rust = re.sub(r"\b(viscera_status|Mode)\b", "i32", rust)

    declared = {
        name: ([rust_type(p) for p in parameters.split(",") if p != "void"], rust_type(result))
        for result, name, parameters in re.findall(r"^([\w *]+?)\b(viscera_\w+)\(([^)]*)\);", header, re.MULTILINE)
    }
    exported = {
        name: (re.findall(r"\w+: ([^,]+?)(?:,|$)", parameters.strip()), result)
        for name, parameters, result in re.findall(r'extern "C" fn (viscera_\w+)\(([^)]*)\)(?: -> ([^{]+?))? {', rust)
    }
    assert "viscera_evaluate" in declared
    assert declared == exported
    assert "viscera_grasp_solve" in declared
    numbers = dict(re.findall(r"VISCERA_(?:GUARD_|)(\w+) = (\d+)", header))
    assert numbers == dict(re.findall(r"pub const (\w+): i32 = (\d+);", rust))
    assert re.findall(r"VISCERA_ABI_VERSION (\d+)", header) == re.findall(r"ABI_VERSION: u32 = (\d+)", rust)


STRUCTS = {name.lower(): name for name in ("Info", "Answer", "Frame", "Guard", "Felt", "Parameter")}
STRUCTS |= {"sampling": "SamplingSettings", "grasp_state": "GraspState", "search": "SearchFacts"}


@pytest.mark.parametrize(("struct", "name"), STRUCTS.items())
def test_structs_have_the_same_fields(struct: str, name: str) -> None:
    header, rust = declarations(), sources()
    in_c = re.search(rf"struct viscera_{struct} {{(.*?)}}", header, re.DOTALL)
    in_rust = re.search(rf"pub struct {name} {{(.*?)\n}}", rust, re.DOTALL)
    assert in_c is not None
    assert in_rust is not None
    assert re.findall(r"\w+ (\w+)(?:\[\d\])?;", in_c[1]) == re.findall(r"pub (\w+):", in_rust[1])
