"""What this installation has: versions, processor, threads, graphics, extras; what is missing, and how to get it."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from viscera import _core, gpu, threads
from viscera.errors import VisceraError

VECTOR_UNITS = ("sse4_2", "avx2", "fma", "avx512f", "asimd", "sve")
"""The vector units that matter here, by their names in Linux."""
RUNTIME_FOLDER = "XDG_RUNTIME_DIR"
"""The variable that names the folder where a session keeps the sockets of its screen."""
BESIDE = {"h5py": "to write .xdmf files", "mpi4py": "to reduce on an MPI cluster"}
"""Useful packages that belong to no extra."""


def examine() -> dict[str, Any]:
    """version, python, platform, processor, cores, threads, vector_units, gpus, gpu, gpu_fault, packages, extras,
    packages_fault, beside, problems.

    gpu: what `solver="gpu"` computes on; None if it cannot, for the reason `gpu_fault`.
    packages: `{name: version}` of what Viscera needs, None if it is missing; extras: the same for each extra. Both are
        empty where they cannot be told, for the reason `packages_fault`.
    problems: sentences, each with what to do.
    """
    (needed, extras), packages_fault = _told_requirements()
    packages = {name: version_of(name) for name in needed}
    found = {extra: {name: version_of(name) for name in names} for extra, names in sorted(extras.items())}
    problems = [
        f"{name} {'is missing' if packages[name] is None else f'{packages[name]} is older than {least}'}: "
        f"pip install '{name}>={least or '0'}'"
        for name, least in needed.items()
        if not is_enough(packages[name], least)
    ]
    device, fault = _gpu()
    return {
        "version": _core.__version__,
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": threads.cores(),
        "threads": threads.in_use(),
        "vector_units": _vector_units(),
        "gpus": _gpus(),
        "gpu": device,
        "gpu_fault": fault,
        "packages": packages,
        "extras": found,
        "packages_fault": packages_fault,
        "beside": {name: version_of(name) for name in BESIDE},
        "problems": problems + _viewer() + _solves(),
    }


def requirements() -> tuple[dict[str, str], dict[str, dict[str, str]]]:
    """Packages with their least version: those that are needed, and those of each extra; of this Python alone."""
    needed: dict[str, str] = {}
    extras: dict[str, dict[str, str]] = {}
    for line in metadata.requires("viscera") or ():
        words = re.match(r"([\w.-]+)\s*(?:\[[^\]]*\])?\s*([^;]*)(?:;(.*))?", line)
        if words is None or words[1] == "viscera" or not _is_of_this_python(words[3] or ""):
            continue
        least = re.search(r">=\s*([\d.]+)", words[2])
        extra = re.search(r"""extra\s*==\s*['"]([\w-]+)['"]""", words[3] or "")
        (extras.setdefault(extra[1], {}) if extra else needed)[words[1]] = least[1] if least else ""
    return needed, extras


def _told_requirements() -> tuple[tuple[dict[str, str], dict[str, dict[str, str]]], str | None]:
    """Needed packages and extras, or none of them and why they cannot be told."""
    try:
        return requirements(), None
    except metadata.PackageNotFoundError:  # a folder on PYTHONPATH, or a copy within another package
        folder = Path(__file__).parent
        return ({}, {}), f"not known, nor the extras: pip did not install {folder}, and it is pip that notes them"


def version_of(package: str) -> str | None:
    """The version that is installed, if one is."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def is_enough(version: str | None, least: str) -> bool:
    """Whether a version is at least another.

    >>> is_enough("1.24.1", "1.24"), is_enough("1.9", "1.24"), is_enough(None, "1")
    (True, False, False)
    """
    return version is not None and _numbers(version) >= _numbers(least)


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])


def _is_of_this_python(marker: str) -> bool:
    below = re.search(r"""python(?:_full)?_version\s*<\s*['"]([\d.]+)['"]""", marker)
    return below is None or _numbers(platform.python_version())[:2] < _numbers(below[1])


def _processor() -> str:
    models = (line.partition(":")[2].strip() for line in _lines("/proc/cpuinfo") if line.startswith("model name"))
    named = next(models, "")
    return named or platform.processor() or platform.machine()


def _vector_units() -> list[str]:
    listed = (set(line.split()) for line in _lines("/proc/cpuinfo") if line.startswith(("flags", "Features")))
    flags = next(listed, set())
    return [unit for unit in VECTOR_UNITS if unit in flags]


def _gpus() -> list[str]:
    """Graphics processors that Linux lists: NVIDIA's by name, others by their driver."""
    named = []
    for card in sorted(Path("/proc/driver/nvidia/gpus").glob("*/information")):
        named += [line.partition(":")[2].strip() for line in _lines(str(card)) if line.startswith("Model")]
    drivers = [link.resolve().name for link in sorted(Path("/sys/class/drm").glob("card[0-9]/device/driver"))]
    return named + [driver for driver in drivers if driver != "nvidia"]


def _gpu() -> tuple[str | None, str | None]:
    """What `solver="gpu"` computes on, or why it does not."""
    try:
        with _runtime_folder():
            return gpu.describe(), None
    except VisceraError as error:
        return None, str(error)


@contextmanager
def _runtime_folder() -> Iterator[None]:
    """Where a session has no folder for its sockets, an empty one stands in.

    Without it the graphics libraries print on standard error that there is none, which is no fault of a machine without
    a screen. Everything else that they print is seen.
    """
    given = os.environ.get(RUNTIME_FOLDER)
    if given:
        yield
        return
    with TemporaryDirectory() as folder:
        os.environ[RUNTIME_FOLDER] = folder
        try:
            yield
        finally:
            del os.environ[RUNTIME_FOLDER]
            if given is not None:
                os.environ[RUNTIME_FOLDER] = given


def _viewer() -> list[str]:
    """Whether the page of `viscera view` is there."""
    from viscera.viewer import page

    try:
        page.files()
    except VisceraError as error:
        return [str(error)]
    return []


def _solves() -> list[str]:
    """Whether the compiled core solves a cube of a few cells."""
    from viscera import NeoHookean, Organ, mesh

    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
    try:
        organ = Organ(mesh(corners, [[0, 1, 2, 3], [1, 2, 3, 4]]), NeoHookean(young=1e3, poisson=0.3), fixed=[0, 1, 2])
        state = organ.solve(force={(4,): (0, 0, 1.0)})
    except VisceraError as error:
        return [f"the compiled core does not solve: {error}"]
    return [] if state.is_converged else [f"the compiled core does not solve: {state.message}"]


def _lines(path: str) -> list[str]:
    """The lines of a file that Linux has; none elsewhere."""
    try:
        return Path(path).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
