"""docs/cli.md names the keys that each verb's JSON has: no more, no fewer."""

import json
import re
from pathlib import Path

import pytest

import viscera as vs
from viscera import VisceraError, cli
from viscera.viewer import page

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")

CASE = """
mesh = "organ:artery"
fixed = "z < 5%"
[material]
law = "NeoHookean"
young = 1e6
poisson = 0.3
[loads]
force."z > 95%" = [0, 0, 0.01]
[reduce]
touchable = "40% < z < 70%"
order = 2
depth = "2%"
tolerance = 1e-2
"""


def documented(verb: str) -> set[str]:
    row = re.search(rf"^\| `{verb}` \| (`.*) \|$", PAGE, re.MULTILINE)
    assert row is not None
    return {"status", "seconds", *re.findall(r"`(\w+)`", row[1])}


def run(folder: Path, *words: str) -> dict[str, object]:
    result = folder / "result.json"
    code = cli.main([*words, "--quiet", "--json", str(result)])
    assert code in {0, 1}
    facts: dict[str, object] = json.loads(result.read_text(encoding="utf-8"))
    return facts


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cli")
    (folder / "case.toml").write_text(CASE, encoding="utf-8")
    return folder


def test_inspect(folder: Path) -> None:
    assert set(run(folder, "inspect", "organ:artery")) == documented("inspect")


def test_mesh(folder: Path) -> None:
    pytest.importorskip("nibabel")
    vs.Scan.of(vs.organs.beam(), voxel=0.03).write(folder / "labels.nii")
    words = ("mesh", str(folder / "labels.nii"), "--edge", "90mm", "-o", str(folder / "mesh.vtu"))
    assert set(run(folder, *words)) == documented("mesh")


def test_fit(folder: Path) -> None:
    (folder / "test.csv").write_text("stretch,stress\n0.8,-70\n0.9,-33\n1.1,28\n1.2,53\n", encoding="utf-8")
    result = run(folder, "fit", str(folder / "test.csv"), "--law", "NeoHookean")
    fit = result["fits"][0]  # type: ignore[index]
    assert {*result, *fit} == documented("fit")


def test_solve(folder: Path) -> None:
    assert set(run(folder, "solve", str(folder / "case.toml"))) == documented("solve")


def test_register(folder: Path) -> None:
    mesh = vs.organs.artery()
    rows = [f"{x},{y},{z}" for x, y, z in mesh.points[mesh.surface_nodes]]
    (folder / "cloud.csv").write_text("\n".join(["x,y,z", *rows]), encoding="utf-8")
    told = run(folder, "register", str(folder / "case.toml"), str(folder / "cloud.csv"), "--noise", "0.1mm")
    assert set(told) == documented("register")


def test_solve_a_scene(folder: Path) -> None:
    told = run(folder, "solve", str(ROOT / "examples" / "scene.toml"))
    assert set(told) == documented("solve") | documented("solve SCENE.toml")
    between = [each for kind in ("contacts", "springs", "bodies") for each in told[kind]]  # type: ignore[attr-defined]
    assert len(between) == 3
    assert all(f"`{key}`" in PAGE for each in between for key in each)


def test_compare(folder: Path) -> None:
    told = run(folder, "compare", str(folder / "case.toml"), "-o", str(folder), "--models", "Linear")
    assert set(told) == documented("compare")
    models = told["models"]
    assert isinstance(models, list)
    keys = {key for model in models for key in (*model, *(model["difference"] or {}), *model["times"])}
    assert all(f"`{key}`" in PAGE for key in keys)


def test_reduce_check_and_touch(folder: Path) -> None:
    model = str(folder / "organ.viscera")
    assert set(run(folder, "reduce", str(folder / "case.toml"), "-o", model)) == documented("reduce")
    checked = run(folder, "check", model, "--touches", "1")
    assert set(checked) == documented("check")
    rows = checked["touches"]
    assert isinstance(rows, list)
    touch, *_ = rows
    assert all(f"`{key}`" in PAGE for key in touch)
    at, push = map(str, touch["point"]), map(str, touch["displacement"])
    assert set(run(folder, "touch", model, "--at", *at, "--push", *push)) == documented("touch")
    try:
        page.files()
    except VisceraError:
        return  # built without its viewer
    assert set(run(folder, "view", model, "--export", str(folder / "site"))) == documented("view")
    case = str(folder / "case.toml")
    assert set(run(folder, "view", case, "--export", str(folder / "live"))) == documented("view CASE.toml")


def test_doctor_and_completion(folder: Path) -> None:
    assert set(run(folder, "doctor")) == documented("doctor")
    assert set(run(folder, "completion", "bash")) == documented("completion")


@pytest.mark.parametrize(
    "words", [("newton", "--cells", "48", "--codes", "viscera cg"), ("laws", "--laws", "Linear", "--elements", "P1")]
)
def test_bench(folder: Path, words: tuple[str, ...]) -> None:
    facts = run(folder, "bench", *words)
    rows = facts["rows"]
    assert isinstance(rows, list)
    assert {*facts, *rows[0]} == documented(f"bench {words[0]}") - {"worse"}
