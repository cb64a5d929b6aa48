"""Runs the marked programs of README.md and docs/, and writes what they really print below each of them.

A marked program is a fenced `sh` or `python` block between `<!-- run -->` and `<!-- output -->`; everything from there
to `<!-- end -->` is replaced. A page's programs share one scratch folder, where `benchmarks`, `examples` and `scripts`
are the repository's, and its Python blocks one namespace. A picture that a page shows from `docs/` is the one of that
name which a program of the page wrote.

    python scripts/pages.py [PAGE ...]
    python scripts/pages.py --kept [PAGE ...]     # only programs that show kept results, which takes no time
    python scripts/pages.py --check [PAGE ...]    # writes nothing; names what is shown but not printed

What a page shows is compared with what its program prints: words, lines, and numbers to the digits that another machine
keeps. Times are not compared, which are numbers with a unit of time and those in a table under a line that begins with
`time`; nor is any number after `<!-- run, varying -->`, where the machine decides. The tests leave out what stands
after `<!-- run, long -->`. Kept results are compared to the letter.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
MARKED = re.compile(
    r"(<!-- run(?P<marks>(?:, (?:varying|long))*) -->\n```(?P<language>sh|python)\n(?P<code>.*?)```\n<!-- output -->\n)"
    r"(?P<output>.*?)(?P<end><!-- end -->)",
    re.DOTALL,
)
ANY = re.compile(rf"{MARKED.pattern}|(?<=\n)```python\n(?P<plain>.*?)```(?=\n|$)", re.DOTALL)
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
TIME = re.compile(r"(s|ms|us|seconds)\b")
KEPT = "benchmarks/results/"
SAME = 1e-4
"""Relative difference of numbers that rounding on another machine may cause, in what has converged."""
NOISE = 1e-9
"""Absolute one: what is zero but for rounding, in the units that pages use."""
PICTURE = re.compile(r"!\[[^\]]*\]\((?:docs/)?([^)/]+\.png)\)")


def programs(text: str, language: str) -> list[str]:
    """The fenced blocks of one language, marked or not, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def render(text: str, run: Callable[[str, str], str], *, only_kept: bool = False) -> str:
    """The text with the output of every marked program renewed by `run(language, code)`."""

    def with_output(match: re.Match[str]) -> str:
        if only_kept and KEPT not in match["code"]:
            return match[0]
        output = run(match["language"], match["code"]).rstrip()
        return f"{match[1]}```text\n{output}\n```\n{match['end']}"

    return MARKED.sub(with_output, text)


def untrue(text: str, run: Callable[[str, str], str], *, with_long: bool) -> list[str]:
    """What the marked programs of a page no longer print; its other Python programs are run between them."""
    found = []
    for match in ANY.finditer(text):
        if match["plain"] is not None:
            run("python", match["plain"])
        elif with_long or "long" not in match["marks"]:
            shown = match["output"].strip().removeprefix("```text\n").removesuffix("```")
            printed = run(match["language"], match["code"])
            if KEPT in match["code"]:
                found += [] if shown.rstrip() == printed.rstrip() else [f"not as kept: {match['code'].rstrip()}"]
            else:
                found += differences(shown, printed, numbers="varying" not in match["marks"])
    return found


def differences(shown: str, printed: str, *, numbers: bool = True) -> list[str]:
    """The lines of two outputs that do not say the same, blanks aside; `numbers` compares these as well."""
    ours, theirs = shown.rstrip().splitlines(), printed.rstrip().splitlines()
    if len(ours) != len(theirs):
        return [f"shown are {len(ours)} lines, printed {len(theirs)}"]
    found, is_timed = [], False
    for a, b in zip(ours, theirs, strict=True):
        is_timed = a.startswith("time") or (is_timed and "  " in a)  # a table has blanks between its columns
        if not _is_same(a, b, numbers and not is_timed):
            found.append(f"shown: {a}\nprinted: {b}")
    return found


def _is_same(shown: str, printed: str, numbers: bool) -> bool:
    words = [" ".join(NUMBER.sub(" # ", line).split()) for line in (shown, printed)]
    if words[0] != words[1]:
        return False
    if not numbers:
        return True
    pairs = zip(NUMBER.finditer(shown), NUMBER.finditer(printed), strict=True)
    return all(TIME.match(shown[a.end() :].lstrip()) or _is_close(a[0], b[0]) for a, b in pairs)


def _is_close(shown: str, printed: str) -> bool:
    """Equal but for one in the last digit of a rounded number; whole numbers are counts, and exact unless large."""
    a, b = float(shown), float(printed)
    return abs(a - b) <= _last_digit(shown) + SAME * abs(b) + NOISE


def _last_digit(number: str) -> float:
    mantissa, _, exponent = number.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 1.01 * 10.0 ** (int(exponent or 0) - decimals) if decimals or exponent else 0.0


def runner(folder: Path) -> Callable[[str, str], str]:
    """Runs shell and Python programs in a folder; what they print comes back, a failure raises."""
    namespace: dict[str, object] = {"__name__": "page"}
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    plain = os.environ | {"PATH": path, "COLUMNS": "100", "NO_COLOR": "1", "MPLBACKEND": "Agg"}

    def run(language: str, code: str) -> str:
        print(code.rstrip(), file=sys.stderr)
        if language == "sh":
            shell = ["bash", "-euo", "pipefail", "-c", code]
            done = subprocess.run(shell, cwd=folder, env=plain, stdout=subprocess.PIPE, text=True)
            if done.returncode != 0:
                sys.exit(f"{done.stdout}\nthe program ended with {done.returncode}; the page was left as it is")
            return done.stdout
        printed = io.StringIO()
        home = Path.cwd()
        os.chdir(folder)
        try:
            with contextlib.redirect_stdout(printed):
                exec(compile(code, "page", "exec"), namespace)
        finally:
            os.chdir(home)
        return printed.getvalue()

    return run


def furnish(folder: Path) -> Callable[[str, str], str]:
    """The runner of a page's programs in a scratch folder, where they find what is the repository's."""
    for name in ("benchmarks", "examples", "scripts"):
        (folder / name).symlink_to(ROOT / name)
    return runner(folder)


def renew(page: Path, *, only_kept: bool = False) -> None:
    """Run a page's marked programs and rewrite it, and its pictures, with what they gave."""
    text = page.read_text(encoding="utf-8")
    if not MARKED.search(text):
        return
    with tempfile.TemporaryDirectory() as scratch:
        text = render(text, furnish(Path(scratch)), only_kept=only_kept)
        if only_kept:
            page.write_text(text, encoding="utf-8")
            return
        for name in PICTURE.findall(text):
            drawn = next(Path(scratch).rglob(name), None)
            if drawn is None:
                sys.exit(f"{page.name} shows {name}, but none of its programs wrote it")
            shutil.copyfile(drawn, ROOT / "docs" / name)
        page.write_text(text, encoding="utf-8")


def check(page: Path) -> list[str]:
    """What a page shows and its programs do not print."""
    with tempfile.TemporaryDirectory() as scratch:
        found = untrue(page.read_text(encoding="utf-8"), furnish(Path(scratch)), with_long=True)
    return [f"{page.name}: {line}" for line in found]


if __name__ == "__main__":
    options = {word for word in sys.argv[1:] if word.startswith("--")}
    named = [Path(word) for word in sys.argv[1:] if word not in options]
    if options - {"--kept", "--check"}:
        sys.exit(__doc__)
    if "--check" in options:
        sys.exit("\n".join(line for page in named or PAGES for line in check(page)) or None)
    for page in named or PAGES:
        renew(page, only_kept="--kept" in options)
