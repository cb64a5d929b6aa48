"""Runs the README's marked programs, in order, and writes what they really print below each of them.

A marked program is a fenced `sh` or `python` block between `<!-- run -->` and `<!-- output -->`; everything from there
to `<!-- end -->` is replaced. All programs share one scratch folder and all Python blocks one namespace. A picture that
the README shows from `docs/` is the one of that name which a program wrote.
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
MARKED = re.compile(
    r"(<!-- run -->\n```(?P<language>sh|python)\n(?P<code>.*?)```\n<!-- output -->\n)"
    r"(?P<output>.*?)(?P<end><!-- end -->)",
    re.DOTALL,
)
PICTURE = re.compile(r"!\[[^\]]*\]\(docs/([^)]+\.png)\)")


def programs(text: str, language: str) -> list[str]:
    """The fenced blocks of one language, marked or not, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def render(text: str, run: Callable[[str, str], str]) -> str:
    """The text with the output of every marked program renewed by `run(language, code)`."""

    def renew(match: re.Match[str]) -> str:
        output = run(match["language"], match["code"]).rstrip()
        return f"{match[1]}```text\n{output}\n```\n{match['end']}"

    return MARKED.sub(renew, text)


def runner(folder: Path) -> Callable[[str, str], str]:
    """Runs shell and Python programs in a folder; what they print comes back, a failure raises."""
    namespace: dict[str, object] = {"__name__": "readme"}
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    plain = os.environ | {"PATH": path, "COLUMNS": "100", "NO_COLOR": "1", "MPLBACKEND": "Agg"}

    def run(language: str, code: str) -> str:
        print(code.rstrip(), file=sys.stderr)
        if language == "sh":
            shell = ["bash", "-euo", "pipefail", "-c", code]
            return subprocess.run(shell, cwd=folder, env=plain, stdout=subprocess.PIPE, text=True, check=True).stdout
        printed = io.StringIO()
        home = Path.cwd()
        os.chdir(folder)
        try:
            with contextlib.redirect_stdout(printed):
                exec(compile(code, "README.md", "exec"), namespace)
        finally:
            os.chdir(home)
        return printed.getvalue()

    return run


def main() -> None:
    readme = ROOT / "README.md"
    with tempfile.TemporaryDirectory() as scratch:
        text = render(readme.read_text(encoding="utf-8"), runner(Path(scratch)))
        for name in PICTURE.findall(text):
            drawn = next(Path(scratch).rglob(name), None)
            if drawn is None:
                sys.exit(f"README.md shows docs/{name}, but none of its programs wrote a {name}")
            shutil.copyfile(drawn, ROOT / "docs" / name)
        readme.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
