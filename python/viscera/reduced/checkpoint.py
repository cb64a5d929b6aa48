"""Finished batches of a reduction, kept in a file beside the output, from which interrupted or killed work continues.

The file holds a line that names the case, then one record for each batch: length and CRC-32, both as 8 bytes, little-
endian, and the batch as the core wrote it. Records are appended and synchronised with the disk, so only the batches in
progress are lost; a record that a kill cut short ends the file.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import stat
import struct
import warnings
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np

from viscera import _core
from viscera.errors import VisceraError
from viscera.quantity import path_of
from viscera.reduced.regions import positions_of

RECORD = struct.Struct("<QQ")
SUFFIX = ".batches"
KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}
"""What is no regular file, by its type."""


class Checkpoint:
    """Where a reduction keeps its finished batches: a file that exists until the model is saved.

    say: receives a sentence if batches of an earlier run are used, or are ignored because they belong to another case.
    """

    def __init__(self, path: str | os.PathLike[str], say: Callable[[str], None] = warnings.warn) -> None:
        self.path = path_of(path, "the file of finished batches")
        self.say = say

    @contextmanager
    def batches(self, case: str) -> Iterator[Batches]:
        """The batches of a case, by its fingerprint; the file stays until `Batches.remove`.

        Where the block does not end well and nothing was finished, what this call made goes again, and an empty file
        that was there is left empty. Raises `VisceraError` if the file cannot be written, is no file of batches, or is
        in use; before anything is opened if there is no regular file of this name, but a device, a pipe or a folder.
        """
        try:
            is_new = not _is_there(self.path)
            file = self.path.open("a+b")
        except OSError as error:
            raise _refusal(self.path, error) from None
        with _closing(file):
            _lock(file, self.path)
            was_empty, batches = os.fstat(file.fileno()).st_size == 0, None
            try:
                batches = self._begun(file, case)
                yield batches
            except BaseException:
                if batches is None or batches.count == 0:
                    if was_empty and not is_new:
                        _empty(file)
                    elif was_empty or batches is not None:
                        _unlink(self.path)
                raise

    def _begun(self, file: IO[bytes], case: str) -> Batches:
        """What the file holds of the case."""
        try:
            return Batches(file, self.path, case, self.say)
        except OSError as error:
            raise _refusal(self.path, error) from None


class Batches:
    """The records of one file, as the core reads and writes them."""

    def __init__(self, file: IO[bytes], path: Path, case: str, say: Callable[[str], None]) -> None:
        self._file, self._path, self._case, self._say = file, path, case, say
        self._found = self._read()
        self.count = len(self._found)

    def finished(self) -> list[bytes]:
        """The batches of the earlier run."""
        found, self._found = self._found, []
        return found

    def keep(self, batch: bytes) -> None:
        """Appends a batch; it is on the disk when this returns."""
        try:
            self._file.write(RECORD.pack(len(batch), zlib.crc32(batch)) + batch)
            self._synchronise()
        except OSError as error:
            raise VisceraError(f"{self._path}: a finished batch could not be kept ({error.strerror})") from None
        self.count += 1

    def remove(self) -> None:
        """Removes the file, once the model is on the disk; one of another case, or in use again, stays."""
        with contextlib.suppress(OSError, VisceraError):
            if _is_there(self._path):
                with self._path.open("r+b") as file:
                    _lock(file, self._path)
                    if _case_of(file, self._path) == self._case:
                        file.truncate(0)
                        _unlink(self._path)

    def _read(self) -> list[bytes]:
        self._file.seek(0)
        found = _case_of(self._file, self._path)
        if found is None:
            self._begin()
            return []
        if found != self._case:
            self._say(f"{self._path}: the batches there are of another case or version; starting again")
            self._begin()
            return []
        batches, end = dict[tuple[int, ...], bytes](), self._file.tell()
        size = self._path.stat().st_size
        while len(record := self._file.read(RECORD.size)) == RECORD.size:
            length, checksum = RECORD.unpack(record)
            batch = self._file.read(length) if length <= size else b""
            if len(batch) < length or zlib.crc32(batch) != checksum:
                break
            if positions := positions_of(batch):  # the core ignores what is no batch, and a second one of its positions
                batches[tuple(positions)] = batch
            end = self._file.tell()
        self._file.truncate(end)
        if batches:
            counted = "1 finished batch" if len(batches) == 1 else f"{len(batches)} finished batches"
            self._say(f"continuing after {counted}, from {self._path}")
        return list(batches.values())

    def _begin(self) -> None:
        self._file.truncate(0)
        self._file.write(json.dumps({"viscera batches": self._case}).encode() + b"\n")
        self._synchronise()

    def _synchronise(self) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())


def fingerprint(arrays: Iterable[Any], settings: dict[str, Any]) -> str:
    """A hash of all that the batches of a reduction depend on, and of the version of the core."""
    digest = hashlib.sha256(json.dumps([_core.__version__, settings], sort_keys=True).encode())
    for array in arrays:
        values = np.ascontiguousarray(array)
        digest.update(f"{values.dtype.str}{values.shape}".encode())
        digest.update(values.tobytes())
    return digest.hexdigest()


def _is_there(path: Path) -> bool:
    """Whether there is a file of this name. A device may act and a pipe may wait when it is opened, so none is."""
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return False
    if not stat.S_ISREG(mode):
        kind = KINDS.get(stat.S_IFMT(mode), "no regular file")
        raise VisceraError(f"{path} is {kind}, and finished batches need a file of their own; choose another name")
    return True


def _case_of(file: IO[bytes], path: Path) -> str | None:
    """The case that a file of batches is of, from its first line; none if it is empty."""
    head = file.readline(1000)
    if not head:
        return None
    try:
        return str(json.loads(head)["viscera batches"])
    except (ValueError, KeyError, TypeError, RecursionError):
        raise VisceraError(f"{path} is no file of finished batches; move it away, or choose another output") from None


def _refusal(path: Path, error: OSError) -> VisceraError:
    return VisceraError(f"{path}: batches cannot be kept there ({error.strerror})")


@contextmanager
def _closing(file: IO[bytes]) -> Iterator[None]:
    """Closes a file. What counts is on the disk by then, and what had no room has been told."""
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            file.close()


def _unlink(path: Path) -> None:
    with contextlib.suppress(OSError):  # a system that keeps open files keeps an empty one
        os.unlink(os.path.realpath(path))  # a link to it is the user's


def _empty(file: IO[bytes]) -> None:
    with contextlib.suppress(OSError):
        os.ftruncate(file.fileno(), 0)


def _lock(file: IO[bytes], path: Path) -> None:
    """One reduction at a time, where the system has locks of files."""
    with contextlib.suppress(ImportError):
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise VisceraError(
                f"{path} is in use: another reduction writes it. Wait for that, or choose another output"
            ) from None
