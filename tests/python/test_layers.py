"""The files of a crate, or of the package, and the folders in it know each other in one direction: no circles."""

import ast
import graphlib
import re
from collections.abc import Iterable, Iterator
from os.path import relpath
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CRATES = sorted(
    folder / "src"
    for parent in (ROOT, ROOT / "crates", ROOT / "bindings")
    for folder in parent.iterdir()
    if (folder / "Cargo.toml").exists() and (folder / "src").exists()
)
Module = tuple[str, ...]


def uses(text: str) -> Iterator[list[str]]:
    """The paths into its own crate that a file names, without those of its tests."""
    text = re.split(r"#\[cfg\(test\)\]\s*mod tests \{", re.sub(r"//[^\n]*", "", text))[0]
    for of_use in re.finditer(r"\buse\s+((?:crate|super|self)[^;]*);", text):
        yield from expanded(of_use[1])
    for inline in re.finditer(r"\b(?:crate|super)(?:::\w+)+", text):
        yield inline[0].split("::")


def expanded(path: str) -> Iterator[list[str]]:
    """`a::{b, c::{d, e}}` as a::b, a::c::d, a::c::e."""
    head, brace, rest = path.strip().partition("{")
    if not brace:
        yield [name.strip() for name in re.split(r"\s+as\s+", head)[0].split("::")]
        return
    names = [name.strip() for name in head.split("::") if name.strip()]
    parts, depth = [""], 0
    for letter in rest[: rest.rindex("}")]:
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    for part in filter(str.strip, parts):
        yield from (names + of_part for of_part in expanded(part))


def module(path: Path, source: Path) -> Module:
    """The module of a file: () for lib.rs, (a, b) for a/b.rs and a/b/mod.rs."""
    parts = path.relative_to(source).with_suffix("").parts
    return parts[:-1] if parts[-1] in ("mod", "lib") else parts


def arrows(source: Path) -> dict[Module, set[Module]]:
    """Which modules each module of a crate names."""
    files = {module(p, source): p for p in source.rglob("*.rs") if "tests" not in (*p.parts, p.stem)}
    known: dict[Module, set[Module]] = {}
    for here, path in files.items():
        known[here] = set()
        for names in uses(path.read_text()):
            at = here if names[0] != "crate" else ()
            for name in names:
                if name == "super":
                    at = at[:-1]
                elif (*at, name) in files:
                    at = (*at, name)
                elif name not in ("crate", "self"):
                    break
            known[here].add(at)
    return known


def imports(source: Path) -> dict[Module, set[Module]]:
    """Which modules each module of a package imports when it is imported: not in functions, not for types alone."""
    files = {p.relative_to(source).with_suffix("").parts: p for p in source.rglob("*.py")}
    return {here: set(imported(path, source.name, files)) for here, path in files.items()}


def imported(path: Path, package: str, files: Iterable[Module]) -> Iterator[Module]:
    """The modules among `files` that a file imports as it is imported."""
    for statement in ast.parse(path.read_text()).body:
        if not isinstance(statement, ast.ImportFrom):
            continue
        head, *inner = (statement.module or "").split(".")
        if head == package:
            for name in statement.names:
                whole = (*inner, name.name)
                yield whole if whole in files else tuple(inner)


def module_imports(source: Path) -> dict[Module, set[Module]]:
    """Which modules each module of the page imports for more than its types."""
    files = {p.relative_to(source).with_suffix("").parts: p for p in source.rglob("*.ts")}
    loads = re.compile(r'^import (?!type )[^;]*?from "(\.[^"]+)"', re.MULTILINE)
    found: dict[Module, set[Module]] = {here: set() for here in files}
    for here, path in files.items():
        for name in loads.findall(path.read_text()):
            other = Path(relpath(path.parent / name, source)).parts
            found[here] |= {other} & files.keys()
    return found


def rooms(known: dict[Module, set[Module]]) -> dict[Module, dict[str, set[str]]]:
    """In each folder, which of its files and folders name which others of it."""
    found: dict[Module, dict[str, set[str]]] = {}
    for here, others in known.items():
        for other in others:
            shared = next((k for k, (a, b) in enumerate(zip(here, other, strict=False)) if a != b), None)
            if shared is not None:
                found.setdefault(here[:shared], {}).setdefault(here[shared], set()).add(other[shared])
    return found


@pytest.mark.parametrize("source", CRATES, ids=lambda source: source.parent.name)
def test_no_files_know_each_other_both_ways(source: Path) -> None:
    refuse_circles(source.parent.name, arrows(source))


def test_the_package_imports_itself_in_one_direction() -> None:
    refuse_circles("viscera", imports(ROOT / "python" / "viscera"))


def test_the_page_imports_itself_in_one_direction() -> None:
    known = module_imports(ROOT / "viewer" / "src")
    assert any(known.values())
    refuse_circles("viewer", known)


def refuse_circles(name: str, known: dict[Module, set[Module]]) -> None:
    for room, names in rooms(known).items():
        try:
            tuple(graphlib.TopologicalSorter(names).static_order())
        except graphlib.CycleError as circle:
            pytest.fail(f"circle in {'/'.join((name, *room))}: {' -> '.join(circle.args[1])}")


def test_a_circle_is_found(tmp_path: Path) -> None:
    (tmp_path / "lib.rs").write_text("mod a;\nmod b;\n")
    (tmp_path / "a.rs").write_text("use super::{b::B, c};\n")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "mod.rs").write_text("mod inner;\n")
    (tmp_path / "b" / "inner.rs").write_text("fn f() -> crate::a::A { todo!() }\n")
    assert rooms(arrows(tmp_path)) == {(): {"a": {"b"}, "b": {"a"}}}


def test_a_circle_of_the_package_is_found(tmp_path: Path) -> None:
    package = tmp_path / "viscera"
    (package / "b").mkdir(parents=True)
    (package / "a.py").write_text("from viscera.b import inner\n")
    (package / "b" / "inner.py").write_text("from viscera.a import A\n\ndef f():\n    from viscera.c import later\n")
    (package / "c.py").write_text("from viscera.a import A\n")
    assert rooms(imports(package)) == {(): {"a": {"b"}, "b": {"a"}, "c": {"a"}}}
