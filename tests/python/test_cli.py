"""The command line: exit codes, one-sentence errors, JSON for machines."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

import viscera as vs
from viscera import _core
from viscera.cli import VERBS, demo, main
from viscera.cli import touch as touch_verb
from viscera.output import state as statefile
from viscera.select import length, offset
from viscera.select import point as point_of
from viscera.study import liver as paper

CASE = """
mesh = "bar.vtu"
units = "m"
fixed = "root"
material = {law = "NeoHookean", young = 1e5, poisson = 0.3}
[loads]
displacement.tip = ["free", "free", -0.02]
[reduce]
touchable = "tip"
radius = "70 mm"
depth = "20 mm"
order = 2
"""
MESH = ["bar.vtu", "--units", "m", "--fixed", "root", "--young", "1e5", "--poisson", "0.3"]
REDUCTION = ["--touchable", "z >= 100% and x > 40%", "--radius", "70 mm", "--depth", "20mm", "--order", "3"]


@pytest.fixture
def folder(bar: vs.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    bar.write(tmp_path / "bar.vtu")
    (tmp_path / "case.toml").write_text(CASE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def model(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    path = tmp_path_factory.mktemp("model") / "bar.viscera"
    organ.reduce(lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.15), radius=0.07, depth=0.02, order=4).save(path)
    return path


def run(*words: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    code = main(words)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def run_json(*words: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, Any]]:
    code, out, _ = run(*words, "--json", "-", capsys=capsys)
    return code, json.loads(out)


def test_inspect(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, facts = run_json("inspect", "bar.vtu", capsys=capsys)
    assert code == 0
    assert facts["status"] == "sound"
    assert (facts["n_points"], facts["n_cells"]) == (81, 192)
    assert facts["volume"] == pytest.approx(0.004)
    assert facts["problems"] == []
    assert facts["seconds"] >= 0
    assert "4000 ml" in run("inspect", "bar.vtu", capsys=capsys)[1]


def test_inspect_names_what_is_wrong(bar: vs.Mesh, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, facts = run_json("inspect", "bar.vtu", "--units", "cm", capsys=capsys)
    assert code == 0
    assert facts["volume"] == pytest.approx(4e-9)
    (folder / "bar.vtu").write_text((folder / "bar.vtu").read_text(errors="ignore")[:300])
    code, _, err = run("inspect", "bar.vtu", capsys=capsys)
    assert code == 2
    assert err.startswith("viscera inspect: bar.vtu")


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        ("points", "point 3 has a coordinate that is not finite"),
        ("cells", "cell 5 [0, 4, 9, 1000] names a point that is not one of 81"),
        ("turned", "cell 5 is inverted"),
    ],
)
def test_a_script_can_stop_at_a_bad_mesh(
    bar: vs.Mesh, folder: Path, spoil: str, problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    points, cells = bar.points.copy(), bar.cells.astype(int)
    if spoil == "points":
        points[3, 1] = np.nan
    else:
        cells[5] = [0, 4, 9, 1000] if spoil == "cells" else cells[5][[1, 0, 2, 3]]
    meshio.vtu.write("bad.vtu", meshio.Mesh(points, [("tetra", cells)]))
    code, facts = run_json("inspect", "bad.vtu", capsys=capsys)
    assert (code, facts["status"], facts["n_cells"]) == (1, "problems", 192)
    assert facts["problems"][0].startswith(problem)
    code, out, err = run("inspect", "bad.vtu", capsys=capsys)
    assert (code, err) == (1, "")
    assert f"problem       {problem}" in out


def test_solve_gives_what_the_api_gives(bar: vs.Mesh, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, facts = run_json("solve", "case.toml", "-o", "out.vtu", capsys=capsys)
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    state = organ.solve(displacement={"tip": (None, None, -0.02)})
    assert code == 0
    assert facts["status"] == "converged"
    assert facts["max_displacement"] == pytest.approx(state.max_displacement, rel=1e-9)
    assert facts["energy"] == pytest.approx(state.energy, rel=1e-9)
    assert facts["reactions"]["tip"] == pytest.approx(state.reaction("tip"), rel=1e-6, abs=1e-8)
    assert set(facts) >= {"status", "seconds", "iterations", "residuals", "volume_ratio", "reactions"}
    assert (folder / "out.vtu").is_file()


@pytest.mark.parametrize("ending", [*statefile.VOLUMES, *statefile.SURFACES])
def test_no_format_prints_what_nobody_asked_for(folder: Path, ending: str, capfd: pytest.CaptureFixture[str]) -> None:
    if ending == ".xdmf":
        pytest.importorskip("h5py")
    assert main(["solve", "case.toml", "-o", f"out{ending}", "--quiet"]) == 0
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["out.docx", "out.inp", "out"])
def test_a_format_that_no_solution_fits_is_refused_before_the_work(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(vs.Organ, "solve", lambda *_, **__: pytest.fail("it was solved first"))
    code, out, err = run("solve", "case.toml", "-o", name, capsys=capsys)
    assert (code, out) == (2, "")
    assert f"{name}: a solution cannot be written as" in err
    assert ".glb" in err
    assert not (folder / name).exists()


def test_a_package_that_xdmf_needs_is_named_before_the_work(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("viscera.output.state.find_spec", lambda name: None)
    monkeypatch.setattr(vs.Organ, "solve", lambda *_, **__: pytest.fail("it was solved first"))
    code, out, err = run("solve", "case.toml", "-o", "out.xdmf", capsys=capsys)
    assert (code, out) == (2, "")
    assert err.startswith("viscera solve: out.xdmf: writing .xdmf needs the package h5py, which is not installed")


def test_solve_says_what_a_surface_file_leaves_out(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run("solve", "case.toml", "-o", "out.stl", capsys=capsys)
    assert code == 0
    assert "written to out.stl: the deformed surface without its fields" in out
    assert len(meshio.read(folder / "out.stl").cells_dict["triangle"]) == 144


def test_where_the_json_cannot_go_is_said_before_the_work(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(vs.Organ, "solve", lambda *_, **__: pytest.fail("it was solved first"))
    code, out, err = run("solve", "case.toml", "--json", "no/where.json", capsys=capsys)
    assert (code, out) == (2, "")
    assert err == "viscera solve: no/where.json: the folder 'no' does not exist; create it first\n"


def test_a_solve_that_does_not_converge_exits_1(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    hopeless = CASE.replace("-0.02", "-0.09") + "[settings.newton]\nmax_iterations = 1\nsmallest_step = 0.9\n"
    (folder / "case.toml").write_text(hopeless)
    code, facts = run_json("solve", "case.toml", capsys=capsys)
    assert code == 1
    assert facts["status"] != "converged"
    assert facts["load"] < 1
    assert facts["message"]


def test_reduce_from_a_case_and_from_a_mesh(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, facts = run_json("reduce", "case.toml", capsys=capsys)
    assert code == 0
    assert facts["terms"] == 9
    assert facts["file_bytes"] == (folder / "case.viscera").stat().st_size
    assert vs.load(folder / "case.viscera").radius == pytest.approx(0.07)
    code, facts = run_json("reduce", *MESH, *REDUCTION, "-o", "other.viscera", capsys=capsys)
    assert code == 0
    assert set(facts) >= {"status", "seconds", "positions", "terms", "modes", "file_bytes", "worst_error"}
    assert vs.load(folder / "other.viscera").order == 3


def test_check(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, facts = run_json("check", str(model), "--touches", "2", "--depths", "1%", "10 mm", capsys=capsys)
    assert code == 0, facts
    assert facts["status"] == "passed"
    assert [row["depth_fraction"] for row in facts["touches"]] == pytest.approx([0.01, 0.01 / 0.18**0.5] * 2)
    assert set(facts) >= {"touches", "worst", "median"}


def test_a_seed_is_not_negative(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run("check", str(model), "--seed", "-1", capsys=capsys)
    assert (code, out) == (2, "")
    assert err == "viscera check: seed must be a whole number from 0 to 4294967295, got -1\n"


def test_a_check_that_fails_exits_1(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("viscera.defaults.ALLOWED_ERROR", {1.0: 1e-12})
    code, out, _ = run("check", str(model), "--touches", "1", "--depths", "1%", capsys=capsys)
    assert code == 1
    assert "FAILED" in out


def test_a_check_that_says_nothing_exits_1(bar: vs.Mesh, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    organ.reduce("tip", radius=0.07, depth=0.08, order=2).save("doubtful.viscera")
    words = ("check", "doubtful.viscera", "--touches", "1", "--depths", "80 mm")
    code, facts = run_json(*words, capsys=capsys)
    assert (code, facts["status"], facts["trusted_share"]) == (1, "nothing could be checked", 0.0)
    code, out, _ = run(*words, capsys=capsys)
    assert code == 1
    assert "the model trusts 0 of 1 answers (0 %)" in out
    assert "nothing could be checked: 1 of 1 full solutions converged, 0 of their answers trusted" in out


def test_touch(model: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["touch", str(model), "--at", "0.3", "50mm", "0.1", "--push", "1e-3", "0", "-1e-2", "--picture", "p.png"]
    code, facts = run_json(*words, capsys=capsys)
    answer = vs.load(model)((0.3, 0.05, 0.1), (1e-3, 0, -0.01))
    assert code == 0
    assert facts["force"] == pytest.approx(answer.force)
    assert np.array(facts["stiffness"]) == pytest.approx(answer.stiffness)
    assert facts["max_displacement"] == pytest.approx(answer.max_displacement)
    assert set(facts) >= {"force", "stiffness", "error_estimate", "is_trusted", "max_displacement"}
    assert (folder / "p.png").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["inspect", "none.vtu"], "viscera inspect: none.vtu: no such file"),
        (["solve", "none.toml"], "viscera solve: none.toml: no such case file"),
        (["check", "none.viscera"], "viscera check: none.viscera: no such model file"),
        (["check", "case.toml"], "viscera check: case.toml is a case file, not a model; `viscera solve`, `reduce`, "),
        (
            ["touch", "case.toml", "--at", "0", "0", "0", "--push", "0", "0", "0"],
            "case.toml is a case file, not a model; ",
        ),
        (["inspect", "case.toml"], "viscera inspect: case.toml is a case file, not a mesh; "),
        (["touch", "bar.vtu", "--at", "0", "0", "0", "--push", "0", "0", "0"], "viscera touch: bar.vtu: "),
        (["reduce", "bar.vtu"], "it needs --fixed as well"),
        (["reduce", *MESH[:1], *MESH[3:]], "needs its units"),
        (
            ["reduce", *MESH, "--poisson", "0.5"],
            "poisson in [material] must be a number above -1 and below 0.5, got 0.5",
        ),
        (["reduce", *MESH, "--young", "-1"], "young in [material] must be a number above 0"),
        (["reduce", *MESH, "--law", "Hookean"], "did you mean 'NeoHookean'"),
        (["reduce", *MESH, "--law", "MooneyRivlin"], "[material] MooneyRivlin: "),
        (["reduce", *MESH, "--fixed", "rot"], "did you mean 'root'"),
        (["reduce", *MESH, "--fixed", "x < 3"], "3 has no unit"),
        (["reduce", *MESH, "--depth", "0"], "depth in [reduce] must be a number above 0 and at most 1000 [m], got 0.0"),
        (["reduce", *MESH, "--depth", "5000"], "must be a number above 0 and at most 1000 [m], got 5000.0"),
        (["solve", "organ:beam"], "viscera solve: organ:beam: a built-in organ is a mesh, not a case file; "),
        (["reduce", *MESH, "--depth", "-5%"], "depth in [reduce] must be a number above 0"),
        (["reduce", *MESH, "--depth", "101%"], "at most the organ's diagonal"),
        (["reduce", *MESH, "--radius", "wide"], "radius in [reduce] 'wide' is not a length"),
        (["reduce", "case.toml", "--young", "1"], "change it there, and leave out --young"),
        (["reduce", *MESH, *REDUCTION, "-o", "no/where.viscera"], "create it first"),
        (["demo", "--touches", "0"], "touches must be a whole number from 1 to 1000000, got 0"),
    ],
)
def test_bad_input_is_one_sentence(
    folder: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = run(*words, capsys=capsys)
    assert code == 2
    assert out == ""
    assert message in err
    assert err.count("\n") == 1


def test_bad_input_is_json_too(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, facts = run_json("solve", "none.toml", capsys=capsys)
    assert code == 2
    assert facts["status"] == "bad input"
    assert "no such case file" in facts["message"]
    assert main(["inspect", "bar.vtu", "--json", "no/where.json"]) == 2


@pytest.mark.parametrize("words", [[], ["dmo"], ["touch", "m.viscera"], ["check", "m.viscera", "--touches", "some"]])
def test_a_wrong_command_line_exits_2(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(words)
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("verb", ["demo", "inspect", "solve", "reduce", "check", "touch"])
def test_every_verb_explains_itself(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([verb, "--help"])
    assert stopped.value.code == 0
    out = capsys.readouterr().out
    assert all(option in out for option in ("--json", "--quiet"))


@pytest.mark.parametrize("verb", [verb.__name__.rpartition(".")[2] for verb in VERBS])
def test_help_fits_the_terminal(verb: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Its paragraphs and its examples stay what they are."""
    monkeypatch.setenv("COLUMNS", "50")
    with pytest.raises(SystemExit):
        main([verb, "--help"])
    told = (import_module(f"viscera.cli.{verb}").__doc__ or "").strip()
    described = capsys.readouterr().out.split("\n\n", 1)[1]
    examples = [line for line in told.splitlines() if line.startswith("viscera ")]
    assert [line for line in described.splitlines() if line in examples] == examples
    paragraphs = described.split("\n\n")[: told.count("\n\n") + 1]
    assert [" ".join(each.split()) for each in paragraphs] == [" ".join(each.split()) for each in told.split("\n\n")]
    assert all(len(line) <= 48 or line in examples for each in paragraphs for line in each.splitlines())


def test_quiet_says_nothing(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["check", str(model), "--touches", "1", "--depths", "1%", "--quiet"]
    assert run(*words, capsys=capsys) == (0, "", "")


def test_ctrl_c_leaves_nothing_half_written(tmp_path: Path) -> None:
    program = "import sys; from viscera.cli import main; print('ready', flush=True); sys.exit(main())"
    words = ["reduce", "organ:liver", "--fixed", "hilum", "--young", "1e5", "--poisson", "0.4", "--order", "4"]
    process = subprocess.Popen(
        [sys.executable, "-c", program, *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.5)  # into the reduction, which takes far longer than this
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    *before, last = err.splitlines()
    assert all(line.startswith("solve ") for line in before), "progress, where the work was slow to stop"
    if kept := [path.name for path in tmp_path.iterdir()]:  # a machine so quick that positions were finished
        assert kept == ["liver.viscera.batches"]
        assert last.startswith("viscera reduce: interrupted; finished positions are kept in liver.viscera.batches")
    else:
        assert last == "viscera reduce: interrupted; nothing was left half-written"


def test_a_case_without_loads_says_that_nothing_acts(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = 'mesh = "bar.vtu"\nunits = "m"\nfixed = "root"\nmaterial = {law = "Linear", mu = 1e5, lam = 1e5}\n'
    (folder / "still.toml").write_text(words, encoding="utf-8")
    code, out, _ = run("solve", "still.toml", capsys=capsys)
    assert code == 0
    assert "still.toml: converged, 1 iteration in " in out
    assert "nothing acts on the organ" in out


def test_cells_that_are_inside_out_are_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = 'mesh = "bar.vtu"\nunits = "m"\nfixed = "root"\nmaterial = {law = "Linear", mu = 1e5, lam = 0.0}\n'
    words += "[loads.displacement]\ntip = [-0.8, 0, 0]\n"
    (folder / "turned.toml").write_text(words, encoding="utf-8")
    code, out, _ = run("solve", "turned.toml", capsys=capsys)
    assert code == 0
    assert "\n  192 of 192 cells are inside out\n" in out


def test_a_push_of_no_size_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It ended well, with a force that was no number."""
    assert run("reduce", *MESH, *REDUCTION, "-o", "pushed.viscera", capsys=capsys)[0] == 0
    at, push = ("--at", "0.4", "0.05", "0.1"), ("--push", "0", "0", "-1e100")
    code, _, error = run("touch", "pushed.viscera", *at, *push, capsys=capsys)
    assert code == 2
    assert "contact displacement must be three finite numbers [m], none above 1000 in size" in error


@pytest.mark.parametrize("words", [(), ("--paper",)])
def test_the_demo_touches_the_tissue_that_it_tells(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On a few positions, so that it takes seconds."""
    few: dict[str, Any] = {"touchable": "anterior and within 12 mm of (-15, -59, 49) mm", "depths": ["4 mm"]}
    for name in ("MEASURED", "PAPER"):
        monkeypatch.setattr(demo, name, replace(getattr(demo, name), **few, reduction={"depth": "8 mm", "order": 2}))
    code, printed, _ = run(
        "demo", "-o", str(tmp_path), "--touches", "1", "--json", str(tmp_path / "a.json"), *words, capsys=capsys
    )
    facts = json.loads((tmp_path / "a.json").read_text())
    assert code == 0
    assert printed.startswith("liver: 2613 nodes, 11714 cells, " + ("P1; " if words else "P1 mean volume; "))
    assert (tmp_path / "liver.png").is_file()
    force, stiffer = facts["forces"]["4 mm"], facts["forces"]["8 mm"]
    assert 1.8 * force < stiffer < 2.5 * force
    assert force > 5.0 if words else force < 1.0  # newtons


def test_the_demos_tissue_is_as_soft_as_measured_and_that_of_the_paper_the_papers() -> None:
    assert 2.3e3 < demo.MEASURED.young < 5.9e3
    assert (demo.PAPER.young, demo.PAPER.poisson) == (paper.YOUNG, paper.POISSON)


def test_the_example_of_touch_lies_on_the_demos_own_liver() -> None:
    liver = vs.organs.liver()
    words = (touch_verb.__doc__ or "").split("--at ")[1].split()
    at = point_of(words[:3], liver, "at")
    triangles = liver.surface[np.isin(liver.surface, liver.nodes(demo.MEASURED.touchable)).all(axis=1)]
    _, _, distance = _core.Surface(liver.points, triangles).closest(at)
    assert distance < 1e-3
    push = offset(words[4:7], liver, "push")
    assert 0.005 <= np.linalg.norm(push) < length(demo.MEASURED.reduction["depth"], liver.diagonal, "depth")


def test_percentages_of_a_point_count_along_the_bounding_box(tmp_path: Path, bar: vs.Mesh) -> None:
    touch = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root").reduce("z > 99% and x > 70%", order=2)
    touch.save(tmp_path / "bar.viscera")
    answers = []
    for at, push in ((("0.38", "5cm", "100%"), ("0", "0", "-1mm")), (("95%", "50%", "100 mm"), ("0", "0", "-0.001"))):
        words = [
            "touch",
            str(tmp_path / "bar.viscera"),
            "--at",
            *at,
            "--push",
            *push,
            "--json",
            str(tmp_path / "a.json"),
        ]
        assert main(words) == 0
        answers.append(json.loads((tmp_path / "a.json").read_text())["force"])
    assert answers[0] == pytest.approx(answers[1])


def test_a_percentage_of_nothing_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """The length of a specimen has no diagonal to be a part of."""
    with pytest.raises(SystemExit, match="2"):
        main(["fit", "test.csv", "--length", "10%", "--area", "1e-4"])
    assert "10% of what? write metres, or a number with its unit" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        main(["fit", "test.csv", "--length", "long", "--area", "1e-4"])
    assert "length 'long' is not a length; write it as '12 mm';" in capsys.readouterr().err
