"""CASE.toml: the API's words, their errors, and the same numbers."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import viscera as vs
from viscera import cli
from viscera.cases.case import read_case
from viscera.law import LAWS

GOOD = """
mesh = "bar.vtu"
units = "m"
fixed = "x <= 0%"
[material]
law = "NeoHookean"
young = 1e5
poisson = 0.3
[loads]
gravity = [0, 0, -9.81]
density = 100
displacement."x >= 100%" = [0.02, "free", -0.01]
force."z >= 100%" = [0, 0, -0.5]
[settings]
steps = 2
newton.tolerance = 1e-10
[reduce]
touchable = "z >= 100%"
radius = "60 mm"
depth = "5%"
order = 2
"""


@pytest.fixture
def folder(bar: vs.Mesh, tmp_path: Path) -> Path:
    bar.write(tmp_path / "bar.vtu")
    return tmp_path


def case_with(folder: Path, old: str, new: str) -> Path:
    assert old in GOOD
    (folder / "case.toml").write_text(GOOD.replace(old, new))
    return folder / "case.toml"


def test_a_case_gives_what_the_api_gives(bar: vs.Mesh, folder: Path) -> None:
    case = read_case(case_with(folder, "", ""))
    organ = case.organ()
    state = case.solve(organ)
    by_hand = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root").solve(
        displacement={"tip": (0.02, None, -0.01)},
        force={lambda x: x[:, 2] >= 0.1: (0, 0, -0.5)},
        gravity=(0, 0, -9.81),
        density=100,
    )
    assert state.displacement == pytest.approx(by_hand.displacement, abs=1e-9)
    reactions = case.reactions(organ, state)
    assert list(reactions) == ["x <= 0%", "x >= 100%"]
    assert reactions["x >= 100%"] == pytest.approx(by_hand.reaction("tip"), rel=1e-6, abs=1e-8)


def test_a_list_of_words_fixes_all_its_places(folder: Path) -> None:
    path = case_with(folder, 'fixed = "x <= 0%"', 'fixed = ["root", "x > 99%"]')
    case = vs.case(path)
    organ = case.organ()
    assert organ.fixed.tolist() == organ.mesh.nodes(["root", "x > 99%"]).tolist()
    with pytest.raises(vs.VisceraError, match=r"\['root', 3\] has 3; write indices among words as words"):
        vs.case(case_with(folder, 'fixed = "x <= 0%"', 'fixed = ["root", 3]'))


def test_displacements_of_a_case_hold_the_organ(folder: Path) -> None:
    expected = (case := read_case(case_with(folder, "", ""))).solve(case.organ()).displacement
    tip = 'displacement."x >= 100%" = [0.02, "free", -0.01]'
    words = GOOD.replace('fixed = "x <= 0%"', "")
    (folder / "held.toml").write_text(words.replace(tip, f'{tip}\ndisplacement."x <= 0%" = [0, 0, 0]'))
    case = read_case(folder / "held.toml")
    assert abs(case.solve(case.organ()).displacement - expected).max() < 1e-9
    (folder / "free.toml").write_text(words.replace(tip, ""))
    case = read_case(folder / "free.toml")
    with pytest.raises(vs.VisceraError, match=r"free\.toml: nothing is fixed: .* \(in a case file `fixed`,"):
        case.solve(case.organ())


def test_a_built_in_organ_needs_no_file(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text('mesh = "organ:beam"\nfixed = "clamp"\nmaterial = {law = "Linear", mu = 1e5, lam = 1e5}\n')
    assert read_case(path).organ().mesh.points.tolist() == vs.organs.beam().points.tolist()
    path.write_text('mesh = "organ:lever"\nfixed = "clamp"\nmaterial = {law = "Linear", mu = 1e5, lam = 1e5}\n')
    with pytest.raises(vs.VisceraError, match="did you mean 'liver'"):
        read_case(path).organ()


def test_a_built_in_organ_is_in_metres(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = 'mesh = "organ:beam"\nunits = "m"\nfixed = "clamp"\nmaterial = {law = "Linear", mu = 1e5, lam = 1e5}\n'
    path = tmp_path / "case.toml"
    path.write_text(words)
    assert read_case(path).organ().mesh.diagonal == vs.organs.beam().diagonal
    path.write_text(words.replace('"m"', '"mm"'))
    told = "organ:beam: a built-in organ is in metres, and the units are 'mm': leave them out"
    with pytest.raises(vs.VisceraError, match=f"mesh: {told}"):
        read_case(path).organ()
    assert cli.main(["inspect", "organ:beam", "--units", "m"]) == 0
    capsys.readouterr()
    assert cli.main(["inspect", "organ:beam", "--units", "mm"]) == 2
    assert told in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("fixed =", "fixd =", "unknown key 'fixd'; did you mean 'fixed'"),
        ("young", "yuong", r"unknown key 'yuong' in \[material\]; did you mean 'young'"),
        ("gravity", "gravty", r"unknown key 'gravty' in \[loads\]; did you mean 'gravity'"),
        ("steps", "step", r"unknown key 'step' in \[settings\]; did you mean 'steps'"),
        ("order", "ordr", r"unknown key 'ordr' in \[reduce\]; did you mean 'order'"),
        ('mesh = "bar.vtu"', 'mesh = "bar.vtu', "not a TOML file"),
        ("[settings]\nsteps = 2\nnewton.tolerance = 1e-10", "[settings.newton]\nsteps", "not a TOML file"),
        ('displacement."x >= 100%" = [0.02, "free", -0.01]', "displacement = 1", "'loads.displacement' is a table"),
        ('"NeoHookean"', '"NeoHokean"', "law 'NeoHokean' is unknown; did you mean 'NeoHookean'"),
        ("poisson = 0.3", "c1 = 0.3", r"\[material\] NeoHookean: it has no parameter 'c1'"),
        ("poisson = 0.3", "poisson = 0.5", r"poisson in \[material\] must be a number above -1 and below 0.5, got 0.5"),
        ('law = "NeoHookean"', "", "the material names no law"),
        (
            '"NeoHookean"\nyoung = 1e5\npoisson = 0.3',
            '"Ogden"',
            r"\[material\] Ogden: write mu = ..., alpha = ... there; it takes mu, alpha, kappa, poisson",
        ),
        (
            "[loads]",
            "[supports.top]\nstifness = 1\n[loads]",
            r"unknown key 'stifness' in \[supports.top\]; did you mean",
        ),
        ("[loads]", "[supports.top]\n[loads]", r"the key 'stiffness' is missing in \[supports.top\]"),
        ('units = "m"', 'units = "mn"', "units 'mn' is unknown; did you mean"),
        ('[0.02, "free", -0.01]', '[0.02, "fre", -0.01]', "displacement of 'x >= 100%' must be three lengths"),
        ('[0.02, "free", -0.01]', "[0.02]", "displacement of 'x >= 100%' must be three lengths"),
        ("tolerance = 1e-10", "tolerence = 1e-10", r"'tolerence' in \[settings.newton\]; did you mean 'tolerance'"),
    ],
)
def test_wrong_words_are_named_on_reading(folder: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=f"case.toml: .*{words}"):
        read_case(case_with(folder, old, new))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('fixed = "x <= 0%"', 'fixed = "rot"', "no node set 'rot'"),
        ('units = "m"', "", "needs its units"),
        ('mesh = "bar.vtu"', 'mesh = "car.vtu"', "car.vtu: no such file"),
    ],
)
def test_wrong_values_are_named_on_solving(folder: Path, old: str, new: str, words: str) -> None:
    case = read_case(case_with(folder, old, new))
    with pytest.raises(ValueError, match=words):
        case.solve(case.organ())


def use(case: vs.Case) -> None:
    organ = case.organ()
    case.loading()
    case.reduce(organ)


NO_SET = "the mesh has no node set 'abc'"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('fixed = "x <= 0%"', 'fixed = "abc"', f"fixed: {NO_SET}"),
        ('fixed = "x <= 0%"', 'fixed = ["root", "abc"]', f"fixed: {NO_SET}"),
        ('touchable = "z >= 100%"', 'touchable = "abc"', f"touchable in [reduce]: {NO_SET}"),
        ('force."z >= 100%"', "force.abc", f"force in [loads]: {NO_SET}"),
        ('displacement."x >= 100%"', "displacement.abc", f"displacement in [loads]: {NO_SET}"),
        ("order = 2", 'order = 2\nstart = "scan"\n[scan]\nforce.abc = [0, 0, 1]', f"force in [scan]: {NO_SET}"),
        ("[loads]", "[supports.abc]\nstiffness = 1e6\n[loads]", f"[supports.abc]: {NO_SET}"),
        ("poisson = 0.3", "", "[material]: NeoHookean takes either young and poisson, or mu and lam"),
        (
            "[loads]",
            '[material."x > 50%"]\nlaw = "NeoHookean"\nyoung = 2e5\n[loads]',
            "[material.x > 50%]: NeoHookean takes either young and poisson, or mu and lam",
        ),
        (
            'law = "NeoHookean"\nyoung = 1e5\npoisson = 0.3\n',
            'law = "MooneyRivlin"\nc1 = 1e3\nc2 = -500\nkappa = 1e5\n'
            '[material."x < 20%"]\nc1 = 2e3\n[material."x > 50%"]\nc1 = 1e2\n',
            "[material.x > 50%]: MooneyRivlin: c1 + c2 of cell 16 is -400; it must be positive [Pa]",
        ),
        (
            "[loads]",
            "[material.abc]\nyoung = 2e5\n[loads]",
            "[material]: the part 'abc': the mesh has no cell set 'abc'",
        ),
        ("density = 100\n", "", "gravity in [loads] needs the key density [kg/m^3] there"),
        (
            "order = 2",
            'order = 2\nvary = {parameter = "young", low = 1e4, high = 1e5, part = "abc"}',
            "[reduce.vary]: the mesh has no cell set 'abc'",
        ),
        ('radius = "60 mm"', 'radius = "9 m"', "[reduce]: radius is 9 m; it may be at most"),
        ('mesh = "bar.vtu"\nunits = "m"', 'mesh = "abc"', "mesh: {folder}/abc: no such file; name a mesh file"),
    ],
)
def test_what_does_not_suit_the_organ_is_named_with_its_file_and_key(
    folder: Path, old: str, new: str, words: str
) -> None:
    path = case_with(folder, old, new)
    case = read_case(path)
    with pytest.raises(vs.VisceraError) as told:
        use(case)
    assert str(told.value).startswith(f"{path}: {words.format(folder=folder)}")


def test_a_case_without_a_file_names_none() -> None:
    case = vs.Case(mesh="organ:beam", fixed="abc", material={"law": "NeoHookean", "young": 1e5, "poisson": 0.3})
    with pytest.raises(vs.VisceraError, match=f"^fixed: {NO_SET}"):
        case.organ()


def test_the_help_names_the_laws_that_a_command_line_can_describe(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["reduce", "--help"])
    told = re.search(r"--law LAW\s+(.*?) \(default: NeoHookean\)", capsys.readouterr().out, re.DOTALL)
    assert told is not None
    assert "".join(told[1].split()).split(",") == [name for name in LAWS if takes_young_and_poisson(name)]


def takes_young_and_poisson(law: str) -> bool:
    try:
        LAWS[law](young=1e5, poisson=0.3)  # type: ignore[call-arg]
    except (TypeError, vs.VisceraError):
        return False
    return True


def test_the_same_place_in_other_words_may_not_contradict(folder: Path) -> None:
    case = read_case(case_with(folder, "force.", 'displacement."x > 99%" = ["free", "free", 0]\nforce.'))
    with pytest.raises(vs.VisceraError, match="let each component be prescribed once"):
        case.solve(case.organ())


def test_a_mark_of_the_byte_order_is_skipped_and_another_coding_is_named(folder: Path) -> None:
    """As Windows' editors write them."""
    path = folder / "case.toml"
    path.write_text(GOOD, encoding="utf-8-sig")
    assert read_case(path).mesh == "bar.vtu"
    path.write_text(GOOD, encoding="utf-16")
    with pytest.raises(vs.VisceraError, match=r"case.toml: not in UTF-8 \(byte 0: .*\); save it as UTF-8"):
        read_case(path)


def test_a_missing_case_file(tmp_path: Path) -> None:
    with pytest.raises(vs.VisceraError, match=r"none\.toml: no such case file"):
        read_case(tmp_path / "none.toml")


def test_a_part_of_another_stiffness(folder: Path, bar: vs.Mesh) -> None:
    """By a cell set's name, by a condition on centroids, and as the API says it."""
    bar.with_cell_sets(nodule=lambda x: x[:, 0] > 0.3).write(folder / "bar.vtu")
    by_name = read_case(case_with(folder, "[loads]", "[material.nodule]\nyoung = 1e6\n[loads]")).organ()
    by_words = read_case(case_with(folder, "[loads]", '[material."x > 75%"]\nyoung = 1e6\n[loads]')).organ()
    young = bar.per_cell(1e5, {lambda x: x[:, 0] > 0.3: 1e6})
    expected = vs.NeoHookean(young=young, poisson=0.3).parameters
    assert by_name.law.parameters == pytest.approx(expected)
    assert by_words.law.parameters == pytest.approx(expected)


def test_laws_with_lists_and_fibres(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    head = 'mesh = "organ:artery"\nfixed = "top"\n[material]\n'
    path.write_text(
        head + 'law = "Ogden"\nmu = [1e3, -50]\nalpha = [2, -4]\npoisson = 0.4\n'
        '[material."z < 50%"]\nmu = [2e3, -100]\n'
    )
    rows = read_case(path).organ().law.parameters
    assert sorted({tuple(row[:2]) for row in rows.tolist()}) == [(1e3, -50.0), (2e3, -100.0)]
    fibres = "fibres = {angle = 30, axis = [0, 0, 1]}"
    wall = 'law = "HolzapfelGasserOgden"\nc = 3e3\nk1 = 2e3\nk2 = 0.8\npoisson = 0.45\n'
    path.write_text(head + wall + fibres)
    law = read_case(path).organ().law
    assert isinstance(law, vs.HolzapfelGasserOgden)
    assert law.fibres == pytest.approx(vs.helical_fibres(vs.organs.artery(), 30.0))
    path.write_text(head + wall + "fibres = [[1, 0, 1], [1, 0, -1]]")
    assert len(read_case(path).organ().law.parameters) == 1
    path.write_text(head + wall + "fibres = {angel = 30}")
    with pytest.raises(vs.VisceraError, match=r"unknown key 'angel' in \[material.fibres\]; did you mean 'angle'"):
        read_case(path)
    path.write_text(head + wall + "fibres = {axis = [0, 0, 1]}")
    with pytest.raises(vs.VisceraError, match=r"the key 'angle' is missing in \[material.fibres\]"):
        read_case(path)


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ("[material.nodule]\nyuong = 1e6", r"unknown key 'yuong' in \[material.nodule\]; did you mean 'young'"),
        ("[material.nodul]\nyoung = 1e6", "no cell set 'nodul'; did you mean 'nodule'"),
        ("[material.nodule]\nmu = 1e6", "'nodule' gives 'mu', which the rest of the organ has no value for"),
        ('[material.nodule]\nyoung = "hard"', r"young in \[material.nodule\] must be a number above 0 .*, got 'hard'"),
        ("[material.nodule]\nyoung = -1", r"young in \[material.nodule\] must be a number above 0"),
        ('[material."x > 110%"]\nyoung = 1', "'x > 110%' selects no cell"),
    ],
)
def test_wrong_parts_are_named(folder: Path, bar: vs.Mesh, part: str, words: str) -> None:
    bar.with_cell_sets(nodule=lambda x: x[:, 0] > 0.3).write(folder / "bar.vtu")
    with pytest.raises(vs.VisceraError, match=words):
        read_case(case_with(folder, "[loads]", f"{part}\n[loads]")).organ()


def test_of_parts_that_overlap_the_later_counts_and_one_with_a_law_over_those_without(folder: Path) -> None:
    def mu(parts: str) -> list[float]:
        law = read_case(case_with(folder, "[loads]", f"{parts}\n[loads]")).organ().law
        return sorted({float(row) for row in law.core().moduli()[:, 0].round(3)})

    soft, stiff = '[material."x > 50%"]\nyoung = 2e5', '[material."x > 40%"]\nyoung = 4e5'
    assert mu(f"{soft}\n{stiff}") == pytest.approx([1e5 / 2.6, 4e5 / 2.6])
    assert mu(f"{stiff}\n{soft}") == pytest.approx([1e5 / 2.6, 2e5 / 2.6, 4e5 / 2.6])
    other = '[material."x > 30%"]\nlaw = "Fung"\nmu = 7e3\nb = 2.0\npoisson = 0.3'
    assert mu(f"{other}\n{soft}") == pytest.approx([7e3, 1e5 / 2.6])


def test_surface_loads_in_a_case(folder: Path, bar: vs.Mesh) -> None:
    loads = 'traction."x >= 100%" = [10, 0, -5]\npressure."z >= 100%" = 40\nforce.'
    case = read_case(case_with(folder, "force.", loads))
    organ = case.organ()
    by_hand = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root").solve(
        displacement={"tip": (0.02, None, -0.01)},
        force={lambda x: x[:, 2] >= 0.1: (0, 0, -0.5)},
        traction={"tip": (10, 0, -5)},
        pressure={lambda x: x[:, 2] >= 0.1: 40},
        gravity=(0, 0, -9.81),
        density=100,
    )
    assert case.solve(organ).displacement == pytest.approx(by_hand.displacement, abs=1e-9)
    with pytest.raises(vs.VisceraError, match="pressure of 'z >= 100%' must be a number"):
        read_case(case_with(folder, "force.", 'pressure."z >= 100%" = "40"\nforce.'))
