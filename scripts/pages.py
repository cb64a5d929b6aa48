"""Runs the marked programs of README.md and docs/, and writes what they really print below each of them.

A marked program is a fenced `sh` or `python` block between `<!-- run -->` and `<!-- output -->`; everything from there
to `<!-- end -->` is replaced. A page's programs share one scratch folder, where `benchmarks`, `examples` and `scripts`
are the repository's, and its Python blocks one namespace. A picture that a page shows from `docs/` is the one of that
name which a program of the page wrote.

    python scripts/pages.py [PAGE ...]
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
    r"(<!-- run -->\n```(?P<language>sh|python)\n(?P<code>.*?)```\n<!-- output -->\n)"
    r"(?P<output>.*?)(?P<end><!-- end -->)",
    re.DOTALL,
)
PICTURE = re.compile(r"!\[[^\]]*\]\((?:docs/)?([^)/]+\.png)\)")


def programs(text: str, language: str) -> list[str]:
    """The fenced blocks of one language, marked or not, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def render(text: str, run: Callable[[str, str], str]) -> str:
    """The text with the output of every marked program renewed by `run(language, code)`."""

    def with_output(match: re.Match[str]) -> str:
        output = run(match["language"], match["code"]).rstrip()
        return f"{match[1]}```text\n{output}\n```\n{match['end']}"

    return MARKED.sub(with_output, text)


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


def renew(page: Path) -> None:
    """Run a page's marked programs and rewrite it, and its pictures, with what they gave."""
    text = page.read_text(encoding="utf-8")
    if not MARKED.search(text):
        return
    with tempfile.TemporaryDirectory() as scratch:
        for folder in ("benchmarks", "examples", "scripts"):
            Path(scratch, folder).symlink_to(ROOT / folder)
        text = render(text, runner(Path(scratch)))
        for name in PICTURE.findall(text):
            drawn = next(Path(scratch).rglob(name), None)
            if drawn is None:
                sys.exit(f"{page.name} shows {name}, but none of its programs wrote it")
            shutil.copyfile(drawn, ROOT / "docs" / name)
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    for page in map(Path, sys.argv[1:]) if sys.argv[1:] else PAGES:
        renew(page)
