"""Fixtures that every test may use: small meshes, and the reference material where it is at hand."""

from __future__ import annotations

import importlib.util
import itertools
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import hypothesis
import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs

ROOT = Path(__file__).resolve().parent.parent
collect_ignore = ["reference"]  # its scripts import codes that are not dependencies

# The same examples on every machine, and no failure because a machine is busy.
hypothesis.settings.register_profile("viscera", deadline=None, derandomize=True, max_examples=50)
hypothesis.settings.load_profile("viscera")

# A shell makes its background jobs ignore Ctrl-C, and they hand that on to every program that a test starts.
signal.signal(signal.SIGINT, signal.default_int_handler)


Block = Callable[[tuple[int, int, int], tuple[float, float, float]], tuple[NDArray[np.float64], NDArray[np.uint32]]]


def block(
    counts: tuple[int, int, int], size: tuple[float, float, float]
) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Points (n, 3) and cells (m, 4) of a box at the origin, each brick cut into six tetrahedra around its diagonal."""
    steps = np.array(counts)
    grid = np.stack(np.meshgrid(*(np.arange(n + 1) for n in counts), indexing="ij"), axis=-1)
    points = grid.reshape(-1, 3) * (np.array(size) / steps)
    stride = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    corners = grid[:-1, :-1, :-1].reshape(-1, 3) @ stride
    cells = []
    for path in itertools.permutations(range(3)):
        tet = np.cumsum(np.concatenate([[0], stride[list(path)]]))
        odd = np.linalg.det(np.eye(3)[list(path)]) < 0
        cells.append(corners[:, None] + (tet[[0, 2, 1, 3]] if odd else tet))
    return points, np.concatenate(cells).astype(np.uint32)


@pytest.fixture(scope="session", name="block")
def block_fixture() -> Block:
    """Points and cells of a box of any size: `block(counts, size)`."""
    return block


@pytest.fixture(scope="session")
def cube() -> vs.Mesh:
    """A cube of side 0.1 m: 27 points, 48 cells, sets `bottom` (z = 0), `top` (z = 0.1) and `corner` (the far one)."""
    points, cells = block((2, 2, 2), (0.1, 0.1, 0.1))
    sets = {
        "bottom": np.flatnonzero(points[:, 2] == 0),
        "top": np.flatnonzero(points[:, 2] == 0.1),
        "corner": np.flatnonzero((points == 0.1).all(axis=1)),
    }
    return vs.mesh(points, cells, sets)


@pytest.fixture(scope="session")
def dome() -> vs.Mesh:
    """A shallow dome over a square of 2 m, 0.25 m high and 0.05 m thick: 75 points, 192 cells, sets `rim` and `top`."""
    unit, cells = block((4, 4, 2), (2.0, 2.0, 0.05))
    height = 0.25 * np.sin(np.pi * unit[:, 0] / 2) * np.sin(np.pi * unit[:, 1] / 2)
    rim = ((unit[:, :2] == 0.0) | (unit[:, :2] == 2.0)).any(axis=1)
    sets = {"rim": np.flatnonzero(rim), "top": np.flatnonzero(unit[:, 2] == 0.05)}
    return vs.mesh(unit + np.outer(height, [0.0, 0.0, 1.0]), cells, sets)


@pytest.fixture(scope="session")
def bar() -> vs.Mesh:
    """A bar 0.4 x 0.1 x 0.1 m along x: 81 points, 192 cells, sets `root` (x = 0) and `tip` (x = 0.4)."""
    points, cells = block((8, 2, 2), (0.4, 0.1, 0.1))
    ends = {"root": np.flatnonzero(points[:, 0] == 0), "tip": np.flatnonzero(np.isclose(points[:, 0], 0.4))}
    return vs.mesh(points, cells, ends)


@pytest.fixture(scope="session")
def wire() -> vs.Mesh:
    """A rod 240 times as long as thick, along x from `root` to `tip`: 964 points, 1440 cells."""
    points, cells = block((240, 1, 1), (0.6, 0.0025, 0.0025))
    ends = {"root": np.flatnonzero(points[:, 0] == 0), "tip": np.flatnonzero(points[:, 0] == 0.6)}
    return vs.mesh(points, cells, ends)


def program(name: str) -> ModuleType:
    """A program of the folder `benchmarks`, which may import its neighbours."""
    path = ROOT / "benchmarks" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def locking() -> ModuleType:
    """The program benchmarks/locking.py."""
    return program("locking")


@pytest.fixture(scope="session")
def probe_study() -> ModuleType:
    """The program benchmarks/probe.py."""
    program("machine")
    return program("probe")


@pytest.fixture(scope="session")
def stress(locking: ModuleType) -> ModuleType:
    """The program benchmarks/stress.py."""
    return program("stress")


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference solutions and organ meshes, which is no part of the repository.

    Named by VISCERA_SHARED; beside the repository without it. What needs it is skipped, loudly, where it is absent.
    """
    folder = Path(os.environ.get("VISCERA_SHARED", ROOT.parent / "shared"))
    if not (folder / "reference").is_dir():
        pytest.skip(f"no reference material in {folder}; name its folder in VISCERA_SHARED")
    return folder


@contextmanager
def full_disk(most: int = 2000) -> Iterator[None]:
    """While this lasts, no file takes more than that many bytes; Python ignores the signal, so writing fails."""
    resource = pytest.importorskip("resource", reason="this system limits no file")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def coarse_liver(edge: float) -> vs.Organ:
    """The built-in liver in cells with such edges [m], with node sets `hilum`, where it is fixed, and `tip`."""
    liver = vs.organs.liver()
    coarse = vs.mesh_surface((liver.points, liver.surface), edge=edge)
    near = np.linalg.norm(coarse.points[:, None] - liver.points[liver.sets["hilum"]], axis=2).min(axis=1)
    mesh = coarse.with_sets(hilum=np.flatnonzero(near < 0.01), tip=np.flatnonzero(coarse.points[:, 0] > 0.095))
    return vs.Organ(mesh, vs.NeoHookean(young=6e3, poisson=0.45), fixed="hilum")


def front_of_liver(mesh: vs.Mesh) -> NDArray[np.uint32]:
    """Triangles of the liver's surface that a camera in front of it sees."""
    rest = mesh.points[mesh.surface]
    facing = np.cross(rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0]) @ [0.0, -0.75, 0.66]
    return np.asarray(mesh.surface[(facing > 0.0) & (rest.mean(axis=1)[:, 1] < 0.03)])
