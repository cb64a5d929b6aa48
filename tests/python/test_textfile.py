"""Tables that people write: what separates their columns, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import viscera as vs
from viscera.fitting.materialtest import read_columns


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_columns_may_be_separated_by_semicolons_and_tabs(separator: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("stretch,stress\n1,0.5\n2,3\n".replace(",", separator))
    assert {name: column.tolist() for name, column in read_columns(tmp_path / "a.csv").items()} == {
        "stretch": [1.0, 2.0],
        "stress": [0.5, 3.0],
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("stretch;stress\n1;0,5\n2;3\n", "line 2: stress is '0,5'; write its decimal comma as a point"),
        (
            "stretch stress\n1 0.5\n2 3\n",
            "spaces separate 'stretch stress'; separate columns by commas, semicolons or tabs",
        ),
    ],
)
def test_a_table_in_another_form_is_refused_with_its_cause(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(vs.VisceraError, match=words):
        read_columns(tmp_path / "a.csv")
