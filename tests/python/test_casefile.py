"""An organ written as a case and read back is the same organ, and does the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs

SOFT = vs.NeoHookean(young=1e5, poisson=0.3)


def is_same(organ: vs.Organ, other: vs.Organ) -> bool:
    pairs: list[tuple[Any, Any]] = [
        (organ.mesh.points, other.mesh.points),
        (organ.mesh.cells, other.mesh.cells),
        (organ.fixed, other.fixed),
        (organ.law.parameters, other.law.parameters),
    ]
    names = [(each.law.name, each.element) for each in (organ, other)]
    return names[0] == names[1] and all(np.array_equal(*pair) for pair in pairs)


@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
def test_what_is_written_is_read(bar: vs.Mesh, tmp_path: Path, element: str) -> None:
    young = bar.per_cell(1e5, {"x < 25%": 3e5, "x > 75%": 2e5})
    organ = vs.Organ(bar, vs.NeoHookean(young=young, poisson=0.3), fixed=lambda x: x[:, 0] < 1e-9, element=element)
    loads: dict[str, Any] = {
        "displacement": {lambda x: (x[:, 0] > 0.39) & (x[:, 2] < 0.01): ("1 mm", None, "free")},
        "force": {(40, 41): (0, 0, -0.1), "x > 99% and z > 99%": (0, 0.2, 0)},
        "traction": [(np.array([72, 73, 75, 76]), (0, 0, 10.0))] if element == "P1" else None,
        "gravity": np.array([0, 0, -9.81]),
        "density": 1000,
    }
    written = organ.to_case(tmp_path / "bar.toml", loads=loads, settings={"steps": 2, "newton": {"max_iterations": 40}})
    case = vs.case(tmp_path / "bar.toml")
    assert written == case
    again = case.organ()
    assert is_same(organ, again)
    state = organ.solve(**loads, steps=2, settings={"max_iterations": 40})
    assert np.array_equal(case.solve(again).displacement, state.displacement)
    assert "tip" in again.mesh.sets


def test_a_reduction_is_written_too(bar: vs.Mesh, tmp_path: Path) -> None:
    organ = vs.Organ(bar, SOFT, fixed="root")
    place, part = bar.nodes("z > 99% and x > 70%"), bar.cells_in("x > 50%")
    settings: dict[str, Any] = {"radius": "15%", "depth": 0.02, "order": 2, "pade": False}
    vary = vs.Vary("young", 5e4, 2e5, part=part, nodes=2)
    case = organ.to_case(tmp_path / "bar.toml", reduction={"touchable": place, "vary": vary, **settings})
    touch, direct = case.reduce(case.organ()), organ.reduce(place, vary=vary, **settings)
    at, push = direct.locate((0.4, 0.05, 0.1)), (0, 0, -0.002)
    assert np.array_equal(touch(at, push).force, direct(at, push).force)


@pytest.mark.parametrize(
    "law",
    [
        vs.Linear(young=1e5, poisson=0.3),
        vs.Corotated(young=1e5, poisson=0.3),
        vs.SaintVenantKirchhoff(young=1e5, poisson=0.3),
        vs.MooneyRivlin(c1=1e4, c2=2e3, alpha=1e5, volumetric="ln J"),
        vs.Yeoh(c10=500.0, c20=200.0, poisson=0.45),
        vs.Ogden(mu=[500.0, -100.0], alpha=[3.0, -4.0], poisson=0.45),
        vs.StableNeoHookean(young=1e3, poisson=0.45),
        vs.ArrudaBoyce(1e3, 1.5, poisson=0.45),
        vs.VerondaWestmann(2e3, 1.5, poisson=0.45),
        vs.Fung(1e3, 1.2, poisson=0.45),
        vs.StrainEnergy(
            "mu/2*(I1bar - 3) + k/2*(J - 1)**2 + f*(I4 - 1)**2", mu=1e3, k=1e5, f=2e3, fibres=np.eye(3)[:2]
        ),
        vs.HolzapfelGasserOgden(3e3, 2.4e3, 0.84, fibres=[(1, 0, 0), (0, 0, 1)], kappa=1e5, bear_compression=True),
    ],
)
def test_every_law_is_written(cube: vs.Mesh, tmp_path: Path, law: vs.laws.Law) -> None:
    organ = vs.Organ(cube, law, fixed="bottom")
    assert is_same(organ, organ.to_case(tmp_path / "cube.toml").organ())


def test_what_a_case_has_no_word_for(cube: vs.Mesh, tmp_path: Path) -> None:
    organ = vs.Organ(cube, SOFT, fixed="bottom")
    field = vs.Organ(cube, vs.NeoHookean(young=np.linspace(1e5, 2e5, 48), poisson=0.3), fixed="bottom")
    many = vs.organs.beam()
    spread = vs.Organ(many, vs.NeoHookean(young=np.linspace(1e5, 2e5, len(many.cells)), poisson=0.3), fixed="clamp")
    patch = organ.patch((0.05, 0.05, 0.1), "5 cm")
    assert is_same(field, field.to_case(tmp_path / "field.toml").organ())
    make: Any
    for make, sentence in (
        (
            lambda: organ.to_case(tmp_path / "a.toml", loads={"force": {patch: (0, 0, 1)}}),
            "no word for a contact patch",
        ),
        (lambda: organ.to_case(tmp_path / "a.toml", loads={"force": np.zeros((27, 3))}), "not node by node"),
        (lambda: organ.to_case(tmp_path / "a.toml", loads={"gravitation": 1}), "unknown key 'gravitation' in .loads"),
        (lambda: organ.to_case(tmp_path / "a.json"), "ends in .toml"),
        (lambda: spread.to_case(tmp_path / "a.toml"), "has 1920 sets of parameters"),
    ):
        with pytest.raises(vs.VisceraError, match=sentence):
            make()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["field.toml", "field_mesh.vtu"]


def test_places_of_a_case_stay_words_when_it_is_written_again(cube: vs.Mesh, tmp_path: Path) -> None:
    """Conditions name sets of its mesh, and the file of that is XML."""
    named: dict[str, Any] = {"z < 1%": "bottom", 'a "b" & c': [26]}
    first = vs.Organ(cube.with_sets(**named), SOFT, fixed="bottom")
    again = first.to_case(tmp_path / "cube.toml").organ().to_case(tmp_path / "again.toml")
    mesh = again.organ().mesh
    assert mesh.sets["z < 1%"].tolist() == cube.sets["bottom"].tolist()
    assert mesh.sets['a "b" & c'].tolist() == [26]


def test_loads_and_settings_of_a_case_are_written_as_they_are_read(cube: vs.Mesh, tmp_path: Path) -> None:
    """`loading` gives both, for `solve`; of an organ and of a scene."""
    organ = vs.Organ(cube, SOFT, fixed="bottom")
    load: dict[str, Any] = {"gravity": (0, 0, -9.81), "density": 1000.0}
    settings = {"steps": 2, "solver": "cg", "newton": {"max_iterations": 40}}
    body: Any
    for body, place in ((organ, "top"), (vs.Scene({"cube": organ}), "cube/top")):
        placed = {"force": {place: (0, 0, -1.0)}, "displacement": {f"{place} and x < 1%": ("1 mm", None, "free")}}
        case = body.to_case(tmp_path / "first.toml", loads={**load, **placed}, settings=settings)
        read = case.organ()
        again = read.to_case(tmp_path / "again.toml", loads=case.loading())
        assert again.loads == case.loads
        assert again.settings == settings
        assert again.loading() == case.loading()
        read.to_case(tmp_path / "again.toml", loads=case.loading(), settings=settings)
        with pytest.raises(
            vs.VisceraError, match=r"'steps' is 2 in loads=, and 'steps' is 3 in settings=; give it once"
        ):
            read.to_case(tmp_path / "again.toml", loads=case.loading(), settings={"steps": 3})
        with pytest.raises(vs.VisceraError, match=r"'settings' is .* in loads=, and 'newton' is .* in settings="):
            read.to_case(tmp_path / "again.toml", loads=case.loading(), settings={"newton": {"max_iterations": 41}})


def test_through_a_link_law_and_mesh_go_to_one_place(bar: vs.Mesh, tmp_path: Path) -> None:
    """What else reads the file finds the mesh that was written with it, and so does who reads through the link."""
    shared, mine = tmp_path / "shared", tmp_path / "mine"
    for folder in (shared, mine):
        folder.mkdir()
    vs.Organ(vs.organs.beam(), SOFT, fixed="clamp").to_case(shared / "organ.toml")
    (mine / "link.toml").symlink_to(Path("..", "shared", "organ.toml"))
    organ = vs.Organ(bar, vs.NeoHookean(young=2e5, poisson=0.3), fixed="root")
    written = organ.to_case(mine / "link.toml")
    for case in (written, vs.case(mine / "link.toml"), vs.case(shared / "organ.toml")):
        assert is_same(organ, case.organ())
    vs.Scene({"bar": organ}).to_case(mine / "link.toml")
    for place in (mine / "link.toml", shared / "organ.toml"):
        assert vs.case(place).organ().mesh.points.shape == bar.points.shape
    assert [path.name for path in mine.iterdir()] == ["link.toml"]
    assert sorted(path.name for path in shared.iterdir()) == ["organ.toml", "organ_bar_mesh.vtu", "organ_mesh.vtu"]


def test_a_folder_of_links_into_a_store_is_read(bar: vs.Mesh, tmp_path: Path) -> None:
    """As git-annex and the like make it: the mesh is beside the link of the case, not beside the file itself."""
    organ = vs.Organ(bar, SOFT, fixed="root")
    for number, name in enumerate(("organ.toml", "organ_mesh.vtu")):
        (tmp_path / "store" / str(number)).mkdir(parents=True)
        organ.to_case(tmp_path / "organ.toml")
        kept = (tmp_path / name).rename(tmp_path / "store" / str(number) / name)
        (tmp_path / name).symlink_to(kept)
    assert is_same(organ, vs.case(tmp_path / "organ.toml").organ())
