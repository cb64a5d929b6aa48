"""Case files of scenes: the API's words, the same numbers, both ways; who takes them and who does not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

import viscera as vs
from viscera import cli
from viscera.cases.case import read_case
from viscera.cases.scene_case import SceneCase
from viscera.viewer.live import live_case

LAW = vs.NeoHookean(young=1e5, poisson=0.3)
GOOD = """
[organs.lower]
mesh = "bar.vtu"
units = "m"
fixed = "root"
[organs.lower.material]
law = "NeoHookean"
young = 1e5
poisson = 0.3

[organs.upper]
mesh = "bar.vtu"
units = "m"
position = "(0, 0, 11) cm"
[organs.upper.supports.root]
stiffness = 1e6
[organs.upper.material]
law = "NeoHookean"
young = 1e5
poisson = 0.3

[[contacts]]
first = "lower/z > 99%"
second = "upper"

[[springs]]
first = "lower/x > 99%"
point = [0.4, 0.05, "40 cm"]
stiffness = 20
cable = true

[[bodies]]
shape = "HalfSpace"
position = [0, 0, "-0.1 mm"]

[loads]
gravity = [0, 0, -9.81]
density = {lower = 900, upper = 1000}
force."upper/x > 99% and z > 50%" = [0, 0, -1.5]
"""


@pytest.fixture
def folder(bar: vs.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    bar.write(tmp_path / "bar.vtu")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def read(folder: Path, words: str = GOOD) -> SceneCase:
    (folder / "scene.toml").write_text(words, encoding="utf-8")
    case = vs.case(folder / "scene.toml")
    assert isinstance(case, SceneCase)
    return case


def by_hand(bar: vs.Mesh) -> tuple[vs.Scene, dict[str, Any]]:
    above = vs.mesh(bar.points + np.array([0, 0, 0.11]), bar.cells, bar.sets)
    scene = vs.Scene(
        {
            "lower": vs.Organ(bar, LAW, fixed="root"),
            "upper": vs.Organ(above, LAW, supports=[vs.ElasticSupport("root", 1e6)]),
        },
        bodies=[vs.Tool(vs.HalfSpace(), position=(0, 0, -1e-4))],
        bonds=[vs.Spring("lower/tip", point=(0.4, 0.05, 0.4), stiffness=20.0, cable=True)],
        contacts=[vs.ContactPair(("lower", "z > 99%"), "upper")],
    )
    where = scene.place("upper", "x > 99% and z > 50%")
    loads: dict[str, Any] = {"force": {where: (0, 0, -1.5)}, "gravity": (0, 0, -9.81)}
    return scene, {**loads, "density": {"lower": 900, "upper": 1000}}


def test_a_case_gives_what_the_api_gives(bar: vs.Mesh, folder: Path) -> None:
    case = read(folder)
    scene = case.organ()
    state = case.solve(scene)
    hand, loads = by_hand(bar)
    expected = hand.solve(**loads)
    assert state.is_converged
    assert abs(state.displacement - expected.displacement).max() < 1e-9
    facts = case.facts(scene, state)
    (contact,), (spring,), (body,) = facts["contacts"], facts["springs"], facts["bodies"]
    assert contact["force"] == pytest.approx(expected.force(hand.contacts[0]), rel=1e-6, abs=1e-8)
    assert contact["force"][2] < -1.0
    assert spring["force"] == pytest.approx(expected.support_force(hand.bonds[0]), rel=1e-6, abs=1e-8)
    assert body["force"] == pytest.approx(expected.force(hand.bodies[0]), rel=1e-6, abs=1e-8)
    assert body["force"][2] > 1.0
    reactions = case.reactions(scene, state)
    assert list(reactions) == ["lower/root", "upper/root"]
    weight = 9.81 * bar.volume * (900 + 1000) + 1.5
    total = np.sum([*reactions.values(), spring["force"], body["force"]], axis=0)
    assert total == pytest.approx([0, 0, weight], abs=1e-6 * weight)


def test_what_is_written_is_read(bar: vs.Mesh, folder: Path) -> None:
    scene, loads = by_hand(bar)
    bodies = [
        vs.Tool(vs.Box((0.1, 0.2, 0.01), rounding="1 mm"), (0, 0, -0.2), (0.0, 0.1, 0.0), friction="bonded"),
        vs.Tool(vs.Capsule(0.01, 0.05), (0, 0, 0.5), displacement=(0, 0, 1e-3), turn=(0, 0, 0.1), stiffness=20.0),
        vs.Tool(vs.Sphere("1 cm"), (1, 1, 1), friction=0.2),
        *scene.bodies,
    ]
    tied = [
        vs.Bond(("lower", lambda x: x[:, 0] < 0.1), ("upper", "x < 25%"), sliding=True, stiffness=10, reach="2 cm"),
        vs.Spring("lower/tip", scene.place("upper", "x > 99% and z > 50%"), stiffness=5.0, length="1 cm"),
        *scene.bonds,
    ]
    scene = vs.Scene(scene.organs, bodies, tied, scene.contacts)
    written = scene.to_case(folder / "two.toml", loads=loads, settings={"steps": 2, "newton": {"max_iterations": 60}})
    assert written == vs.case(folder / "two.toml")
    assert sorted(path.name for path in folder.glob("two*")) == ["two.toml", "two_lower_mesh.vtu", "two_upper_mesh.vtu"]
    again = written.organ()
    state, other = scene.solve(**loads, steps=2, settings={"max_iterations": 60}), written.solve(again)
    assert state.is_converged
    assert abs(state.displacement - other.displacement).max() < 1e-9
    assert repr(again) == repr(scene)
    assert repr(again.bodies) == repr(scene.bodies)
    for one, two in zip(scene.bodies, again.bodies, strict=True):
        assert two._spec()[1:] == one._spec()[1:]


def test_what_a_case_has_no_word_for(bar: vs.Mesh, folder: Path) -> None:
    scene, _ = by_hand(bar)
    solid = vs.Scene(scene.organs, [vs.Tool(vs.Shape(vs.organs.beam()), position=(5, 0, 0))])
    held = vs.Organ(bar, LAW, fixed="root", supports=[vs.Spring("tip", point=(1, 0, 0), stiffness=1.0)])
    make: Any
    for make, sentence in (
        (lambda: solid.to_case("a.toml"), "the surface of the body Tool.* is in no file"),
        (lambda: scene.to_case("a.toml", loads={"force": {"x > 99%": (0, 0, 1)}}), "'x > 99%' spans several organs"),
        (lambda: vs.Scene({"bar": held}).to_case("a.toml"), "no word for springs"),
        (lambda: scene.to_case("a.json"), "ends in .toml"),
        (lambda: scene.to_case("a.toml", loads={"wind": 1}), "unknown key 'wind' in .loads"),
    ):
        with pytest.raises(vs.VisceraError, match=sentence):
            make()
    assert sorted(path.name for path in folder.iterdir()) == ["bar.vtu"]


def test_mesh_files_of_odd_names_stay_apart(bar: vs.Mesh, folder: Path) -> None:
    organ = vs.Organ(bar, LAW, fixed="root")
    above = vs.Organ(vs.mesh(bar.points + np.array([0, 0, 1]), bar.cells, bar.sets), LAW, fixed="root")
    case = vs.Scene({"le foie: 1": organ, "le foie? 1": above}).to_case("odd.toml")
    assert [str(each["mesh"]) for each in case.organs.values()] == ["odd_le_foie_1_mesh.vtu", "odd_2_mesh.vtu"]
    assert case.organ().organ("le foie? 1").mesh.points.min() == 0.0
    assert case.organ().organ("le foie? 1").mesh.points[:, 2].min() == 1.0


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('first = "lower/z > 99%"', 'first = "lowr"', r"'lowr' of \[\[contacts\]\]: no organ .*; did you mean 'lower'"),
        ('force."upper/', 'force."uper/', r"of force in \[loads\]: no organ is called 'uper'; did you mean 'upper'"),
        ('force."upper/', 'force."', r"of force in \[loads\]: no organ is called 'x > 99% and z > 50%'"),
        ("upper = 1000", "uper = 1000", "the density: no organ is called 'uper'"),
        (", upper = 1000", "", r"density in \[loads\] has none for the organ 'upper'"),
        ("lower = 900", "lower = -900", "of 'lower' must be a number above 0"),
        ('first = "lower/z > 99%"\n', "", r"the key 'first' is missing in \[\[contacts\]\] \(number 1 of contacts\)"),
        ("[[contacts]]", "[contacts]", r"'contacts' is a list of tables, each under \[\[contacts\]\]"),
        ("cable = true", "cable = 1", r"cable in \[\[springs\]\] must be true or false, got 1"),
        ("point = [", "points = [", r"unknown key 'points' in \[\[springs\]\]"),
        ('point = [0.4, 0.05, "40 cm"]\n', "", "a spring ends at a second place or at a point"),
        ('"40 cm"', '"40%"', r"point in \[\[springs\]\]: a percentage of what"),
        ('"HalfSpace"', '"HalfSpac"', "shape in .* 'HalfSpac' is unknown; did you mean 'HalfSpace'"),
        (
            'shape = "HalfSpace"',
            'shape = "HalfSpace"\nradius = 1',
            "a HalfSpace has no 'radius' .* takes no size",
        ),
        ('"HalfSpace"', '"Sphere"', r"the key 'radius' is missing in \[\[bodies\]\]; its shape takes radius"),
        ("young = 1e5", "yuong = 1e5", "organ 'lower': unknown key 'yuong' in .material.; did you mean 'young'"),
        ("[organs.upper]", '[organs."up/per"]', "the name of an organ must be words without '/'"),
        ("[organs.upper]", "[organs.upper]\nfixd = 0", r"organ 'upper': unknown key 'fixd' in \[organs.upper\]"),
        ("stiffness = ", "stif = ", r"organ 'upper': unknown key 'stif' in \[supports.root\]"),
        ("[loads]", "[reduce]\norder = 2\n[loads]", "unknown key 'reduce'"),
    ],
)
def test_wrong_words_are_named_on_reading(folder: Path, old: str, new: str, words: str) -> None:
    assert old in GOOD
    with pytest.raises(vs.VisceraError, match=f"scene.toml: .*{words}"):
        read(folder, GOOD.replace(old, new, 1))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('fixed = "root"', 'fixed = "rot"', "organ 'lower': .*no node set 'rot'; did you mean 'root'"),
        (
            'second = "upper"',
            'second = "upper/rim"',
            r"organ 'upper': \[\[contacts\]\]: the mesh has no node set 'rim'",
        ),
        ('mesh = "bar.vtu"', 'mesh = "car.vtu"', "organ 'lower': .*car.vtu: no such file"),
        (
            "[[contacts]]",
            '[[bonds]]\nfirst = "lower"\nsecond = "upper"\n[[contacts]]',
            "no triangle of the one",
        ),
    ],
)
def test_wrong_places_are_named_on_solving(folder: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        read(folder, GOOD.replace(old, new, 1)).organ()


def test_what_is_wrong_with_a_body_names_it(folder: Path) -> None:
    def read_with(words: str) -> SceneCase:
        sphere = '[[bodies]]\nshape = "Sphere"\nradius = 0.01\nposition = [0, 0, 5]\n'
        return read(folder, GOOD.replace("[loads]", sphere + words + "\n[loads]"))

    with pytest.raises(vs.VisceraError, match="number 2 of bodies: the rotation of a tool must be"):
        read_with("rotation = [[2, 0, 0], [0, 2, 0], [0, 0, 2]]")
    with pytest.raises(vs.VisceraError, match=r'must be .* or "bonded", got \'stick\' \(number 2 of bodies\)'):
        read_with('friction = "stick"')
    (folder / "organ.toml").write_text('mesh = "organ:beam"\n[[bodies]]\nshape = "HalfSpace"\n', encoding="utf-8")
    with pytest.raises(vs.VisceraError, match=r"\[\[bodies\]\] belong to a scene, .* into \[organs.NAME\]"):
        vs.case("organ.toml")


def test_an_organ_is_turned_and_a_body_is_a_surface_file(folder: Path) -> None:
    """As the same scene by hand: the upper bar stands upright, and a block of a file takes the place of the table."""
    table = vs.mesh([[0, 0, -100], [400, 0, -100], [0, 400, -100], [0, 0, 0]], [[0, 1, 2, 3]])
    meshio.write(folder / "table.stl", meshio.Mesh(table.points, [("triangle", table.surface)]))
    words = GOOD.replace(
        'position = "(0, 0, 11) cm"', 'position = "(0, 0, 11) cm"\nrotation = [0, -1.5707963267948966, 0]'
    )
    words = words.replace('shape = "HalfSpace"', 'shape = "Shape"\nsurface = "table.stl"\nunits = "mm"')
    scene = read(folder, words).organ()
    plain = read(folder).organ().organ("upper").mesh.points - np.array([0, 0, 0.11])
    upright = np.stack([-plain[:, 2], plain[:, 1], plain[:, 0]], axis=1) + np.array([0, 0, 0.11])
    assert scene.organ("upper").mesh.points == pytest.approx(upright, abs=1e-12)
    (body,) = scene.bodies
    assert repr(body.shape) == "Shape(4 triangles)"
    assert body.shape._core.distance(np.array([[0.05, 0.05, -0.09]]))[0] < 0.0
    with pytest.raises(vs.VisceraError, match="is in no file; write it"):
        scene.to_case("again.toml")
    for old, new, said in (
        ('surface = "table.stl"\n', "", "the key 'surface' is missing"),
        ('units = "mm"\nposition', "position", "'units' are those of a 'surface'"),
        ("rotation = [0, -1.57", "rotation = [[1, 0, 0], [0, 2, 0], [0, 0, 1]] #", "the rotation of the organ 'upper'"),
    ):
        assert old in words
        with pytest.raises(vs.VisceraError, match=said):
            read(folder, words.replace(old, new, 1))
    (folder / "table.stl").unlink()
    with pytest.raises(vs.VisceraError, match=r"table.stl: no such file"):
        read(folder, words).organ()


@pytest.mark.parametrize("verb", ["reduce", "compare"])
def test_what_takes_one_organ_refuses_a_scene_before_any_work(
    folder: Path, verb: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    read(folder)
    monkeypatch.setattr(vs.Organ, "__init__", lambda *_, **__: pytest.fail("an organ was made"))
    assert cli.main([verb, "scene.toml"]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"viscera {verb}: scene.toml: a scene of several organs, and this takes one organ; ")
    assert "`viscera solve`" in said
    assert said.count("\n") == 1
    with pytest.raises(vs.VisceraError, match="a scene of several organs"):
        read_case("scene.toml")
    with pytest.raises(vs.VisceraError, match="a scene is stepped on this machine"):
        live_case(vs.case("scene.toml"), "Scene")


def test_solve_writes_every_organ_and_says_what_is_between_them(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = read(folder)
    assert cli.main(["solve", "scene.toml", "-o", "out.vtu", "--json", "out.json"]) == 0
    said = capsys.readouterr().out
    facts = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    scene = case.organ()
    state = case.solve(scene)
    grid = meshio.read(folder / "out.vtu")
    assert grid.point_data["displacement"] == pytest.approx(state.displacement, abs=1e-12)
    (number,) = grid.cell_data["organ"]
    assert np.array_equal(np.unique(grid.cells[0].data[number == 1.0]), scene.mesh.sets["upper"])
    largest = np.linalg.norm(state["upper"].displacement, axis=1).max()
    assert facts["organs"]["upper"]["max_displacement"] == pytest.approx(largest)
    assert facts["contacts"][0]["force"] == pytest.approx(state.force(scene.contacts[0]))
    assert facts["springs"][0]["point"] == [0.4, 0.05, 0.4]
    body = "the body HalfSpace, number 1:"
    for line in ("largest displacement of 'upper'", "contact of 'lower/z > 99%' and 'upper'", body):
        assert line in said


def test_words_mean_the_same_place_of_an_organ_in_python_as_in_a_file() -> None:
    """Percentages are of the organ's own bounding box, also where the place begins with one of its sets."""
    beam = vs.organs.beam()
    above = vs.mesh(beam.points * [0.5, 1.0, 1.0] + [0.3, 0.0, 0.2], beam.cells, beam.sets)
    law = vs.NeoHookean(young=1e5, poisson=0.3)
    organs = {"lower": vs.Organ(beam, law, fixed="clamp"), "upper": vs.Organ(above, law, fixed="clamp")}
    scene = vs.Scene(organs)
    for words in ("x > 98%", "top and x > 50%", "0, 3"):
        place = np.sort(scene.place("upper", words))
        np.testing.assert_array_equal(scene.mesh.nodes(f"upper/{words}"), place)
    by_words, by_nodes = ({where: (0, 0, -2.0)} for where in ("upper/x > 98%", scene.place("upper", "x > 98%")))
    np.testing.assert_array_equal(scene.solve(force=by_words).displacement, scene.solve(force=by_nodes).displacement)


def test_a_bond_takes_the_words_of_a_file() -> None:
    assert vs.Bond("liver/x < 30%", "gallbladder").sides == (("liver", "x < 30%"), ("gallbladder", None))


def test_a_bond_of_a_case_holds_an_organ(bar: vs.Mesh, folder: Path) -> None:
    """Written and read again; without the bond, solving names the organ."""
    above = vs.mesh(bar.points + np.array([0.0, 0.0, 0.1]), bar.cells, bar.sets)
    organs = {"lower": vs.Organ(bar, LAW, fixed="root"), "upper": vs.Organ(above, LAW)}
    loads: dict[str, Any] = {"force": {"upper/tip": (0, 0, -0.5)}}
    scene = vs.Scene(organs, bonds=[vs.Bond("lower", "upper")])
    again = scene.to_case(folder / "bonded.toml", loads=loads)
    state = again.solve(again.organ())
    assert np.abs(state.displacement - scene.solve(**loads).displacement).max() < 1e-9
    case = vs.Scene(organs).to_case(folder / "apart.toml", loads=loads)
    with pytest.raises(vs.VisceraError, match="node 0 of 'upper' among them"):
        case.solve(case.organ())
