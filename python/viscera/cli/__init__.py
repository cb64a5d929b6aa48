"""The `viscera` program: one file here for each command, each a thin layer over the Python API.

Exit codes: 0 done; 1 did not converge, or a check failed; 2 bad input or a full disk, one sentence on standard error;
130 interrupted; 141 nobody reads what is printed.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from itertools import groupby
from textwrap import wrap
from time import perf_counter
from typing import Any, NoReturn

from viscera import _core, startup
from viscera.cli import (
    bench,
    check,
    compare,
    completion,
    demo,
    doctor,
    fit,
    inspect,
    interrupt,
    mesh,
    reduce,
    register,
    solve,
    study,
    touch,
    view,
    warp,
)
from viscera.cli.output import BAD_INPUT, INTERRUPTED, NO_READER, Outcome, Output, ReaderGone, put, standard_error
from viscera.errors import VisceraError
from viscera.files.atomic import NotWritten
from viscera.output.backend import without_window

VERBS = (
    demo, inspect, mesh, fit, solve, compare, reduce, check, touch, view, register, warp, study, bench, doctor,
    completion,
)  # fmt: skip
NEGATIVE_NUMBER = re.compile(r"-\d*[.,]?\d+([eE][-+]?\d+)?\s*[a-z%]*")


class _Misread(SystemExit):
    """A command line that is wrong; what is wrong with it has been said."""

    def __init__(self, message: str) -> None:
        super().__init__(BAD_INPUT)
        self.message = message


class _Parser(argparse.ArgumentParser):
    """Like its parent, but the error of a wrong command line is one sentence, and help that nobody reads is none."""

    def error(self, message: str) -> NoReturn:
        message = f"{message}; see {self.prog} --help"
        self._print_message(f"{self.prog}: {message}\n", sys.stderr)
        raise _Misread(message)

    def _print_message(self, message: str, file: Any = None) -> None:
        put(message, is_error=file is not sys.stdout)


class _Wrapped(argparse.HelpFormatter):
    """Wraps every paragraph of a description to the terminal; lines that are commands stay as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        pieces: list[str] = []
        for is_whole, group in groupby(text.strip().splitlines(), lambda line: not line or line.startswith("viscera ")):
            lines = list(group)
            words = " ".join(lines)
            pieces += lines if is_whole else wrap(words, width, break_long_words=False, break_on_hyphens=False)
        return "\n".join(indent + piece for piece in pieces)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code."""
    with standard_error():
        try:
            return _run(sys.argv[1:] if argv is None else list(argv))
        except ReaderGone:
            return NO_READER
        except VisceraError as error:  # help, or a script for the shell, on a full device
            return _refused("", error)


def _refused(verb: str, error: object) -> int:
    """Says what is wrong in one sentence; the exit code."""
    with suppress(VisceraError):  # standard error is full, too
        put(f"viscera{f' {verb}' if verb else ''}: {error}\n", is_error=True)
    return BAD_INPUT


def _run(words: list[str]) -> int:
    began = perf_counter()
    # argparse takes "-1e-3" for an option; a leading blank makes it the number it is.
    words = [f" {word}" if NEGATIVE_NUMBER.fullmatch(word) else word for word in words]
    try:
        args = command_line().parse_args(words)
    except _Misread as error:
        _tell_of(error, words, perf_counter() - began)
        raise
    output = Output(args.json, is_quiet=args.quiet)
    try:
        output.check()
    except VisceraError as error:
        return _refused(args.verb, error)
    try:
        startup.handle_interrupts()
        with interrupt.heard(), without_window():
            outcome: Outcome = args.run(args, output)
    except KeyboardInterrupt as stop:
        message = str(stop) or "interrupted; nothing was left half-written"
        outcome = Outcome("interrupted", INTERRUPTED, {"message": message})
    except (ValueError, OSError) as error:
        status = "not written" if isinstance(error, NotWritten) else "bad input"
        outcome = Outcome(status, BAD_INPUT, {"message": " ".join(str(error).split())})
    if outcome.code in {BAD_INPUT, INTERRUPTED}:
        _refused(args.verb, outcome.facts["message"])
    try:
        output.write(outcome, perf_counter() - began)
    except (ValueError, OSError) as error:
        return _refused(args.verb, error)
    return outcome.code


def _tell_of(error: _Misread, words: list[str], seconds: float) -> None:
    """The JSON of a command line that is wrong, where its words name a file for it that is no other one of theirs."""
    finder = argparse.ArgumentParser(add_help=False, exit_on_error=False)
    finder.add_argument("--json")
    with suppress(argparse.ArgumentError, ValueError, OSError):  # what is wrong first has been said
        found, others = finder.parse_known_args(words)
        output = Output(found.json, is_quiet=True)
        output.check()
        output.spare(part for word in others for part in (word, word.partition("=")[2]) if os.path.isfile(part))
        output.write(Outcome("bad input", BAD_INPUT, {"message": error.message}), seconds)


def command_line() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = _Parser(prog="viscera", description="Organs you can touch: hyperelastic soft tissue, reduced off-line.")
    parser.add_argument("--version", action="version", version=f"viscera {_core.__version__}")
    verbs = parser.add_subparsers(dest="verb", metavar="COMMAND", required=True)
    for verb in VERBS:
        name = verb.__name__.rpartition(".")[2]
        summary = (verb.__doc__ or "").strip().partition("\n")[0]
        options = verbs.add_parser(name, help=summary, description=verb.__doc__, formatter_class=_Wrapped)
        verb.add_arguments(options)
        options.add_argument("--json", metavar="FILE", help="write the result there for machines; - is standard output")
        options.add_argument("--quiet", action="store_true", help="no text and no progress bar")
        options.set_defaults(run=verb.run)
    return parser
