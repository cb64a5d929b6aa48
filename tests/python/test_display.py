"""What a notebook shows of each object by itself: a picture in its cell, or a table."""

from __future__ import annotations

import base64
import gc
import struct
import weakref
from typing import Any

import pytest
from matplotlib.figure import Figure

import viscera as vs
from viscera.display import WIDTH

formatters = pytest.importorskip("IPython.core.formatters", reason="IPython is not installed")


@pytest.fixture(scope="module")
def organ() -> vs.Organ:
    return vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")


@pytest.fixture(scope="module")
def touch(organ: vs.Organ) -> vs.Touch:
    return organ.reduce(lambda x: (x[:, 2] == 0.2) & (x[:, 0] > 0.6), depth=0.02, order=2)


def shown(thing: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    data, metadata = formatters.DisplayFormatter().format(thing)
    return data, metadata


@pytest.mark.parametrize("name", ["mesh", "organ", "state", "frame", "touch"])
def test_what_has_a_shape_appears_as_a_picture(name: str, organ: vs.Organ, touch: vs.Touch) -> None:
    make: dict[str, Any] = {
        "mesh": lambda: organ.mesh.with_cell_sets(end=lambda x: x[:, 0] > 0.8),
        "organ": lambda: organ,
        "state": lambda: organ.solve(displacement={"tip": (None, None, 0.01)}),
        "frame": lambda: organ.stepper().frame({"tip": (None, None, 0.01)}),
        "touch": lambda: touch,
    }
    thing = make[name]()
    data, metadata = shown(thing)
    png = data["image/png"]
    png = png if isinstance(png, bytes) else base64.b64decode(png)
    assert png.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", png[16:24])
    assert width == pytest.approx(2 * WIDTH, abs=2)
    assert 0.3 * width < height < 2 * width
    assert metadata["image/png"] == {"width": WIDTH}
    assert data["text/plain"] == repr(thing)


def test_a_comparison_appears_as_picture_and_table_and_a_check_as_its_table(organ: vs.Organ, touch: vs.Touch) -> None:
    compared = vs.compare(organ, displacement={"tip": (None, None, 0.05)})
    data, _ = shown(compared)
    assert "image/png" in data
    assert "Linear" in data["text/html"]
    check = touch.check(touches=2, depths=[0.01])
    data, _ = shown(check)
    assert "displacement error" in data["text/html"]
    assert check.verdict in repr(check)


def test_a_frame_is_drawn_like_a_state(organ: vs.Organ) -> None:
    assert isinstance(organ.stepper().frame({"tip": (None, None, 0.01)}).plot(), Figure)


def test_a_closed_view_says_so(touch: vs.Touch) -> None:
    pytest.importorskip("anywidget")
    from IPython.core.interactiveshell import InteractiveShell
    from IPython.utils.capture import capture_output

    widget = touch.view("Beam")
    widget.close()
    InteractiveShell.instance()
    try:
        with capture_output() as cell:
            widget._ipython_display_()
    finally:
        InteractiveShell.clear_instance()
    assert [each.data for each in cell.outputs] == [
        {"text/plain": "this view is closed; show the organ anew, with view()"}
    ]
    with pytest.raises(vs.VisceraError, match="this view is closed; show the organ anew"):
        widget.touch((1, 0.05, 0.1), (0, 0, -0.01))
    widget.release()
    widget.close()


@pytest.mark.parametrize("kind", ["touch", "state"])
def test_a_closed_view_keeps_no_model(kind: str, organ: vs.Organ) -> None:
    pytest.importorskip("anywidget")
    make: dict[str, Any] = {
        "touch": lambda: organ.reduce(lambda x: (x[:, 2] == 0.2) & (x[:, 0] > 0.9), depth=0.01, order=2),
        "state": lambda: organ.solve(displacement={"tip": (None, None, 0.01)}),
    }
    thing = make[kind]()
    widget, kept = thing.view("Beam"), weakref.ref(thing)
    widget.close()
    del thing
    gc.collect()
    assert kept() is None
