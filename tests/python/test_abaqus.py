"""Input files of Abaqus as it and other programs write them: several blocks, sets of sets, parts, other files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import viscera as vs
from viscera.errors import VisceraError

NODES = "1, 0,0,0\n2, 1,0,0\n3, 0,1,0\n4, 0,0,1\n"
MORE = "5, 1,1,1\n"
CELLS = "*ELEMENT, TYPE=C3D4\n1, 1,2,3,4\n"
BOTH = f"*NODE\n{NODES}{MORE}{CELLS}*Element, type=c3d4, elset=far\n7, 2,3,4,5\n"


def read(folder: Path, text: str) -> vs.Mesh:
    (folder / "a.inp").write_text(text)
    return vs.read(folder / "a.inp")


def sets(found: vs.Mesh) -> dict[str, list[int]]:
    return {name: nodes.tolist() for name, nodes in found.sets.items()}


def test_several_blocks_of_nodes(tmp_path: Path) -> None:
    found = read(tmp_path, "*NODE, NSET=LOW\n1, 0,0,0\n2, 1,0,0\n3, 0,1,0\n*NODE\n4, 0,0,1\n" + CELLS)
    assert found.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert sets(found) == {"LOW": [0, 1, 2]}


@pytest.mark.parametrize("kind", ["C3D4H", "c3d4", "C3D4T", "DC3D4"])
def test_tetrahedra_of_every_formulation(tmp_path: Path, kind: str) -> None:
    assert read(tmp_path, f"*NODE\n{NODES}" + CELLS.replace("C3D4", kind)).cells.tolist() == [[0, 1, 2, 3]]


def test_ten_node_tetrahedra_go_on_in_the_next_line(tmp_path: Path) -> None:
    middles = "5,.5,0,0\n6,.5,.5,0\n7,0,.5,0\n8,0,0,.5\n9,.5,0,.5\n10,0,.5,.5\n"
    cell = "*ELEMENT, TYPE=C3D10HS\n1, 1,2,3,4,5,6,7,8,9\n10\n"
    assert len(read(tmp_path, f"*NODE\n{NODES}{middles}{cell}").points) == 4


def test_sets_that_name_sets(tmp_path: Path) -> None:
    text = """*NSET, NSET=base, GENERATE
1, 3, 2
*NSET, NSET="two words"
BASE, 4
*NSET, NSET=more, INSTANCE=liver-1
liver-1.base,
2
*NSET, NSET=more
5,
*ELSET, ELSET=all
far, 1
*NSET, NSET=by cells, ELSET=far
"""
    found = read(tmp_path, BOTH + text)
    assert sets(found) == {
        "all": [0, 1, 2, 3, 4],
        "far": [1, 2, 3, 4],
        "base": [0, 2],
        "two words": [0, 2, 3],
        "more": [0, 1, 2, 4],
        "by cells": [1, 2, 3, 4],
    }
    assert {name: cells.tolist() for name, cells in found.cell_sets.items()} == {"far": [1], "all": [0, 1]}


def test_commas_within_quotes_are_of_the_label(tmp_path: Path) -> None:
    text = """*NSET, NSET="left, side"
1, 2
*NSET, GENERATE , NSET="a = b,c"
2, 3
*NSET, NSET=both
"left, side", "A = B,C", 4,
*ELSET, ELSET="far, too"
7
"""
    found = read(tmp_path, BOTH + text)
    named = {name: nodes for name, nodes in sets(found).items() if name not in found.cell_sets}
    assert named == {"left, side": [0, 1], "a = b,c": [1, 2], "both": [0, 1, 2, 3]}
    assert found.cell_sets["far, too"].tolist() == [1]


def test_capitals_do_not_count_in_labels(tmp_path: Path) -> None:
    text = f"""*NODE
{NODES}{MORE}*ELEMENT, TYPE=C3D4, ELSET=Liver
1, 1,2,3,4
*ELEMENT, TYPE=C3D4, ELSET=LIVER
2, 2,3,4,5
*NSET, NSET=Fix
1, 2
*NSET, NSET=FIX
3
*ELSET, ELSET=all
liver
"""
    found = read(tmp_path, text)
    assert sets(found) == {"Fix": [0, 1, 2], "Liver": [0, 1, 2, 3, 4], "all": [0, 1, 2, 3, 4]}
    assert {name: cells.tolist() for name, cells in found.cell_sets.items()} == {"Liver": [0, 1], "all": [0, 1]}


def test_names_that_differ_in_capitals_alone_are_not_written(bar: vs.Mesh, tmp_path: Path) -> None:
    both = bar.with_sets(Fix=[0, 1, 2], FIX=[3])
    with pytest.raises(VisceraError, match=r"the names 'Fix' and 'FIX' of sets differ in capitals alone, which .inp"):
        both.write(tmp_path / "a.inp")
    both.write(tmp_path / "a.vtu")


def test_surfaces_are_sets_of_the_nodes_of_their_faces(tmp_path: Path) -> None:
    text = """*SURFACE, NAME=below, TYPE=ELEMENT
1, S1
far, S3
*Surface, name=nodes, type=NODE
4, 1.0
first
*NSET, NSET=first
1, 2
*SURFACE, NAME=FIRST
1, S4
*SURFACE INTERACTION, NAME=smooth
"""
    found = read(tmp_path, BOTH + text)
    assert sets(found) == {"far": [1, 2, 3, 4], "below": [0, 1, 2, 3, 4], "nodes": [0, 1, 3], "first": [0, 1]}
    taken = "the *SURFACE 'FIRST' is not read: a set of other nodes is called so; rename one of them"
    assert found.messages == (taken,)
    assert read(tmp_path, BOTH + "*NSET, NSET=a\n2,3,4\n*SURFACE, NAME=A\n1, S3\n").messages == ()
    one = read(tmp_path, BOTH + "*SURFACE, NAME=a\n7, S2\n*SURFACE, NAME=b\n7, S3\n*SURFACE, NAME=c\n7, S4\n")
    assert [sets(one)[name] for name in "abc"] == [[1, 2, 4], [2, 3, 4], [1, 3, 4]]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("\nfar,\n", "it names the face '' of a tetra; name each of its faces, S1 to S4 of a tetrahedron"),
        ("\nnear, S1\n", "it names 'near', and no set before it is called so"),
        ("\n8, S1\n", "it names element 8, which is not there"),
        (", TYPE=NODE\n8\n", "it names node 8, which is not there"),
        (", COMBINE=UNION\na, b\n", "only lists of nodes and of faces of elements are"),
        (", TYPE=CYLINDER\n0,0,0\n", "only lists of nodes and of faces of elements are"),
    ],
)
def test_a_surface_that_is_not_read_is_told(
    tmp_path: Path, text: str, reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    found = read(tmp_path, f"{BOTH}*SURFACE, NAME=skin{text}")
    assert found.messages == (f"the *SURFACE 'skin' is not read: {reason}",)
    assert found.messages[0] in caplog.text
    assert "skin" not in found.sets


def test_numbers_as_fortran_writes_them(tmp_path: Path) -> None:
    found = read(tmp_path, f"*NODE\n1, 0,0,0\n2, 1.D0,,\n3, ,1d0,\n4,,,1.0D+00,\n{CELLS}")
    assert found.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]


def test_lines_from_other_files_and_long_keywords(tmp_path: Path) -> None:
    (tmp_path / "nodes.txt").write_text(NODES)
    (tmp_path / "cells.inp").write_text(CELLS)
    text = "*NODE,\n  NSET=every,\n  INPUT=nodes.txt\n** comment\n*INCLUDE, INPUT=cells.inp\n"
    assert sets(read(tmp_path, text)) == {"every": [0, 1, 2, 3]}
    (tmp_path / "nodes.txt").write_text(NODES + "5, x, 0, 0\n")
    with pytest.raises(VisceraError, match=r"a\.inp: line 5 of nodes\.txt: 'x' is no number"):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("span", "nodes"), [("2, 99999999999", [1, 2, 3, 4]), (f"{1 - 10**30}, {10**30}, 2", [0, 2, 4])]
)
def test_a_generated_set_may_reach_beyond_the_nodes(tmp_path: Path, span: str, nodes: list[int]) -> None:
    assert sets(read(tmp_path, f"{BOTH}*NSET, NSET=x, GENERATE\n{span}\n")).get("x", []) == nodes


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("*SYSTEM\n0,0,10\n" + BOTH, "*SYSTEM moves the nodes of the file, which is not read; write their coordinates"),
        (BOTH + "*Instance, name=A-1, part=A\n 10., 0., 0.\n", "*INSTANCE moves the nodes of the file"),
        (
            BOTH + "*Instance, name=A-1, part=A\n 0, 0, 0\n 0,0,0, 0,0,1, 90\n",
            "*INSTANCE moves the nodes of the file",
        ),
        ("*NODE, SYSTEM=C\n1,1,90,0\n", "*NODE, SYSTEM=C: only nodes in rectangular coordinates are read"),
        (BOTH + "*NGEN\n1, 9, 2\n", "*NGEN is not read; write every node and element on a line of its own"),
        (BOTH + "*NODE\n1, 5,0,0\n", "node 1 stands at [0.0, 0.0, 0.0] and at [5.0, 0.0, 0.0]; parts that count their"),
        (BOTH + CELLS, "two elements have the number 1; parts that count their elements each for itself are not read"),
        (BOTH + "*NSET, NSET=x\nbass\n", "a set names 'bass', and no set before it is called so"),
        (BOTH + "*NSET, NSET=x\n6\n", "'x' names node 6, which is not there"),
        (BOTH + "*ELSET, ELSET=x\n2\n", "'x' names element 2, which is not there"),
        (BOTH + "*NSET\n1\n", "a *NSET has no NSET="),
        (BOTH.replace("2,3,4,5\n", "2,3,4,9\n"), "element 7 names node 9, which is not there"),
        (BOTH.replace("2,3,4,5\n", "2,3,4\n"), "its *ELEMENT, TYPE=c3d4 ends amid an element"),
        (BOTH + "*ELEMENT, TYPE=SPRING1\n9, 1\n", "elements of the type SPRING1 are not read; leave them out"),
        (BOTH + "*NODE\n6, 1, 2\n", "node 6 has 2 coordinates; it needs three"),
        ("*NODE\n1, 0,0,0\n** comment\n\n2, 1,o,0\n", "line 5: 'o' is no number"),
        (BOTH + "*NODE\n6x, 1, 2, 3\n", "line 12: '6x' is no whole number"),
        (BOTH.replace("2,3,4,5\n", "2,3,4.5,5\n"), "line 10: '4.5' is no whole number"),
        (BOTH + "*NSET, NSET=x, GENERATE\n1, 1e3\n", "line 12: '1e3' is no whole number"),
        (BOTH + "*NSET, NSET=x, GENERATE\n1, 5, 0\n", "line 12: the step is 0; it must be 1 or more"),
        (BOTH + "*NSET, NSET=x, GENERATE\n1,\n", "line 12: a set that is generated needs the first number, the last"),
        (BOTH + "*INCLUDE, INPUT=/dev/null\n", "it takes lines from /dev/null, and there is no such file beside it"),
        (BOTH + "*INCLUDE, INPUT=gone.inp\n", "it takes lines from gone.inp, and there is no such file beside it"),
        (BOTH + "*INCLUDE, INPUT=a.inp\n", "a.inp includes itself"),
    ],
)
def test_what_is_not_read_is_refused_in_words(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(VisceraError, match=re.escape(f"a.inp: {sentence}")):
        read(tmp_path, text)


def test_an_assembly_of_one_part_in_its_place_is_read(tmp_path: Path) -> None:
    found = read(tmp_path, f"*Part, name=A\n{BOTH}*End Part\n*Instance, name=A-1, part=A\n*End Instance\n")
    assert len(found.cells) == 2


ASSEMBLY = f"""*PART, NAME=Liver
{BOTH}*NSET, NSET=Set-1
1,2
*NSET, NSET=own
Set-1
*ELSET, ELSET=Cells
1,
*END PART
*ASSEMBLY, NAME=all
*INSTANCE, NAME=Liver-1, PART=LIVER
*END INSTANCE
*NSET, NSET=set-1, INSTANCE=Liver-1
5,
*NSET, NSET=local, INSTANCE=Liver-1
Set-1
*NSET, NSET=global
SET-1, 3
*NSET, NSET=named
Liver-1.Set-1, 4
*ELSET, ELSET=Cells, INSTANCE=Liver-1
7,
*SURFACE, NAME=below
Liver-1.Cells, S1
*SURFACE, NAME=above
Cells, S1
*END ASSEMBLY
"""


def test_a_label_of_a_part_is_not_that_of_the_assembly(tmp_path: Path) -> None:
    found = read(tmp_path, ASSEMBLY)
    assert {name: nodes for name, nodes in sets(found).items() if name not in found.cell_sets} == {
        "Liver-1.Set-1": [0, 1],
        "own": [0, 1],
        "set-1": [4],
        "local": [0, 1],
        "global": [2, 4],
        "named": [0, 1, 3],
        "below": [0, 1, 2],
        "above": [1, 2, 3],
    }
    assert {name: cells.tolist() for name, cells in found.cell_sets.items()} == {
        "far": [1],
        "Liver-1.Cells": [0],
        "Cells": [1],
    }
    assert found.messages == (
        "the node set 'Set-1' of 'Liver' is called 'Liver-1.Set-1': another has its name",
        "the element set 'Cells' of 'Liver' is called 'Liver-1.Cells': another has its name",
    )


def test_a_mark_of_the_encoding_is_no_part_of_the_first_keyword(tmp_path: Path) -> None:
    assert len(read(tmp_path, "\ufeff" + BOTH).cells) == 2
