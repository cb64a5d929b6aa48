"""The C interface for Python programs that have no `viscera` package: ctypes and NumPy alone.

Arrays are float64 in the frame of the mesh, in metres and newtons; see viscera.h for what the calls promise.
"""

from __future__ import annotations

import ctypes as c
import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

ABI_VERSION = 3
OK, BEYOND_DEPTH, ERROR_TOO_LARGE, OFF_SURFACE, STALE = 0, 1, 2, 3, 9

Vector = c.c_double * 3


class Info(c.Structure):
    _fields_ = [
        *[(name, c.c_uint64) for name in ("points", "surface_nodes", "surface_triangles", "positions")],
        *[(name, c.c_double) for name in ("radius", "depth", "edge_length")],
    ]


class Answer(c.Structure):
    _fields_ = [
        ("force", Vector),
        ("stiffness", c.c_double * 9),
        ("error_estimate", c.c_double),
        ("shape_error_estimate", c.c_double),
        ("contact_point", Vector),
    ]


class GuardState(c.Structure):
    _fields_ = [
        *[(name, c.c_double) for name in ("force_limit", "rate_limit", "watchdog", "fade")],
        *[(name, Vector) for name in ("force", "target")],
        *[(name, c.c_double) for name in ("age", "fade_rate", "energy_limit", "damping", "energy")],
    ]


def load_library(path: str | os.PathLike[str]) -> c.CDLL:
    """The shared library, with the types of what is called here."""
    library = c.CDLL(os.fspath(path))
    handle, size, vector, double = c.c_void_p, c.c_size_t, Vector, c.c_double
    floats, integers, pointer = c.POINTER(c.c_float), c.POINTER(c.c_uint32), c.POINTER
    signatures = {
        "viscera_abi_version": [],
        "viscera_load_file": [c.c_char_p, pointer(handle), c.c_char_p, size],
        "viscera_free": [handle],
        "viscera_info": [handle, pointer(Info)],
        "viscera_locate": [handle, vector, vector, pointer(double)],
        "viscera_evaluate": [handle, vector, vector, pointer(Answer)],
        "viscera_workspace_size": [handle],
        "viscera_surface": [handle, vector, vector, floats, size, floats, size],
        "viscera_surface_topology": [handle, integers, size, integers, size],
        "viscera_guard_init": [pointer(GuardState), double, double, double, double],
        "viscera_guard_keep_passive": [pointer(GuardState), double, double],
        "viscera_guard_step_moved": [pointer(GuardState), vector, c.c_int32, vector, double, vector],
    }
    for name, arguments in signatures.items():
        getattr(library, name).argtypes = arguments
    library.viscera_free.restype = None
    library.viscera_workspace_size.restype = size
    if library.viscera_abi_version() != ABI_VERSION:
        raise OSError(f"{path} has interface version {library.viscera_abi_version()}, this file {ABI_VERSION}")
    return library


def vector(values: ArrayLike) -> c.Array[c.c_double]:
    return Vector(*np.asarray(values, dtype=float).tolist())


class Organ:
    """A model file, and the memory it is drawn into."""

    def __init__(self, library: c.CDLL, path: str | os.PathLike[str]) -> None:
        self.library, self.handle, self.info = library, c.c_void_p(), Info()
        message = c.create_string_buffer(256)
        if library.viscera_load_file(os.fsencode(Path(path)), self.handle, message, len(message)) != OK:
            raise ValueError(message.value.decode())
        library.viscera_info(self.handle, self.info)
        self.workspace = np.zeros(library.viscera_workspace_size(self.handle), np.float32)
        self.positions = np.zeros((self.info.surface_nodes, 3), np.float32)
        self.triangles = np.zeros((self.info.surface_triangles, 3), np.uint32)
        rows = self.triangles.ctypes.data_as(c.POINTER(c.c_uint32))
        library.viscera_surface_topology(self.handle, rows, self.triangles.size, None, 0)
        self.draw(np.zeros(3), np.zeros(3))

    def close(self) -> None:
        self.library.viscera_free(self.handle)
        self.handle = c.c_void_p()

    def locate(self, point: ArrayLike) -> tuple[NDArray[np.float64], float]:
        """The closest touchable point (3,) [m] and its distance [m]."""
        contact, distance = Vector(), c.c_double()
        if self.library.viscera_locate(self.handle, vector(point), contact, distance) != OK:
            raise ValueError(f"no point of the surface is closest to {point!r}")
        return np.array(contact), distance.value

    def touch(self, point: ArrayLike, displacement: ArrayLike) -> tuple[int, Answer]:
        """The status and the answer to a touch."""
        answer = Answer()
        return self.library.viscera_evaluate(self.handle, vector(point), vector(displacement), answer), answer

    def draw(self, point: ArrayLike, displacement: ArrayLike) -> NDArray[np.float32]:
        """Positions (surface nodes, 3) [m] of the deformed surface."""
        floats = c.POINTER(c.c_float)
        work, out = self.workspace, self.positions
        memory = [work.ctypes.data_as(floats), work.size, out.ctypes.data_as(floats), out.size]
        self.library.viscera_surface(self.handle, vector(point), vector(displacement), *memory)
        return out


class Guard:
    """Limits on the force and its rate, a watchdog, and passivity."""

    def __init__(self, library: c.CDLL, force_limit: float, rate_limit: float, watchdog: float, fade: float) -> None:
        self.library, self.state = library, GuardState()
        if library.viscera_guard_init(self.state, force_limit, rate_limit, watchdog, fade) != OK:
            settings = f"{force_limit} N, {rate_limit} N/s, {watchdog} s and {fade} s"
            raise ValueError(f"a guard with {settings}; all four must be positive")

    def keep_passive(self, energy_limit: float, damping: float) -> None:
        if self.library.viscera_guard_keep_passive(self.state, energy_limit, damping) != OK:
            raise ValueError(f"an energy limit of {energy_limit} J with a damping of {damping} N s/m is out of range")

    def step(self, force: ArrayLike, status: int, moved: ArrayLike, dt: float) -> NDArray[np.float64]:
        """The force (3,) [N] to give out, `dt` seconds after the last."""
        out = Vector()
        self.library.viscera_guard_step_moved(self.state, vector(force), status, vector(moved), dt, out)
        return np.array(out)
