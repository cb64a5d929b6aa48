"""The loaded model: answers, their refusals, and files that are whole or refused."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs

POINT = (0.3, 0.05, 0.1)


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")


@pytest.fixture(scope="module")
def touch(organ: vs.Organ) -> vs.Touch:
    return organ.reduce(lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.1), radius=0.07, depth=0.02, order=3)


def test_a_small_touch_is_what_the_full_organ_answers(touch: vs.Touch, organ: vs.Organ) -> None:
    push = (1e-4, -1e-4, -2e-4)
    answer, patch = touch(POINT, push), touch.patch(POINT)
    full = organ.solve(displacement={patch: push})
    assert answer.is_trusted, answer.reason
    assert answer.force == pytest.approx(full.reaction(patch), rel=2e-3, abs=2e-3 * np.linalg.norm(answer.force))
    error = np.linalg.norm(answer.displacement - full.displacement) / np.linalg.norm(full.displacement)
    assert error < 2e-3


def test_the_stiffness_is_the_derivative_of_the_force(touch: vs.Touch) -> None:
    push, step = np.array([2e-3, 1e-3, -5e-3]), 1e-6
    columns = [
        (touch(POINT, push + step * e).force - touch(POINT, push - step * e).force) / (2 * step) for e in np.eye(3)
    ]
    answer = touch(POINT, push)
    assert answer.stiffness == pytest.approx(np.stack(columns, axis=1), rel=1e-5, abs=1e-5 * np.abs(columns).max())


def test_surface_displacements_are_those_of_the_field(touch: vs.Touch) -> None:
    push = (0.0, 0.0, -0.01)
    field = touch(POINT, push).displacement
    assert touch.surface_displacement(POINT, push) == pytest.approx(field[touch.surface_nodes], rel=1e-5, abs=1e-9)


def test_too_deep_is_not_trusted(touch: vs.Touch) -> None:
    answer = touch(POINT, (0, 0, -3 * touch.depth))
    assert not answer.is_trusted
    assert answer.reason


@pytest.mark.parametrize(
    ("point", "push", "words"),
    [
        (
            (0.3, 0.05, 0.2),
            (0, 0, 0),
            "100.0 mm from the touchable surface; .* the nearest touchable point is .300.0, 50.0, 100.0. mm",
        ),
        ((0.0, 0.05, 0.1), (0, 0, 0), "150.0 mm from the touchable surface"),
        ((0.3, 0.05), (0, 0, 0), "contact point must be three finite numbers"),
        ((0.3, 0.05, np.nan), (0, 0, 0), "contact point must be three finite numbers"),
        (POINT, (0, 0, np.inf), "contact displacement must be three finite numbers"),
    ],
)
def test_touches_that_are_refused(touch: vs.Touch, point: Any, push: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        touch(point, push)


def test_a_saved_model_answers_alike(touch: vs.Touch, tmp_path: Path) -> None:
    touch.save(tmp_path / "bar.viscera")
    again = vs.load(tmp_path / "bar.viscera")
    push = (1e-3, 0, -8e-3)
    assert again(POINT, push).force == pytest.approx(touch(POINT, push).force, rel=1e-12)
    assert again(POINT, push).displacement == pytest.approx(touch(POINT, push).displacement, rel=1e-12)
    assert (again.radius, again.depth, again.order) == (0.07, 0.02, 3)
    assert set(again.summary()) == {"positions", "terms", "modes", "errors", "worst_error"}
    assert again.summary()["positions"] == 3 * 6, "x > 0.1 on the top face"
    assert again.summary()["terms"] == 19, "monomials of three components of total order 1 to 3"


def test_the_file_rebuilds_the_organ(touch: vs.Touch, organ: vs.Organ) -> None:
    full = touch.organ()
    assert full.mesh.points.tolist() == organ.mesh.points.tolist()
    assert full.mesh.cells.tolist() == organ.mesh.cells.tolist()
    assert full.fixed.tolist() == organ.fixed.tolist()
    assert full.law.parameters == pytest.approx(organ.law.parameters)
    assert type(full.law) is type(organ.law)


def damaged(data: bytes, how: str) -> bytes:
    head = 8 + struct.unpack("<Q", data[:8])[0]
    return {
        "empty": b"",
        "header only": data[:head],
        "cut short": data[: len(data) * 2 // 3],
        "cut by one byte": data[:-1],
        "text": b"not a model at all, only words",
        "header of absurd length": b"\xff" * 8 + data[8:],
        "not finite": data[:head] + np.full((len(data) - head) // 4, np.nan, dtype=np.float32).tobytes(),
    }[how]


@pytest.mark.parametrize(
    "how", ["empty", "header only", "cut short", "cut by one byte", "text", "header of absurd length", "not finite"]
)
def test_damaged_files_are_one_sentence(touch: vs.Touch, tmp_path: Path, how: str) -> None:
    path = tmp_path / "bar.viscera"
    touch.save(path)
    path.write_bytes(damaged(path.read_bytes(), how))
    with pytest.raises(vs.VisceraError, match=r"bar\.viscera: ") as raised:
        vs.load(path)
    assert "\n" not in str(raised.value)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(vs.VisceraError, match="is a folder, not a model"):
        vs.load(tmp_path)
    with pytest.raises(vs.VisceraError, match=r"none\.viscera: no such model file"):
        vs.load(tmp_path / "none.viscera")


def test_an_interrupted_reduction_leaves_the_organ_usable(organ: vs.Organ) -> None:
    def stop(done: int, total: int, stage: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        organ.reduce(radius=0.07, depth=0.02, order=2, progress=stop)
    assert organ.solve(force={"tip": (0, 0, -1.0)}).is_converged


def test_a_plot_shows_the_force(touch: vs.Touch, tmp_path: Path) -> None:
    figure = touch.plot(POINT, (0, 0, -0.01), tmp_path / "touch.png")
    assert (tmp_path / "touch.png").read_bytes().startswith(b"\x89PNG")
    size = np.linalg.norm(touch(POINT, (0, 0, -0.01)).force)
    assert f"{size:.3g} N" in [text.get_text() for text in figure.axes[0].texts]
