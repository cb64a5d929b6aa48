"""The model as the page gets it: the surface without loss, and the web version with the loss it states."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera.touch import load_bytes
from viscera.viewer import export, page
from viscera.viewer.surface import surface_model
from viscera.viewer.web import web_model

POINT = (0.3, 0.05, 0.1)


@pytest.fixture(scope="module")
def touch(bar: vs.Mesh) -> vs.Touch:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    return organ.reduce(lambda x: x[:, 0] > 0.1, radius=0.07, depth=0.02, order=3)


def test_the_surface_alone_answers_alike(touch: vs.Touch) -> None:
    alone = load_bytes(surface_model(touch, "Bar"))
    assert alone.metadata["user"]["name"] == "Bar"
    assert len(alone._model.array("points")) == len(touch.surface_nodes)
    for push in [(1e-3, 2e-3, -0.012), (0.0, -5e-3, 8e-3)]:
        assert np.array_equal(alone(POINT, push).force, touch(POINT, push).force)
        assert alone(POINT, push).error_estimate == touch(POINT, push).error_estimate
        assert np.array_equal(alone.surface_displacement(POINT, push), touch.surface_displacement(POINT, push))


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


def test_the_error_estimate_knows_of_the_loss(touch: vs.Touch) -> None:
    full = len(surface_model(touch, "Bar"))
    small = load_bytes(web_model(touch, "Bar", limit=int(0.7 * full)).data)
    assert small.metadata["errors"]["compression"] > touch.metadata["errors"]["compression"]
    push = (0.0, 0.0, -touch.depth)
    assert small(POINT, push).error_estimate > touch(POINT, push).error_estimate


def test_a_limit_that_cannot_be_kept_is_a_sentence(touch: vs.Touch) -> None:
    with pytest.raises(vs.VisceraError, match="no web version of this model is below 0 MB"):
        web_model(touch, "Bar", limit=1000)


def test_an_export_is_a_whole_page(touch: vs.Touch, tmp_path: Path) -> None:
    try:
        files = page.files()
    except vs.VisceraError as error:
        pytest.skip(str(error))
    written = export(touch, tmp_path / "site", "Bar")
    assert set(written.files) == {*files, page.MODEL} == {path.name for path in (tmp_path / "site").iterdir()}
    assert vs.load(tmp_path / "site" / page.MODEL).metadata["user"]["name"] == "Bar"
    with pytest.raises(vs.VisceraError, match="is a file"):
        export(touch, tmp_path / "site" / "viewer.js")
