"""The C library as it was built, a model file to load, and a compiler for the programs that use them."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import viscera as vs

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / "bindings" / "c"
STRICT = ["-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]


@pytest.fixture(scope="session")
def libraries() -> Path:
    folder = ROOT / "target" / "c"
    if not (folder / "libviscera.a").is_file():
        pytest.skip(f"no C library in {folder}; `make c-library` builds it")
    if shutil.which("cc") is None or shutil.which("c++") is None:
        pytest.skip("no C and C++ compilers called cc and c++")
    return folder


@pytest.fixture(scope="session")
def shared_library(libraries: Path) -> Path:
    return next(libraries.glob("libviscera.so*"), libraries / "libviscera.dylib")


@pytest.fixture(scope="session")
def touch() -> vs.Touch:
    beam = vs.organs.beam()
    organ = vs.Organ(beam, vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    return organ.reduce(lambda x: (x[:, 2] == 0.2) & (x[:, 0] > 0.3) & (x[:, 0] < 0.7), radius=0.1, depth=0.08, order=4)


@pytest.fixture(scope="session")
def model(touch: vs.Touch, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "beam.viscera"
    touch.save(path)
    return path


@pytest.fixture
def build(libraries: Path, tmp_path: Path) -> Callable[..., Path]:
    """Compiles a program as a user would; system libraries are those the pkg-config file names."""

    def build(*sources: str, linkage: str = "static", flags: tuple[str, ...] = ()) -> Path:
        compiler = ["c++", "-std=c++11"] if sources[0].endswith(".cpp") else ["cc", "-std=c11"]
        system = (libraries / "viscera.pc").read_text().split("Libs.private:")[1].split()
        library = {
            "shared": [f"-L{libraries}", "-lviscera", f"-Wl,-rpath,{libraries}"],
            "hands": [f"-L{libraries}", "-lviscera_hands", f"-Wl,-rpath,{libraries}"],
            "static": [str(libraries / "libviscera.a"), *system],
        }[linkage]
        program = tmp_path / Path(sources[0]).stem
        paths = [str(SOURCES / source) for source in sources]
        including = f"-I{SOURCES / 'include'}"
        command = [*compiler, *STRICT, including, *flags, *paths, *library, "-lpthread", "-lm", "-o", str(program)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return program

    return build
