"""The README keeps its word: its programs run, and the outputs it shows come from them."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def readme() -> ModuleType:
    spec = importlib.util.spec_from_file_location("readme", ROOT / "scripts" / "readme.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_python_programs_run(readme: ModuleType, tmp_path: Path) -> None:
    run = readme.runner(tmp_path)
    programs = readme.programs(README, "python")
    assert programs
    for program in programs:
        run("python", program)


def test_marked_programs_show_an_output(readme: ModuleType) -> None:
    shown = [match["output"].strip() for match in readme.MARKED.finditer(README)]
    assert len(shown) == README.count("<!-- run -->")
    assert all(shown), "run `make readme`"


def test_outputs_are_replaced_by_what_the_programs_print(readme: ModuleType, tmp_path: Path) -> None:
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
    renewed = readme.render(page, readme.runner(tmp_path))
    assert "stale" not in renewed
    assert "```text\ntwo 100\n```" in renewed
    assert "```text\n['two', '100']\n```" in renewed
    assert readme.render(renewed, readme.runner(tmp_path)) == renewed
