"""What is said of an organ that floats: each computation advises what may hold an organ in it, and nothing else."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera import cli
from viscera.viewer.live import live_case
from viscera.viewer.scene import live_scene

LAW = vs.NeoHookean(young=1e5, poisson=0.3)
ALONE = "prescribed displacements hold it in a solve alone"
AT_REST = (
    "nothing is fixed: the organ would float away; hold it by fixed nodes, elastic supports (in a case file `fixed` or "
    f"`supports`), or bonds of a scene; {ALONE}"
)
BY_NODES = (
    "nothing is fixed: the organ would float away; hold it by fixed nodes (in a case file `fixed`); "
    f"{ALONE}, and elastic supports do not count here yet"
)
IN_PAGE = (
    "nothing is fixed: the organ would float away; hold it by fixed nodes (in a case file `fixed`); "
    f"{ALONE}, and elastic supports (`supports`) in `viscera view`"
)
IN_FRAMES = "hold it by fixed nodes, hands, elastic supports, or bonds of a scene; with inertia it may be free: "
IN_SOLVE = (
    "nothing is fixed: the organ would float away; hold it by fixed nodes, prescribed displacements, elastic supports "
    "(in a case file `fixed`, `displacement`, `supports`), or bonds of a scene; if contact alone holds it, "
)
HELD = {"root": (0, 0, 0), "tip": (None, None, "-1 mm")}
WEIGHT: dict[str, Any] = {"gravity": (0, 0, -1.0), "density": 1000.0}


@pytest.fixture
def floating(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar.with_sets(tip="x > 99%"), LAW)


@pytest.mark.parametrize(
    ("floats", "said"),
    [
        (lambda organ: organ.solve(**WEIGHT), IN_SOLVE),
        (lambda organ: organ.path(force={"tip": (0, 0, -1.0)}), AT_REST),
        (lambda organ: organ.reduce("tip"), AT_REST),
        (lambda organ: organ.pgd("tip", load=1.0), AT_REST),
        (lambda organ: organ.unloaded(**WEIGHT), AT_REST),
        (lambda organ: organ.register(points=(organ.mesh.points, organ.mesh.points)), BY_NODES),
        (lambda organ: organ.stepper(), IN_FRAMES),
    ],
    ids=["solve", "path", "reduce", "pgd", "unloaded", "register", "stepper"],
)
def test_the_advice_is_open_to_who_asks(floating: vs.Organ, floats: Callable[[vs.Organ], object], said: str) -> None:
    with pytest.raises(vs.VisceraError, match=re.escape(said)):
        floats(floating)


def test_supports_do_where_they_are_advised(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, LAW, supports=[vs.ElasticSupport("root", stiffness=1e7)])
    assert organ.path(force={"x > 99%": (0, 0, -0.1)}, order=3).expansions
    assert organ.unloaded(**WEIGHT).is_converged
    assert organ.pgd("x > 99%", load=0.1, order=1)


def test_a_frame_says_so_when_the_last_hand_has_let_go(floating: vs.Organ) -> None:
    stepper = floating.stepper({"root": (0, 0, 0)})
    stepper.frame()
    with pytest.raises(vs.VisceraError, match=f"{IN_FRAMES}give the stepper dynamics="):
        stepper.frame({})


def test_parts_that_are_not_held_get_the_same_advice(bar: vs.Mesh) -> None:
    two = vs.mesh(np.vstack([bar.points, bar.points + 2.0]), np.vstack([bar.cells, bar.cells + len(bar.points)]))
    organ = vs.Organ(two, LAW, fixed=bar.nodes("root"))
    with pytest.raises(vs.VisceraError, match=r"hold every part, by fixed nodes \(in a case file `fixed`\), or remove"):
        organ.register(points=(two.points, two.points))


def test_a_case_that_displacements_hold_is_solved_and_no_more(floating: vs.Organ, tmp_path: Path) -> None:
    case = floating.to_case(
        tmp_path / "held.toml",
        loads={"displacement": HELD},
        reduction={"touchable": "tip", "start": "loads"},
        scan=WEIGHT,
    )
    organ = case.organ()
    assert organ.solve(**case.loading()).is_converged
    for asked in (case.reduce, case.unloaded):
        with pytest.raises(vs.VisceraError, match=f"{re.escape(f'held.toml: {AT_REST}')}$"):
            asked(organ)
    shown = floating.to_case(tmp_path / "shown.toml", loads={"displacement": HELD})
    with pytest.raises(vs.VisceraError, match=f"{re.escape(f'shown.toml: {IN_PAGE}')}$"):
        live_case(shown, "bar")
    scene = vs.Scene({"bar": floating}).to_case(
        tmp_path / "scene.toml", loads={"displacement": {"bar/root": (0, 0, 0)}}
    )
    with pytest.raises(vs.VisceraError, match=f"{re.escape(f'scene.toml: {AT_REST}')}$"):
        live_scene(scene, "bar")


def test_a_case_may_float_until_it_is_solved(floating: vs.Organ, tmp_path: Path) -> None:
    """One rule for an organ and a scene: both may be stepped with inertia."""
    scene = vs.Scene({"bar": floating})
    for case in (floating.to_case(tmp_path / "free.toml"), scene.to_case(tmp_path / "free_scene.toml")):
        organ = vs.case(case.folder / case.file).organ()
        assert organ.stepper(density=1000.0, time_step=0.01, dynamics="backward_euler").frame().is_settled
        with pytest.raises(vs.VisceraError, match=f"^{re.escape(f'{case.file}: {IN_SOLVE}')}"):
            case.solve(organ)


@pytest.mark.parametrize("verb", ["solve", "compare", "view"])
def test_commands_name_the_file_of_a_case_that_floats(
    floating: vs.Organ, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    monkeypatch.chdir(tmp_path)
    floating.to_case("free.toml")
    assert cli.main([verb, "free.toml"]) == 2
    assert f"viscera {verb}: free.toml: nothing is fixed: " in capsys.readouterr().err


def test_a_scene_with_joints_is_registered_organ_by_organ(bar: vs.Mesh) -> None:
    height = np.ptp(bar.points[:, 2])
    above = vs.mesh(bar.points + np.array([0.0, 0.0, height]), bar.cells, bar.sets)
    bond = vs.Bond("a", "b")
    scene = vs.Scene({"a": vs.Organ(bar, LAW, "root"), "b": vs.Organ(above, LAW)}, bonds=[bond])
    said = re.escape(f"this one has {bond!r}; register an organ by itself, with fixed nodes, such as scene.organ('a').")
    with pytest.raises(vs.VisceraError, match=said):
        scene.register(points=(scene.mesh.points, scene.mesh.points))


def test_the_force_of_a_joint_is_asked_of_the_whole(bar: vs.Mesh) -> None:
    above = vs.mesh(bar.points + np.array([0.0, 0.0, np.ptp(bar.points[:, 2])]), bar.cells, bar.sets)
    bond, spring = vs.Bond("a", "b"), vs.Spring("a/root", "b/root", stiffness=1.0)
    organs = {"a": vs.Organ(bar, LAW, "root"), "b": vs.Organ(above, LAW, supports=[vs.ElasticSupport("root", 1e6)])}
    state = vs.Scene(organs, bonds=[bond, spring]).solve(force={"b": (0, 0, -0.1)})
    model = vs.Scene(organs, bonds=[bond]).reduce("b/x > 99%", depth="1%", order=2)
    answer = model(above.points[above.nodes("x > 99%")[-1]], (0, 0, -1e-4))
    for whole in (state, answer):
        assert whole.support_force(bond).shape == (3,)
        with pytest.raises(
            vs.VisceraError, match=r"^Bond\(a, b\) joins two organs, .* ask the state, .* of the whole scene"
        ):
            whole["b"].support_force(bond)
    with pytest.raises(vs.VisceraError, match=r"ask the state, the frame or the answer of the whole scene"):
        state["b"].support_force(spring)
