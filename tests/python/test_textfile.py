"""Tables that people write: what separates their columns, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import viscera as vs
from viscera.cli import main
from viscera.fitting.columns import read_columns


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_columns_may_be_separated_by_semicolons_and_tabs(separator: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("stretch,stress\n1,0.5\n2,3\n".replace(",", separator))
    assert {name: column.tolist() for name, column in read_columns(tmp_path / "a.csv").items()} == {
        "stretch": [1.0, 2.0],
        "stress": [0.5, 3.0],
    }


@pytest.mark.parametrize(
    "text",
    [
        "stretch,stress,\n1,0.5,\n2,3,\n",
        "stretch,stress\n1,0.5,\n2,3\n",
        "# tensile test, 3 mm/s\n\n#\nstretch,stress\n1,0.5\n2,3\n",
        "# tensile test; 3 mm/s\nstretch;stress\n1;0.5\n2;3\n",
        "# stretch,stress\n1,0.5\n2,3\n",
    ],
)
def test_separators_at_the_end_of_lines_and_comments_are_left_out(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    columns = read_columns(tmp_path / "a.csv")
    assert {name: column.tolist() for name, column in columns.items()} == {"stretch": [1.0, 2.0], "stress": [0.5, 3.0]}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("stretch;stress\n1;0,5\n2;3\n", "line 2: stress is '0,5'; write its decimal comma as a point"),
        (
            "stretch stress\n1 0.5\n2 3\n",
            "spaces separate 'stretch stress'; separate columns by commas, semicolons or tabs",
        ),
        (
            'stretch,stress\n1,0\n2,"1,500.5"\n',
            "line 3: stress is '1,500.5'; leave out the commas between its thousands",
        ),
        ('stretch,stress\n1,0\n2,"1,5"\n', "line 3: stress is '1,5'; write its decimal comma as a point"),
        ("stretch,\n1,\n2,3\n", "line 3: 2 values under 1 names"),
        ("stretch,,stress\n1,,0\n2,,3\n", "line 2: a column without a name is ''; give a number"),
        ("# by hand\nstretch,stress\n1,x\n2,3\n", "line 3: stress is 'x'; give a number"),
    ],
)
def test_a_table_in_another_form_is_refused_with_its_cause(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(vs.VisceraError, match=words):
        dict(read_columns(tmp_path / "a.csv"))


def test_columns_that_nobody_asks_for_may_hold_anything(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(
        "time,stretch,stress,remark\n10:00:00,1,0,\n10:00:01,1.1,250,slipped\n10:00:02,1.2,450,\n"
    )
    columns = read_columns(tmp_path / "a.csv")
    assert list(columns) == ["time", "stretch", "stress", "remark"]
    assert columns["stress"].tolist() == [0.0, 250.0, 450.0]
    with pytest.raises(vs.VisceraError, match="line 2: time is '10:00:00'; give a number"):
        columns["time"]
    assert main(["fit", str(tmp_path / "a.csv"), "--law", "NeoHookean"]) == 0
