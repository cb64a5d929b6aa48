"""Writes the first corpus of the fuzzers: a small valid model, that model damaged, and headers that lie.

What a fuzzer finds worth keeping is added to the corpus beside it, under the name that the fuzzer gave it.
"""

import json
from itertools import permutations, product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import viscera as vs
from viscera.cases.case import Case
from viscera.viewer.live import live_case

FOLDER = Path(__file__).parent / "corpus"


def cubes(n: int) -> vs.Mesh:
    """A block of n x n x n cubes, 4 cm in all, and its floor."""
    points = np.array([point[::-1] for point in product(range(n + 1), repeat=3)], dtype=float)
    index = {tuple(point): number for number, point in enumerate(points.astype(int).tolist())}
    cells = []
    for corner in product(range(n), repeat=3):
        for order in permutations(range(3)):
            steps = np.eye(3, dtype=int)[list(order)].cumsum(axis=0)
            cells.append([index[tuple(np.add(corner, step).tolist())] for step in ([0, 0, 0], *steps.tolist())])
    return vs.mesh(0.04 / n * points, cells, sets={"floor": np.flatnonzero(points[:, 2] == 0)})


def block(n: int) -> bytes:
    """The model file of such a block, held at the bottom and touched at the top."""
    organ = vs.Organ(cubes(n), vs.NeoHookean(young=3000, poisson=0.4), fixed="floor")
    touch = organ.reduce(lambda x: x[:, 2] > 0.039, radius=0.02, depth=0.004, order=2, tolerance=0.01)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "block.viscera"
        touch.save(path)
        return path.read_bytes()


def cube() -> bytes:
    """A case of one cube of 4 cm, held at the bottom."""
    with TemporaryDirectory() as folder:
        mesh = cubes(1)
        mesh.write(Path(folder) / "cube.vtu")
        material = {"law": "NeoHookean", "young": 3000, "poisson": 0.4}
        case = Case(mesh="cube.vtu", units="m", fixed="floor", material=material, folder=Path(folder))
        return live_case(case, "Cube").data


REQUESTS = {
    "hand": '{"grab": [0.04, 0.04, 0.04], "move": [0, 0, -0.004]}\n{"move": [0, 0.004, 0]}\n{}\n{"release": true}\n{}',
    "two_laws": '{"laws": ["Linear", "NeoHookean"], "gravity": [0, 0, -9.81]}\n{}\n{"laws": ["Corotated"]}\n{}',
    "hand_gone_mad": '{"grab": [0.04, 0, 0.04], "move": [9e5, 9e5, 9e5]}\n{}\n{"gravity": [9e5, 0, -9e5]}\n{}\n{}',
    "everything": '{"laws": ["MooneyRivlin"], "grab": [0, 0, 0.04], "move": [0, 0, 1], "release": false}',
    "nobody_there": '{"grab": [1, 1, 1]}',
    "numbers_out_of_range": '{"move": [0, 0, 1e999]}\n{"move": [0, 0, -1e7]}\n{"move": [0, 0, 1e-320]}',
    "no_object": "[{}, {}, {}, {}, {}]",
    "deep": '{"move": ' + "[" * 300,
    "no_text": "\ufffe\x00{}",
}


def parts(file: bytes) -> tuple[dict[str, Any], bytes]:
    end = 8 + int.from_bytes(file[:8], "little")
    return json.loads(file[8:end]), file[end:]


def whole(header: dict[str, Any] | bytes, data: bytes = b"") -> bytes:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data


def damaged(file: bytes) -> dict[str, bytes]:
    """Damage that checksums would hide, so to files of the format before them."""
    header, data = parts(file)
    metadata = json.loads(header["__metadata__"]["viscera"])
    for checksum in ("array_crc32", "crc32"):
        del metadata[checksum]
    metadata["format_version"] = 1
    header["__metadata__"] = {"viscera": json.dumps(metadata)}
    tensors = {name: tensor for name, tensor in header.items() if name != "__metadata__"}

    def with_metadata(**changes: object) -> bytes:
        return whole({**tensors, "__metadata__": {"viscera": json.dumps({**metadata, **changes})}}, data)

    def with_tensor(name: str, **changes: object) -> bytes:
        return whole({**header, name: {**header[name], **changes}}, data)

    points = header["points"]["data_offsets"]
    return {
        "empty": b"",
        "seven_bytes": bytes(7),
        "no_header": bytes(8),
        "header_of_all_memory": (2**63 - 1).to_bytes(8, "little") + b"{}",
        "header_of_most_memory": (2**40).to_bytes(8, "little") + b"{}",
        "header_past_the_end": (len(file) + 1).to_bytes(8, "little") + file[8:],
        "header_no_object": whole(b"[]"),
        "header_no_text": whole(b"\xff\xfe{}"),
        "header_empty": whole({}),
        "header_deep": whole(b"[" * 5000),
        "cut": file[: len(file) // 2],
        "longer": file + bytes(100),
        "shape_overflows": with_tensor("points", shape=[2**62, 2**62]),
        "shape_without_data": with_tensor("cells", shape=[2**40, 4], data_offsets=[0, 2**44]),
        "shape_empty": with_tensor("points", shape=[]),
        "shape_no_columns": with_tensor("points", shape=[0, 0], data_offsets=[0, 0]),
        "offsets_reversed": with_tensor("points", data_offsets=points[::-1]),
        "offsets_shared": with_tensor("compliance", data_offsets=header["force"]["data_offsets"]),
        "type_unknown": with_tensor("points", dtype="F7"),
        "metadata_missing": whole(tensors, data),
        "metadata_no_object": whole({**header, "__metadata__": {"viscera": "[1]"}}, data),
        "metadata_deep": with_metadata(user=json.loads("[" * 100 + "]" * 100)),
        "metadata_long": with_metadata(user=[0] * 5000),
        "order_huge": with_metadata(order=2**40),
        "order_negative": with_metadata(order=-1),
        "edge_order_zero": with_metadata(edge_order=0),
        "depth_overflows": with_metadata(depth=1e308),
        "diagonal_tiny": with_metadata(diagonal=5e-324),
        "block_without_checksums.viscera": whole(header, data),
        "checksums_missing": with_metadata(format_version=2),
        "version_next": with_metadata(format_version=5),
    }


def main() -> None:
    for name in ("file", "edits", "case", "requests"):
        (FOLDER / name).mkdir(parents=True, exist_ok=True)
    (FOLDER / "file" / "block.viscera").write_bytes(block(2))
    for name, content in damaged(block(1)).items():
        (FOLDER / "file" / name).write_bytes(content)
    whole_case = cube()
    (FOLDER / "case" / "cube.case").write_bytes(whole_case)
    (FOLDER / "case" / "cut").write_bytes(whole_case[: len(whole_case) // 2])
    header, data = parts(whole_case)
    for name in ("points", "cells", "fixed", "density"):
        other = {**header, name: {**header[name], "dtype": "F32"}}
        (FOLDER / "case" / f"{name}_of_another_type").write_bytes(whole(other, data))
    for name, text in REQUESTS.items():
        (FOLDER / "requests" / name).write_text(text, encoding="utf-8")
    random = np.random.default_rng(1)
    for number in range(16):
        (FOLDER / "edits" / f"random_{number}").write_bytes(random.bytes(8 * (number + 1)))


if __name__ == "__main__":
    main()
