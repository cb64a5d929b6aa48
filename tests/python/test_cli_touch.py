"""What `viscera touch`, `check` and `view` say of a model: the value of its parameter, and where the contact is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import viscera as vs
from viscera.cli import main
from viscera.reduced.touch import load_bytes
from viscera.viewer import Server, page

PUSH = ("--push", "0", "0", "-1e-3")
AT = ("--at", "0.3", "0.05", "0.1")
CASE = """
mesh = "organ:beam"
fixed = "clamp"
material = {law = "NeoHookean", young = 1e5, poisson = 0.3}
[loads]
gravity = [0, 0, -9.81]
density = 1000
"""


@pytest.fixture(scope="module")
def folder(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model, and one for a range of each kind of parameter."""
    folder = tmp_path_factory.mktemp("models")
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    ranges = {
        "bar": None,
        "young": vs.Vary("young", 5e4, 2e5, nodes=2),
        "radius": vs.Vary("radius", 0.06, 0.09, nodes=2),
    }
    for name, vary in ranges.items():
        touch = organ.reduce("z > 99% and x > 40%", radius=0.07, depth=0.02, order=2, vary=vary)
        touch.save(folder / f"{name}.viscera")
    return folder


@pytest.fixture
def built() -> None:
    try:
        page.stepping_files()
    except vs.VisceraError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize(
    ("model", "words", "told", "value"),
    [
        ("young", (), "young = 100000 Pa, in the range 50000 to 200000 Pa", 1e5),
        ("young", ("--value", "6e4"), "young = 60000 Pa, in the range 50000 to 200000 Pa", 6e4),
        ("radius", ("--value", "80mm"), "radius = 0.08 m, in the range 0.06 to 0.09 m", 0.08),
    ],
)
def test_a_touch_says_which_value_it_answers_for(
    folder: Path, model: str, words: tuple[str, ...], told: str, value: float, capsys: pytest.CaptureFixture[str]
) -> None:
    result = folder / "a.json"
    assert main(["touch", str(folder / f"{model}.viscera"), *AT, *PUSH, *words, "--json", str(result)]) == 0
    assert capsys.readouterr().out.startswith(f"{told}\n")
    parameter = json.loads(result.read_text())["parameter"]
    assert (parameter["name"], parameter["value"]) == (model, pytest.approx(value))
    assert parameter["range"] == ([5e4, 2e5] if model == "young" else [0.06, 0.09])


def test_a_model_of_one_value_names_none(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["touch", str(folder / "bar.viscera"), *AT, *PUSH, "--json", str(folder / "a.json")]) == 0
    assert capsys.readouterr().out.startswith("force ")
    assert json.loads((folder / "a.json").read_text())["parameter"] is None


def test_check_takes_a_radius_in_words(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--touches", "1", "--depths", "1%", "--value", "80 mm"]
    assert main(["check", str(folder / "radius.viscera"), *words]) in {0, 1}
    assert "radius = 0.08)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("at", "told"),
    [
        (("0.3", "0.05", "0.07"), "contact at (300.0, 50.0, 100.0) mm, 30 mm from the given point\n"),
        (("0.3", "0.05", "0.14"), "contact at (300.0, 50.0, 100.0) mm, 40 mm from the given point\n"),
        (("0.3", "0.05", "0.099"), ""),
    ],
)
def test_a_contact_beside_the_given_point_is_told(
    folder: Path, at: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["touch", str(folder / "bar.viscera"), "--at", *at, *PUSH]) == 0
    assert capsys.readouterr().out.startswith(f"{told}force ")


@pytest.mark.parametrize("words", [("--at", "0,3", "0.05", "0.1", *PUSH), (*AT, "--push", "0", "0", "-0,001mm")])
def test_a_decimal_comma_is_named(folder: Path, words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["touch", str(folder / "bar.viscera"), *words])
    assert "has a comma; write decimals with a point, such as 0.01" in capsys.readouterr().err


def test_the_viewer_begins_at_a_value(folder: Path, monkeypatch: pytest.MonkeyPatch, built: None) -> None:
    served = []
    monkeypatch.setattr(Server, "run", lambda server: served.append(load_bytes(server._files[page.MODEL])))
    path = str(folder / "radius.viscera")
    assert main(["view", path, "--no-browser", "--quiet", "--value", "80mm"]) == 0
    assert served[0].radius == 0.08
    assert main(["view", path, "--quiet", "--value", "80mm", "--export", str(folder / "site")]) == 0
    assert vs.load(folder / "site" / page.MODEL).radius == 0.08


def test_an_address_that_no_browser_is_given_is_printed_also_when_quiet(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], built: None
) -> None:
    """It is random, and nobody else knows it."""
    served: list[str] = []
    opened: list[str] = []
    monkeypatch.setattr(Server, "run", lambda server: served.append(server.url))
    monkeypatch.setattr("webbrowser.open", opened.append)
    words = ["view", str(folder / "bar.viscera"), "--quiet"]
    assert main([*words, "--no-browser"]) == 0
    assert capsys.readouterr().out == f"{served[-1]}\n"
    assert main([*words, "--no-browser", "--json", "-"]) == 0
    printed = capsys.readouterr()
    assert printed.err == f"{served[-1]}\n"
    assert json.loads(printed.out)["status"] == "closed"
    assert main(words) == 0
    assert capsys.readouterr().out == ""


def test_a_case_has_no_value(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "case.toml").write_text(CASE)
    assert main(["view", str(folder / "case.toml"), "--no-browser", "--value", "3"]) == 2
    assert "case.toml is a case file, and --value is that of a model's parameter" in capsys.readouterr().err


def test_an_export_has_no_port(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["view", str(folder / "bar.viscera"), "--export", str(folder / "one.html"), "--port", "45671"]
    assert main(words) == 2
    assert "--port is that of the server on this machine, and --export needs none" in capsys.readouterr().err
    assert not (folder / "one.html").exists()


@pytest.mark.parametrize("words", [("--no-browser",), ("--export", "site")])
def test_loads_that_a_page_leaves_out_are_told(
    folder: Path,
    words: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    built: None,
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr(Server, "run", lambda server: None)
    told = "the page leaves out displacement and force of the case's [loads]; it takes gravity and density\n"
    (folder / "case.toml").write_text(CASE)
    assert main(["view", "case.toml", *words]) == 0
    assert told not in capsys.readouterr().out
    (folder / "case.toml").write_text(f"{CASE}force.tip = [0, 0, 1]\ndisplacement.top = [0, 'free', 'free']\n")
    assert main(["view", "case.toml", *words]) == 0
    assert told in capsys.readouterr().out


@pytest.mark.parametrize("name", ["page.html", "page.htm", "page.HTML"])
def test_a_page_in_one_file(folder: Path, name: str, built: None) -> None:
    assert main(["view", str(folder / "bar.viscera"), "--quiet", "--export", str(folder / name)]) == 0
    assert (folder / name).is_file()


@pytest.mark.parametrize("port", ["99999", "-1", "http"])
def test_what_is_no_port_is_refused_among_the_arguments(port: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["view", "none.viscera", "--port", port])
    assert stopped.value.code == 2
    told = f"argument --port: {port} is no port; give a whole number from 0 to 65535, 0 for any free one; see"
    assert told in capsys.readouterr().err
