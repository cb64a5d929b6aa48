"""Every example runs, asserts what it shows, makes its picture, and is short enough to be read."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

from viscera import cli

ROOT = Path(__file__).resolve().parent.parent
LINES = 80


def _gallery() -> ModuleType:
    spec = importlib.util.spec_from_file_location("gallery", ROOT / "scripts" / "gallery.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


gallery = _gallery()


@pytest.mark.parametrize("example", gallery.EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_makes_its_picture(example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        figure = gallery.run(example)
    except SystemExit as missing:  # the example's own words for what this machine lacks
        pytest.skip(str(missing))
    figure.savefig(tmp_path / "picture.png", dpi=40)
    assert (tmp_path / "picture.png").stat().st_size > 1000


@pytest.mark.parametrize("case", sorted((ROOT / "examples").glob("*.toml")), ids=lambda path: path.name)
def test_a_case_file_solves(case: Path, tmp_path: Path) -> None:
    assert cli.main(["solve", str(case), "--quiet", "-o", str(tmp_path / "solved.vtu")]) == 0


@pytest.mark.parametrize("example", gallery.EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_tells_its_story_and_asserts_a_number(example: Path) -> None:
    source = example.read_text(encoding="utf-8")
    story = source.split('"""')[1]
    assert len(source.splitlines()) <= LINES
    assert story.partition("\n")[0].rstrip().endswith(".")
    assert len(story.split()) > 30
    assert re.search(r"^ *assert ", source, re.MULTILINE)


def test_every_example_has_its_picture_in_the_gallery() -> None:
    missing = [path.stem for path in gallery.EXAMPLES if not (gallery.PICTURES / f"{path.stem}.png").is_file()]
    assert not missing, "run `python scripts/gallery.py`"
