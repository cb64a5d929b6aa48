"""Print a script with which the shell completes commands, options and files.

viscera completion bash > ~/.local/share/bash-completion/completions/viscera
viscera completion zsh > ~/.zfunc/_viscera
"""

from __future__ import annotations

import argparse
from pathlib import Path

from viscera.cli.output import Outcome, Output, put

SHELLS = ("bash", "zsh")
FILES = {"FILE", "MESH", "LABELS", "SURFACE", "IMAGE", "CLOUD"}
"""The words for files, beside those that have an ending; `DIR` is a folder."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera completion`."""
    parser.add_argument("shell", choices=SHELLS, help=f"one of {', '.join(SHELLS)}")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Print the script."""
    import shtab

    from viscera.cli import command_line

    parser = command_line()
    _mark_files(parser)
    script = shtab.complete(parser, shell=args.shell)
    if args.json != "-":
        put(script + "\n")
    return Outcome("printed", facts={"shell": args.shell, "script": script})


def _mark_files(parser: argparse.ArgumentParser) -> None:
    """Names of files are completed where an option takes one."""
    import shtab

    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for verb in action.choices.values():
                _mark_files(verb)
        elif isinstance(action.metavar, str) and is_file(action.metavar):
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        elif action.metavar == "DIR":
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]


def is_file(word: str) -> bool:
    """Whether a file may be given for this word, one of several that a bar parts: `organ.viscera|CASE.toml`."""
    return any(each in FILES or Path(each).suffix for each in word.split("|"))
