"""`viscera bench`: what it measures, what it says of codes that are absent or fail, and when it calls a run worse."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera import cli
from viscera.bench import laws, measure, newton
from viscera.bench.peers import PEERS, Peer
from viscera.bench.problem import SIDE, cube
from viscera.law import LAWS


def test_the_body_is_a_whole_cube() -> None:
    problem = cube(300)
    edges = problem.points[problem.cells[:, 1:]] - problem.points[problem.cells[:, :1]]
    volumes = np.linalg.det(edges) / 6
    assert volumes.min() > 0.0
    assert volumes.sum() == pytest.approx(SIDE**3, rel=1e-12)
    assert len(vs.mesh(problem.points, problem.cells).surface) == 2 * 6 * 4**2


def test_solvers_agree_and_growth_is_fitted(tmp_path: Path) -> None:
    folder = tmp_path / "found"
    words = ["bench", "newton", "--cells", "48", "384", "--codes", "viscera cholesky", "viscera cg", "--quiet"]
    assert cli.main([*words, "-o", str(folder)]) == 0
    facts = json.loads((folder / "newton.json").read_text(encoding="utf-8"))
    assert [(row["code"], row["cells"]) for row in facts["rows"]] == [
        ("viscera cholesky", 48),
        ("viscera cg", 48),
        ("viscera cholesky", 384),
        ("viscera cg", 384),
    ]
    assert all(row["difference"] < 1e-6 and row["iterations"] > 4 and row["seconds"] > 0.0 for row in facts["rows"])
    assert set(facts["exponents"]) == {"viscera cholesky", "viscera cg"}
    printed = (folder / "newton.txt").read_text(encoding="utf-8")
    assert "printed on 2" in printed
    assert "growth exponents of an iteration: viscera cholesky " in printed
    assert (folder / "newton.png").stat().st_size > 10_000


@pytest.mark.parametrize("peer", [peer for peer in PEERS if peer.requires], ids=lambda peer: peer.name)
def test_other_codes_find_the_same(peer: Peer) -> None:
    absent = measure.missing(peer)
    if absent:
        pytest.skip(f"NOT TESTED: {peer.name}; {absent} is not installed")
    row = measure.measured(peer, 48, measure.reference(cube(48), peer.volumetric), 100.0)
    assert not row.fault
    assert row.difference < 1e-6


def test_what_is_absent_fails_or_takes_too_long_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    absent = replace(PEERS[0], name="absent", requires=("no_such_package",))
    monkeypatch.setattr(newton, "PEERS", (absent, PEERS[0]))
    rows = newton.run([48, 100])
    assert [(row.code, row.fault) for row in rows] == [
        ("absent", "no_such_package is not installed"),
        ("viscera cholesky", ""),
        ("viscera cholesky", ""),
    ]
    assert "no_such_package is not installed" in newton.table(rows)
    row = measure.measured(PEERS[0], 48, None, 0.01)
    assert row.fault == "not done after 0.01 s"
    row = measure.measured(replace(PEERS[0], name="unknown"), 48, None, 100.0)
    assert "there is no code 'unknown' to measure" in row.fault


def test_exponents_are_those_of_powers() -> None:
    rows = [measure.Row("one", n, iterations=10, seconds=1e-6 * n**1.5) for n in (1000, 8000, 64000)]
    assert newton.exponent(rows) == pytest.approx(1.5)
    assert np.isnan(newton.exponent(rows[:1]))


def test_every_law_has_a_sample() -> None:
    assert set(laws.samples()) == set(LAWS)


def test_laws_are_measured_and_compared_with_an_earlier_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(laws, "ELEMENTS", {"P1": 48})
    monkeypatch.setattr(laws, "TOUCHES", 2)
    words = ["bench", "laws", "--laws", "Linear", "NeoHookean"]
    assert cli.main([*words, "-o", str(tmp_path), "--quiet"]) == 0
    kept = json.loads((tmp_path / "laws.json").read_text(encoding="utf-8"))
    assert [row["law"] for row in kept["rows"]] == ["Linear", "NeoHookean"]
    for row in kept["rows"]:
        assert row["iteration"] > 0.0
        assert row["off_line"] > 0.0
        assert row["tick"] > 0.0
    kept["rows"][1]["iterations"] -= 5
    kept["rows"][1]["trusted"] = 5.0
    (tmp_path / "before.json").write_text(json.dumps(kept), encoding="utf-8")
    assert cli.main([*words, "--against", str(tmp_path / "before.json")]) == 1
    printed = capsys.readouterr().out
    assert "NeoHookean, P1: " in printed
    assert "500 % before" in printed


def row(law: str, **facts: float) -> laws.Row:
    usual = {
        "iterations": 12,
        "iteration": 1.0,
        "off_line": 2.0,
        "tick": 3.0,
        "trusted": 0.9,
        "beyond": 0,
        "worst": 0.5,
    }
    return laws.Row(law=law, element="P1", **{**usual, **facts})  # type: ignore[arg-type]


def test_a_slower_machine_is_not_a_slower_law() -> None:
    before = {each.key: each for each in (row("A"), row("B"), row("C"))}
    doubled = {"iteration": 2.0, "off_line": 4.0, "tick": 6.0}
    assert laws.worse([row(name, **doubled) for name in "ABC"], before) == []
    told = laws.worse([row("A", **doubled), row("B", **doubled), row("C", **{**doubled, "off_line": 6.0})], before)
    assert told == ["C, P1: off-line [s] grew 1.50 times as much as in the median of all laws"]
    told = laws.worse([row("A"), row("B", beyond=1), row("C", trusted=0.7)], before)
    assert told == [
        "B, P1: 1 trusted answers are beyond their allowance, 0 before",
        "C, P1: 70 % of the answers are trusted, 90 % before",
    ]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["newton", "--cells", "3"], "a body has at least 6 cells"),
        (["newton", "--cells", "99999999999"], "at most 10,000,000"),
        (["newton", "--limit", "0"], "give a positive number of seconds"),
        (["newton", "-o", "/dev/null/here"], "/dev/null"),
        (["newton", "--codes", "abacus"], "there is no code 'abacus' to measure; there are viscera cholesky"),
        (["newton", "--laws", "Yeoh"], "--laws is no option of `viscera bench newton`"),
        (["laws", "--cells", "100"], "--cells is no option of `viscera bench laws`"),
        (["laws", "--laws", "Hooke"], "there is no law 'Hooke'; there are Linear"),
        (["laws", "--elements", "Q1"], "there is no element 'Q1'; there are P1"),
        (["laws", "--against", "nowhere.json"], "nowhere.json"),
    ],
)
def test_bad_input_is_one_sentence(words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["bench", *words]) == 2
    assert sentence in capsys.readouterr().err


def test_a_comparison_of_nothing_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "kept.json").write_text(json.dumps(laws.facts([row("A")])), encoding="utf-8")
    assert cli.main(["bench", "laws", "--against", str(tmp_path / "kept.json")]) == 2
    assert "nothing could be compared" in capsys.readouterr().err


@pytest.mark.parametrize("value", ["fast", None, True, 0.0, -1.0])
def test_a_cost_that_is_no_number_is_refused(value: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = laws.facts([row("Linear")])
    kept["rows"][0]["iteration"] = value
    (tmp_path / "kept.json").write_text(json.dumps(kept), encoding="utf-8")
    assert cli.main(["bench", "laws", "--against", str(tmp_path / "kept.json")]) == 2
    assert "iteration of Linear, P1 is" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["{}", '{"rows": [{}]}', '{"rows": 3}', "no json", '["rows"]'])
def test_a_file_of_something_else(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "kept.json").write_text(text, encoding="utf-8")
    assert cli.main(["bench", "laws", "--against", str(tmp_path / "kept.json")]) == 2
    assert str(tmp_path / "kept.json") in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[]", "holds no rows of `viscera bench laws`; give the laws.json that it wrote"),
        ('{"rows": [1]}', "holds no rows of `viscera bench laws`"),
        ('{"rows": [{"law": "NeoHookean"}]}', "holds rows without 'element'"),
        ("rows", "is no JSON file"),
        (None, "no such file"),
    ],
)
def test_what_is_no_earlier_run_is_refused_in_a_sentence(
    text: str | None, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "kept.json"
    if text is not None:
        path.write_text(text)
    assert cli.main(["bench", "laws", "--against", str(path)]) == 2
    assert words in capsys.readouterr().err
    assert cli.main(["bench", "laws", "--against", str(tmp_path)]) == 2
    assert "is a folder, not a JSON file" in capsys.readouterr().err
