"""A scene stepped for a page: its organs in the hands of the page, and where rigid bodies and springs are."""

from __future__ import annotations

import json
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from websockets.sync.client import ClientConnection, connect

import viscera as vs
from viscera import cli
from viscera.cases.scene_case import SceneCase
from viscera.viewer import Server, page, serve_live
from viscera.viewer.live import Reply, converse
from viscera.viewer.scene import live_scene
from viscera.viewer.stepped import PlayedState, PlayedStepper, radius

SCENE = """
[organs.lower]
mesh = "bar.vtu"
units = "m"
fixed = "root"
material = {law = "NeoHookean", young = 1e5, poisson = 0.3}

[organs.upper]
mesh = "bar.vtu"
units = "m"
position = "(0, 0, 11) cm"
fixed = "root"
material = {law = "Yeoh", c10 = 5e3, poisson = 0.3}

[[contacts]]
first = "lower"
second = "upper"

[[springs]]
first = "lower/tip"
point = [0.4, 0.05, "-20 cm"]
stiffness = 20

[[springs]]
first = "lower/tip"
second = "upper/tip"
stiffness = 5
cable = true

[[bodies]]
shape = "HalfSpace"
position = [0, 0, "-4 cm"]

[[bodies]]
shape = "Capsule"
radius = "1 cm"
length = "8 cm"
position = [0.2, 0.05, "30 cm"]
rotation = [0, 1.5707963267948966, 0]

[loads]
density = {lower = 500, upper = 1000}
"""
RESTING = """
mesh = "bar.vtu"
units = "m"
material = {law = "NeoHookean", young = 1e5, poisson = 0.3}

[supports."z < 1%"]
stiffness = 1e6

[loads]
gravity = [0, 0, -9.81]
density = 500
force = {"x > 99%" = [0, 0, 1]}
"""
TOP = (0.35, 0.05, 0.21)
PUSH = (0.0, 0.0, -0.02)
FACTS = 14
SETTLED = 8
BODIES, SPRINGS = 2, 2

Numbers = NDArray[np.float32]


@pytest.fixture(scope="module")
def case(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> SceneCase:
    folder = tmp_path_factory.mktemp("live-scene")
    bar.write(folder / "bar.vtu")
    (folder / "scene.toml").write_text(SCENE)
    read = vs.case(folder / "scene.toml")
    assert isinstance(read, SceneCase)
    return read


@pytest.fixture
def reply(case: SceneCase) -> Reply:
    return live_scene(case, "Bars").open()


def ask(reply: Reply, **request: Any) -> tuple[Numbers, Numbers, Numbers]:
    """Facts of a frame, displacement (s, 3) of the surface, and what follows."""
    answer = reply(json.dumps(request))
    assert isinstance(answer, bytes), answer
    numbers = np.frombuffer(answer, "<f4")
    assert numbers[0] == 1
    nodes = len(json.loads(reply(""))["organ_of"])
    facts, field, more = np.split(numbers[1:], [FACTS, FACTS + 3 * nodes])
    return facts, field.reshape(-1, 3), more


def settled(reply: Reply, **request: Any) -> tuple[Numbers, Numbers, Numbers]:
    """The frame in which what is asked for has settled."""
    answer = ask(reply, **request)
    for _ in range(200):
        answer = ask(reply)
        if answer[0][SETTLED] and answer[0][3] < 1e-7:
            return answer
    raise AssertionError(f"no frame of 200 has settled: residual {answer[0][3]:g}")


def test_a_scene_introduces_its_organs_bodies_and_springs(reply: Reply, case: SceneCase) -> None:
    hello = json.loads(reply(""))
    mesh = case.organ().mesh
    assert hello["name"] == "Bars"
    assert hello["organs"] == ["lower", "upper"]
    heights = np.reshape(hello["rest"], (-1, 3))[:, 2]
    assert np.array_equal(np.array(hello["organ_of"]) == 1, heights > 0.105)
    assert np.array_equal(mesh.surface_nodes[np.reshape(hello["triangles"], (-1, 3))], mesh.surface)
    assert hello["bodies"] == [{"shape": "HalfSpace"}, {"shape": "Capsule", "radius": 0.01, "length": 0.08}]
    assert hello["springs"] == SPRINGS
    assert hello["gravity"] == [0, 0, 0]
    assert hello["radius"] == pytest.approx(0.1 * case.organ().organ("lower").mesh.diagonal)


def test_a_hand_on_one_organ_moves_the_other_as_in_a_solve(reply: Reply, case: SceneCase) -> None:
    scene = case.organ()
    patch = scene.patch(TOP, radius(scene), "upper")
    exact = scene.solve(displacement={patch: PUSH}, steps=4)
    assert exact.is_converged
    facts, field, _ = settled(reply, grab=TOP, organ="upper", move=PUSH)
    size = np.abs(exact.displacement).max()
    assert field == pytest.approx(exact.displacement[scene.mesh.surface_nodes], abs=1e-4 * size)
    force = exact.reaction(patch)
    assert facts[:3] == pytest.approx(force, abs=1e-3 * np.linalg.norm(force))
    lower = scene.of_node[scene.mesh.surface_nodes] == 0
    assert field[lower, 2].min() < -0.2 * size  # pressed down by the upper one, which nobody but the hand moves
    facts, field, _ = settled(reply, release=True)
    assert not facts[:3].any()
    assert np.abs(field).max() < 1e-4 * size


def test_two_hands_hold_two_organs(reply: Reply, case: SceneCase) -> None:
    scene = case.organ()
    below, lift = (0.35, 0.05, 0.0), (0.0, 0.0, -0.01)
    patches = {scene.patch(TOP, radius(scene), "upper"): (0.0, 0.0, 0.02), scene.patch(below, radius(scene)): lift}
    exact = scene.solve(displacement=patches)
    facts, _, _ = settled(
        reply, grab=TOP, organ="upper", move=(0.0, 0.0, 0.02), second={"grab": below, "organ": "lower", "move": lift}
    )
    for found, patch in zip((facts[:3], facts[11:]), patches, strict=True):
        force = exact.reaction(patch)
        assert found == pytest.approx(force, abs=1e-3 * np.linalg.norm(force))


def test_bodies_and_springs_are_told_where_they_are(reply: Reply, case: SceneCase) -> None:
    scene = case.organ()
    exact = scene.solve(displacement={scene.patch(TOP, radius(scene), "upper"): PUSH}, steps=4)
    _, field, more = settled(reply, grab=TOP, organ="upper", move=PUSH, stress=True)
    poses, ends, stress = np.split(more, [12 * BODIES, 12 * BODIES + 6 * SPRINGS])
    assert len(stress) == len(field)
    table, rod = poses.reshape(-1, 12)
    assert table == pytest.approx([0, 0, -0.04, *np.eye(3).ravel()])
    assert rod[:3] == pytest.approx([0.2, 0.05, 0.3])
    assert rod[3:].reshape(3, 3) @ (0, 0, 1) == pytest.approx([1, 0, 0], abs=1e-6)  # along x, as it was turned
    tips = [place_of(exact, scene, f"{name}/tip") for name in scene.organs]
    thread, cable = ends.reshape(-1, 2, 3)
    assert thread[0] == pytest.approx(tips[0], abs=1e-5)
    assert thread[1] == pytest.approx([0.4, 0.05, -0.2], abs=1e-6)
    assert cable == pytest.approx(np.array(tips), abs=1e-5)


def place_of(state: vs.State, scene: vs.Scene, place: str) -> NDArray[np.float64]:
    """Where a square face is: the mean over its area, which each of its triangles carries by a third at each corner."""
    mesh = scene.mesh
    moved = mesh.points + state.displacement
    faces = mesh.surface[np.isin(mesh.surface, mesh.nodes(place)).all(axis=1)]
    a, b, c = (mesh.points[faces[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.asarray(np.average(moved[faces].mean(axis=1), axis=0, weights=areas))


def test_gravity_pulls_at_the_density_of_each_organ(reply: Reply, case: SceneCase) -> None:
    scene = case.organ()
    gravity = [0.0, 2.0, 1.0]
    exact = scene.solve(gravity=gravity, density={"lower": 500, "upper": 1000}, steps=4)
    _, field, _ = settled(reply, gravity=gravity)
    size = np.abs(exact.displacement).max()
    assert field == pytest.approx(exact.displacement[scene.mesh.surface_nodes], abs=1e-4 * size)


def test_a_scene_begins_anew_where_the_page_resets_it(reply: Reply) -> None:
    _, moved, _ = settled(reply, grab=TOP, organ="upper", move=PUSH)
    facts, field, _ = ask(reply, laws=["Several"])
    assert np.abs(field).max() < 1e-3 * np.abs(moved).max()
    assert not facts[:3].any()


def test_a_hand_holds_the_organ_that_is_named_where_two_touch(bar: vs.Mesh) -> None:
    law = vs.NeoHookean(young=1e5, poisson=0.3)
    above = vs.mesh(bar.points + np.array((0, 0, 0.1)), bar.cells, bar.sets)
    organs = {"lower": vs.Organ(bar, law, fixed="root"), "upper": vs.Organ(above, law, fixed="root")}
    scene = vs.Scene(organs, contacts=[vs.ContactPair("lower", "upper")])
    between = (0.4, 0.05, 0.1)
    for number, name in enumerate(scene.organs):
        assert set(scene.of_node[scene.patch(between, "5 cm", name).nodes]) == {number}
        played = PlayedStepper(lambda: scene.stepper(iterations=20), "Bars")
        _, field, _ = settled(played.reply, grab=between, organ=name, move=(0.0, 0.02, 0.0))
        mean = [np.abs(field[scene.of_node[scene.mesh.surface_nodes] == k]).max() for k in (0, 1)]
        assert mean[number] > 10 * mean[1 - number]  # they slide on each other without friction
    with pytest.raises(vs.VisceraError, match="no organ of the scene is called 'uper'; did you mean 'upper'"):
        scene.patch(between, "5 cm", "uper")


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ("not JSON", "a request cannot be read"),
        ("[1, 2]", "a request must be a JSON object, got"),
        ('{"move":' + "[" * 2000, "cannot be read"),
        ('{"grap": [0, 0, 0]}', "unknown key 'grap'; did you mean 'grab'"),
        ('{"move": [0, 0]}', "move must be three finite numbers [m]"),
        ('{"move": [0, 0, NaN]}', "move must be three finite numbers [m]"),
        ('{"gravity": "down"}', "gravity must be three finite numbers [m/s^2]"),
        ('{"stress": 1}', "stress must be true or false"),
        ('{"laws": []}', "laws must be a list of one name"),
        ('{"second": {"laws": ["Linear"]}}', "unknown key 'laws'"),
        ('{"second": 3}', "second must be a JSON object"),
        ('{"grab": [0.35, 0.05, 0.21], "organ": "liver"}', "no organ of the scene is called 'liver'"),
        ('{"grab": [0.35, 0.05, 0.21], "organ": "lower"}', "no free surface within"),
    ],
)
def test_what_cannot_be_followed_is_a_sentence(reply: Reply, message: str, words: str) -> None:
    answer = reply(message)
    assert isinstance(answer, str)
    assert words in json.loads(answer)["error"]
    facts, field, _ = ask(reply)
    assert not facts[:3].any()  # and nothing else happened
    assert np.abs(field).max() < 1e-6


def test_each_page_has_a_scene_of_its_own(case: SceneCase) -> None:
    with Server({}, live=converse(live_scene(case, "Bars"))) as server, page_of(server) as one, page_of(server) as two:
        assert json.loads(one.recv())["organs"] == json.loads(two.recv())["organs"] == ["lower", "upper"]
        one.send(json.dumps({"grab": TOP, "organ": "upper", "move": PUSH}))
        two.send("{}")
        frames = [np.frombuffer(bytes(socket.recv(decode=False)), "<f4") for socket in (one, two)]
        forces = [np.linalg.norm(frame[1:4]) for frame in frames]
        assert forces[0] > 0.0
        assert forces[1] == 0.0


def page_of(server: Server) -> ClientConnection:
    """A socket as a page opens it."""
    settings: dict[str, Any] = {"origin": f"http://127.0.0.1:{server.port}", "proxy": None}
    opened: ClientConnection = connect(server.url.replace("http", "ws") + "live", **settings)
    return opened


def test_a_solved_scene_shows_its_bodies_where_they_ended(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    motion: dict[str, Any] = {"displacement": (0, 0, -0.02), "turn": (0, 0, 1.0)}
    body = vs.Tool(vs.Box(("4 cm", "4 cm", "2 cm"), rounding="2 mm"), position=(0.35, 0.05, 0.112), **motion)
    state = vs.Scene({"bar": organ}, bodies=[body, vs.Tool(vs.Shape(bar), position=(0, 0, 1.0))]).solve(steps=4)
    assert state.is_converged
    played = PlayedState(state, "Bar")
    hello = json.loads(played.reply(""))
    assert hello["is_still"]
    box, shape = hello["bodies"]
    assert box == {"shape": "Box", "sides": [0.04, 0.04, 0.02], "rounding": 0.002}
    points, triangles = np.reshape(shape["points"], (-1, 3)), np.reshape(shape["triangles"], (-1, 3))
    assert np.array_equal(points[triangles], bar.points[bar.surface])
    _, field, more = ask(played.reply)
    assert field == pytest.approx(state.displacement[bar.surface_nodes], abs=1e-6)
    poses = more[:24].reshape(2, 12)
    assert poses[0, :3] == pytest.approx([0.35, 0.05, 0.092])
    assert poses[0, 3:].reshape(3, 3) @ (1, 0, 0) == pytest.approx([np.cos(1.0), np.sin(1.0), 0.0])
    assert len(more) == 24 + len(field)


def test_tools_of_a_stepper_move_on_the_page(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    stepper = organ.stepper(iterations=10)
    tool = stepper.tool(vs.Sphere("2 cm"), position=(0.3, 0.05, 0.15))
    played = PlayedStepper(lambda: stepper, "Bar")
    assert json.loads(played.reply(""))["bodies"] == [{"shape": "Sphere", "radius": 0.02}]
    tool.move((0, 0, -0.01))
    answer = played.reply("{}")
    assert isinstance(answer, bytes)
    assert np.frombuffer(answer, "<f4")[-12:-9] == pytest.approx([0.3, 0.05, 0.14])


def test_view_serves_a_scene(
    case: SceneCase, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    needs_page()

    def visited(server: Server) -> None:
        """What a browser does, then Ctrl-C."""
        with server, urllib.request.urlopen(f"{server.url}page.js") as script, page_of(server) as socket:
            assert b"openLive" in script.read()
            assert json.loads(socket.recv())["name"] == "Scene"
        raise KeyboardInterrupt

    monkeypatch.setattr(Server, "run", visited)
    assert cli.main(["view", str(case.folder / "scene.toml"), "--no-browser"]) == 0
    assert "http://127.0.0.1" in capsys.readouterr().out


def test_what_a_page_cannot_do_is_refused_before_any_work(
    case: SceneCase, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(vs.Organ, "__init__", lambda *_, **__: pytest.fail("an organ was made"))
    for target in ("site", "scene.html"):
        assert cli.main(["view", str(case.folder / "scene.toml"), "--export", str(tmp_path / target)]) == 2
        said = capsys.readouterr().err
        assert said.startswith("viscera view: a scene is stepped on this machine, by `viscera view` without --export;")
        assert said.count("\n") == 1
        assert not (tmp_path / target).exists()
    with pytest.raises(vs.VisceraError, match="a scene is stepped on this machine"):
        serve_live(case, in_page=True)


def test_an_organ_with_elastic_supports_is_stepped_on_this_machine(
    case: SceneCase, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (case.folder / "resting.toml").write_text(RESTING)
    resting = vs.case(case.folder / "resting.toml")
    reply = live_scene(resting, "Bar").open()
    hello = json.loads(reply(""))
    assert (hello["name"], hello["gravity"], hello["left_out"]) == ("Bar", [0.0, 0.0, -9.81], ["force"])
    answer = reply("{}")
    assert isinstance(answer, bytes)
    organ = resting.organ()
    exact = organ.solve(gravity=(0.0, 0.0, -9.81), density=500.0)
    nodes = organ.mesh.surface_nodes
    shown = np.frombuffer(answer, "<f4")[1 + FACTS :].reshape(-1, 3)
    assert shown[: len(nodes)] == pytest.approx(exact.displacement[nodes], abs=1e-3 * exact.max_displacement)
    with serve_live(resting, "Bar") as server, page_of(server) as socket:
        assert json.loads(socket.recv())["name"] == "Bar"
    with pytest.raises(vs.VisceraError, match="an organ with elastic supports is stepped on this machine"):
        serve_live(resting, in_page=True)
    assert cli.main(["view", str(case.folder / "resting.toml"), "--export", str(tmp_path / "site")]) == 2
    assert "an organ with elastic supports is stepped on this machine, by `viscera view`" in capsys.readouterr().err
    scanned = case.folder / "scanned.toml"
    scanned.write_text(RESTING.replace("[loads]", "[scan]").replace('force = {"x > 99%" = [0, 0, 1]}', ""))
    with pytest.raises(vs.VisceraError, match=r"scanned.toml: .* solve the \[scan\] first"):
        live_scene(vs.case(scanned), "Bar")


def test_a_scene_that_cannot_be_stepped_is_refused_before_it_is_served(case: SceneCase) -> None:
    words = SCENE.replace('position = [0.2, 0.05, "30 cm"]', 'position = [0.2, 0.05, "5 cm"]')
    (case.folder / "inside.toml").write_text(words)
    inside = vs.case(case.folder / "inside.toml")
    assert isinstance(inside, SceneCase)
    with pytest.raises(vs.VisceraError, match="inside"):
        live_scene(inside, "Inside")


def needs_page() -> None:
    """Skip where the page is not built."""
    try:
        page.files()
    except vs.VisceraError as error:
        pytest.skip(str(error))
