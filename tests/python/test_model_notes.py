"""What stands under `user` of a model file: the package's own sets, axes and flags, or what another program wrote."""

from __future__ import annotations

import base64
import json
import struct
import tracemalloc
import zlib
from pathlib import Path
from typing import Any

import pytest

import viscera as vs
from viscera.reduced.touch import load_bytes


@pytest.fixture(scope="module")
def model(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    path = tmp_path_factory.mktemp("model") / "bar.viscera"
    organ.reduce("tip", order=2).save(path)
    return path.read_bytes()


def with_metadata(model: bytes, **changes: Any) -> bytes:
    """The model with other entries of its metadata, and the checksum of these."""
    length = struct.unpack("<Q", model[:8])[0]
    header = json.loads(model[8 : 8 + length])
    about = json.loads(header["__metadata__"]["viscera"]) | changes
    del about["crc32"]
    text = json.dumps(about, separators=(",", ":"))[:-1]
    header["__metadata__"]["viscera"] = f'{text},"crc32":{zlib.crc32(text.encode())}}}'
    packed = json.dumps(header).encode()
    packed += b" " * (-len(packed) % 8)
    return struct.pack("<Q", len(packed)) + packed + model[8 + length :]


@pytest.mark.parametrize(
    "user", [{}, None, 5, "text", {"mine": [1, 2], "sets": {}, "axes": "LPS", "is_unloaded": True}]
)
def test_what_others_write_under_other_keys_is_left_alone(model: bytes, user: Any) -> None:
    touch = load_bytes(with_metadata(model, user=user))
    assert touch.mesh.axes == ("LPS" if isinstance(user, dict) and user else "")
    assert touch.metadata["user"] == user


SHORT = base64.b64encode(zlib.compress(b"\0")).decode()
BOMB = base64.b64encode(zlib.compress(bytes(10_000_000), 9)).decode()


@pytest.mark.parametrize(
    ("user", "words"),
    [
        (
            {"sets": {"mine": [1, 2, 3]}},
            r"`user\.sets\.mine` is not the base64 text of a zlib stream of \d+ bits: \[1, 2",
        ),
        ({"sets": {"clamp": "@@@"}}, r"`user\.sets\.clamp` is not the base64 text of a zlib stream of \d+ bits: '@@@'"),
        ({"sets": {"clamp": "\u00e9"}}, r"`user\.sets\.clamp` is not the base64"),
        ({"sets": {"clamp": SHORT}}, r"`user\.sets\.clamp` is not the base64"),
        ({"sets": {"clamp": BOMB}}, r"`user\.sets\.clamp` is not the base64"),
        ({"sets": [1, 2]}, r"`user\.sets` is no object with a text for each name: \[1, 2\]"),
        ({"cell_sets": {"a": "b"}}, r"`user\.cell_sets\.a` is not the base64 text"),
        ({"cell_sets": None}, r"`user\.cell_sets` is no object"),
        ({"axes": "XYZ"}, r"`user\.axes` is none of \"RAS\" and \"LPS\": 'XYZ'"),
        ({"axes": [1]}, r"`user\.axes` is none of"),
        ({"is_unloaded": 1}, r"`user\.is_unloaded` is neither true nor false: 1"),
        ({"starts_as_scanned": {}}, r"`user\.starts_as_scanned` is neither true nor false"),
    ],
)
def test_what_others_write_under_the_keys_of_the_package_is_refused_at_once(
    tmp_path: Path, model: bytes, user: dict[str, Any], words: str
) -> None:
    (tmp_path / "other.viscera").write_bytes(with_metadata(model, user=user))
    with pytest.raises(vs.VisceraError, match=rf"other\.viscera: its {words}.*write it under another key"):
        vs.load(tmp_path / "other.viscera")


def test_a_set_is_inflated_no_further_than_its_bits(model: bytes) -> None:
    """A text of a few kilobytes would take all memory."""
    data = with_metadata(model, user={"sets": {"clamp": BOMB}})
    tracemalloc.start()
    with pytest.raises(vs.VisceraError, match="clamp"):
        load_bytes(data)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 5_000_000


@pytest.mark.parametrize("names", [[], ["mu", "lam", "kappa"], ["mu", "lam", "kappa", "beta", "eta"]])
def test_parameters_of_a_law_have_a_column_for_each_name(model: bytes, names: list[str]) -> None:
    """No columns ended in a panic where the organ was asked for."""
    with pytest.raises(vs.VisceraError, match=rf"law_parameters has \d+ entries, .* the {len(names)} columns in"):
        load_bytes(with_metadata(model, law_parameter_names=names))
