"""The page as one file: a browser opens it from a disk, with no server and nothing beside it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.cases.case import Case
from viscera.viewer import Server, export, export_case

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

TOP = (0.3, 0.05, 0.1)
PUSH = (0.0, 0.002, -0.012)


def test_a_model_opens_from_a_disk(
    touch: vs.Touch, server: Server, look_at: Callable[..., Viewer], tmp_path: Path
) -> None:
    written = export(touch, tmp_path / "bar.html", "Bar")
    assert written.files == []
    assert [file.name for file in tmp_path.iterdir()] == ["bar.html"]
    viewer = look_at((tmp_path / "bar.html").as_uri())
    assert viewer.page.url.startswith("file:")
    viewer.call("touch", TOP, PUSH)
    force = touch(viewer.state["point"], PUSH).force
    assert np.allclose(viewer.state["force"], force, rtol=1e-6, atol=1e-6 * np.linalg.norm(force))
    assert viewer.complaints == []
    viewer.close()


@pytest.mark.parametrize("part", [0.2, 0.8, 0.99, "in the head", "after the script"])
def test_a_file_that_was_cut_short_says_so(
    touch: vs.Touch, server: Server, browser: Any, tmp_path: Path, part: float | str
) -> None:
    """In the model, in the script, in the head; the last few bytes are needed by nothing."""
    export(touch, tmp_path / "bar.html", "Bar")
    whole = (tmp_path / "bar.html").read_bytes()
    ends = {"in the head": whole.index(b"</style>"), "after the script": whole.rindex(b"</script>") + len("</script>")}
    (tmp_path / "bar.html").write_bytes(whole[: int(part * len(whole)) if isinstance(part, float) else ends[part]])
    tab = browser.new_page()
    tab.goto((tmp_path / "bar.html").as_uri())
    if part == "after the script":
        tab.wait_for_function("() => window.viscera")
        assert tab.locator(".sentence").count() == 0
    else:
        sentences = tab.locator(".sentence").all_inner_texts()
        assert sentences == ["The end of this file is missing. Copy or download it again."]
    tab.close()


def test_a_file_that_a_browser_cannot_run_says_so(
    touch: vs.Touch, server: Server, browser: Any, tmp_path: Path
) -> None:
    export(touch, tmp_path / "bar.html", "Bar")
    whole = (tmp_path / "bar.html").read_text()
    begin = whole.index(">", whole.rindex('<script type="module"')) + 1
    (tmp_path / "bar.html").write_text(f"{whole[:begin]}not a language;{whole[begin:]}")
    tab = browser.new_page()
    tab.goto((tmp_path / "bar.html").as_uri())
    assert tab.locator(".sentence").all_inner_texts() == ["This page cannot start. Use a newer browser."]
    tab.close()


def test_a_case_steps_itself_from_a_disk(
    bar: vs.Mesh, server: Server, look_at: Callable[..., Viewer], tmp_path: Path
) -> None:
    bar.write(tmp_path / "bar.vtu")
    material = {"law": "NeoHookean", "young": 1e5, "poisson": 0.45}
    export_case(
        Case(mesh=str(tmp_path / "bar.vtu"), units="m", fixed="root", material=material), tmp_path / "case.html", "Bar"
    )
    viewer = look_at((tmp_path / "case.html").as_uri())
    viewer.call("touch", TOP, (0.0, 0.0, -0.01))
    viewer.page.wait_for_function(
        "() => { const [{ isSettled, force }] = viscera.state().specimens; return isSettled && force[2] < 0 }"
    )
    assert viewer.state["place"] == "in this page"
    assert viewer.complaints == []
    viewer.close()


def test_a_folder_is_no_file_and_a_file_no_folder(touch: vs.Touch, server: Server, tmp_path: Path) -> None:
    (tmp_path / "site.html").mkdir()
    with pytest.raises(vs.VisceraError, match="is a folder"):
        export(touch, tmp_path / "site.html")
    (tmp_path / "site").touch()
    with pytest.raises(vs.VisceraError, match="is a file"):
        export(touch, tmp_path / "site")
