"""What `make install-c` installs: found by pkg-config and CMake, named by its version, and small."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / "bindings" / "c"
VERSION = re.findall(r'^version = "(.*)"', (ROOT / "Cargo.toml").read_text(), re.MULTILINE)[0]
MAJOR = VERSION.split(".")[0]

linux = pytest.mark.skipif(sys.platform != "linux", reason="names and sizes of libraries are those of Linux")


def output(*command: object, **options: object) -> str:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)  # type: ignore[call-overload]
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return str(done.stdout)


@pytest.fixture(scope="module")
def prefix(libraries: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("make") is None:
        pytest.skip("no make")
    prefix = tmp_path_factory.mktemp("prefix")
    # It is built already, so `true` may stand for cargo.
    output("make", "--no-print-directory", "-C", ROOT, "install-c", f"PREFIX={prefix}", "CARGO=true")
    return prefix


def test_pkg_config_finds_it(model: Path, prefix: Path, tmp_path: Path) -> None:
    if shutil.which("pkg-config") is None:
        pytest.skip("no pkg-config")
    paths = {**os.environ, "PKG_CONFIG_PATH": str(prefix / "lib" / "pkgconfig")}
    assert output("pkg-config", "--modversion", "viscera", env=paths).strip() == VERSION
    flags = output("pkg-config", "--cflags", "--libs", "viscera", env=paths).split()
    libdir = output("pkg-config", "--variable=libdir", "viscera", env=paths).strip()
    program, rpath = tmp_path / "haptic", f"-Wl,-rpath,{libdir}"
    output("cc", SOURCES / "examples" / "haptic.c", *flags, rpath, "-lm", "-o", program)
    assert "ticks trusted" in output(program, model)
    flags = output("pkg-config", "--cflags", "--libs", "viscera_hands", env=paths).split()
    output("cc", SOURCES / "examples" / "hands.c", *flags, rpath, "-lpthread", "-lm", "-o", program)
    assert "ticks trusted" in output(program, model)


@linux
def test_a_program_may_be_static_to_the_last_library(model: Path, prefix: Path, tmp_path: Path) -> None:
    """As docs/c-library.md has it: with the form of GCC's run time that is not shared."""
    if shutil.which("pkg-config") is None:
        pytest.skip("no pkg-config")
    (tmp_path / "nothing.c").write_text("int main(void) { return 0; }\n")
    bare = subprocess.run(
        ["cc", "-static", "nothing.c", "-lgcc_eh", "-o", "nothing"], cwd=tmp_path, capture_output=True
    )
    if bare.returncode != 0:
        pytest.skip(f"no static C library: {bare.stderr.decode()}")
    paths = {**os.environ, "PKG_CONFIG_PATH": str(prefix / "lib" / "pkgconfig")}
    flags = output("pkg-config", "--cflags", "--static", "--libs", "viscera", env=paths)
    program = tmp_path / "haptic"
    source = SOURCES / "examples" / "haptic.c"
    output("cc", "-static", source, *flags.replace("-lgcc_s", "-lgcc_eh").split(), "-o", program)
    assert "ticks trusted" in output(program, model)


def test_cmake_finds_it_also_where_it_was_moved_to(model: Path, prefix: Path, tmp_path: Path) -> None:
    if shutil.which("cmake") is None:
        pytest.skip("*** NOT TESTED: the CMake package. There is no cmake; `make test-c` installs it on Debian. ***")
    moved, build = tmp_path / "moved", tmp_path / "build"
    shutil.copytree(prefix, moved, symlinks=True)
    configure = ["cmake", "-S", SOURCES / "tests" / "cmake", "-B", build, f"-DCMAKE_PREFIX_PATH={moved}"]
    output(*configure, "-DCMAKE_BUILD_TYPE=Release")
    output("cmake", "--build", build)
    assert "ticks trusted" in output(build / "haptic", model)
    assert "in millimetres" in output(build / "wrapper", model)
    assert "ticks trusted" in output(build / "hands", model)


@pytest.mark.parametrize(("asked", "serves"), [(VERSION, True), ("0.0.9", True), ("0.9", False), ("1.0", False)])
def test_cmake_takes_only_a_version_that_serves(prefix: Path, tmp_path: Path, asked: str, serves: bool) -> None:
    if shutil.which("cmake") is None:
        pytest.skip("no cmake")
    script = tmp_path / "ask.cmake"
    folder = prefix / "lib" / "cmake" / "Viscera"
    parts = "\n".join(
        f"set(PACKAGE_FIND_VERSION{name} {value})"
        for name, value in zip(["", "_MAJOR", "_MINOR"], [asked, *asked.split(".")[:2]], strict=True)
    )
    script.write_text(
        f'{parts}\ninclude("{folder}/VisceraConfigVersion.cmake")\nmessage("<${{PACKAGE_VERSION_COMPATIBLE}}>")\n'
    )
    done = subprocess.run(["cmake", "-P", script], capture_output=True, text=True, check=True)
    assert ("<TRUE>" in done.stderr) == serves, done.stderr


@linux
def test_programs_keep_the_name_with_the_first_version_number(prefix: Path, model: Path, tmp_path: Path) -> None:
    """A program runs with the versioned file and the link that its loader asks for; the third is for its linker."""
    lib = prefix / "lib"
    assert (lib / "libviscera.so").readlink() == Path(f"libviscera.so.{MAJOR}")
    assert (lib / f"libviscera.so.{MAJOR}").readlink() == Path(f"libviscera.so.{VERSION}")
    program = tmp_path / "haptic"
    where = [f"-I{prefix / 'include'}", f"-L{lib}", f"-Wl,-rpath,{tmp_path}"]
    output("cc", SOURCES / "examples" / "haptic.c", *where, "-lviscera", "-lm", "-o", program)
    assert subprocess.run([program, model], capture_output=True).returncode == 127, "it is not installed there"
    shutil.copy(lib / f"libviscera.so.{VERSION}", tmp_path / f"libviscera.so.{MAJOR}")
    assert "ticks trusted" in output(program, model)


@linux
def test_they_are_small_and_show_nothing_else(libraries: Path) -> None:
    names = ("libviscera.so", "libviscera.a", "libviscera_hands.so")
    sizes = {name: (libraries / name).stat().st_size for name in names}
    assert sizes["libviscera.so"] < 0.9e6, sizes
    assert sizes["libviscera.a"] < 3e6, sizes
    assert sizes["libviscera_hands.so"] < 12e6, sizes
    if shutil.which("nm"):
        small, large = (shown(libraries / f"{name}.so") for name in ("libviscera", "libviscera_hands"))
        assert small
        assert all(name.startswith("viscera_") for name in small | large), small | large
        assert small < large
        assert "viscera_grasp_solve" in large - small


def shown(library: Path) -> set[str]:
    symbols = output("nm", "--dynamic", "--defined-only", library).split("\n")
    return {line.split()[-1].split("@")[0] for line in symbols if line}


def test_the_headers_serve_older_standards(libraries: Path, tmp_path: Path) -> None:
    for name, compiler, header in (("c.c", "cc -std=c90", "viscera.h"), ("cpp.cpp", "c++ -std=c++11", "viscera.hpp")):
        (tmp_path / name).write_text(
            f'#include "{header}"\n#include "viscera_hands.h"\nint main(void) {{ return 0; }}\n'
        )
        strict = ["-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{SOURCES / 'include'}"]
        output(*compiler.split(), *strict, "-fsyntax-only", tmp_path / name)
