"""Columns of the curves that `viscera fit` reads: where their units stand, and in which letters."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from viscera.cli import main
from viscera.mesh import Floats

STRETCH = np.concatenate([np.linspace(0.4, 0.98, 15), np.linspace(1.02, 1.8, 15)])


def write_curve(path: Path, header: str, *columns: Floats) -> None:
    rows = "\n".join(",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True))
    path.write_text(f"{header}\n{rows}\n")


@pytest.mark.parametrize(
    "header",
    [
        "compression_mm,load_N", "Compression (mm),Load (N)", "compression[MM],load [n]", "Compression,Load\n(mm),(N)",
        "compression,load_mN\nmm,", "COMPRESSION_MM,LOAD_KN",
    ],
)  # fmt: skip
def test_units_stand_in_names_or_below_them(tmp_path: Path, header: str) -> None:
    squeezed, area = np.linspace(0.6, 0.99, 12), np.pi * 0.025**2
    per_newton = 1e3 if "_mN" in header else 1e-3 if "_KN" in header else 1.0
    load = 1000.0 * (squeezed**-2 - squeezed) * area * per_newton
    write_curve(tmp_path / "a.csv", header, 30.0 * (1.0 - squeezed), load)
    words = [str(tmp_path / "a.csv"), "--length", "30 mm", "--diameter", "50 mm", "--law", "NeoHookean"]
    assert main(["fit", *words, "--json", str(tmp_path / "r.json")]) == 0
    (found,) = json.loads((tmp_path / "r.json").read_text())["fits"]
    assert found["parameters"]["mu"] == pytest.approx(1000.0, rel=1e-6)


@pytest.mark.parametrize(("unit", "factor"), [("KPA", 1e3), ("kpa", 1e3), ("MPA", 1e6), ("pa", 1.0)])
def test_units_are_read_in_any_case(tmp_path: Path, unit: str, factor: float) -> None:
    write_curve(tmp_path / "a.csv", f"stretch [-],Stress_{unit}", STRETCH, 1000.0 * (STRETCH - STRETCH**-2) / factor)
    assert main(["fit", str(tmp_path / "a.csv"), "--law", "NeoHookean", "--json", str(tmp_path / "r.json")]) == 0
    (found,) = json.loads((tmp_path / "r.json").read_text())["fits"]
    assert found["parameters"]["mu"] == pytest.approx(1000.0, rel=1e-6)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("GPa", 1e9), ("N/m^2", 1.0), ("N/m²", 1.0), ("N/m2", 1.0), ("kN/m^2", 1e3), ("N/cm²", 1e4), ("N/mm^2", 1e6),
        ("n/mm2", 1e6), ("mN/mm²", 1e3), ("MN/m^2", 1e6),
    ],
)  # fmt: skip
@pytest.mark.parametrize("header", ["stretch,stress [{}]", "stretch,stress_{}", "stretch,stress\n-,{}"])
def test_a_stress_may_be_a_force_over_an_area(tmp_path: Path, header: str, unit: str, factor: float) -> None:
    write_curve(tmp_path / "a.csv", header.format(unit), STRETCH, 1000.0 * (STRETCH - STRETCH**-2) / factor)
    assert main(["fit", str(tmp_path / "a.csv"), "--law", "NeoHookean", "--json", str(tmp_path / "r.json")]) == 0
    (found,) = json.loads((tmp_path / "r.json").read_text())["fits"]
    assert found["parameters"]["mu"] == pytest.approx(1000.0, rel=1e-6)


@pytest.mark.parametrize("unit", ["mn/m2", "MN/mm2", "N/m", "N/mm3", "mPa", "N^2"])
def test_a_stress_in_no_such_unit_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], unit: str) -> None:
    write_curve(tmp_path / "a.csv", f"stretch,stress [{unit}]", STRETCH, STRETCH)
    assert main(["fit", str(tmp_path / "a.csv")]) == 2
    assert f"not known of stress, '{unit}'; known: Pa, kPa, MPa, GPa, N/m2" in capsys.readouterr().err


@pytest.mark.parametrize("micro", ["u", "\u00b5", "\u03bc"])
def test_forces_and_lengths_may_be_in_micro(tmp_path: Path, micro: str) -> None:
    squeezed = np.linspace(0.6, 0.99, 12)
    load = 1000.0 * (squeezed - squeezed**-2) * 1e-4
    header = f"displacement [{micro}m],force [{micro}N]"
    write_curve(tmp_path / "a.csv", header, 30e3 * (squeezed - 1.0), 1e6 * load)
    words = ["--length", "30 mm", "--area", "1 cm2", "--law", "NeoHookean", "--json", str(tmp_path / "r.json")]
    assert main(["fit", str(tmp_path / "a.csv"), *words]) == 0
    (found,) = json.loads((tmp_path / "r.json").read_text())["fits"]
    assert found["parameters"]["mu"] == pytest.approx(1000.0, rel=1e-6)


@pytest.mark.parametrize("name", ["shear", "Shear [-]"])
def test_a_curve_of_simple_shear_has_a_column_of_shear(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    shear = np.linspace(0.1, 0.5, 5)
    write_curve(tmp_path / "a.csv", f"{name},stress [kPa]", shear, 1.2 * shear)
    words = ["fit", str(tmp_path / "a.csv"), "--law", "NeoHookean", "--json", str(tmp_path / "r.json")]
    assert main([*words, "--mode", "simple shear"]) == 0
    (found,) = json.loads((tmp_path / "r.json").read_text())["fits"]
    assert found["parameters"]["mu"] == pytest.approx(1200.0, rel=1e-6)
    assert main([*words, "--mode", "simple shear", "--length", "3 cm"]) == 2
    assert "--length is for curves of displacement and force" in capsys.readouterr().err
    write_curve(tmp_path / "a.csv", "angle,stress", shear, shear)
    assert main([*words, "--mode", "simple shear"]) == 2
    assert "it has angle, stress. Give shear and stress, or displacement" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("mode", "given", "missed"),
    [("simple shear", "stretch", "shear"), ("uniaxial", "shear", "stretch"), ("pure shear", "shear", "stretch")],
)
def test_a_stretch_is_no_amount_of_shear(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], mode: str, given: str, missed: str
) -> None:
    write_curve(tmp_path / "a.csv", f"{given},stress", STRETCH, STRETCH)
    assert main(["fit", str(tmp_path / "a.csv"), "--mode", mode]) == 2
    assert f"no column '{missed}'; it has {given}, stress. Give {missed} and stress" in capsys.readouterr().err


def test_a_column_of_stress_beside_displacement_and_force_is_ignored(tmp_path: Path) -> None:
    path, squeezed = tmp_path / "a.csv", np.linspace(0.6, 0.99, 12)
    moved, force = 0.03 * (squeezed - 1.0), 0.1 * (squeezed - squeezed**-2)
    np.savetxt(
        path, np.column_stack([moved, force, force]), delimiter=",", header="displacement,force,stress", comments=""
    )
    words = ["--length", "30 mm", "--area", "1 cm2", "--law", "NeoHookean", "--json", str(tmp_path / "r.json")]
    assert main(["fit", str(path), *words]) == 0
    (found,) = json.loads((tmp_path / "r.json").read_text())["fits"]
    assert found["parameters"]["mu"] == pytest.approx(1000.0, rel=1e-6)


@pytest.mark.parametrize("cell", ["nan", "inf", "-Infinity", "1e999"])
def test_a_cell_that_is_not_finite_is_refused_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], cell: str
) -> None:
    path = tmp_path / "q.csv"
    path.write_text(f"stretch,stress,remark\n1.1,200,nan\n\n1.2,{cell},nan\n1.3,600,nan\n")
    assert main(["fit", str(path)]) == 2
    assert f"{path}, line 4: stress is {cell!r}; give a finite number" in capsys.readouterr().err


@pytest.mark.parametrize("law", ["NeoHookean", "all"])
def test_a_fit_without_scipy_says_what_to_install(
    law: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_curve(tmp_path / "curve.csv", "stretch,stress", STRETCH, 300.0 * (STRETCH - STRETCH**-2))
    for name in ("scipy", "scipy.optimize", "scipy.interpolate", "scipy.stats"):
        monkeypatch.setitem(sys.modules, name, None)
    assert main(["fit", str(tmp_path / "curve.csv"), "--law", law, "--json", str(tmp_path / "told.json")]) == 2
    sentence = "fitting needs scipy: pip install 'viscera[fit]'"
    assert capsys.readouterr().err == f"viscera fit: {sentence}\n"
    told = json.loads((tmp_path / "told.json").read_text())
    assert (told["status"], told["message"]) == ("bad input", sentence)


@pytest.mark.parametrize(
    ("header", "at", "words"),
    [
        ("stretch,stress", [0.9, 0.95, 1.02, 1.1, 1.1001], ["--up-to", "0.1"]),
        (
            "displacement_mm,force",
            [-10.5, -2.0, 2.0, 10.5, 10.501],
            ["--up-to", "0.35", "--length", "30 mm", "--area", "1 cm2"],
        ),
    ],
)
def test_a_point_at_the_end_of_the_part_belongs_to_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], header: str, at: list[float], words: list[str]
) -> None:
    """1.1 - 1 is above 0.1 by rounding, and 10.5e-3 above 0.35 * 30e-3."""
    rest = 1.0 if header.startswith("stretch") else 0.0
    write_curve(tmp_path / "a.csv", header, np.array(at), np.array(at) - rest)
    assert main(["fit", str(tmp_path / "a.csv"), "--law", "NeoHookean", *words]) == 0
    assert ", 4 points," in capsys.readouterr().out
