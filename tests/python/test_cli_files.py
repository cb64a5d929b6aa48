"""What a command writes never replaces what it reads, and is never written under the name of something else."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import viscera as vs
from viscera.cli import main
from viscera.output import picture

CASE = """
mesh = "bar.vtu"
units = "m"
fixed = "root"
material = {law = "NeoHookean", young = 1e5, poisson = 0.3}
loads.displacement.tip = ["free", "free", -0.02]
reduce = {touchable = "tip", radius = "70 mm", depth = "20 mm", order = 2}
"""
SCENE = """
loads.force."bar/tip" = [0, 0, -1]
[organs.bar]
mesh = "bar.vtu"
units = "m"
fixed = "root"
material = {law = "NeoHookean", young = 1e5, poisson = 0.3}
[[bodies]]
shape = "Shape"
surface = "body.stl"
units = "m"
position = [0, 0, 1]
"""
MESH = ["bar.vtu", "--units", "m", "--fixed", "root", "--young", "1e5", "--poisson", "0.3"]
AT = ["--at", "0.4", "0.05", "0.1", "--push", "0", "0", "-1e-3"]


@pytest.fixture(scope="module")
def made(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a file of each kind that commands read."""
    folder = tmp_path_factory.mktemp("inputs")
    bar.write(folder / "bar.vtu")
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    organ.reduce("tip", radius=0.07, depth=0.02, order=2).save(folder / "bar.viscera")
    state = organ.solve(force={"tip": (0, 0, -1)})
    state.write(folder / "solved.vtu")
    state.write(folder / "body.stl")
    (folder / "case.toml").write_text(CASE)
    (folder / "scene.toml").write_text(SCENE)
    (folder / "test.csv").write_text("stretch,stress\n0.9,-100\n1.1,90\n1.2,170\n")
    (folder / "marks.csv").write_text("name,x,y,z\ntip,0.4,0.05,0.05\n")
    (folder / "cloud.csv").write_text("x,y,z\n0.4,0.05,0.1\n")
    (folder / "scan.nii.gz").write_bytes(b"an image, which is not read before the names are compared")
    (folder / "site").mkdir()
    shutil.copy(folder / "bar.viscera", folder / "site" / "organ.viscera")
    (folder / "laws.json").write_text("{}")
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def refuses(folder: Path, words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The command says one sentence, with this in it, before any work, and leaves the folder as it was."""
    before = contents(folder)
    assert main(words) == 2
    printed = capsys.readouterr()
    assert sentence in printed.err
    assert printed.out == "", "the work had begun"
    assert printed.err.count("\n") == 1
    assert contents(folder) == before


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["solve", "case.toml", "-o", "bar.vtu"], "-o bar.vtu would replace 'bar.vtu', which is read"),
        (["solve", "case.toml", "--json", "case.toml"], "--json case.toml would replace 'case.toml'"),
        (["solve", "case.toml", "--json", "bar.vtu"], "--json bar.vtu would replace 'bar.vtu'"),
        (["solve", "wrong.toml", "--json", "bar.vtu"], "--json bar.vtu would replace 'bar.vtu', which holds no JSON"),
        (["solve", "scene.toml", "-o", "bar.vtu"], "-o bar.vtu would replace 'bar.vtu'"),
        (["solve", "scene.toml", "-o", "body.stl"], "-o body.stl would replace 'body.stl'"),
        (["solve", "case.toml", "-o", "new.vtu", "--json", "./new.vtu"], "would replace what -o writes"),
        (["reduce", "case.toml", "-o", "case.toml"], "-o case.toml would replace 'case.toml'"),
        (["reduce", "case.toml", "-o", "bar.vtu"], "-o bar.vtu would replace 'bar.vtu'"),
        (["reduce", *MESH, "-o", "bar.vtu"], "-o bar.vtu would replace 'bar.vtu'"),
        (["reduce", "case.toml", "--json", "case.viscera"], "--json case.viscera would replace what -o writes"),
        (["check", "bar.viscera", "--json", "bar.viscera"], "--json bar.viscera would replace 'bar.viscera'"),
        (["touch", "bar.viscera", *AT, "--json", "bar.viscera"], "--json bar.viscera would replace"),
        (["touch", "bar.viscera", *AT, "--picture", "bar.viscera"], "--picture bar.viscera would replace"),
        (["inspect", "bar.vtu", "--json", "bar.vtu"], "--json bar.vtu would replace 'bar.vtu'"),
        (["mesh", "body.stl", "--units", "m", "--edge", "20mm", "-o", "body.stl"], "-o body.stl would replace"),
        (["mesh", "body.stl", "--units", "m", "--edge", "20mm", "--json", "body.stl"], "--json body.stl would replace"),
        (["fit", "test.csv", "--plot", "test.csv"], "--plot test.csv would replace 'test.csv'"),
        (["fit", "test.csv", "--json", "test.csv"], "--json test.csv would replace 'test.csv'"),
        (["register", "case.toml", "cloud.csv", "-o", "bar.vtu"], "-o bar.vtu would replace 'bar.vtu'"),
        (["register", "case.toml", "cloud.csv", "--shape", "bar.vtu"], "--shape bar.vtu would replace 'bar.vtu'"),
        (["register", "case.toml", "cloud.csv", "--json", "cloud.csv"], "--json cloud.csv would replace 'cloud.csv'"),
        (["register", "case.toml", "--landmarks", "marks.csv", "--json", "marks.csv"], "--json marks.csv would"),
        (["register", "case.toml", "cloud.csv", "-o", "a.vtu", "--shape", "a.vtu"], "would replace what -o writes"),
        (["warp", "scan.nii.gz", "--with", "solved.vtu", "-o", "scan.nii.gz"], "-o scan.nii.gz would replace"),
        (["warp", "scan.nii.gz", "--with", "solved.vtu", "--field", "scan.nii.gz"], "--field scan.nii.gz would"),
        (["warp", "scan.nii.gz", "--with", "solved.vtu", "-o", "a.nrrd", "--json", "solved.vtu"], "--json solved.vtu"),
        (["warp", "scan.nii.gz", "--with", "solved.vtu", "-o", "a.mha", "--forward-field", "a.mha"], "what -o writes"),
        (["view", "site/organ.viscera", "--export", "site"], "would replace 'site/organ.viscera'"),
        (["view", "case.toml", "--export", "page", "--json", "case.toml"], "--json case.toml would replace"),
        (["compare", "case.toml", "--json", "case.toml"], "--json case.toml would replace"),
        (["compare", "case.toml", "-o", "site", "--json", "site/compare.csv"], "would replace what -o writes"),
        (["demo", "-o", ".", "--json", "liver.viscera"], "would replace what -o writes"),
        (["study", "liver", *MESH[:5], "--json", "bar.vtu"], "--json bar.vtu would replace"),
        (["bench", "laws", "--against", "laws.json", "-o", "."], "-o laws.json would replace 'laws.json'"),
        (["bench", "laws", "--against", "laws.json", "--json", "laws.json"], "--json laws.json would replace"),
    ],
)  # fmt: skip
def test_what_is_read_is_never_replaced(
    folder: Path, words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    refuses(folder, words, sentence, capsys)


def test_a_file_is_the_same_by_whatever_path_it_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "link.viscera").symlink_to("bar.viscera")
    os.link("case.toml", "twin.json")
    before = contents(folder)
    assert main(["check", str(folder / "bar.viscera"), "--json", "site/../bar.viscera"]) == 2
    assert main(["check", "bar.viscera", "--json", "link.viscera"]) == 2
    assert "--json link.viscera would replace 'bar.viscera', which is read" in capsys.readouterr().err
    assert main(["solve", "case.toml", "--json", "twin.json"]) == 2
    assert contents(folder) == before


@pytest.mark.skipif(not Path("/proc/self/mem").is_file(), reason="needs a file that is there and cannot be read")
def test_a_file_that_cannot_be_read_is_not_replaced(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", "case.toml", "--json", "/proc/self/mem"]) == 2
    printed = capsys.readouterr()
    assert "--json /proc/self/mem would replace '/proc/self/mem', which cannot be read (" in printed.err
    assert printed.out == ""


def test_a_device_may_serve_for_several(folder: Path) -> None:
    assert main(["touch", "bar.viscera", *AT, "--json", "/dev/null", "--picture", "/dev/null", "--quiet"]) == 0


@pytest.mark.parametrize("name", ["x.stl", "x.vtu", "x.msh", "x.feb", "x.toml", "x.GLB", "x.xdmf"])
def test_a_model_does_not_take_the_name_of_something_else(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["reduce", "case.toml", "-o", name]) == 2
    assert f"{name}: that is the name of a " in capsys.readouterr().err
    with pytest.raises(vs.VisceraError, match=f"{name}: that is the name of a .* end it in .viscera"):
        vs.load("bar.viscera").save(name)
    assert not (folder / name).exists()


@pytest.mark.parametrize("name", ["x", "x.viscera", "x.VISCERA", "x.model"])
def test_a_model_takes_every_other_name(folder: Path, name: str) -> None:
    vs.load("bar.viscera").save(name)
    assert (folder / name).read_bytes() == (folder / "bar.viscera").read_bytes()


@pytest.mark.parametrize("name", ["x.pdf", "x.vtu", "x.viscera", "x.jpg"])
def test_a_picture_does_not_take_the_name_of_something_else(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    sentence = f"{name}: a picture is written as PNG; end its name in .png, not in {Path(name).suffix}"
    assert main(["touch", "bar.viscera", *AT, "--picture", name]) == 2
    assert main(["fit", "test.csv", "--plot", name]) == 2
    assert capsys.readouterr() == ("", f"viscera touch: {sentence}\nviscera fit: {sentence}\n")
    touch, found = vs.load("bar.viscera"), vs.fit("NeoHookean", vs.MaterialTest("uniaxial", [1, 1.1], [0, 1]))
    organ = touch.organ()
    state, mesh = organ.solve(force={"x > 99%": (0, 0, -1)}), organ.mesh
    monkeypatch.setattr(picture, "Figure", lambda **_: pytest.fail("it was drawn first"))
    calls: tuple[Callable[[], object], ...] = (
        lambda: touch.plot((0.4, 0.05, 0.1), (0, 0, -1e-3), name),
        lambda: organ.plot(name),
        lambda: mesh.plot(name),
        lambda: state.plot(name),
        lambda: picture.draw_side_by_side(mesh.points, mesh.surface, {"": state.displacement}, path=name),
        lambda: found.plot(name),
    )
    for call in calls:
        with pytest.raises(vs.VisceraError, match=sentence):
            call()
    assert not (folder / name).exists()


@pytest.mark.parametrize("name", ["x.PNG", "x"])
def test_a_picture_is_written_under_its_own_name(folder: Path, name: str) -> None:
    assert main(["touch", "bar.viscera", *AT, "--picture", name]) == 0
    assert (folder / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["reduce", "none.vtu"], "none.vtu: no such file"),
        (["reduce", "site"], "site: is a folder, not a case file or a mesh"),
        (["reduce", "bar.viscera"], "bar.viscera: is a model, not a case file or a mesh; `viscera check`, `touch`"),
        (["reduce", "body.stl"], "body.stl: is a surface, not a case file or a mesh; `viscera mesh`"),
        (["reduce", "laws.json"], "laws.json: is no case file, which ends in .toml, and no mesh: .vtu, "),
        (["solve", "bar.viscera"], "bar.viscera: is a model, not a case file; `viscera check`, `touch`"),
        (["solve", "bar.vtu"], "bar.vtu: is a mesh, not a case file; `viscera inspect` and `reduce` take meshes"),
        (["compare", "bar.vtu"], "bar.vtu: is a mesh, not a case file; "),
        (["register", "bar.viscera", "cloud.csv"], "bar.viscera: is a model, not a case file; "),
        (["check", "site"], "site: is a folder, not a model"),
        (["check", "bar.vtu"], "bar.vtu: is a mesh, not a model; "),
        (["touch", "site", *AT], "site: is a folder, not a model"),
        (["view", "site"], "site: is a folder, not a model or a case file"),
        (["view", "bar.vtu"], "bar.vtu: is a mesh, not a model or a case file; "),
        (["mesh", "bar.vtu", "--edge", "8mm"], "bar.vtu: is a mesh, not an image or a surface; label maps end in .nii"),
        (["mesh", "test.csv", "--edge", "8mm"], "test.csv: unknown format; label maps end in .nii, "),
        (["mesh", "case.toml", "--edge", "8mm"], ".dcm, surfaces in .stl, .obj, .ply"),
        (["mesh", "site", "--edge", "8mm"], "site: is a folder, not an image or a surface"),
        (["mesh", "none.vtu", "--edge", "8mm"], "none.vtu: no such file"),
    ],
)
def test_a_file_of_the_wrong_kind_is_named(
    folder: Path, words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    refuses(folder, words, sentence, capsys)


def test_the_error_of_a_wrong_file_is_not_written_over_it(folder: Path) -> None:
    before = contents(folder)
    for verb, name in (("solve", "bar.vtu"), ("reduce", "bar.viscera"), ("check", "bar.vtu"), ("view", "bar.vtu")):
        assert main([verb, name, "--json", name]) == 2
    assert contents(folder) == before


@pytest.mark.parametrize(
    "words",
    [
        ["solve", "case.toml", "-o", ""],
        ["solve", "case.toml", "--json", ""],
        ["reduce", "case.toml", "-o", ""],
        ["touch", "bar.viscera", *AT, "--picture", ""],
        ["fit", "test.csv", "--plot", ""],
        ["mesh", "body.stl", "--units", "m", "--edge", "20mm", "-o", ""],
        ["register", "case.toml", "cloud.csv", "-o", ""],
        ["warp", "scan.nii.gz", "--with", "solved.vtu", "-o", ""],
        ["view", "bar.viscera", "--export", ""],
        ["compare", "case.toml", "-o", ""],
        ["demo", "-o", ""],
        ["study", "beam", "-o", ""],
        ["bench", "laws", "-o", ""],
    ],
)
def test_an_empty_name_is_refused(folder: Path, words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(folder)
    assert main(words) == 2
    assert "must be named by a text or a path, got ''" in capsys.readouterr().err
    assert contents(folder) == before


def test_a_mesh_whose_format_is_not_known_is_refused_before_it_is_made(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["mesh", "body.stl", "--units", "m", "--edge", "20mm", "-o", "x.stl"]) == 2
    printed = capsys.readouterr()
    assert "x.stl: unknown mesh format '.stl'" in printed.err
    assert printed.err.count("\n") == 1


@pytest.mark.parametrize("words", [["compare", "case.toml"], ["demo"], ["study", "beam"], ["bench", "laws"]])
def test_a_file_in_the_place_of_a_folder_is_named(
    folder: Path, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "-o", "test.csv"]) == 2
    assert "test.csv: no folder can be made there (a file has that name)" in capsys.readouterr().err


def test_a_refusal_is_not_written_over_the_file_that_is_wrong(folder: Path) -> None:
    (folder / "wrong.toml").write_text("mesh = 3\n")
    for verb in ("solve", "reduce", "compare", "view"):
        assert main([verb, "wrong.toml", "--json", "wrong.toml"]) == 2
        assert (folder / "wrong.toml").read_text() == "mesh = 3\n"
    assert main(["solve", "wrong.toml", "--json", "a.json"]) == 2
    assert '"bad input"' in (folder / "a.json").read_text(), "elsewhere it is"


def test_batches_of_a_linked_model_lie_beside_the_model_itself(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(made)
    link, batches = tmp_path / "link.viscera", tmp_path / "real" / "model.viscera.batches"
    batches.mkdir(parents=True)  # so that none can be kept there
    link.symlink_to(tmp_path / "real" / "model.viscera")
    assert main(["reduce", "case.toml", "-o", str(link)]) == 2
    assert f"{batches} is a folder" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.viscera", "real"]
