"""The model file can be read and evaluated from its description alone: docs/read_model.py against the package."""

from __future__ import annotations

import ast
import importlib.util
import json
import re
import struct
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import viscera as vs
from viscera import _core
from viscera.reduced.touch import load_bytes

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests" / "data"
TOLERANCE = 1e-5  # the package adds up fields in single precision; a wrong sum is wrong by a percent and more


@pytest.fixture(scope="module")
def reader() -> ModuleType:
    spec = importlib.util.spec_from_file_location("read_model", ROOT / "docs" / "read_model.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of order 4, so that one order lies above those that edges have, with several regions."""
    organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.45), fixed="clamp")
    path = tmp_path_factory.mktemp("model") / "beam.viscera"
    organ.reduce("top", order=4, tolerance=1e-2).save(path)
    return path


def test_the_metadata_and_the_organ_are_there(reader: ModuleType, file: Path) -> None:
    about, arrays = reader.read(file)
    beam = vs.organs.beam()
    assert about["format_version"] == 3
    assert (about["units"], about["order"], about["edge_order"]) == ("SI", 4, 4)
    assert np.array_equal(arrays["points"], beam.points)
    assert np.array_equal(arrays["cells"], beam.cells)
    assert len(arrays["region_start"]) > 2


def described(what: str) -> list[str]:
    """The names in the first column of a table of the page, sorted."""
    page = (ROOT / "docs" / "model-file.md").read_text(encoding="utf-8")
    rows = re.search(rf"\| {what} \|.*?\n\n", page, re.DOTALL)
    assert rows is not None
    return sorted(
        name for line in rows[0].splitlines()[2:] if line for name in re.findall(r"`(\w+)`", line.split("|")[1])
    )


def test_the_page_describes_every_array_and_key_of_the_file(reader: ModuleType, file: Path, bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    state, vary = organ.solve(force={"tip": (0, 0, -1.0)}), vs.Vary("young", 1e4, 1e6, part=[0, 1], nodes=2)
    lying = vs.Organ(bar, organ.law, supports=[vs.ElasticSupport("root", stiffness=1e6)])
    small = vs.Organ(vs.mesh(1e-3 * bar.points, bar.cells, bar.sets), organ.law, fixed="root")
    keys, names = map(set, reader.read(file))
    for touch in (
        small.reduce("tip", order=5),
        organ.reduce("tip", order=2, start=state),
        organ.reduce("tip", order=3, vary=vary),
        lying.reduce("tip", order=2),
    ):
        touch.save(file.with_name("bar.viscera"))
        about, arrays = reader.read(file.with_name("bar.viscera"))
        keys |= set(about)
        names |= set(arrays)
    assert described("array") == sorted(names)
    assert described("key") == sorted(keys)


@pytest.mark.parametrize("is_loaded", [False, True])
def test_midpoints_are_numbered_as_the_page_says(
    is_loaded: bool, reader: ModuleType, tmp_path: Path, bar: vs.Mesh
) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root", element="P2")
    state = organ.solve(force={"tip": (0, 0, -1.0)}) if is_loaded else None
    organ.reduce("tip", order=2, start=state).save(tmp_path / "bar.viscera")
    about, arrays = reader.read(tmp_path / "bar.viscera")
    assert about["element"] == "P2"
    cells, c = arrays["cells"].astype(int), int(arrays["cells"].max()) + 1
    ends = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    edges = sorted({tuple(sorted(pair)) for a, b in ends for pair in cells[:, [a, b]].tolist()})
    node = {pair: c + k for k, pair in enumerate(edges)}

    def middle(a: int, b: int) -> int:
        return node[min(a, b), max(a, b)]

    rest = arrays["points"] - arrays.get("preload", 0.0)
    assert rest[c:] == pytest.approx(rest[np.array(edges)].mean(axis=1), abs=1e-12)
    assert len(rest) == c + len(edges)
    ten = [[*cell, *(middle(cell[a], cell[b]) for a, b in ends)] for cell in cells.tolist()]
    assert _core.quadratic(c, arrays["cells"])[1].tolist() == ten
    for face in arrays["surface"].reshape(-1, 4, 3).tolist():
        a, b, d = face[0][0], face[1][1], face[2][2]
        ab, bd, da = middle(a, b), middle(b, d), middle(d, a)
        assert face == [[a, ab, da], [ab, b, bd], [da, bd, d], [ab, bd, da]]


@pytest.mark.parametrize("order", [2, 4])
def test_force_and_field_are_those_of_the_package(reader: ModuleType, file: Path, order: int) -> None:
    """Random touches, on the surface and beside it, within triangles, on an edge and at a node."""
    model = vs.load(file)
    if order < model.order:
        model = model.organ().reduce("top", order=order, tolerance=1e-2)
        file = file.with_name(f"order-{order}.viscera")
        model.save(file)
    about, arrays = reader.read(file)
    rng = np.random.default_rng(7)
    points = rng.uniform((0.1, -0.02, 0.18), (1.02, 0.22, 0.22), (20, 3)).tolist()
    for point in [*points, [0.5, 0.025, 0.2], [0.5, 0.1, 0.2]]:
        direction = rng.normal(size=3)
        push = direction / np.linalg.norm(direction) * rng.uniform(0.01, 1.0) * model.depth
        answer = model(point, push)
        force, field = reader.touch(about, arrays, point, push)
        assert np.linalg.norm(force - answer.force) <= TOLERANCE * np.linalg.norm(answer.force)
        assert np.abs(field - answer.displacement).max() <= TOLERANCE * np.abs(answer.displacement).max()


def flipped(data: bytes, bit: int) -> bytes:
    return data[: bit // 8] + bytes([data[bit // 8] ^ 1 << bit % 8]) + data[bit // 8 + 1 :]


def test_every_flipped_bit_is_refused(reader: ModuleType, tmp_path: Path, bar: vs.Mesh) -> None:
    """400 bits anywhere, 400 of the header and those of its version: by the package, and by the reader of the page."""
    organ, path = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root"), tmp_path / "bar.viscera"
    organ.reduce("tip", order=2).save(path)
    data = path.read_bytes()
    rng = np.random.default_rng(8)
    header = 8 * (8 + int.from_bytes(data[:8], "little"))
    key = b'format_version\\":'
    version = 8 * (data.index(key) + len(key))  # a bit makes it that of files without checksums
    anywhere = [*rng.integers(8 * len(data), size=400).tolist(), *rng.integers(header, size=400).tolist()]
    for bit in [*range(version, version + 8), *anywhere]:
        with pytest.raises(vs.VisceraError, match="not a usable model file"):
            load_bytes(flipped(data, bit))
        path.write_bytes(flipped(data, bit))
        with pytest.raises((ValueError, KeyError, TypeError, MemoryError, OverflowError, struct.error)):
            reader.read(path)


def answers_are_those_of_the_version_that_wrote_it(old: vs.Touch, reader: ModuleType, name: str) -> None:
    for known in json.loads((DATA / f"{name}.json").read_text(encoding="utf-8")):
        answer = old(known["point"], known["displacement"])
        assert answer.force == pytest.approx(known["force"], rel=1e-12)
        assert np.linalg.norm(answer.displacement) == pytest.approx(known["field"], rel=1e-6)
        force, field = reader.touch(*reader.read(DATA / f"{name}.viscera"), known["point"], known["displacement"])
        assert force == pytest.approx(known["force"], rel=1e-10)
        assert np.linalg.norm(field) == pytest.approx(known["field"], rel=TOLERANCE)


def test_a_file_without_checksums_is_read_with_a_word(
    reader: ModuleType, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A file of format version 1, with the answers of the version that wrote it."""
    old = vs.load(DATA / "format-1.viscera")
    assert "format-1.viscera is of format version 1" in caplog.text
    assert "save it anew" in caplog.text
    answers_are_those_of_the_version_that_wrote_it(old, reader, "format-1")
    caplog.clear()
    old.save(tmp_path / "new.viscera")
    assert vs.load(tmp_path / "new.viscera").metadata["format_version"] == 3
    assert not caplog.text


def test_a_file_whose_second_order_is_interpolated_is_read(
    reader: ModuleType, caplog: pytest.LogCaptureFixture
) -> None:
    """A file of format version 2, with the answers of the version that wrote it."""
    answers_are_those_of_the_version_that_wrote_it(vs.load(DATA / "format-2.viscera"), reader, "format-2")
    assert not caplog.text


def test_the_reader_is_as_short_as_the_page_says() -> None:
    """Lines of code without docstrings; modules of the standard library and NumPy."""
    tree = ast.parse((ROOT / "docs" / "read_model.py").read_text(encoding="utf-8"))
    lines, modules = set[int](), set[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.stmt) and not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            is_block = isinstance(node, ast.FunctionDef | ast.For | ast.If | ast.With)
            lines |= {node.lineno} if is_block else set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        if isinstance(node, ast.Import):
            modules |= {name.name for name in node.names}
        if isinstance(node, ast.ImportFrom):
            modules.add(str(node.module))
    assert modules - set(sys.stdlib_module_names) == {"numpy"}
    assert 80 <= len(lines) < 90


@pytest.mark.parametrize("order", [4, 6, 8])
def test_a_small_organ_answers_as_a_large_one(bar: vs.Mesh, order: int, tmp_path: Path) -> None:
    """Squares of its fields would leave single precision in metres: their file has a unit of length of its own."""
    touches, answers = [], []
    for scale in (1.0, 1e-3):
        mesh = vs.mesh(scale * bar.points, bar.cells, bar.sets)
        organ = vs.Organ(mesh, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
        organ.reduce("tip", order=order).save(tmp_path / "organ.viscera")
        touches.append(vs.load(tmp_path / "organ.viscera"))
        answers.append(touches[-1](scale * np.array((0.4, 0.05, 0.05)), scale * np.array((0.0, 0.0, -0.03))))
    large, small = answers
    assert small.force / 1e-3**2 == pytest.approx(large.force, rel=1e-6)
    # In the last digits of single precision, in which both are kept.
    assert small.error_estimate == pytest.approx(large.error_estimate, rel=1e-4)
    assert small.shape_error_estimate == pytest.approx(large.shape_error_estimate, rel=1e-3)
    assert [touch.metadata["format_version"] for touch in touches] == [3, 4]
    assert [touch.metadata.get("norm_length") for touch in touches] == [None, touches[1].radius]
    assert touches[1].compressed(0.05).metadata["norm_length"] == touches[1].radius


def test_fields_beyond_single_precision_are_refused_before_they_are_all_solved(bar: vs.Mesh) -> None:
    organ = vs.Organ(
        vs.mesh(1e-6 * bar.points, bar.cells, bar.sets), vs.NeoHookean(young=1e5, poisson=0.3), fixed="root"
    )
    said: list[int] = []
    with pytest.raises(vs.VisceraError, match=r"fields of order 8 under a patch of radius 4.24e-8 m .* a lower order"):
        organ.reduce("tip", order=8, progress=lambda done, total, stage: said.append(done))
    assert max(said, default=0) == 0
