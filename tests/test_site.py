"""The documentation site: how docstrings, the C header and links become its pages. `make docs` builds all of it."""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

import viscera

ROOT = Path(__file__).resolve().parent.parent
SITE = ROOT / "docs" / "site"


def _load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, SITE / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(autouse=True)
def _beside_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SITE))
    for name in ("reference", "docstrings", "generate"):
        monkeypatch.delitem(sys.modules, name, raising=False)


def markup(text: str) -> str:
    return "\n".join(_load("docstrings").markup(text.splitlines()))


def test_a_line_that_explains_a_parameter_becomes_a_field() -> None:
    explained = "gravity: acceleration (3,),\n    with `density`.\nradius [m]: of it."
    assert markup(f"Solves.\n\n{explained}\nRaises `VisceraError`: rarely.") == (
        "Solves.\n\n:param gravity: acceleration (3,),\n    with `density`.\n:param radius: [m] of it.\n\n"
        "Raises `VisceraError`: rarely."
    )


def test_a_sentence_with_a_colon_stays_a_sentence() -> None:
    assert markup("It holds this.\n\nof the two, one: the first.") == "It holds this.\n\nof the two, one: the first."


def test_formulas_examples_and_code_are_not_read_as_markup() -> None:
    assert markup("So\n\n    W = mu/2 * (I1 - 3)\n    + J") == "So\n\n::\n\n    W = mu/2 * (I1 - 3)\n    + J"
    assert markup(">>> a = 2 * b_\n8") == ">>> a = 2 * b_\n8"
    assert markup("two * `x < 10%` and `Mesh.nodes`") == r"two \* ``x < 10%`` and `Mesh.nodes`"


def test_every_function_of_the_c_header_has_its_place() -> None:
    generate = _load("generate")
    header = (ROOT / generate.HEADER).read_text(encoding="utf-8")
    page = generate.c_header(header)
    headings = {name for line in page.splitlines() if line.startswith("## ") for name in line[3:].split(", ")}
    functions = set(re.findall(r"^\w[\w ]*\W(viscera_\w+)\(", header, re.MULTILINE))
    assert functions
    assert functions <= headings


def test_every_public_name_has_a_place_in_the_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    reference = _load("reference")
    assert "python/organs-and-equilibrium.md" in reference.python_pages()
    monkeypatch.setattr(viscera, "__all__", [*viscera.__all__, "newcomer"])
    with pytest.raises(SystemExit, match="newcomer"):
        reference.python_pages()


def test_links_follow_a_page_to_where_it_is_shown(tmp_path: Path) -> None:
    generate = _load("generate")
    source, folder = tmp_path / "tests" / "page.md", tmp_path / "docs" / "generated"
    text = "[a](../CONTRIBUTING.md#laws) [b](../docs/cli.md) [c](https://toml.io)"
    assert generate.relinked(text, source, tmp_path, folder) == (
        "[a](contributing.md#laws) [b](../cli.md) [c](https://toml.io)"
    )
    kept = "[d](../benchmarks/results/gpu_plan.txt) [e](../benchmarks/results)"
    assert generate.relinked(kept, source, tmp_path, folder) == "[d](results.md#gpu-plan) [e](results.md)"
