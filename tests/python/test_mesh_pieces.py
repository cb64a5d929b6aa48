"""Pieces of a label map that its mesh lacks, or holds in other places: told, and their volume given to no other."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs

VOXEL = 0.003


def test_what_is_dropped_leaves_the_rest_its_volume() -> None:
    values = np.zeros((40, 40, 40), dtype=np.uint16)
    values[5:25, 5:25, 5:25] = values[30:36, 30:36, 30:36] = 1
    mesh = vs.Scan(values, 1e-3 * np.eye(3, 4)).mesh({"block": 1}, edge="4 mm")
    assert mesh.volume == pytest.approx(8e-6, rel=1e-3)
    assert mesh.messages == ("dropped a separate piece with less than 5 % of its label: 0.22 ml of 'block'",)


def ball(n: int = 40) -> NDArray[np.uint16]:
    """A ball of 114 ml, of voxels of 3 mm, in a map of n x 40 x 40."""
    return np.asarray(np.linalg.norm(np.moveaxis(np.indices((n, 40, 40)), 0, -1) - 19.5, axis=-1) < 10, dtype=np.uint16)


def test_a_piece_that_the_cells_miss_is_told_and_not_given_to_another() -> None:
    """A slab of 9 mm, a quarter of its label, beside a ball."""
    values = ball(60)
    values[48:51, 5:35, 12:28] = 1
    mesh = vs.Scan(values, VOXEL * np.eye(3, 4)).mesh({"organ": 1}, edge="18 mm")
    assert mesh.volume == pytest.approx(114.05e-6, rel=1e-3)
    assert mesh.messages == (
        "dropped a separate piece for which the edge is too long: 39 ml of 'organ'; "
        "give a shorter edge where that matters",
    )


def test_specks_that_no_cell_sees_are_told_and_not_given_to_another() -> None:
    values = ball(60)
    for corner in np.argwhere(np.ones((6, 9, 9))) * 4 + [34, 2, 2]:
        values[tuple(slice(i, i + 2) for i in corner)] = 1
    mesh = vs.Scan(values, VOXEL * np.eye(3, 4)).mesh({"organ": 1}, edge="12 mm")
    assert mesh.volume == pytest.approx(114.05e-6, rel=1e-3)
    assert mesh.messages == ("dropped 486 separate pieces with less than 5 % of its label: 100 ml of 'organ'",)


def test_a_part_that_is_thick_in_places_and_thin_in_others_is_told() -> None:
    """A vein one voxel thick, whose volume goes to its ends at the surface of an organ."""
    values = (np.linalg.norm(np.indices((30, 30, 30)) - 14.5, axis=0) < 12).astype(np.uint16)
    values[15, 15, 1:29] = 2
    mesh = vs.Scan(values, VOXEL * np.eye(3, 4)).mesh({"liver": 1, "vein": 2}, edge={"liver": "12 mm", "vein": "3 mm"})
    (told,) = [message for message in mesh.messages if "too thick" in message]
    assert re.match(
        r"'vein' is too thick in some places and too thin in others: 0\.\d+ of its 0\.7\d+ ml are not", told
    )


def test_an_end_is_told_only_where_the_mesh_has_it() -> None:
    """A speck in the corner of the image is dropped, so nothing is cut."""
    values = (np.linalg.norm(np.indices((30, 30, 30)) - 13.5, axis=0) < 10).astype(np.uint16)
    values[28:, 28:, 28:] = 1
    mesh = vs.Scan(values, VOXEL * np.eye(3, 4)).mesh({"organ": 1}, edge="9 mm")
    assert "cut" not in mesh.sets
    assert mesh.messages == ("dropped a separate piece with less than 5 % of its label: 0.22 ml of 'organ'",)
