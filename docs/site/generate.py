"""Pages that are made from other files: the Python and C references, the results, the gallery, adopted root pages."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import reference

PICTURES = Path("docs/pictures/gallery")
HEADER = Path("bindings/c/include/viscera.h")
RESULTS = Path("benchmarks/results")
ADOPTED = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "tests/reference/README.md": "reference-codes.md",
}
"""Pages that live elsewhere in the repository, and their names on the site."""
LINK = re.compile(r"\]\((?!https?:|#|mailto:)([^)]+)\)")


def everything(root: Path, folder: Path) -> None:
    """Writes all generated pages into `folder`, touching only what changed so that a second build is quick."""
    pages = {
        **reference.python_pages(),
        "c-header.md": c_header((root / HEADER).read_text(encoding="utf-8")),
        "results.md": results(root / RESULTS),
        "gallery.md": gallery(root),
        **{page: adopted(root, path) for path, page in ADOPTED.items()},
    }
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    for path in folder.rglob("*.md"):
        if str(path.relative_to(folder)) not in pages:
            path.unlink()
    shutil.rmtree(folder / "pictures", ignore_errors=True)
    if (root / PICTURES).exists():
        shutil.copytree(root / PICTURES, folder / "pictures")


def adopted(root: Path, path: str) -> str:
    """A page from elsewhere in the repository, with its links."""
    return relinked((root / path).read_text(encoding="utf-8"), root / path, root, root / "docs" / "generated")


def relinked(text: str, source: Path, root: Path, folder: Path) -> str:
    """A page with its relative links as seen from `folder`; adopted pages and results are linked where shown."""

    def moved(match: re.Match[str]) -> str:
        path, mark, anchor = match[1].partition("#")
        target = (source.parent / path).resolve()
        inside = str(target.relative_to(root)) if target.is_relative_to(root) else ""
        if inside == "README.md":
            target = root / "docs" / "index.md"
        elif inside in ADOPTED:
            target = root / "docs" / "generated" / ADOPTED[inside]
        elif target == root / RESULTS:
            target = root / "docs" / "generated" / "results.md"
        elif target.suffix == ".txt" and target.parent == root / RESULTS:
            target, mark, anchor = root / "docs" / "generated" / "results.md", "#", target.stem.replace("_", "-")
        return f"]({os.path.relpath(target, folder)}{mark}{anchor})"

    return LINK.sub(moved, text)


def fenced(text: str, language: str = "text") -> list[str]:
    """A block of code or plain text."""
    return [f"```{language}", text.strip("\n").rstrip(), "```", ""]


def c_header(text: str) -> str:
    """The C header as a page: the comment above a declaration becomes prose, the declaration code."""
    head, body = text.split("*/\n", 1)
    page = ["# C header", "", prose(head), ""]
    for block in re.split(r"\n{2,}", body):
        match = re.match(r"(?:/\*(?P<comment>.*?)\*/\n)?(?P<code>[^/#].*)", block, re.DOTALL)
        names = declared(match["code"]) if match else []
        if match and names:
            page += [f"## {', '.join(names)}", "", prose(match["comment"] or ""), "", *fenced(match["code"], "c")]
    return "\n".join([*page, "## The whole file", "", *fenced(text, "c")])


def declared(code: str) -> list[str]:
    """What a block of C declares: functions, or the type."""
    functions = re.findall(r"\b(viscera_\w+)\s*\(", code)
    types = re.findall(r"^}? ?(?:enum |typedef struct \w+ )?(viscera_\w+)(?=;| {)", code, re.MULTILINE)
    return list(dict.fromkeys(functions or types[-1:]))


def prose(comment: str) -> str:
    """The text of a C comment."""
    lines = [line.strip().removeprefix("/*").removeprefix("*").strip() for line in comment.strip().splitlines()]
    return "\n".join(line for line in lines if not line.startswith("SPDX"))


def results(folder: Path) -> str:
    """All kept results, each with the stamp it was printed with."""
    page = [
        "# Benchmarks",
        "",
        "Every table below was printed by the script of its name under `benchmarks/`. Its first lines say on which",
        "machine, when, from which commit and under which load. Other pages quote these tables.",
        "",
    ]
    for path in sorted(folder.glob("*.txt")):
        page += [f"## {title(path)}", "", *fenced(path.read_text(encoding="utf-8"))]
    for study in sorted(path for path in folder.iterdir() if path.is_dir()):
        page += [f"## study: {study.name}", "", *fenced((study / "printed.txt").read_text(encoding="utf-8"))]
        for table in sorted(study.glob("*.csv")):
            page += [f"**{title(table)}**", "", *fenced(table.read_text(encoding="utf-8"))]
    return "\n".join(page)


def title(path: Path) -> str:
    return path.stem.replace("_", " ")


def gallery(root: Path) -> str:
    """The examples: their story, their picture, their code, and the command that runs them."""
    page = ["# Gallery", "", "The tests run every example, and each asserts what it shows.", ""]
    for path in sorted((root / "examples").glob("*.py")):
        source = path.read_text(encoding="utf-8")
        story, code = source.removeprefix('"""').split('"""\n', 1)
        headline, _, rest = story.partition("\n")
        name, _, lead = headline.partition(": ")
        page += [f"## {name}", "", f"{lead[:1].upper()}{lead[1:]}", ""]
        if (root / PICTURES / f"{path.stem}.png").exists():
            page += [f"![{name}](pictures/{path.stem}.png)", ""]
        page += [drawn(rest.strip("\n")), "", *fenced(f"python examples/{path.name}", "sh"), *fenced(code, "python")]
    return "\n".join(page)


def drawn(text: str) -> str:
    """The paragraphs of a docstring; indented ones are drawings."""
    parts = re.split(r"\n\n(?=\S)|(?<=\S)\n\n", text)
    return "\n\n".join("\n".join(fenced(part)).rstrip() if part.startswith("    ") else part for part in parts)
