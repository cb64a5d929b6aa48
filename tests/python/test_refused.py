"""What once raised an error of Python or NumPy: a sentence names the argument and the value, and is not too long."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs

LONG = "a" * 5000
LAW = vs.NeoHookean(young=1e5, poisson=0.3)


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, LAW, "root")


@pytest.fixture(scope="module")
def touch(organ: vs.Organ) -> vs.Touch:
    return organ.reduce("tip", depth="2%", order=2)


@pytest.mark.parametrize("name", ["loads", "scan", "settings", "reduction"])
@pytest.mark.parametrize("value", ["gravity", True, [("gravity", (0, 0, 1))], 3, {1: 2}])
def test_a_case_is_written_of_tables(organ: vs.Organ, tmp_path: Path, name: str, value: Any) -> None:
    given: dict[str, Any] = {name: value}
    with pytest.raises(vs.VisceraError, match=f"^{name} must be a mapping by name, such as .*, got ") as refusal:
        organ.to_case(tmp_path / "case.toml", **given)
    assert repr(value) in str(refusal.value)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("laws", [True, [LAW], {1: LAW}])
def test_laws_to_compare_have_names(organ: vs.Organ, laws: Any) -> None:
    with pytest.raises(vs.VisceraError, match=r"^laws must be a mapping from names to laws, .*, got "):
        vs.compare(organ, laws=laws, force={"tip": (0, 0, -1.0)})
    with pytest.raises(vs.VisceraError, match=r"^the law 'soft' must be a law, .*, got 3$"):
        vs.compare(organ, laws={"soft": 3}, force={"tip": (0, 0, -1.0)})  # type: ignore[dict-item]


@pytest.mark.parametrize("tensor", [np.full((3, 3), np.nan), np.full((2, 3, 3), np.inf), "stress", None, [[1, 2], [3]]])
def test_principal_values_are_of_numbers(tensor: Any) -> None:
    with pytest.raises(vs.VisceraError, match=r"^the tensor must be an array \(..., 3, 3\) of finite numbers, got "):
        vs.principal(tensor)


@pytest.mark.parametrize("stress", [[0, 10, 10**400], np.array([0, 10, 20j]), ["0", "10", "20"]])
def test_a_stress_is_a_number_that_a_float_holds(stress: Any) -> None:
    with pytest.raises(vs.VisceraError, match=r"^test: stress is no list of numbers that a float can hold, got "):
        vs.MaterialTest("uniaxial", [1, 1.1, 1.2], stress)


@pytest.mark.parametrize("depths", [np.array(5), np.array(0.001), "5%", 5])
def test_depths_are_several(touch: vs.Touch, depths: Any) -> None:
    with pytest.raises(vs.VisceraError, match=r"^depths must be a list of lengths, such as .*, got "):
        touch.check(depths=depths)


@pytest.mark.parametrize("ending", [".vtu", ".vtk", ".msh", ".inp"])
def test_half_a_letter_is_no_name_in_a_file(bar: vs.Mesh, tmp_path: Path, ending: str) -> None:
    with pytest.raises(
        vs.VisceraError, match=r"the name 'bad\\udcff' of a set holds half of a letter.*; rename the set"
    ):
        bar.with_sets(**{"bad\udcff": [0, 1, 2]}).write(tmp_path / f"mesh{ending}")
    assert not [*tmp_path.iterdir()]


NAMED: dict[str, Callable[[vs.Organ], Any]] = {
    "fixed": lambda organ: vs.Organ(organ.mesh, LAW, fixed=LONG),
    "a condition": lambda organ: organ.mesh.nodes(f"x > 1 m and {'x > 1 m and ' * 500}x > 1 m"),
    "solver": lambda organ: organ.solve(gravity=(0, 0, 1), density=1.0, solver=LONG),
    "preconditioner": lambda _: vs.ConjugateGradients(LONG),
    "settings": lambda organ: organ.solve(force={"tip": (0, 0, 1)}, settings={LONG: 1}),
    "units": lambda _: vs.read("mesh.vtu", units=LONG),
    "mode": lambda _: vs.MaterialTest(LONG, [1, 1.1], [0, 1]),
    "laws": lambda organ: vs.compare(organ, laws=LONG, force={"tip": (0, 0, 1)}),  # type: ignore[arg-type]
    "reference": lambda organ: vs.compare(organ, reference=LONG, force={"tip": (0, 0, 1)}),
    "landmarks": lambda organ: organ.register(landmarks={LONG: (0, 0, 0)}, noise=1e-3),
    "dynamics": lambda organ: organ.stepper(dynamics=LONG, density=1e3, time_step=0.1),
}


@pytest.mark.parametrize("what", NAMED)
def test_a_long_name_is_told_in_short(organ: vs.Organ, what: str) -> None:
    with pytest.raises(vs.VisceraError) as refusal:
        NAMED[what](organ)
    assert "..." in str(refusal.value)
    assert len(str(refusal.value)) < 500
