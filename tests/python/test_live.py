"""A case stepped for a page: frames over a web socket are the stepper's, and nothing a page sends disturbs it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

import viscera as vs
from viscera import _core
from viscera.cases.case import Case, read_case
from viscera.viewer import Server, page
from viscera.viewer.live import converse, live_case, matched
from viscera.viewer.scene import live_scene

CASE = """
mesh = "bar.vtu"
units = "m"
fixed = "root"
material = {law = "NeoHookean", young = 1e5, poisson = 0.4}
"""
TIP = [0.4, 0.05, 0.1]
FACTS = 14


@pytest.fixture(scope="module")
def case(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> Case:
    folder = tmp_path_factory.mktemp("live")
    bar.write(folder / "bar.vtu")
    (folder / "bar.toml").write_text(CASE)
    return read_case(folder / "bar.toml")


@pytest.fixture(scope="module")
def server(case: Case) -> Iterator[Server]:
    with Server({}, live=converse(live_case(case, "Bar"))) as running:
        yield running


@pytest.fixture
def socket(server: Server) -> Iterator[ClientConnection]:
    with open_socket(server) as opened:
        opened.recv()
        yield opened


def open_socket(server: Server, **changes: Any) -> ClientConnection:
    settings: dict[str, Any] = {"origin": f"http://127.0.0.1:{server.port}", "proxy": None, **changes}
    opened: ClientConnection = connect(server.url.replace("http", "ws") + "live", **settings)
    return opened


def ask(socket: ClientConnection, **request: Any) -> NDArray[np.float32]:
    socket.send(json.dumps(request))
    answer = socket.recv()
    assert isinstance(answer, bytes), answer
    return np.frombuffer(answer, "<f4")


def bodies(frame: NDArray[np.float32]) -> list[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """Facts and surface displacement of each organ of a frame."""
    parts = np.split(frame[1:], int(frame[0]))
    return [(part[:FACTS], part[FACTS:].reshape(-1, 3)) for part in parts]


def test_the_stepper_introduces_itself(server: Server, bar: vs.Mesh) -> None:
    with open_socket(server) as opened:
        hello = json.loads(opened.recv())
    assert hello["name"] == "Bar"
    assert hello["law"] == "NeoHookean"
    assert {"Linear", "Corotated", "SaintVenantKirchhoff", "NeoHookean", "MooneyRivlin"} <= set(hello["laws"])
    assert np.allclose(np.reshape(hello["rest"], (-1, 3)), bar.points[bar.surface_nodes])
    assert np.array_equal(bar.surface_nodes[np.reshape(hello["triangles"], (-1, 3))], bar.surface)


def test_a_hand_finds_the_full_solution(socket: ClientConnection, case: Case) -> None:
    organ = case.organ()
    patch = organ.patch(TIP, 0.1 * organ.mesh.diagonal)
    push = [0.0, 0.01, -0.02]
    exact = organ.solve(displacement={patch: push})
    ask(socket, grab=TIP, move=push)
    for _ in range(10):
        frame = ask(socket)
    [(facts, surface)] = bodies(frame)
    assert facts[:3] == pytest.approx(exact.reaction(patch), rel=1e-4)
    assert surface == pytest.approx(exact.displacement[organ.mesh.surface_nodes], abs=1e-7)
    assert facts[3] < 1e-6  # residual
    assert facts[4] == 1.0  # the whole step was taken
    assert facts[8] == 1.0  # settled
    assert facts[9] == 0.0  # no cell is at a bound
    assert facts[10] >= 1.0  # Newton iterations
    assert facts[7] == pytest.approx(exact.volume_ratio - 1, abs=1e-5)


def test_two_hands_and_the_stress_are_those_of_the_full_solution(socket: ClientConnection, case: Case) -> None:
    organ = case.organ()
    places, pushes = ([0.2, 0.05, 0.1], TIP), ([0.0, 0.0, -0.01], [0.0, 0.01, 0.005])
    patches = [organ.patch(place, 0.1 * organ.mesh.diagonal) for place in places]
    exact = organ.solve(displacement=dict(zip(patches, pushes, strict=True)))
    second = {"grab": places[1], "move": pushes[1]}
    ask(socket, grab=places[0], move=pushes[0], second=second, stress=True)
    for _ in range(10):
        frame = ask(socket)
    facts, rest = np.split(frame[1:], [FACTS])
    nodes = organ.mesh.surface_nodes
    assert facts[:3] == pytest.approx(exact.reaction(patches[0]), rel=1e-4, abs=1e-4)
    assert facts[11:] == pytest.approx(exact.reaction(patches[1]), rel=1e-4, abs=1e-4)
    stress = exact.von_mises("nodes")[nodes]
    assert rest[3 * len(nodes) :] == pytest.approx(stress, rel=1e-4, abs=1e-4 * stress.max())


@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
def test_the_stress_of_a_page_is_that_of_python(element: str, case: Case, tmp_path: Path) -> None:
    path = tmp_path / "bar.toml"
    case.organ().mesh.write(tmp_path / "bar.vtu")
    path.write_text(f'element = "{element}"\n{CASE}\n[loads]\ngravity = [0, 0, -3]\ndensity = 500\n')
    organ = read_case(path).organ()
    reply = live_case(read_case(path), "Bar").open()
    reply("")
    reply('{"stress": true}')
    frames = [reply("{}") for _ in range(10)]
    nodes = organ.mesh.surface_nodes
    stress = organ.solve(gravity=(0, 0, -3), density=500).von_mises("nodes")[nodes]
    assert isinstance(frames[-1], bytes)
    shown = np.frombuffer(frames[-1], "<f4")[-len(nodes) :]
    assert shown == pytest.approx(stress, rel=1e-4, abs=1e-5 * stress.max())


def test_letting_go_brings_it_back(socket: ClientConnection) -> None:
    ask(socket, grab=TIP, move=[0.0, 0.0, -0.02])
    for _ in range(5):
        ask(socket)
    ask(socket, release=True)
    for _ in range(10):
        frame = ask(socket)
    [(facts, surface)] = bodies(frame)
    assert not facts[:3].any()
    assert np.abs(surface).max() < 1e-7


def test_gravity_turns(socket: ClientConnection, case: Case) -> None:
    organ = case.organ()
    for gravity in ([0.0, 0.0, -5.0], [0.0, 5.0, 0.0]):
        ask(socket, gravity=gravity)
        for _ in range(12):
            frame = ask(socket)
        exact = organ.solve(gravity=gravity, density=1000.0)
        [(_, surface)] = bodies(frame)
        assert surface == pytest.approx(exact.displacement[organ.mesh.surface_nodes], abs=1e-6)


def test_two_laws_in_one_hand(socket: ClientConnection, case: Case, bar: vs.Mesh) -> None:
    """Side by side they are moved alike; linear elasticity alone answers twice the push with twice the force."""
    ask(socket, laws=["Linear", "NeoHookean"])
    forces = []
    for push in (-0.01, -0.02):
        ask(socket, grab=TIP, move=[0.0, 0.0, push])
        for _ in range(10):
            frame = ask(socket)
        forces.append([facts[:3] for facts, _ in bodies(frame)])
    (linear, neo), (linear2, neo2) = forces
    assert linear2 == pytest.approx(2 * linear, rel=1e-4)
    assert np.linalg.norm(neo2 - 2 * neo) > 1e-2 * np.linalg.norm(neo2)


def test_laws_are_matched_at_rest(case: Case) -> None:
    laws = matched(case.organ().law)
    moduli = np.array([law.core().moduli()[0] for law in laws.values()])
    assert moduli == pytest.approx(np.tile(moduli[0], (len(moduli), 1)))


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ("not JSON", "a request is a JSON object"),
        ("[1, 2]", "a request is a JSON object"),
        ('{"move":' + "[" * 2000, "cannot be read"),
        ('{"grap": [0, 0, 0]}', "expected one of `laws`, `release`, `grab`"),
        ('{"move": [0, 0]}', "an array of length 3"),
        ('{"move": [0, 0, NaN]}', "cannot be read"),
        ('{"move": [0, 0, 1e999]}', "out of range"),
        ('{"gravity": "down"}', "an array of length 3"),
        ('{"laws": ["Linear", "Linear", "Linear"]}', "one or two names"),
        ('{"laws": ["Rubber"]}', "no law is called"),
        ('{"laws": [["Linear"]]}', "expected a string"),
        ('{"grab": [100, 0, 0]}', "no free surface within"),
    ],
)
def test_what_cannot_be_read_is_a_sentence(socket: ClientConnection, message: str, words: str) -> None:
    socket.send(message)
    answer = json.loads(socket.recv())
    assert words in answer["error"]
    assert ask(socket)[0] == 1  # and nothing else happened


def test_a_far_hand_stays_near(socket: ClientConnection, bar: vs.Mesh) -> None:
    ask(socket, grab=TIP, move=[1e5, 0.0, 0.0])
    for _ in range(3):
        frame = ask(socket)
    assert np.isfinite(frame).all()


@pytest.mark.parametrize("noise", [b"\x00\xff", b"x" * 100_000, "x" * 100_000])
def test_frames_that_are_none_close_the_socket(server: Server, noise: bytes | str) -> None:
    with open_socket(server) as opened:
        opened.recv()
        opened.send(noise)
        with pytest.raises(ConnectionClosed):
            opened.recv()
    with open_socket(server) as again:
        assert json.loads(again.recv())["name"] == "Bar"


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"origin": "http://evil.example"}, 403),
        ({"origin": None}, 403),
        ({"additional_headers": {"Host": "evil"}}, 421),
    ],
)
def test_strangers_get_no_socket(server: Server, changes: dict[str, Any], status: int) -> None:
    with pytest.raises(InvalidStatus) as refusal:
        open_socket(server, **changes)
    assert refusal.value.response.status_code == status


def test_a_case_that_floats_is_refused_at_once(case: Case) -> None:
    loose = Case(mesh=case.mesh, units=case.units, fixed=[0], material=case.material, folder=case.folder)
    with pytest.raises(vs.VisceraError):
        live_case(loose, "Loose")


def test_a_case_with_a_scan_is_refused(case: Case) -> None:
    scanned = Case(mesh=case.mesh, units=case.units, fixed="root", material=case.material, folder=case.folder,
                   scan={"gravity": [0, 0, -9.81]})  # fmt: skip
    with pytest.raises(vs.VisceraError, match="viscera solve"):
        live_case(scanned, "Scanned")


@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
def test_every_element_is_stepped(case: Case, element: str) -> None:
    chosen = Case(mesh=case.mesh, units=case.units, fixed="root", material=case.material, folder=case.folder,
                  element=element)  # fmt: skip
    organ = chosen.organ()
    exact = organ.solve(gravity=(0, 0, -5), density=1000)
    live = _core.Live(live_case(chosen, "Bar").data)
    live.answer('{"gravity": [0, 0, -5]}')
    for _ in range(10):
        frame = np.frombuffer(live.answer("{}"), "<f4")
    [(_, surface)] = bodies(frame)
    size = np.abs(exact.displacement).max()
    assert surface == pytest.approx(exact.displacement[organ.mesh.surface_nodes], abs=1e-5 * size)


def test_parameters_and_densities_may_differ_from_cell_to_cell(bar: vs.Mesh, tmp_path: Path) -> None:
    bar.write(tmp_path / "bar.vtu")
    rng = np.random.default_rng(0)
    stiffness, density = (rng.uniform(1, 3, len(bar.cells)) for _ in range(2))
    material = {"law": "NeoHookean", "young": 1e5 * stiffness, "poisson": 0.4}
    loads = {"gravity": [0, 0, -5], "density": 500 * density}
    chosen = Case(mesh="bar.vtu", units="m", fixed="root", material=material, loads=loads, folder=tmp_path)
    exact = chosen.organ().solve(gravity=(0, 0, -5), density=500 * density)
    live = _core.Live(live_case(chosen, "Bar").data)
    for _ in range(10):
        frame = np.frombuffer(live.answer("{}"), "<f4")
    [(_, surface)] = bodies(frame)
    size = np.abs(exact.displacement).max()
    assert surface == pytest.approx(exact.displacement[bar.surface_nodes], abs=1e-5 * size)


@pytest.mark.parametrize("bytes_of_a_case", [b"", b"nothing", b"\xff" * 100])
def test_what_is_no_case_is_a_sentence(bytes_of_a_case: bytes) -> None:
    with pytest.raises(ValueError, match="not a usable case"):
        _core.Live(bytes_of_a_case)


def test_an_export_steps_the_case_in_the_page(case: Case, tmp_path: Path) -> None:
    needs_page()
    from viscera.cli import main

    assert main(["view", str(case.folder / "bar.toml"), "--export", str(tmp_path / "site"), "--quiet"]) == 0
    written = {file.name for file in (tmp_path / "site").iterdir()}
    assert {"index.html", "page.js", "viewer.js", "stepper.js", "stepper.wasm", "organ.case"} <= written
    assert "organ.viscera" not in written
    live = _core.Live((tmp_path / "site" / "organ.case").read_bytes())
    assert json.loads(live.describe())["name"] == "Bar"


def test_a_large_case_is_not_exported(
    case: Case, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    needs_page()
    from viscera.cli import main

    monkeypatch.setattr("viscera.viewer.live.PAGE_UNKNOWNS", 100)
    assert main(["view", str(case.folder / "bar.toml"), "--export", str(tmp_path / "site")]) == 2
    assert "reduce it first" in capsys.readouterr().err
    assert not (tmp_path / "site").exists()


def needs_page() -> None:
    """Skip where the page is not built."""
    try:
        page.files()
    except vs.VisceraError as error:
        pytest.skip(str(error))


def test_gravity_without_a_density_is_refused_as_by_a_solve(case: Case, bar: vs.Mesh) -> None:
    pulled = dataclasses.replace(case, loads={"gravity": [0.0, 0.0, -5.0]})
    for made in (live_case, live_scene):
        with pytest.raises(vs.VisceraError, match=r"gravity in \[loads\] needs the key density \[kg/m\^3\] there"):
            made(pulled, "Bar")


def test_the_page_is_told_of_the_axes_and_of_a_density_that_the_case_does_not_name(
    case: Case, bar: vs.Mesh, tmp_path: Path
) -> None:
    organ = vs.Organ(dataclasses.replace(bar, axes="LPS"), vs.NeoHookean(young=1e5, poisson=0.4), fixed="root")
    for loads, density in ({}, 1000.0), ({"density": 900.0}, None):
        scanned = organ.to_case(tmp_path / "scanned.toml", loads=loads)
        for made in (live_case, live_scene):
            told = json.loads(made(scanned, "Bar").open()(""))
            assert (told["axes"], told["assumed_density"]) == ("LPS", density)
    assert json.loads(live_case(case, "Bar").open()(""))["axes"] == ""
