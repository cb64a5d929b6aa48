"""The output of a command: text for people, JSON for machines, and an exit code."""

from __future__ import annotations

import json
import logging
import math
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stderr, suppress
from dataclasses import dataclass, field
from typing import Any, TextIO

import numpy as np

from viscera.cases.case import Case
from viscera.errors import VisceraError
from viscera.files.atomic import Name, NotWritten, replacing, spare, writable
from viscera.organ import Organ

DONE, FAILED, BAD_INPUT, INTERRUPTED, NO_READER = 0, 1, 2, 130, 141
"""Exit codes. The last is what a shell reports of a program that a closed pipe ended: 128 and the signal's number."""


class ReaderGone(Exception):
    """Nobody reads what is printed any more: the pipe behind standard output or standard error is closed."""


@dataclass(frozen=True)
class Outcome:
    """How a command ended: a word, the exit code, and the facts of its JSON."""

    status: str
    code: int = DONE
    facts: dict[str, Any] = field(default_factory=dict)


class Output:
    """Text goes to standard output, or to standard error where that carries the JSON; nowhere when quiet."""

    def __init__(self, json_path: str | None, *, is_quiet: bool) -> None:
        self.json_path = json_path
        self.is_quiet = is_quiet

    def check(self) -> None:
        """Raises `VisceraError` if the JSON or the text could not be written: asked before the work."""
        if self.json_path == "-":
            _require_open("write the JSON to a file")
        elif not self.is_quiet:
            _require_open("open it, or print nothing with --quiet")
        if self.json_path not in (None, "-"):
            writable(self.json_path)

    def spare(self, read: Iterable[Name | None], *written: tuple[str, Name | None]) -> None:
        """Raises `VisceraError` if what a command writes would replace what it reads: asked before the work.

        read: the files that the command reads; written: each file that it writes, with the option that names it.
        """
        sources = [path for path in read if path is not None]
        spare(sources, written)
        json_path = None if self.json_path == "-" else self.json_path
        try:
            spare(sources, [*written, ("--json", json_path)])
            _spare_what_is_no_json(json_path)
        except VisceraError:
            self.json_path = None  # the error itself would be written there
            raise

    def say(self, text: str) -> None:
        """A line for people."""
        if not self.is_quiet:
            put(text + "\n", is_error=self.json_path == "-")

    def say_all(self, messages: Iterable[str]) -> None:
        """Lines for people, such as what was repaired in a mesh."""
        for message in messages:
            self.say(message)

    @contextmanager
    def saying_messages(self) -> Iterator[None]:
        """While this lasts, what meshes keep among their messages is not logged: the command says it afterwards.

        A quiet command says nothing, so the log has it.
        """
        log = logging.getLogger("viscera.mesh")

        def is_logged(_: logging.LogRecord) -> bool:
            return self.is_quiet

        log.addFilter(is_logged)
        try:
            yield
        finally:
            log.removeFilter(is_logged)

    def organ(self, case: Case) -> Organ:
        """The organ of a case, with what its mesh has to say."""
        with self.saying_messages():
            organ = case.organ()
        self.say_all(organ.mesh.messages)
        return organ

    def write(self, outcome: Outcome, seconds: float) -> None:
        """The JSON of an outcome, where it was asked for."""
        if self.json_path is None:
            return
        facts = {"status": outcome.status, "seconds": round(seconds, 3), **outcome.facts}
        text = json.dumps(plain(facts), indent=1, allow_nan=False) + "\n"
        if self.json_path == "-":
            put(text)
            return
        with replacing(self.json_path) as scratch:
            scratch.write_text(text, encoding="utf-8")


def _spare_what_is_no_json(path: str | None) -> None:
    """What a command reads may not be known before a case file is read, and that may fail."""
    if path is None or not os.path.isfile(path):
        return
    try:
        with open(path, "rb") as file:
            begins = file.read(64).lstrip()
    except OSError as error:
        raise VisceraError(
            f"--json {path} would replace {path!r}, which cannot be read ({error.strerror}); name another file"
        ) from error
    if begins and not begins.startswith(b"{"):
        raise VisceraError(f"--json {path} would replace {path!r}, which holds no JSON; name another file")


def _require_open(advice: str) -> None:
    """Raises `VisceraError` with the advice if standard output is closed: Python then has no stream for it."""
    if sys.stdout is None:
        raise VisceraError(f"standard output: could not be written (it is closed); {advice}")


def iterations(count: int) -> str:
    """A number of iterations in words."""
    return "1 iteration" if count == 1 else f"{count} iterations"


@contextmanager
def standard_error() -> Iterator[None]:
    """While this lasts, what is written to a closed standard error is dropped, and does not fail."""
    if sys.stderr is not None:
        yield
        return
    with open(os.devnull, "w", encoding="utf-8") as nowhere, redirect_stderr(nowhere):
        yield


def put(text: str, *, is_error: bool = False) -> None:
    """Writes to standard output or standard error at once; raises `ReaderGone` or `NotWritten` if it cannot.

    What the stream's encoding has no sign for, such as a letter of a file's name, is escaped: `\\u043b`.
    """
    if not is_error:
        _require_open("open it")
    stream, name = (sys.stderr, "standard error") if is_error else (sys.stdout, "standard output")
    try:
        _write(stream, text)
        stream.flush()
    except BrokenPipeError:
        _abandon(stream)
        raise ReaderGone from None
    except OSError as error:
        _abandon(stream)
        raise NotWritten(f"{name}: could not be written ({error.strerror})") from error


def _write(stream: TextIO, text: str) -> None:
    """A stream that can spell the text gets it as it is, also where that is by an error handler of the user's."""
    try:
        stream.write(text)
    except UnicodeEncodeError as error:  # nothing of the text has been written
        stream.write(text.encode(error.encoding, "backslashreplace").decode(error.encoding))


def _abandon(stream: TextIO) -> None:
    """What is left in the buffer goes nowhere: Python would try it again as it ends, and print that error too."""
    with suppress(OSError, ValueError):  # a stream without a file, as in a notebook
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def plain(value: Any) -> Any:
    """NumPy values as JSON knows them; a number that is not finite becomes null."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
