"""Sets of nodes in words."""

from __future__ import annotations

import re
from functools import partial
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.errors import VisceraError
from viscera.select import in_space, length, length_in_space, offset, point


@pytest.mark.parametrize(
    ("words", "holds"),
    [
        ("x < 10%", lambda x: x[:, 0] < 0.04),
        ("x <= 0%", lambda x: x[:, 0] <= 0),
        ("z > 3 cm", lambda x: x[:, 2] > 0.03),
        ("z>=50mm", lambda x: x[:, 2] >= 0.05),
        ("20% < x < 300 mm", lambda x: (x[:, 0] > 0.08) & (x[:, 0] < 0.3)),
        ("0.09 m <= y", lambda x: x[:, 1] >= 0.09),
        ("x < 50% and z > 1e-2 m and y < 9e4um", lambda x: (x[:, 0] < 0.2) & (x[:, 2] > 0.01) & (x[:, 1] < 0.09)),
        ("300 mm > x > 20%", lambda x: (x[:, 0] > 0.08) & (x[:, 0] < 0.3)),
        ("x > -5%", lambda x: x[:, 0] > -1),
        ("x > 0", lambda x: x[:, 0] > 0),
        ("within 60 mm of (0, 5 cm, 50%)", lambda x: np.linalg.norm(x - [0, 0.05, 0.05], axis=1) <= 0.06),
        ("within 6cm of (0, 50, 50) mm", lambda x: np.linalg.norm(x - [0, 0.05, 0.05], axis=1) <= 0.06),
        ("within 20% of (0, 0, 0)", lambda x: np.linalg.norm(x, axis=1) <= 0.2 * np.sqrt(0.18)),
        ("root and z > 50%", lambda x: (x[:, 0] == 0) & (x[:, 2] > 0.05)),
        ("80, 3 7", lambda x: np.isin(np.arange(81), [3, 7, 80])),
    ],
)
def test_conditions(bar: vs.Mesh, words: str, holds: Any) -> None:
    expected: NDArray[np.bool_] = holds(bar.points)
    assert bar.nodes(words).tolist() == np.flatnonzero(expected).tolist()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("x < 10", "10 has no unit; use %, m, cm, mm"),
        ("x < 10 ft", "unit 'ft' is unknown"),
        ("w < 10%", "cannot read 'w < 10%'"),
        ("x < 10% or z > 3 cm", "cannot read"),
        ("x << 10%", "cannot read"),
        ("x > 2 m", "selects no node; the mesh spans x 0..400 mm, y 0..100 mm"),
        ("rot", "did you mean 'root'"),
        ("x", "no node set 'x'"),
        ("rot and x < 10%", "'rot and x < 10%': the mesh has no node set 'rot'; did you mean 'root'"),
        ("within 8 of (0, 0, 0)", "8 has no unit"),
        ("within 8 mm of (1, 2) mm", r"the centre in .* is not a point; write it as '\(100, 50, 80\) mm'"),
        ("within 8 mm of (1, 2, 3)", "1 has no unit"),
        ("within 8 mm of root", "cannot read 'within 8 mm of root'"),
        ("within 8 mm of (10, 20, 30) m", "selects no node; the mesh spans"),
        ("81", "names node 81, but the mesh has 81 nodes"),
    ],
)
def test_words_that_mean_nothing(bar: vs.Mesh, words: str, message: str) -> None:
    with pytest.raises(vs.VisceraError, match=message):
        bar.nodes(words)


def test_a_set_with_a_strange_name_is_still_a_set(bar: vs.Mesh) -> None:
    named = bar.with_sets(**{"x < 10": [1, 2]})
    assert named.nodes("x < 10").tolist() == [1, 2]
    assert bar.nodes([3, 1]).tolist() == [1, 3]


def test_lengths() -> None:
    assert length("12 mm", 1.0, "radius") == pytest.approx(0.012)
    assert length("10%", 0.3, "radius") == pytest.approx(0.03)
    assert length(0.02, 1.0, "radius") == 0.02
    wrong: Any
    for wrong in ("12", "wide", "12 parsec", True, [1]):
        with pytest.raises(vs.VisceraError, match="radius"):
            length(wrong, 1.0, "radius")


@pytest.mark.parametrize(
    "words", ["foo", "(1, 2)", "(1, 2, 3)", "(1, 2, 3) furlong", ["1", "2 mm", "3 mm"], ["1 mm", "b"]]
)
def test_where_there_is_no_mesh_no_percentage_is_advised(words: Any, bar: vs.Mesh) -> None:
    """What an error advises is taken then: a percentage would be refused."""
    for resolve, advises in ((partial(in_space, name="point"), False), (partial(point, mesh=bar, name="point"), True)):
        with pytest.raises(vs.VisceraError) as told:
            resolve(words)
        assert ("%" in str(told.value)) is advises, told.value
    with pytest.raises(vs.VisceraError, match=r"not a length; write it as '12 mm'$"):
        length_in_space("wide", "the radius")
    assert in_space("(10 cm, 5 cm, 50 mm)", "point").tolist() == [0.1, 0.05, 0.05]


def test_a_sphere_of_cells_goes_by_their_centroids(bar: vs.Mesh) -> None:
    inside = np.linalg.norm(bar.centroids - [0.2, 0.05, 0.05], axis=1) <= 0.05
    assert bar.cells_in("within 5 cm of (50%, 50%, 50%)").tolist() == np.flatnonzero(inside).tolist()
    young = bar.per_cell(1e3, {"within 5 cm of (50%, 50%, 50%)": 3e4})
    assert (young == 3e4).sum() == inside.sum() > 0


def test_points_and_displacements(bar: vs.Mesh) -> None:
    words: Any
    for words in ("(100, 50, 80) mm", "100 mm, 5 cm, 80%", ["100 mm", 0.05, "80%"], (0.1, 0.05, 0.08)):
        assert point(words, bar, "a point") == pytest.approx([0.1, 0.05, 0.08])
    push: list[float | str] = [0, "-1 mm", "10%"]
    assert offset(push, bar, "a push") == pytest.approx([0, -0.001, 0.1 * bar.diagonal])
    wrong: Any
    for wrong in ("100", "(1, 2, 3)", ["1 mm", 2], [1, "two", 3], ["1 mm", True, 0], ["1 mm", None, 0]):
        with pytest.raises(vs.VisceraError, match="a push"):
            offset(wrong, bar, "a push")


def test_the_language_is_the_same_wherever_a_point_or_a_push_enters(bar: vs.Mesh) -> None:
    organ = vs.Organ(
        bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="within 1 mm of (0, 50, 50) mm and root and x < 1%"
    )
    assert organ.fixed.tolist() == bar.nodes("within 1 mm of (0, 50, 50) mm").tolist()
    held = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    by_words = held.solve(displacement={"tip": ("free", 0, "-1 mm")})
    assert by_words.displacement.tolist() == held.solve(displacement={"tip": (None, 0, -0.001)}).displacement.tolist()
    touch = held.reduce("z > 99% and x > 70%", order=2)
    at: Any = "(380, 50, 100) mm"
    push: Any = [0, 0, "-1 mm"]
    assert touch(at, push).force.tolist() == touch((0.38, 0.05, 0.1), (0, 0, -0.001)).force.tolist()
    assert touch.patch(at).nodes.tolist() == touch.patch((0.38, 0.05, 0.1)).nodes.tolist()
    assert held.patch(at, "12%").nodes.tolist() == held.patch((0.38, 0.05, 0.1), 0.12 * bar.diagonal).nodes.tolist()
    assert bar.near(at, "6 cm").tolist() == bar.near((0.38, 0.05, 0.1), 0.06).tolist()
    assert touch.check(touches=1, depths=["1%"]).rows == touch.check(touches=1, depths=[0.01 * bar.diagonal]).rows
    hand = held.stepper().grasp("tip")
    hand.move((0, 0, "-1 mm"))
    assert hand.displacement[:, 2] == pytest.approx(-0.001)


def test_the_nearest_touchable_point(bar: vs.Mesh) -> None:
    touch = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root").reduce("z > 99% and x > 70%", order=2)
    assert touch.locate((0.38, 0.05, 0.3)) == pytest.approx([0.38, 0.05, 0.1])
    assert touch.locate((0.0, -1.0, 0.0)) == pytest.approx([0.3, 0.0, 0.1])
    assert touch(touch.locate((9, 9, 9)), (0, 0, -0.001)).force[2] < 0


def test_a_list_of_words_is_all_their_places_together(bar: vs.Mesh) -> None:
    both = np.union1d(bar.nodes("root"), bar.nodes("x > 90%")).tolist()
    for where in (["root", "x > 90%"], ("root", "x > 90%"), np.array(["root", "x > 90%"])):
        assert bar.nodes(where).tolist() == both
    assert len(bar.cells_in(["x < 25%", "x > 75%"])) == len(bar.cells_in("x < 25%")) + len(bar.cells_in("x > 75%"))
    quadratic = bar.quadratic()
    assert len(quadratic.nodes(["root", "root"])) == len(quadratic.nodes("root"))


def test_a_list_of_words_holds_and_loads_an_organ(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e4, poisson=0.3), fixed=["root", "x > 99%"])
    assert organ.fixed.tolist() == bar.nodes(["root", "x > 99%"]).tolist()
    places = ["45% < x < 55% and z > 99%", "45% < x < 55% and y > 99%"]
    listed, known = (organ.solve(force=[(where, (0, 0, -0.1))]) for where in (places, bar.nodes(places)))
    np.testing.assert_array_equal(listed.displacement, known.displacement)
    with pytest.raises(vs.VisceraError, match=r"'root' and 'x > 99%' are fixed"):
        organ.solve(force={("root", "x > 99%"): (0, 0, -0.1)})


def test_a_list_of_words_and_indices_is_refused_with_what_is_wrong(bar: vs.Mesh) -> None:
    mixed: Any = ["root", 3]
    with pytest.raises(vs.VisceraError, match=r"\['root', 3\] has 3; write indices among words as words"):
        bar.nodes(mixed)
    organ = vs.Organ(bar, vs.NeoHookean(young=1e4, poisson=0.3), fixed="root")
    with pytest.raises(vs.VisceraError, match=r"\['x > 90%', 3\] has 3"):
        organ.solve(force=[(["x > 90%", 3], (0, 0, -0.1))])


@pytest.mark.parametrize("is_quadratic", [False, True])
def test_the_part_of_a_set_counts_percentages_within_the_set(bar: vs.Mesh, is_quadratic: bool) -> None:
    half = bar.with_sets(half="x < 50%").with_cell_sets(half="x < 50%")
    mesh = half.quadratic() if is_quadratic else half
    assert mesh.nodes("half/x > 99%").tolist() == mesh.nodes("half and x > 37%").tolist()
    assert mesh.nodes("half/0, 2").tolist() == mesh.sets["half"][[0, 2]].tolist()
    assert mesh.cells_in("half/x < 50%").tolist() == mesh.cells_in("x < 25%").tolist()
    with pytest.raises(vs.VisceraError, match="has no node set 'half/tip'"):
        mesh.nodes("half/tip")


def test_places_do_not_depend_on_where_the_mesh_lies(bar: vs.Mesh) -> None:
    """Percentages, contact patches and registration beyond a kilometre from the origin, where lengths end."""
    away, moved = np.array([0, 0, 1100]), np.array([0, 0, 1e-4])
    far = vs.mesh(bar.points + away, bar.cells, bar.sets)
    assert far.nodes("within 6 cm of (0%, 0%, 0%)").tolist() == bar.nodes("within 6 cm of (0%, 0%, 0%)").tolist()
    assert far.nodes("within 6 cm of (0, 0, 1100) m").tolist() == bar.nodes("within 6 cm of (0, 0, 0)").tolist()
    assert far.near("(100%, 50%, 100%)", "6 cm").tolist() == bar.near("(100%, 50%, 100%)", "6 cm").tolist()
    law = vs.NeoHookean(young=1e5, poisson=0.3)
    near, organ = (vs.Organ(mesh, law, fixed="root") for mesh in (bar, far))
    corner = far.points[far.nodes("tip")[0]]
    assert len(organ.patch(corner, "6 cm").nodes) == len(near.patch(corner - away, "6 cm").nodes)
    found, same = (each.register(each.mesh.points[::3] + moved, noise="1 mm") for each in (organ, near))
    assert found.status == same.status


@pytest.mark.parametrize(
    ("point", "sentence"),
    [
        ((0, 0, 2e9), "centre must be three finite numbers [m], none above 1e+09 in size, got (0, 0, 2000000000.0)"),
        (("1e12 m", 0, 0), "centre must be a number from -1e+09 to 1e+09 [m], got '1e12 m'"),
        (("1e999%", 0, 0), "centre must be a number from -1e+09 to 1e+09 [m], got '1e999%'"),
        (("1 mn", 0, 0), "in 'centre': unit 'mn' is unknown"),
    ],
)
def test_a_place_out_of_range_is_named_as_it_was_given(bar: vs.Mesh, point: Any, sentence: str) -> None:
    with pytest.raises(VisceraError, match=re.escape(sentence)):
        bar.near(point, "1 cm")


def test_a_motion_in_words_is_limited_as_in_numbers(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e4, poisson=0.3), fixed="root")
    with pytest.raises(VisceraError, match=re.escape("must be a number from -1000 to 1000 [m], got '2000 m'")):
        organ.solve(displacement={"tip": (0, 0, "2000 m")})


@pytest.mark.parametrize("kind", [np.int64, np.uint32, bool, list])
def test_a_set_that_is_put_among_the_others_is_read_as_indices(bar: vs.Mesh, kind: Any) -> None:
    """As scripts do: `flatnonzero` gives wide integers."""
    is_root = bar.points[:, 0] == bar.points[:, 0].min()
    nodes = np.flatnonzero(is_root)
    mesh = bar.with_sets(tip="x > 99%").with_cell_sets(low="z < 50%")
    sets, cell_sets = cast("dict[str, Any]", mesh.sets), cast("dict[str, Any]", mesh.cell_sets)
    sets["wall"] = is_root if kind is bool else nodes.tolist() if kind is list else nodes.astype(kind)
    cell_sets["half"] = mesh.cells_in("x < 50%").astype(np.int64)
    organ = vs.Organ(mesh, vs.NeoHookean(young=1e5, poisson=0.3), fixed="wall")
    assert np.array_equal(organ.fixed, nodes)
    assert mesh.nodes("wall").dtype == mesh.cells_in("half").dtype == np.uint32
    assert np.array_equal(mesh.nodes("wall/z > 50%"), mesh.nodes("wall and z > 50%"))
    model = organ.reduce("tip", depth="2%", order=2)
    assert np.array_equal(model.mesh.nodes("wall"), nodes)
    assert np.array_equal(model.mesh.cells_in("half"), mesh.cells_in("half"))


def test_a_set_of_nodes_that_are_not_there_is_refused_by_name(bar: vs.Mesh) -> None:
    mesh = bar.with_sets(tip="x > 99%")
    cast("dict[str, Any]", mesh.sets)["wall"] = np.array([0, len(mesh.points)])
    with pytest.raises(vs.VisceraError, match=r"the node set 'wall' names node \d+, but the mesh has \d+ nodes"):
        mesh.nodes("wall")
