"""Measure: a Newton iteration beside other codes, or what every law costs and what its reduced models are worth.

viscera bench newton --cells 1000 9000 60000 -o out/bench
viscera bench laws --against benchmarks/results/laws.json

`newton` solves one body with every code that is installed: FElupe, scikit-fem, NGSolve, CalculiX, and Viscera by four
solvers. Each runs in a process of its own on one thread; what is compared is processor time. `laws` fails (exit 1) if
something got worse since the run it is compared with.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from viscera import progress
from viscera.bench.machine import describe
from viscera.cli.output import DONE, FAILED, Outcome, Output, plain
from viscera.errors import VisceraError
from viscera.files.atomic import made_folder, replacing, writable
from viscera.quantity import path_of

QUESTIONS = ("newton", "laws")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera bench`."""
    parser.add_argument("question", choices=QUESTIONS, metavar="QUESTION", help=f"one of {', '.join(QUESTIONS)}")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for the table, the plot and the JSON")
    newton = parser.add_argument_group("newton")
    newton.add_argument("--cells", nargs="+", type=int, metavar="N", help="sizes of the body (default: 1000 9000)")
    newton.add_argument("--codes", nargs="+", metavar="NAME", help="such as 'felupe pardiso' (default: all)")
    newton.add_argument("--limit", type=float, metavar="SECONDS", help="stop a code after this time (default: 300)")
    laws = parser.add_argument_group("laws")
    laws.add_argument("--laws", nargs="+", metavar="NAME", help="such as NeoHookean (default: all)")
    laws.add_argument("--elements", nargs="+", metavar="NAME", help="such as P1 or 'P1 mean volume' (default: all)")
    laws.add_argument("--against", metavar="FILE", help="the JSON of an earlier run, for comparison")


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Measure, print the table, and write it where asked."""
    others = {"newton": ("laws", "elements", "against"), "laws": ("cells", "codes", "limit")}[args.question]
    wrong = next((name for name in others if getattr(args, name) is not None), None)
    if wrong:
        raise VisceraError(f"--{wrong} is no option of `viscera bench {args.question}`")
    if args.output is not None:  # before the work
        table = made_folder(args.output) / f"{args.question}.txt"
        output.spare([args.against], ("-o", writable(table)), ("-o", table.with_suffix(".json")))
    output.spare([args.against])
    return _newton(args, output) if args.question == "newton" else _laws(args, output)


def _newton(args: argparse.Namespace, output: Output) -> Outcome:
    from viscera.bench import newton

    given = {name: getattr(args, name) for name in ("cells", "codes", "limit") if getattr(args, name) is not None}
    head = describe(1)

    def keep(rows: list[Any]) -> None:  # after every row: a run of many minutes may be interrupted
        _write(args.output, "newton", f"{head}\n{newton.table(rows)}", newton.facts(rows))

    with progress.bar(output.is_quiet) as bar:
        rows = newton.run(**given, progress=bar, keep=keep)
    if args.output is not None and any(not row.fault for row in rows):
        with replacing(Path(args.output) / "newton.png") as scratch:
            newton.plot(rows).savefig(scratch, format="png", dpi=150)
    output.say(f"{head}\n{newton.table(rows)}")
    own = [row for row in rows if row.code.startswith("viscera") and row.fault]
    return Outcome("failed" if own else "measured", FAILED if own else DONE, newton.facts(rows))


def _laws(args: argparse.Namespace, output: Output) -> Outcome:
    from viscera.bench import laws

    before = None if args.against is None else laws.rows_of(_read(args.against), args.against)
    wanted = {f"{law}, {element}" for law, element in laws.chosen(args.laws, args.elements)}
    if before is not None and not wanted & before.keys():
        raise VisceraError(f"{args.against} has none of the laws and elements asked for: nothing could be compared")
    head = describe()

    def keep(rows: list[Any]) -> None:
        _write(args.output, "laws", f"{head}\n{laws.table(rows)}", laws.facts(rows))

    with progress.bar(output.is_quiet) as bar:
        rows = laws.run(args.laws, args.elements, progress=bar, keep=keep)
    facts = laws.facts(rows)
    output.say(f"{head}\n{laws.table(rows)}")
    if before is None:
        return Outcome("measured", DONE, facts)
    told = laws.worse(rows, before)
    for cost, words in laws.COSTS.items():
        output.say(f"{words}: {laws.speed(rows, before, cost):.2f} times that of {args.against}, in the median")
    output.say_all(told or ["nothing got worse"])
    return Outcome("worse" if told else "no worse", FAILED if told else DONE, {**facts, "worse": told})


def _read(path: str) -> Any:
    file = path_of(path, "--against")
    if not file.is_file():
        raise VisceraError(f"{path}: {'is a folder, not a JSON file' if file.is_dir() else 'no such file'}")
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise VisceraError(f"{path} is no JSON file: {error}") from error


def _write(folder: str | None, name: str, text: str, facts: dict[str, Any]) -> None:
    """Table and JSON, in the folder if there is one."""
    if folder is None:
        return
    with replacing(Path(folder) / f"{name}.txt") as scratch:
        scratch.write_text(text + "\n", encoding="utf-8")
    with replacing(Path(folder) / f"{name}.json") as scratch:
        scratch.write_text(json.dumps(plain(facts), indent=1) + "\n", encoding="utf-8")
