"""What `viscera doctor` finds, and what it advises."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

import viscera as vs
from viscera import cli, doctor, gpu
from viscera.cli.completion import FILES, is_file


def answered(tmp_path: Path) -> tuple[int, dict[str, Any]]:
    code = cli.main(["doctor", "--quiet", "--json", str(tmp_path / "facts.json")])
    return code, json.loads((tmp_path / "facts.json").read_text(encoding="utf-8"))


@pytest.fixture
def built_viewer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether the page is built is not what these tests ask."""
    monkeypatch.setattr(doctor, "_viewer", list)


@pytest.mark.usefixtures("built_viewer")
def test_a_sound_installation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYON_NUM_THREADS", "3")
    code, facts = answered(tmp_path)
    assert (code, facts["status"], facts["problems"]) == (0, "sound", [])
    assert facts["version"] == vs.__version__
    assert facts["threads"] == 3
    assert facts["packages"]["numpy"] == metadata.version("numpy")
    assert {"fit", "notebook"} <= set(facts["extras"])


def requires(*lines: str) -> Any:
    return lambda package: list(lines)


@pytest.mark.usefixtures("built_viewer")
def test_what_is_missing_or_old_is_named_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = requires(
        "numpy>=900.1",
        "not-there>=2",
        "tomli>=2; python_version < '3.2'",
        "neither>=1; extra == 'fit'",
        "viscera[docs]; extra == 'dev'",
    )
    monkeypatch.setattr(metadata, "requires", lines)
    code, facts = answered(tmp_path)
    assert (code, facts["status"]) == (1, "problems")
    version = metadata.version("numpy")
    assert facts["problems"] == [
        f"numpy {version} is older than 900.1: pip install 'numpy>=900.1'",
        "not-there is missing: pip install 'not-there>=2'",
    ]
    assert facts["extras"] == {"fit": {"neither": None}}
    assert cli.main(["doctor"]) == 1
    assert "  [fit]         none; pip install neither\n" in capsys.readouterr().out


@pytest.mark.usefixtures("built_viewer")
def test_a_package_without_metadata_is_examined_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As from a folder on PYTHONPATH."""

    def absent(package: str) -> list[str]:
        raise metadata.PackageNotFoundError(package)

    monkeypatch.setattr(metadata, "requires", absent)
    code, facts = answered(tmp_path)
    assert (code, facts["packages"], facts["extras"], facts["problems"]) == (0, {}, {}, [])
    assert facts["packages_fault"].startswith("not known, nor the extras: ")
    assert facts["cores"] > 0
    assert cli.main(["doctor"]) == 0
    assert "  packages      not known, nor the extras: " in capsys.readouterr().out


@pytest.mark.usefixtures("built_viewer")
def test_a_core_that_does_not_solve_is_a_problem(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*arguments: Any, **words: Any) -> None:
        raise vs.VisceraError("no vector units")

    monkeypatch.setattr(vs.Organ, "solve", broken)
    assert answered(tmp_path)[1]["problems"] == ["the compiled core does not solve: no vector units"]


@pytest.mark.parametrize("given", [None, "", "/somewhere"])
def test_a_machine_without_a_screen_is_no_finding(given: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """The graphics libraries print an error where no folder for sockets is named."""
    monkeypatch.delenv(doctor.RUNTIME_FOLDER, raising=False)
    if given is not None:
        monkeypatch.setenv(doctor.RUNTIME_FOLDER, given)
    seen = list[str]()

    def look() -> str:
        seen.append(os.environ[doctor.RUNTIME_FOLDER])
        assert given or Path(seen[0]).is_dir()
        raise vs.VisceraError("there is none")

    monkeypatch.setattr(gpu, "describe", look)
    assert doctor._gpu() == (None, "there is none")
    assert os.environ.get(doctor.RUNTIME_FOLDER) == given
    assert (seen == [given]) if given else not Path(seen[0]).exists()


def test_the_doctor_prints_nothing_beside_its_findings() -> None:
    """Nor does a library that it loads, on a machine without a screen."""
    around = {name: value for name, value in os.environ.items() if name != doctor.RUNTIME_FOLDER}
    done = subprocess.run(
        [sys.executable, "-m", "viscera", "doctor"], env=around, capture_output=True, text=True, check=False
    )
    assert done.stderr == ""


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion_knows_verbs_and_options(shell: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["completion", shell]) == 0
    script = capsys.readouterr().out
    for verb in cli.VERBS:
        assert verb.__name__.rpartition(".")[2] in script
    assert "--touchable" in script
    if program := shutil.which(shell):
        (tmp_path / "script").write_text(script, encoding="utf-8")
        assert subprocess.run([program, "-n", tmp_path / "script"], check=False).returncode == 0


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As at a prompt: verbs, choices, options, and files where a file is asked for."""
    cli.main(["completion", "bash"])
    (tmp_path / "script").write_text(capsys.readouterr().out, encoding="utf-8")
    (tmp_path / "kidney.toml").touch()

    def completed(*words: str) -> list[str]:
        line = " ".join(f"'{word}'" for word in ("viscera", *words))
        ask = f"source ./script; COMP_WORDS=({line}); COMP_CWORD={len(words)}; _shtab_viscera; echo ${{COMPREPLY[@]}}"
        done = subprocess.run(["bash", "-c", ask], cwd=tmp_path, capture_output=True, text=True, check=False)
        return done.stdout.split()

    assert completed("so") == ["solve"]
    assert completed("study", "art") == ["artery"]
    assert completed("reduce", "--touch") == ["--touchable"]
    assert "kidney.toml" in completed("solve", "kid")


def test_the_citation_names_this_version() -> None:
    text = (Path(__file__).resolve().parents[2] / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {vs.__version__}\n" in text
    yaml = pytest.importorskip("yaml", reason="PyYAML comes with viscera[docs]")
    cited = yaml.safe_load(text)
    assert {"cff-version", "message", "title", "authors"} <= set(cited)
    assert cited["references"][0]["doi"] == "10.1002/nme.4531"


NO_FILES = {
    "AREA", "DEPTH", "DIR", "LENGTH", "MODEL", "N", "NAME", "NAME=NUMBER", "PA", "PLACE", "QUESTION", "SECONDS", "SET",
    "STRAIN",
}  # fmt: skip


def test_completion_knows_of_every_word_whether_it_is_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    """A new one must be among the words for files, or among those above."""
    (verbs,) = (each for each in cli.command_line()._actions if isinstance(each, argparse._SubParsersAction))
    words = {action.metavar for verb in verbs.choices.values() for action in verb._actions}
    words = {word for word in words if isinstance(word, str)}
    assert {word for word in words if not is_file(word)} == NO_FILES
    assert {each for word in words for each in word.split("|")} >= FILES
    cli.main(["completion", "bash"])
    script = capsys.readouterr().out
    for option in ("warp___with", "warp__o", "warp___forward_field", "warp_pos_0", "register___shape", "register_pos_1",
                   "view___export", "mesh_pos_0"):  # fmt: skip
        assert f"_shtab_viscera_{option}_COMPGEN=_shtab_compgen_files" in script, option
