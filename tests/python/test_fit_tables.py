"""Tables of a size that no fit needs: told at once."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from viscera.errors import VisceraError
from viscera.fitting import columns


def test_many_columns_are_read_in_little_time(tmp_path: Path) -> None:
    """Comparing each name with all others took hours for a million."""
    names = [f"c{k}" for k in range(50_000)]
    row = ",".join(["1"] * len(names))
    path = tmp_path / "wide.csv"
    path.write_text(f"{','.join(names)}\n{row}\n{row}\n")
    start = time.perf_counter()
    assert len(columns.read_columns(path)) == len(names)
    assert time.perf_counter() - start < 5.0  # about 0.1 s here, and 30 s with each compared
    path.write_text(f"{','.join([*names[1:], 'c7'])}\n{row}\n{row}\n")
    with pytest.raises(VisceraError, match="two columns are called 'c7'; leave one"):
        columns.read_columns(path)


def test_a_curve_of_more_lines_than_a_fit_takes_is_to_be_thinned_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(columns, "MOST_LINES", 100)
    path = tmp_path / "long.csv"
    path.write_text("stretch,stress\n" + "1.1,200\n" * 100)
    assert len(columns.read_columns(path)["stress"]) == 100
    path.write_text("stretch,stress\n" + "1.1,200\n" * 201)
    words = "a curve of 201 lines, and a fit takes 100 at most; thin it out, one line of 3 is enough"
    with pytest.raises(VisceraError, match=words):
        columns.read_columns(path)
