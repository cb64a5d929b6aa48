"""The files of the viewer's page where only some of it is built; what they do in a browser is in tests/web."""

from __future__ import annotations

import urllib.request
from pathlib import Path

import pytest

import viscera as vs
from viscera.viewer import page
from viscera.viewer.hybrid import page_of
from viscera.viewer.server import serve_live

SCRIPT = page._opening("open", page.MODEL).encode()


@pytest.fixture
def page_without_stepper(monkeypatch: pytest.MonkeyPatch) -> None:
    """As `make package` builds it."""
    monkeypatch.setattr(page, "_built", lambda: {"viewer.js": b"", "page.js": SCRIPT})


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")


def test_a_package_without_its_page_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("viscera.viewer.page.resources.files", lambda package: tmp_path)
    with pytest.raises(vs.VisceraError, match=r"built without its viewer: install Node\.js, then run 'make viewer'"):
        page.files()


@pytest.mark.usefixtures("page_without_stepper")
def test_a_model_is_shown_without_the_stepper(organ: vs.Organ) -> None:
    touch = organ.reduce(lambda x: x[:, 0] > 0.25, radius=0.07, depth=0.01, order=2)
    shown = page_of(touch, bytes(10_000_000), "Bar")
    assert shown.keys() == {"viewer.js", "page.js", page.MODEL}
    with pytest.raises(vs.VisceraError, match="without what steps a case in the page: run 'make viewer'"):
        page_of(touch, bytes(10_000_000), "Bar", is_hybrid=True)


@pytest.mark.usefixtures("page_without_stepper")
def test_a_case_is_stepped_on_this_machine_without_the_stepper(organ: vs.Organ, tmp_path: Path) -> None:
    case = organ.to_case(tmp_path / "bar.toml", loads={"force": {"tip": (0, 0, -1.0)}})
    with serve_live(case) as server, urllib.request.urlopen(f"{server.url}page.js") as answer:
        assert b"openLive" in answer.read()
    with pytest.raises(vs.VisceraError, match="without what steps a case in the page"):
        serve_live(case, in_page=True)
