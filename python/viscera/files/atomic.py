"""Files that appear whole or not at all: written under another name in the same folder, then renamed.

Anything but a regular file (a device, a pipe) is written in place, in one piece; a symbolic link is followed.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import time

from viscera.errors import VisceraError
from viscera.quantity import path_of

Name = str | os.PathLike[str]

SCRATCH = re.compile(r"\.viscera-[0-9a-f]{16}\.part(\..*)?")
"""Names of scratch files. They are random, since processes in two containers may have the same number."""
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
"""Errors that only writing raises. They come without the name of the file."""
SHORT = re.compile(r"\d+ requested and \d+ written")
"""All that NumPy says, without a number of the system, when a file takes a part of an array."""
STALE = 3600.0
"""Seconds since its last change after which a scratch file belongs to a program that was killed."""


class NotWritten(VisceraError):
    """A file could not be written to its end; its place may be sound otherwise."""


def writable(path: Name) -> Path:
    """The path. It is an error if no file can be written there; call this before long work."""
    target = path_of(path, "the file to write")
    try:
        mode = os.stat(target).st_mode
    except FileNotFoundError:  # so far; where a link leads counts, not where it lies
        mode = stat.S_IFREG
    except OSError as error:
        raise VisceraError(f"{target}: no file can be written there ({error.strerror})") from error
    if stat.S_ISDIR(mode):
        raise VisceraError(f"{target} is a folder; name a file in it")
    is_in_place = _is_in_place(target)
    # A regular file, too, though renaming would replace it: who protects it means it to stay.
    if (is_in_place or target.exists()) and not os.access(target, os.W_OK):
        raise VisceraError(f"{target}: you may not write to it")
    if is_in_place:
        return target
    folder = Path(_real(target)).parent
    if not folder.is_dir():
        named = target.parent if not target.is_symlink() else folder
        raise VisceraError(f"{target}: the folder {str(named)!r} does not exist; create it first")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise VisceraError(f"{target}: you may not write to the folder {str(folder)!r}")
    return target


def followed(path: Path) -> Path:
    """The file that a symbolic link leads to, else the path itself: what belongs to a file is written beside it."""
    return Path(_real(path)) if path.is_symlink() else path


def made_folder(path: Name) -> Path:
    """The folder of that name, made where it is missing; it is an error if it cannot be. Call this before long work."""
    target = path_of(path, "the folder to write to")
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "a file has that name" if isinstance(error, FileExistsError) else error.strerror
        raise VisceraError(f"{target}: no folder can be made there ({reason})") from error
    return target


@contextmanager
def making(folder: Path) -> Iterator[None]:
    """A folder, made where it is missing; what was made, and is empty, vanishes when the block does not end well."""
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        made_folder(folder)
        yield
    except BaseException:
        with suppress(OSError):  # it was not made, or something else has come in
            for each in missing:
                each.rmdir()
        raise


def spare(read: Iterable[Name], written: Iterable[tuple[str, Name | None]]) -> None:
    """Raises `VisceraError` if a file to be written is one that is read, or is named twice.

    written: each file with the option that names it; None for what was not asked for.
    """
    sources, before = [Path(path) for path in read], list[tuple[str, Path]]()
    for option, path in written:
        if path is None:
            continue
        target = path_of(path, f"the file of {option}")
        if found := next((source for source in sources if _is_same(source, target)), None):
            raise VisceraError(f"{option} {target} would replace {str(found)!r}, which is read; name another file")
        if twice := next((other for other, earlier in before if _is_same(earlier, target)), None):
            raise VisceraError(f"{option} {target} would replace what {twice} writes; name another file")
        before.append((option, target))


@contextmanager
def replacing(path: Name) -> Iterator[Path]:
    """A scratch path to write to; it takes the place of `path` when the block ends well and vanishes when it does not.

    The suffix is kept, since writers choose the format by it. A reader of `path` sees the old file or the new one.
    Raises `NotWritten` if the scratch file cannot be written to its end; other errors of the block stay what they are.
    """
    target = writable(path)
    if _is_in_place(target):
        with tempfile.TemporaryDirectory() as folder:
            scratch = Path(folder, f"whole{target.suffix}")
            with _telling(target, scratch, tempfile.gettempdir()):
                yield scratch
            _pour(scratch, target)
        return
    whole = Path(_real(target))
    _sweep(whole.parent)
    scratch = whole.with_name(f".viscera-{secrets.token_hex(8)}.part{whole.suffix}")
    with _refusing(target):  # before the writer does, whose error would name the scratch file
        scratch.touch(exist_ok=False)
    try:
        with _telling(target, scratch, str(whole.parent)):
            yield scratch
        with _refusing(target):
            if whole.exists():
                shutil.copymode(whole, scratch)
            scratch.replace(whole)
    finally:
        scratch.unlink(missing_ok=True)


@contextmanager
def _refusing(target: Path) -> Iterator[None]:
    """An error of the system becomes one that names the file which was to be written."""
    try:
        yield
    except OSError as error:
        raise VisceraError(f"{target}: no file can be written there ({error.strerror})") from error


@contextmanager
def _telling(target: Path, scratch: Path, folder: str) -> Iterator[None]:
    """An error of writing the scratch file, in the folder, becomes one that names the file which was to be written."""
    try:
        yield
    except OSError as error:
        if not _is_of(scratch, error):
            raise
        fault = f"written ({error.strerror})" if error.strerror else f"written whole ({error})"
        advice = f"see that the folder {folder!r} has room, or name a file elsewhere"
        raise NotWritten(f"{target}: could not be {fault}; {advice}") from error


def _is_of(scratch: Path, error: OSError) -> bool:
    """Whether an error came of writing the scratch file. Another file that is read has a name, or another error."""
    if error.filename is not None:
        return error.filename in (scratch, str(scratch))
    return error.errno in FULL or (error.errno is None and SHORT.fullmatch(str(error)) is not None)


def _is_same(one: Path, other: Path) -> bool:
    """Whether two paths lead to one regular file, or would lead to a single new one; a device may serve many."""
    try:
        states = os.stat(one), os.stat(other)
    except OSError:
        return _real(one) == _real(other)
    return stat.S_ISREG(states[0].st_mode) and os.path.samestat(*states)


def _is_in_place(target: Path) -> bool:
    """Whether the path is a device, a pipe or a file that the process holds open (`/dev/stdout`)."""
    parent = _real(target.parent)
    if parent == "/dev" or parent.startswith("/proc/"):
        return True
    return target.exists() and not target.is_file()


def _real(path: Path) -> str:
    """Where the path leads, symbolic links followed."""
    try:
        return os.path.realpath(path)
    except FileNotFoundError as error:  # no other folder need exist
        raise VisceraError(f"{path}: the working folder was removed; change to one that exists") from error


def _pour(scratch: Path, target: Path) -> None:
    try:
        # Appended, never cut off: standard output may be a file that holds lines already.
        descriptor = os.open(target, os.O_WRONLY | os.O_APPEND)
        with scratch.open("rb") as whole, os.fdopen(descriptor, "wb") as out:
            shutil.copyfileobj(whole, out)
    except OSError as error:
        raise NotWritten(f"{target}: could not be written ({error.strerror})") from error


def _sweep(folder: Path) -> None:
    """Removes scratch files that killed programs have left."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if SCRATCH.fullmatch(entry.name):
                with suppress(OSError):  # another process may be as quick
                    if time() - entry.stat(follow_symlinks=False).st_mtime > STALE:
                        os.unlink(entry.path)
