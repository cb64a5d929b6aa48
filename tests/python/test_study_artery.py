"""The artery study: its report is whole, and paper B's claims come out as docs/paper-b.md says."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from viscera import cli
from viscera.study import artery


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("artery")
    words = ["study", "artery", "--quick", "--quiet", "-o", str(folder), "--json", str(folder / "facts.json")]
    assert cli.main(words) == 0
    return folder


@pytest.fixture(scope="module")
def facts(folder: Path) -> dict[str, Any]:
    told: dict[str, Any] = json.loads((folder / "facts.json").read_text(encoding="utf-8"))
    assert told["status"] == "done"
    results: dict[str, Any] = told["510e3"]
    return results


def test_independent_codes_agree(facts: dict[str, Any]) -> None:
    agreement = facts["table_3"]["agreement"]
    assert set(agreement) == set(artery.LAWS)
    assert all(by["felupe"] < 1e-6 for by in agreement.values())
    assert sum("calculix" in by for by in agreement.values()) == 3
    assert all(by.get("calculix", 0.0) < 2e-6 for by in agreement.values())


def test_the_volumetric_form_hardly_matters_but_the_constant_does(facts: dict[str, Any]) -> None:
    same, literal = facts["table_3"]["volumetric_forms"].values()
    assert same["field"] < 0.003
    assert literal["field"] > 0.03


def test_corotation_is_near_and_linearity_far(facts: dict[str, Any]) -> None:
    corotated, linear = (facts["table_4"][name] for name in ("Corotated", "Linear"))
    assert 0.02 < corotated["listed_mean"] < 0.12  # the paper: 0.061
    assert linear["listed_mean"] > 4 * corotated["listed_mean"]  # the paper: 0.357
    assert linear["field"] > 4 * corotated["field"]
    assert facts["table_4"]["SaintVenantKirchhoff"]["field"] == 0.0


def test_only_the_reference_loses_volume_by_a_tenth(facts: dict[str, Any]) -> None:
    volume = facts["volume_ratio"]
    assert volume["SaintVenantKirchhoff"] < 0.9
    assert all(0.99 < volume[name] < 1.01 for name in volume if "Mooney" in name or name == "NeoHookean")


def test_times_are_ratios_to_corotated_generation(facts: dict[str, Any]) -> None:
    assert facts["table_5"]["Corotated"]["generation"] == 1.0
    assert all(ratio["generation"] > 0 and ratio["solution"] > 0 for ratio in facts["table_5"].values())


def test_the_report_shows_what_is_there(folder: Path) -> None:
    page = (folder / "index.html").read_text(encoding="utf-8")
    for name in ("table_3", "table_4", "table_5", "summary", "agreement", "volumetric"):
        with (folder / f"{name}_510e3.csv").open(encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        assert rows
        assert all(len(row) == len(header) for row in rows)
        assert f"{name}_510e3.csv" in page
    assert (folder / "figure_2_510e3.png").read_bytes().startswith(b"\x89PNG")
    assert "figure_2_510e3.png" in page


def test_an_unknown_study_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["study", "kidney"])
    assert ended.value.code == 2
    assert "artery" in capsys.readouterr().err
