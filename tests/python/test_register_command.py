"""`viscera register`: files of what was measured, what it prints and writes, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera import VisceraError, cli
from viscera.registration.measured import read_cloud, read_landmarks

CASE = """
mesh = "organ:beam"
fixed = "clamp"
[material]
law = "NeoHookean"
young = 1e5
poisson = 0.3
"""
TURN = np.array([[0.96, -0.28, 0.0], [0.28, 0.96, 0.0], [0.0, 0.0, 1.0]])
SHIFT = np.array([0.3, -0.2, 0.5])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A beam that hangs, moved rigidly: points on its upper side [mm] with noise, and two landmarks."""
    folder = tmp_path_factory.mktemp("register")
    (folder / "beam.toml").write_text(CASE, encoding="utf-8")
    organ = vs.case(folder / "beam.toml").organ()
    mesh = organ.mesh
    hanging = organ.solve(force={"tip": (0, 0, -5.0)}, throw=True)
    now = (mesh.points + hanging.displacement) @ TURN.T + SHIFT
    np.save(folder / "now.npy", now)
    rng = np.random.default_rng(0)
    upper = mesh.surface[np.isin(mesh.surface, mesh.nodes("z > 99%")).all(axis=1)]
    places = rng.dirichlet(np.ones(3), size=300)
    cloud = np.einsum("ka,kai->ki", places, now[rng.choice(upper, size=300)])
    cloud += rng.normal(scale=1e-3, size=cloud.shape)
    np.savetxt(folder / "cloud.csv", 1e3 * cloud, delimiter=", ", header="x, y, z", comments="")
    rows = [(name, *(1e3 * now[mesh.sets[name]].mean(axis=0))) for name in ("tip", "clamp")]
    table = "\n".join(", ".join(map(str, row)) for row in [("name", "x", "y", "z"), *rows])
    (folder / "marks.csv").write_text(table + "\n", encoding="utf-8")
    return folder


def test_an_organ_is_found_from_files(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--units", "mm", "--noise", "1mm", "--visible", "z > 99%"]
    files = [
        str(folder / name) for name in ("beam.toml", "cloud.csv", "marks.csv", "found.vtu", "shape.vtu", "found.json")
    ]
    case, cloud, marks, found, shape, facts = files
    assert (
        cli.main(
            ["register", case, cloud, *words, "--landmarks", marks, "-o", found, "--shape", shape, "--json", facts]
        )
        == 0
    )
    told = json.loads(Path(facts).read_text(encoding="utf-8"))
    # A turn about the clamp and a bend of the beam look alike from one side.
    assert abs(told["angle"] - np.degrees(np.arccos(0.96))) < 4.0
    assert np.allclose(told["translation"], SHIFT, atol=0.01)
    assert told["residual"] < 1.5e-3
    assert told["inlier_share"] > 0.9
    assert max(told["landmarks"].values()) < 3e-3
    printed = capsys.readouterr().out
    assert "beam.toml: " in printed
    assert "turned by" in printed
    assert "landmark 'tip'" in printed
    assert "do not fit" not in printed
    mesh, displacement, _ = vs.output.state.read(found)
    error = np.linalg.norm(mesh.points + displacement - np.load(folder / "now.npy"), axis=1)
    assert error.mean() < 4e-3  # the noise is 1 mm, the beam 1 m long, and one side of it is seen
    assert np.ptp(vs.output.state.read(shape)[1][:, 2]) > 0.05


def test_a_poor_fit_fails(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Points with much more noise than is said; the result is written all the same."""
    cloud = np.loadtxt(folder / "cloud.csv", delimiter=",", skiprows=1)
    cloud += np.random.default_rng(1).normal(scale=6.0, size=cloud.shape)
    np.savetxt(folder / "noisy.csv", cloud, delimiter=", ", header="x, y, z", comments="")
    case, noisy, marks, facts, found = (
        str(folder / name) for name in ("beam.toml", "noisy.csv", "marks.csv", "poor.json", "poor.vtu")
    )
    words = [
        "--units",
        "mm",
        "--noise",
        "1mm",
        "--visible",
        "z > 99%",
        "--landmarks",
        marks,
        "--json",
        facts,
        "-o",
        found,
    ]
    assert cli.main(["register", case, noisy, *words]) == 1
    told = json.loads(Path(facts).read_text(encoding="utf-8"))
    assert told["status"] == "poor fit"
    assert told["misfit"] > 2.0
    assert "do not trust the band" in capsys.readouterr().out
    assert Path(found).exists()


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert cli.main(["register", *words]) == 2
    return capsys.readouterr().err


def test_what_cannot_be_read_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = str(folder / "beam.toml")
    assert "nothing was measured" in refused(capsys, case)
    assert "no such file" in refused(capsys, case, str(folder / "no.ply"))
    assert "the formats are .csv, .ply, .obj, .stl" in refused(capsys, case, case)
    assert "are both in metres?" in refused(capsys, case, str(folder / "cloud.csv"))
    assert "is a folder" in refused(capsys, case, str(folder))
    unknown = str(folder / "found.foo")
    assert "cannot be written as .foo" in refused(capsys, case, str(folder / "cloud.csv"), "-o", unknown)


def test_a_bare_noise_beside_another_unit_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A number is in metres wherever it stands; beside a cloud in millimetres that would be a slip."""
    case, cloud = str(folder / "beam.toml"), str(folder / "cloud.csv")
    for option in ("--noise", "--landmark-noise"):
        said = refused(capsys, case, cloud, "--units", "mm", option, "1")
        assert f"{option} 1 is in metres" in said
        assert f"as in {option} 1mm" in said
    assert "the noise of the surface points is 1 m" in refused(capsys, case, cloud, "--units", "mm", "--noise", "1m")


def test_a_case_under_loads_of_its_scan_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = folder / "scanned.toml"
    case.write_text(CASE + "[scan]\ngravity = [0, 0, -1.0]\ndensity = 1000\n", encoding="utf-8")
    said = refused(capsys, str(case), str(folder / "cloud.csv"), "--units", "mm")
    assert "`viscera register` takes the mesh as free of load; leave the [scan] out" in said


def test_a_registration_that_observes_nothing_fails(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Points on one flat face leave the beam free to slide along it."""
    places = np.random.default_rng(2).uniform(size=(60, 3)) * [400.0, 150.0, 0.0] + [300.0, 20.0, 200.0]
    np.savetxt(folder / "face.csv", places, delimiter=", ", header="x, y, z", comments="")
    words = ["--units", "mm", "--noise", "1mm", "--visible", "z > 95%"]
    assert cli.main(["register", str(folder / "beam.toml"), str(folder / "face.csv"), *words]) == 1
    assert "beam.toml: not observed, " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("flat.csv", "x,y\n1,2\n", "no column 'z'"),
        ("word.csv", "x,y,z\n1,2,here\n", "line 2: z is 'here'; give a number"),
        ("short.csv", "x,y,z\n1,2\n", "line 2: 2 values under 3 names"),
        ("nan.csv", "x,y,z\n1,2,3\n1,nan,3\n", "line 3: y is .nan.; give a finite number"),
        ("bare.csv", "x,y,z\n", "has no points"),
        ("empty.csv", "\n", "the file is empty"),
        ("bad.ply", "no ply", "not a readable .ply file"),
    ],
)
def test_clouds_that_are_none(tmp_path: Path, name: str, text: str, words: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(VisceraError, match=words):
        read_cloud(tmp_path / name)


def test_a_surface_gives_its_points_once(tmp_path: Path) -> None:
    beam = vs.organs.beam()
    still = vs.Organ(beam, vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp").solve()
    still.write(tmp_path / "beam.stl")
    points = read_cloud(tmp_path / "beam.stl", "mm")
    assert len(points) == len(np.unique(beam.surface))
    assert np.allclose(points.max(axis=0), 1e-3 * beam.points.max(axis=0))


def test_a_landmark_stands_once(tmp_path: Path) -> None:
    (tmp_path / "marks.csv").write_text("name,x,y,z\ntip,1,2,3\ntip,1,2,4\n", encoding="utf-8")
    with pytest.raises(VisceraError, match="'tip' stands twice"):
        read_landmarks(tmp_path / "marks.csv")
    (tmp_path / "nameless.csv").write_text("x,y,z\n1,2,3\n", encoding="utf-8")
    with pytest.raises(VisceraError, match="no column 'name'; it has x, y, z, and needs name, x, y, z"):
        read_landmarks(tmp_path / "nameless.csv")
    (tmp_path / "flat.csv").write_text("x,y\n1,2\n", encoding="utf-8")
    with pytest.raises(VisceraError, match="no column 'z'; it has x, y, and needs x, y, z"):
        read_cloud(tmp_path / "flat.csv")
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(VisceraError, match="not a table of comma-separated text"):
        read_landmarks(tmp_path / "bytes.csv")
