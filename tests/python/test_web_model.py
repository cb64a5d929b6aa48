"""The model as the page gets it: the surface without loss, and the web version with the loss it states."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.conftest import full_disk

import viscera as vs
from viscera import cli
from viscera.mesh import Floats
from viscera.reduced.check import surface_points
from viscera.reduced.touch import load_bytes
from viscera.viewer import export, page
from viscera.viewer.surface import surface_model
from viscera.viewer.web import web_model

POINT = (0.3, 0.05, 0.1)


@pytest.fixture(scope="module")
def touch(bar: vs.Mesh) -> vs.Touch:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    return organ.reduce(lambda x: x[:, 0] > 0.1, radius=0.07, depth=0.06, order=3)


def test_the_surface_alone_answers_alike(touch: vs.Touch) -> None:
    alone = load_bytes(surface_model(touch, "Bar"))
    assert alone.metadata["user"]["name"] == "Bar"
    assert len(alone._model.array("points")) == len(touch.surface_nodes)
    for push in [(1e-3, 2e-3, -0.012), (0.0, -5e-3, 8e-3)]:
        assert np.array_equal(alone(POINT, push).force, touch(POINT, push).force)
        assert alone(POINT, push).error_estimate == touch(POINT, push).error_estimate
        assert np.array_equal(alone.surface_displacement(POINT, push), touch.surface_displacement(POINT, push))


def test_the_surface_alone_says_what_it_lacks(touch: vs.Touch) -> None:
    alone = load_bytes(surface_model(touch, "Bar"))
    assert repr(alone).startswith(f"Touch({len(touch.surface_nodes)} points, order 3")
    assert np.allclose(alone.locate(POINT), touch.locate(POINT))
    with pytest.raises(vs.VisceraError, match="the nearest touchable point is"):
        alone((9.0, 0.0, 0.0), (0, 0, -1e-3))
    asked: list[Callable[[], object]] = [
        lambda: alone.mesh,
        lambda: alone.organ(),
        lambda: alone.galerkin(),
        lambda: alone.check(touches=1),
        lambda: alone(POINT, (0, 0, -1e-3)).stress(),
        lambda: alone(("10 cm", "50%", "10 cm"), (0, 0, -1e-3)),
    ]
    for ask in asked:
        with pytest.raises(vs.VisceraError, match="this model has no cells: it was written for a page"):
            ask()


def test_a_page_model_is_touched_from_the_shell(touch: vs.Touch, tmp_path: Path) -> None:
    (tmp_path / "page.viscera").write_bytes(surface_model(touch, "Bar"))
    words = ["touch", str(tmp_path / "page.viscera"), "--at", "0.3", "0.05", "0.1", "--push", "0", "0", "-0.012"]
    assert cli.main(words) == 0


def test_arrays_lie_aligned(touch: vs.Touch) -> None:
    data = surface_model(touch, "Bar")
    assert (8 + struct.unpack("<Q", data[:8])[0]) % 8 == 0


def test_a_web_version_keeps_forces_and_states_its_error(touch: vs.Touch) -> None:
    full = len(surface_model(touch, "Bar"))
    web = web_model(touch, "Bar", limit=int(0.7 * full))
    assert len(web.data) < 0.7 * full
    assert web.modes < len(touch._model.array("mode_scale"))
    small = load_bytes(web.data)
    assert small.metadata["user"]["web"] == {"worst_error": web.worst_error, "touches": web.touches}
    worst = 0.0
    rng = np.random.default_rng(3)
    for _ in range(50):
        push = rng.normal(size=3)
        push *= touch.depth / np.linalg.norm(push)
        assert np.array_equal(small(POINT, push).force, touch(POINT, push).force)
        exact = touch.surface_displacement(POINT, push)
        worst = max(
            worst, float(np.linalg.norm(small.surface_displacement(POINT, push) - exact) / np.linalg.norm(exact))
        )
    assert 0 < worst < 2 * web.worst_error
    assert web.worst_error < 0.05


def touches(touch: vs.Touch, count: int) -> list[tuple[Floats, Floats]]:
    """Points anywhere on the surface, pushed and pulled in any direction, to any depth."""
    rng = np.random.default_rng(5)
    ways = rng.normal(size=(count, 3))
    ways *= (touch.depth * rng.uniform(0.02, 1.0, count) / np.linalg.norm(ways, axis=1))[:, None]
    return list(zip(surface_points(touch, count, rng), ways, strict=True))


def test_an_exported_model_trusts_the_forces_that_the_model_trusts(touch: vs.Touch) -> None:
    """The share of answers whose trust differs is none: forces are not compressed."""
    small = load_bytes(web_model(touch, "Bar", limit=int(0.6 * len(surface_model(touch, "Bar")))).data)
    trusts = []
    for point, push in touches(touch, 300):
        exported, full = small(point, push), touch(point, push)
        assert np.array_equal(exported.force, full.force)
        assert exported.error_estimate == full.error_estimate
        assert (exported.is_trusted, exported.reason) == (full.is_trusted, full.reason)
        trusts.append(exported.is_trusted)
    assert 0.2 < np.mean(trusts) < 1.0, "some are trusted, some are not"


def test_the_estimate_of_the_shape_covers_what_is_lost(touch: vs.Touch) -> None:
    """Against the full model at touches that compression has not seen; the surface is where a page shows it."""
    small = load_bytes(web_model(touch, "Bar", limit=int(0.6 * len(surface_model(touch, "Bar")))).data)
    assert small.metadata["errors"]["compression"] > touch.metadata["errors"]["compression"]
    for point, push in touches(touch, 300):
        full = touch.surface_displacement(point, push)
        lost = np.linalg.norm(small.surface_displacement(point, push) - full) / np.linalg.norm(full)
        exported = small(point, push)
        admitted = exported.shape_error_estimate - touch(point, push).shape_error_estimate
        assert lost <= admitted + 1e-4 or exported.shape_error_estimate == 1.0
        assert not exported.is_shape_trusted or exported.is_trusted


def test_a_model_may_be_compressed_whole(touch: vs.Touch, tmp_path: Path) -> None:
    small = touch.compressed(0.02)
    small.save(tmp_path / "small.viscera")
    touch.save(tmp_path / "full.viscera")
    assert (tmp_path / "small.viscera").stat().st_size < (tmp_path / "full.viscera").stat().st_size
    assert small.summary()["modes"] < touch.summary()["modes"]
    push = (2e-3, 1e-3, -5e-3)
    exact, answer = touch(POINT, push), small(POINT, push)
    lost = np.linalg.norm(answer.displacement - exact.displacement) / np.linalg.norm(exact.displacement)
    assert 0.0 < lost < answer.shape_error_estimate - exact.shape_error_estimate
    assert np.array_equal(answer.force, exact.force)
    assert len(small.organ().mesh.points) == len(touch.organ().mesh.points)
    with pytest.raises(vs.VisceraError, match="tolerance must be a number above 0 and below 1, got 0"):
        touch.compressed(0.0)


def test_an_answer_says_that_only_its_shape_is_doubtful(touch: vs.Touch) -> None:
    small = touch.compressed(0.2)
    answer = next(a for a in (small(*t) for t in touches(touch, 300)) if a.is_trusted and not a.is_shape_trusted)
    assert answer.reason == ""
    assert answer.shape_reason.startswith("the estimated error of the shape is ")
    assert f"trusted; its shape is not: {answer.shape_reason}" in repr(answer)


def test_a_limit_that_cannot_be_kept_is_a_sentence(touch: vs.Touch) -> None:
    with pytest.raises(vs.VisceraError, match="no web version of this model is below 0 MB"):
        web_model(touch, "Bar", limit=1000)


@pytest.fixture(scope="module")
def files() -> dict[str, bytes]:
    """Those of the page, if it was built."""
    try:
        return page.files()
    except vs.VisceraError as error:
        pytest.skip(str(error))


def test_an_export_is_a_whole_page(touch: vs.Touch, files: dict[str, bytes], tmp_path: Path) -> None:
    written = export(touch, tmp_path / "site", "Bar")
    assert set(written.files) == {*files, page.MODEL} == {path.name for path in (tmp_path / "site").iterdir()}
    assert vs.load(tmp_path / "site" / page.MODEL).metadata["user"]["name"] == "Bar"
    with pytest.raises(vs.VisceraError, match="is a file"):
        export(touch, tmp_path / "site" / "viewer.js")


@pytest.mark.usefixtures("files")
def test_a_page_is_exported_whole_or_not_at_all(touch: vs.Touch, tmp_path: Path) -> None:
    """On a full disk small files still fit; the page of before must not meet them."""
    for target in (tmp_path / "new" / "site", tmp_path / "new" / "site.html"):
        with full_disk(100_000), pytest.raises(vs.VisceraError, match="could not be written"):
            export(touch, target)
        assert list(tmp_path.iterdir()) == []
    site = tmp_path / "site"
    export(touch, site)
    for name in ("page.css", "viewer.js", "organ.viscera"):
        (site / name).write_text(f"old {name}")
    old = {path.name: path.read_bytes() for path in site.iterdir()}
    with full_disk(100_000), pytest.raises(vs.VisceraError, match=r"site/.+: could not be written"):
        export(touch, site)
    assert {path.name: path.read_bytes() for path in site.iterdir()} == old


@pytest.mark.usefixtures("files")
def test_the_page_itself_comes_last(touch: vs.Touch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    came, replace = [], Path.replace

    def noted(self: Path, target: Path) -> Path:
        came.append(Path(target).name)
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", noted)
    written = export(touch, tmp_path / "site")
    assert sorted(came) == written.files
    assert came[-1] == "index.html"
