"""A command line that cannot be read: what is wrong goes where the result for machines would go."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import viscera as vs
from viscera.cli import main


@pytest.fixture
def folder(bar: vs.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    bar.write(tmp_path / "bar.vtu")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["solve", "case.toml", "--stpes", "2"], "unrecognized arguments: --stpes 2; see viscera --help"),
        (["touch", "m.viscera"], "the following arguments are required: --at, --push; see viscera touch --help"),
        (["dmo"], "invalid choice: 'dmo'"),
    ],
)
def test_a_wrong_command_line_is_json_too(
    folder: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "a.json").write_text('{"status": "converged"}')
    for given in (["--json", "a.json"], ["--json=a.json"], ["--json", "-"]):
        with pytest.raises(SystemExit, match="2"):
            main([*words, *given])
        printed = capsys.readouterr()
        text = printed.out if "-" in given else (folder / "a.json").read_text()
        facts = json.loads(text)
        (folder / "a.json").write_text('{"status": "converged"}')
        assert list(facts) == ["status", "seconds", "message"]
        assert facts["status"] == "bad input"
        assert message in facts["message"]
        assert facts["message"] in printed.err


@pytest.mark.parametrize("name", ["--against", "--against="])
def test_a_wrong_command_line_replaces_nothing_that_it_names(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nor does it say more than what is wrong first."""
    (folder / "laws.json").write_text("{}")
    against = [f"{name}laws.json"] if name.endswith("=") else [name, "laws.json"]
    for words in (["bench", "laws", *against, "--lwas", "x"], ["solve", "bar.vtu", "--stpes", "2"]):
        with pytest.raises(SystemExit, match="2"):
            main([*words, "--json", "laws.json" if words[0] == "bench" else "bar.vtu"])
        assert capsys.readouterr().err.count("\n") == 1
    with pytest.raises(SystemExit, match="2"):
        main(["solve", "--json"])
    assert (folder / "laws.json").read_text() == "{}"
    assert vs.read("bar.vtu", units="m").volume > 0.0
