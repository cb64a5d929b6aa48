"""The notices that go with the binaries: of everything that is linked in, and of today's versions."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
REMEDY = "run `.venv/bin/python scripts/notices.py`"


@pytest.fixture(scope="module")
def notices() -> ModuleType:
    spec = importlib.util.spec_from_file_location("notices", ROOT / "scripts" / "notices.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def text(notices: ModuleType) -> str:
    found: str = notices.NOTICES.read_text(encoding="utf-8")
    return found


def test_they_are_of_the_versions_that_are_locked(notices: ModuleType, text: str) -> None:
    assert f"packages locked: {notices.digest()}" in text, f"Cargo.lock or package-lock.json has changed; {REMEDY}"


def test_they_name_what_the_crates_ask_for(text: str) -> None:
    """Every dependency that a manifest of the shipped crates names, macros and test tools left out."""
    bindings = ("bindings/python", "bindings/wasm", "gpu")
    for folder in ("core", "crates/linear", "crates/touch", "live", "mesher", *bindings):
        manifest = (ROOT / folder / "Cargo.toml").read_text(encoding="utf-8")
        needed = re.search(r"^\[dependencies\]\n(.*?)(?:^\[|\Z)", manifest, re.DOTALL | re.MULTILINE)
        assert needed is not None
        for name in re.findall(r"^([a-z0-9_-]+) = ", needed[1], re.MULTILINE):
            if not name.startswith("viscera-"):
                assert re.search(rf"^{name} \d", text, re.MULTILINE), f"{folder} needs {name}; {REMEDY}"


def test_they_name_what_the_page_bundles(notices: ModuleType) -> None:
    sources = [file.read_text(encoding="utf-8") for file in (ROOT / "viewer" / "src").rglob("*.ts")]
    imported = {name.partition("/")[0] for text in sources for name in re.findall(r'from "([^."][^"]*)"', text)}
    assert imported == set(notices.BUNDLED)


def test_the_logarithm_keeps_the_notice_of_its_source(text: str) -> None:
    """FDLIBM asks for it, in the source and in what is made of it."""
    source = ROOT / "crates" / "number" / "src" / "elementary.rs"
    plain = re.sub(r"//! ?>? ?", "", source.read_text(encoding="utf-8"))
    notice = re.search(r"Copyright \(C\) 1993 by Sun Microsystems.*?is preserved\.", plain, re.DOTALL)
    assert notice is not None
    assert " ".join(notice[0].split()) in " ".join(text.split())
