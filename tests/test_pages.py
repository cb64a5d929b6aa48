"""README and documentation keep their word: programs run, outputs are shown, links lead somewhere."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent


def _script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "scripts" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


pages = _script("pages")
every_page = pytest.mark.parametrize("page", [*pages.PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)


@every_page
def test_python_programs_run(page: Path, tmp_path: Path) -> None:
    run = pages.runner(tmp_path)
    for program in pages.programs(page.read_text(encoding="utf-8"), "python"):
        run("python", program)


@every_page
def test_marked_programs_show_an_output(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    shown = [match["output"].strip() for match in pages.MARKED.finditer(text)]
    assert len(shown) == text.count("<!-- run -->")
    assert all(shown), f"run `make pages`: {page.name} has a program without its output"


@every_page
def test_relative_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8"))
    missing = [target for target in targets if not (page.parent / target).exists()]
    assert not missing


def test_the_law_that_contributors_are_shown_is_the_one_in_use() -> None:
    shown = pages.programs((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), "rust")
    assert shown == [(ROOT / "core" / "src" / "law" / "yeoh.rs").read_text(encoding="utf-8")]


def test_the_readme_has_a_program() -> None:
    assert pages.programs((ROOT / "README.md").read_text(encoding="utf-8"), "python")


def test_outputs_are_replaced_by_what_the_programs_print(tmp_path: Path) -> None:
    page = """
<!-- run -->
```sh
echo "two ${COLUMNS}" > note; cat note
```
<!-- output -->
stale
<!-- end -->
<!-- run -->
```python
print(open("note").read().split())
```
<!-- output -->
<!-- end -->
"""
    renewed = pages.render(page, pages.runner(tmp_path))
    assert "stale" not in renewed
    assert "```text\ntwo 100\n```" in renewed
    assert "```text\n['two', '100']\n```" in renewed
    assert pages.render(renewed, pages.runner(tmp_path)) == renewed
