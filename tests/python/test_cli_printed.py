"""What a command prints may not reach its reader; what it has computed is there all the same."""

from __future__ import annotations

import io
import json
import os
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera.cli import VERBS, main
from viscera.cli.output import put

CASE = """
mesh = "bar.vtu"
units = "m"
fixed = "root"
[material]
law = "NeoHookean"
young = 1e5
poisson = 0.3
"""
LOADS = "[loads]\nforce = {tip = [0, 0, -1]}\n"
NAME = "лёгкое.toml"
ESCAPED = NAME.encode("ascii", "backslashreplace").decode()
needs_full_device = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")


@pytest.fixture
def folder(bar: vs.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    bar.write(tmp_path / "bar.vtu")
    for name in ("case.toml", NAME):
        (tmp_path / name).write_text(CASE + LOADS, encoding="utf-8")
    (tmp_path / "scan.toml").write_text(CASE + LOADS + "[scan]\nforce = {tip = [0, 0, 0.5]}\n")
    (tmp_path / "still.toml").write_text(CASE)
    (tmp_path / "test.csv").write_text("stretch,stress\n0.9,-100\n1.1,90\n1.2,170\n")
    skin = bar.points[np.unique(bar.surface)]
    np.savetxt(tmp_path / "cloud.csv", skin, delimiter=",", header="x,y,z", comments="")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def printed(encoding: str, errors: str, *words: str, monkeypatch: pytest.MonkeyPatch) -> tuple[int, bytes]:
    """The exit code of a command, and the bytes on a standard output of an encoding."""
    into = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(into, encoding=encoding, errors=errors))
    return main(words), into.getvalue()


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
def test_what_a_stream_cannot_spell_is_escaped(encoding: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code, told = printed(encoding, "strict", "solve", NAME, "-o", "solved.vtu", monkeypatch=monkeypatch)
    assert code == 0
    assert told.decode(encoding).startswith(f"{ESCAPED}: converged, ")
    assert (folder / "solved.vtu").exists()


def test_a_byte_of_a_name_that_is_no_letter_is_escaped_or_printed_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    for errors, expected in (("strict", b"\\udcff\n"), ("surrogateescape", b"\xff\n")):
        into = io.BytesIO()
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(into, encoding="utf-8", errors=errors))
        put(os.fsdecode(b"\xff") + "\n")
        assert into.getvalue().replace(b"\r\n", b"\n") == expected


WRITING = {
    "solve case.toml -o solved.vtu": ["solved.vtu"],
    "solve scan.toml -o solved.vtu": ["solved.vtu"],
    "fit test.csv --law NeoHookean --plot fitted.png": ["fitted.png"],
    "compare case.toml -o . --models Linear NeoHookean": ["compare.csv", "compare.png"],
    "register still.toml cloud.csv --units m --noise 1mm -o found.vtu": ["found.vtu"],
}
"""Commands that print what they have computed, and the files that they write."""


@needs_full_device
@pytest.mark.parametrize("words", WRITING)
def test_what_was_computed_is_written_though_it_cannot_be_printed(
    words: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main([*words.split(), "--json", "told.json"]) == 2
    assert "standard output: could not be written (No space left on device)" in capsys.readouterr().err
    assert json.loads((folder / "told.json").read_text())["status"] == "not written"
    for name in WRITING[words]:
        assert (folder / name).stat().st_size > 0, name


@needs_full_device
def test_a_deformed_image_is_written_though_it_cannot_be_printed(
    bar: vs.Mesh, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("SimpleITK", reason="images need SimpleITK: pip install viscera[scan]")
    vs.Scan.of(bar, voxel=0.05).write("labels.nrrd")
    assert main(["solve", "case.toml", "-o", "solved.vtu", "--quiet"]) == 0
    with open("/dev/full", "w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main(["warp", "labels.nrrd", "--with", "solved.vtu", "-o", "moved.nrrd", "--field", "field.nrrd"]) == 2
    assert (folder / "moved.nrrd").stat().st_size > 0
    assert (folder / "field.nrrd").stat().st_size > 0


def test_the_help_has_whole_sentences(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    told = " ".join(capsys.readouterr().out.split())
    names = [verb.__name__.rpartition(".")[2] for verb in VERBS]
    for name, following in zip(names, [*names[1:], "options:"], strict=True):
        summary = re.search(rf" {name} ([A-Z][^.]*\.) {following} ", told)
        assert summary is not None, f"the summary of {name} is not one sentence"
