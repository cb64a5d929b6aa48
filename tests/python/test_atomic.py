"""Files that appear whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

import viscera as vs
from viscera.atomic import replacing


def interrupted(target: Path) -> None:
    with replacing(target) as scratch:
        scratch.write_text("half")
        raise KeyboardInterrupt


def test_a_file_replaces_the_old_one_only_when_it_is_whole(tmp_path: Path) -> None:
    target = tmp_path / "model.viscera"
    target.write_text("old")
    with pytest.raises(KeyboardInterrupt):
        interrupted(target)
    assert target.read_text() == "old"
    with replacing(target) as scratch:
        scratch.write_text("new")
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_missing_folder_and_a_folder_in_the_way_are_named(tmp_path: Path) -> None:
    with pytest.raises(vs.VisceraError, match="does not exist"), replacing(tmp_path / "no" / "file"):
        pass
    with pytest.raises(vs.VisceraError, match="is a folder"), replacing(tmp_path):
        pass
