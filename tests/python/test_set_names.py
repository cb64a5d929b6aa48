"""Names of sets in mesh files: a node set and a cell set of one name, and letters that a format has its own use for."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import viscera as vs
from viscera.cli import main
from viscera.errors import VisceraError

WITH_SETS = (".vtu", ".vtk", ".msh", ".inp", ".feb")
TETS = """$Nodes
5
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
5 1 1 1
$EndNodes
$Elements
3
1 2 2 1 1 1 2 3
2 4 2 2 1 1 2 3 4
3 4 2 2 1 2 3 4 5
$EndElements
"""


@pytest.mark.parametrize("element", ["P1", "P2"])
@pytest.mark.parametrize("ending", [".vtu", ".vtk", ".msh"])
def test_a_written_solution_keeps_the_sets_of_its_mesh(bar: vs.Mesh, tmp_path: Path, ending: str, element: str) -> None:
    mesh = bar.with_sets(**{"x < 10%": bar.nodes("x < 10%")}).with_cell_sets(low="z < 60%", **{"<high>": "z > 40%"})
    state = vs.Organ(mesh, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root", element=element).solve()
    state.write(tmp_path / f"bar{ending}")
    again = vs.read(tmp_path / f"bar{ending}")
    assert {name: again.sets[name].tolist() for name in mesh.sets} == {
        name: nodes.tolist() for name, nodes in mesh.sets.items()
    }
    assert {name: cells.tolist() for name, cells in again.cell_sets.items()} == {
        name: cells.tolist() for name, cells in mesh.cell_sets.items()
    }
    assert vs.output.state.read(tmp_path / f"bar{ending}")[1].shape[1] == 3


@pytest.mark.parametrize("ending", [".mesh", ".meshb"])
def test_a_format_without_sets_says_so(
    bar: vs.Mesh, tmp_path: Path, caplog: pytest.LogCaptureFixture, ending: str
) -> None:
    path = tmp_path / f"bar{ending}"
    bar.write(path)
    assert caplog.messages == [f"{path}: {ending} cannot hold sets and parts; .vtu does"]
    assert not vs.read(path).sets
    bar.with_sets(**{"line\nbreak": [0]}).write(path)  # no name is written, so none is refused


@pytest.mark.parametrize("ending", WITH_SETS)
def test_a_node_set_and_a_cell_set_of_one_name_stay_apart(bar: vs.Mesh, tmp_path: Path, ending: str) -> None:
    mesh = bar.with_cell_sets(root="x < 50%")
    assert len(mesh.sets["root"]) < len(np.unique(mesh.cells[mesh.cell_sets["root"]]))
    mesh.write(tmp_path / f"bar{ending}")
    again = vs.read(tmp_path / f"bar{ending}")
    assert again.sets["root"].tolist() == mesh.sets["root"].tolist()
    assert again.cell_sets["root"].tolist() == mesh.cell_sets["root"].tolist()
    assert sorted(set(again.sets) - {"root"}) == sorted(set(bar.sets) - {"root"})


@pytest.mark.parametrize("names", [('2 1 "liver"', '3 2 "liver"'), ('3 2 "liver"', '2 1 "liver"')])
def test_gmsh_groups_of_one_name_in_two_dimensions(tmp_path: Path, names: tuple[str, str]) -> None:
    """The set is the nodes of the surface, the cell set the volume, whichever the file names first."""
    head = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n{}\n{}\n$EndPhysicalNames\n".format(*names)
    (tmp_path / "a.msh").write_text(head + TETS)
    found = vs.read(tmp_path / "a.msh")
    assert {name: nodes.tolist() for name, nodes in found.sets.items()} == {"liver": [0, 1, 2]}
    assert {name: cells.tolist() for name, cells in found.cell_sets.items()} == {"liver": [0, 1]}


def test_gmsh_4_groups_of_one_name_in_two_dimensions(tmp_path: Path) -> None:
    """An entity of version 4 may be in several groups, which meshio keeps by name."""
    (tmp_path / "a.msh").write_text(
        """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
2 5 "liver"
3 1 "all"
3 2 "liver"
$EndPhysicalNames
$Entities
0 0 1 2
1 0 0 0 1 1 0 1 5 0
1 0 0 0 1 1 1 2 1 2 0
2 0 0 0 1 1 1 1 1 0
$EndEntities
$Nodes
1 5 1 5
3 1 0 5
1
2
3
4
5
0 0 0
1 0 0
0 1 0
0 0 1
1 1 1
$EndNodes
$Elements
3 3 1 3
2 1 2 1
1 1 2 3
3 1 4 1
2 1 2 3 4
3 2 4 1
3 2 3 4 5
$EndElements
"""
    )
    found = vs.read(tmp_path / "a.msh")
    assert found.sets["liver"].tolist() == [0, 1, 2]
    assert {name: cells.tolist() for name, cells in found.cell_sets.items()} == {"all": [0, 1], "liver": [0]}


def test_nodes_of_febio_win_over_faces_of_their_name(tmp_path: Path) -> None:
    nodes = "".join(f'<node id="{k}">{k == 2:d},{k == 3:d},{k == 4:d}</node>' for k in range(1, 5))
    (tmp_path / "a.feb").write_text(
        f'<febio_spec version="4.0"><Mesh><Nodes>{nodes}</Nodes><Elements type="tet4"><elem id="1">1,2,3,4</elem>'
        '</Elements><NodeSet name="base">1,2</NodeSet><Surface name="base"><tri3 id="1">1,2,3</tri3></Surface></Mesh>'
        "</febio_spec>"
    )
    assert vs.read(tmp_path / "a.feb").sets["base"].tolist() == [0, 1]


@pytest.mark.parametrize("ending", WITH_SETS)
@pytest.mark.parametrize("name", ["x < 10%", "left lobe", "50%20", "Lebertumor, größter", 'the "base"', "a=b", "a\\b"])
def test_a_name_is_read_again_as_it_was_or_refused(bar: vs.Mesh, tmp_path: Path, ending: str, name: str) -> None:
    mesh = bar.with_sets(**{name: [0, 1], "Lebertumor": [3]}).with_cell_sets(**{name: [4, 5]})
    path = tmp_path / f"bar{ending}"
    if set(name) & set({".inp": ',="', ".msh": '"\\'}.get(ending, "")):
        with pytest.raises(VisceraError, match=rf"of a set holds .*, which \{ending} cannot say; rename the set"):
            mesh.write(path)
        assert not path.exists()
        return
    mesh.write(path)
    again = vs.read(path)
    assert again.sets[name].tolist() == [0, 1]
    assert again.cell_sets[name].tolist() == [4, 5]
    assert again.sets["Lebertumor"].tolist() == [3]


@pytest.mark.parametrize("ending", WITH_SETS)
def test_names_with_colons_are_names_of_their_own(bar: vs.Mesh, tmp_path: Path, ending: str) -> None:
    """Others are left out where they hold everything: those that are made of arrays and numbers of groups."""
    mesh = bar.with_sets(**{"ref:2:7": np.arange(2), "z:1": np.arange(len(bar.points))})
    mesh = mesh.with_cell_sets(**{"org:1": np.arange(len(bar.cells))})
    mesh.write(tmp_path / f"bar{ending}")
    again = vs.read(tmp_path / f"bar{ending}")
    assert {name: len(nodes) for name, nodes in again.sets.items() if name in mesh.sets} == {
        name: len(nodes) for name, nodes in mesh.sets.items()
    }
    assert {name: len(cells) for name, cells in again.cell_sets.items()} == {"org:1": len(bar.cells)}


def test_control_characters_and_outer_spaces_in_names(bar: vs.Mesh, tmp_path: Path) -> None:
    with pytest.raises(VisceraError, match=r"'a\\nb' of a set holds '\\n', which \.vtu cannot say"):
        bar.with_sets(**{"a\nb": [0]}).write(tmp_path / "bar.vtu")
    with pytest.raises(VisceraError, match=r"' a' of a set begins or ends in a space, which \.inp loses"):
        bar.with_sets(**{" a": [0]}).write(tmp_path / "bar.inp")
    bar.with_sets(**{"a\nb": [0]}).write(tmp_path / "bar.mesh")  # holds no sets


def test_vtk_names_are_written_as_vtk_writes_them(bar: vs.Mesh, tmp_path: Path) -> None:
    bar.with_sets(**{"x < 10%": [0]}).write(tmp_path / "bar.vtk")
    assert "set:x%20<%2010%25" in meshio.vtk.read(tmp_path / "bar.vtk").point_data


def test_the_command_refuses_a_name_before_it_meshes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    labels = np.zeros((12, 12, 12), dtype=int)
    labels[2:10, 2:10, 2:10] = 1
    vs.Scan(labels, np.diag([0.005, 0.005, 0.005, 1.0])).write(tmp_path / "labels.nii.gz")
    given = ["mesh", str(tmp_path / "labels.nii.gz"), "--label", "a,b=1", "--edge", "1e9 m"]
    assert main([*given, "-o", str(tmp_path / "organ.inp")]) != 0
    assert "the name 'a,b' of a set holds ',', which .inp cannot say" in capsys.readouterr().err
