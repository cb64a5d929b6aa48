"""The studies of paper A: every file they name is there, with contents that make sense."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import matplotlib.image
import meshio
import pytest

import viscera as vs
from viscera.cli import main

FIGURES = {"curves", "modes_F_order1", "modes_F_order4", "modes_G_order1", "modes_G_order4"}
TABLES = {"curves", "reach", "errors", "routes", "error_analysis", "rate"}


def run(folder: Path, *words: str) -> dict[str, Any]:
    result = folder / "result.json"
    assert main(["study", *words, "-o", str(folder), "--quick", "--quiet", "--json", str(result)]) == 0
    facts: dict[str, Any] = json.loads(result.read_text())
    return facts


def table(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def beam(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("beam")
    return folder, run(folder, "beam")


@pytest.fixture(scope="module")
def liver(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Another mesh in place of the liver, which is quicker."""
    folder = tmp_path_factory.mktemp("liver")
    bar.write(folder / "bar.vtu")
    return folder, run(
        folder, "liver", str(folder / "bar.vtu"), "--units", "m", "--fixed", "root", "--touchable", "z >= 100%"
    )


@pytest.mark.parametrize("study", ["beam", "liver"])
def test_every_file_is_written(study: str, request: pytest.FixtureRequest) -> None:
    folder, facts = request.getfixturevalue(study)
    own = {"beam": ({"deformed"}, {"volume"}), "liver": ({"vertical", "load_path"}, set())}[study]
    page = Path(facts["report"]).read_text(encoding="utf-8")
    for key in ("svk", "neo_hookean"):
        for figure in FIGURES | own[0]:
            assert f'src="{figure}_{key}.png"' in page
            assert matplotlib.image.imread(folder / f"{figure}_{key}.png").std() > 0.01, "not a blank picture"
        for name in TABLES | own[1]:
            assert f'href="{name}_{key}.csv"' in page
            assert table(folder, f"{name}_{key}")
        modes = sorted((folder / f"paraview_{key}").glob("modes_*.vtu"))
        assert set(meshio.read(modes[0]).point_data) >= {"F_1", "G_1", "F_4", "G_4"}


@pytest.mark.parametrize("study", ["beam", "liver"])
@pytest.mark.parametrize("key", ["svk", "neo_hookean"])
def test_curves_make_sense(study: str, key: str, request: pytest.FixtureRequest) -> None:
    folder, facts = request.getfixturevalue(study)
    curve = table(folder, f"curves_{key}")
    linear = [float(row["order 1"]) / float(row["load factor"]) for row in curve]
    assert linear == pytest.approx([linear[0]] * len(curve))
    assert linear[0] > 0, "a push goes in"
    assert facts[key]["radius"] == pytest.approx(0.5)
    first = {row["sum"]: float(row["a = 0.125"]) for row in table(folder, f"errors_{key}")}
    assert first["order 1"] > first["order 2"] > first["order 4"] > first["order 6"] > first["order 15"]
    assert first["Padé 6"] < first["order 6"]
    reached = {row["solver"]: row["load factor reached"] for row in table(folder, f"reach_{key}")}
    assert all(0.0 <= float(load) <= 1.0 for load in reached.values() if load != "none")
    assert float(reached["Newton, line search and load steps"]) > 0.0


def test_low_orders_gain_volume_that_newton_does_not(beam: tuple[Path, dict[str, Any]]) -> None:
    _, facts = beam
    gain = facts["neo_hookean"]["volume_gain"]
    assert gain["order 1"] > 0.05
    assert abs(gain["Newton"]) < 0.01
    assert gain["Padé 15"] == pytest.approx(gain["Newton"], abs=1e-4)


@pytest.mark.parametrize("key", ["svk", "neo_hookean"])
def test_routes_are_compared(key: str, beam: tuple[Path, dict[str, Any]]) -> None:
    folder, facts = beam
    exact, greedy, projected, best = table(folder, f"routes_{key}")
    assert float(exact["worst error"]) == 0.0
    assert int(greedy["fixed-point iterations"]) > 0
    assert float(best["error, order 4"]) <= 0.05 < float(greedy["error, order 4"])
    assert all(int(projected[f"pairs, order {p}"]) <= int(greedy[f"pairs, order {p}"].rstrip("*")) for p in range(1, 5))
    assert all(row["evaluations per second"] > 0 for row in facts[key]["rate"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["beam", "bar.vtu"], "the beam study has its own mesh"),
        (["liver", "bar.vtu"], "it needs --fixed as well"),
        (["liver", "--fixed", "x < 10%"], "--fixed describes a mesh; give its file as well"),
        (["liver", "none.vtu", "--fixed", "root", "--units", "m"], "none.vtu: no such file"),
    ],
)
def test_bad_input_is_one_sentence(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", *words]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1
