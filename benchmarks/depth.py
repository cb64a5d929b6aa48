"""How deep a reduced model reaches: the same series summed as a polynomial and in its Padé form, against Newton.

    python benchmarks/depth.py [TOUCHES [ORDER [REACH]]]

The built-in liver, neo-Hookean, E = 0.17 MPa, nu = 0.48, linear cells; random touches of the anterior face within REACH
(in diagonals, 1 for all of it) of its middle, in any direction at 5, 10 and 15 % of the diagonal. A touch at which
Newton passed an instability may have several answers: errors are given with such touches and without.
"""

from __future__ import annotations

import json
import struct
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from machine import describe

import viscera as vs
from viscera.reduced.check import Full, allowed_error, surface_points, unit_vectors
from viscera.reduced.touch import load_bytes
from viscera.study.case import middle

DEPTHS = (0.05, 0.10, 0.15)
LOOPS = 10


def without(data: bytes, name: str) -> bytes:
    """A model file without one of its arrays, in the format that has no checksums."""
    size = struct.unpack("<Q", data[:8])[0]
    header, body, kept = json.loads(data[8 : 8 + size]), data[8 + size :], b""
    for key, about in [*header.items()]:
        if key == name:
            del header[key]
        elif key != "__metadata__":
            start, end = about["data_offsets"]
            about["data_offsets"] = [len(kept), len(kept) + end - start]
            kept += body[start:end]
    metadata = json.loads(header["__metadata__"]["viscera"])
    unsealed = {key: value for key, value in metadata.items() if key not in ("array_crc32", "crc32")}
    header["__metadata__"]["viscera"] = json.dumps({**unsealed, "format_version": 1})
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + kept


def main(touches: int, order: int, reach: float) -> None:
    """Reduce, then ask everything once."""
    liver = vs.organs.liver()
    organ = vs.Organ(liver, vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element="P1")
    face = organ.touchable("anterior")
    near = np.intersect1d(face, liver.near(liver.points[middle(liver, face)], reach * liver.diagonal))
    print(describe())
    pade = organ.reduce(near, depth=max(DEPTHS) * liver.diagonal, order=order)
    data = pade._model.to_bytes()
    models = {"polynomial": load_bytes(without(data, "sketch")), "Padé": pade}
    print(
        f"order {order}, {pade.summary()['positions']} positions, {1e-6 * len(data):.0f} MB; "
        f"errors off-line {pade.metadata['errors']}",
        flush=True,
    )
    comparison = Comparison(models, touches)
    for name, model in models.items():
        loops = comparison.points[:LOOPS]
        lost = (max(_lost(model, point, depth * liver.diagonal) for point in loops) for depth in DEPTHS)
        shares = " ".join(f"{depth:.0%}: {100 * part:.2g} %" for depth, part in zip(DEPTHS, lost, strict=True))
        print(
            "energy gained or lost in closed loops of displacements, over the work done, "
            f"worst of {len(loops)}: {name} {shares}"
        )
    with ThreadPoolExecutor() as pool:
        rows = [row for some in pool.map(comparison.rows, range(touches)) for row in some]
    print("depth            field median / 90 % / worst     force median / 90 % / worst     trusted, worst, /estimate")
    for depth in DEPTHS:
        at = [row for row in rows if row[0] == depth]
        print(
            f"{depth:5.0%} {len(at)} of {touches} full solutions converged, "
            f"{sum(not row[1] for row in at)} of them past an instability"
        )
        for k, name in enumerate(models):
            for words, some in (("all", at), ("stable", [row for row in at if row[1]])):
                print(_row(name, words, np.array([row[2][k] for row in some], dtype=float), allowed_error(depth)))


Row = tuple[float, bool, list[tuple[float, float, float, bool]]]
"""Depth, whether Newton met no instability, and of all models error of field and force, estimate and trust."""


class Comparison:
    """Touches that models of one body have not seen, by them and by Newton."""

    def __init__(self, models: dict[str, vs.Touch], touches: int, seed: int = 0) -> None:
        self.models, self.first = models, next(iter(models.values()))
        random = np.random.default_rng(seed)
        self.points, self.directions = surface_points(self.first, touches, random), unit_vectors(touches, random)
        self.full = Full(self.first)

    def rows(self, k: int) -> list[Row]:
        """One touch, at every depth to which Newton's method converges."""
        patch, state, rows = self.first.patch(self.points[k]), None, []
        for depth in DEPTHS:
            push = depth * self.first.mesh.diagonal * self.directions[k]
            state = self.full.solve(patch, push, state)
            if not state.is_converged:
                break
            field, force = self.full.added(state), state.reaction(patch)
            answers = [model(self.points[k], push) for model in self.models.values()]
            errors = [
                (_gap(a.displacement, field), _gap(a.force, force), a.shape_error_estimate, a.is_shape_trusted)
                for a in answers
            ]
            rows.append((depth, state.status == "converged", errors))
        return rows


def _row(name: str, words: str, table: np.ndarray, limit: float) -> str:
    if not len(table):
        return f"      {name:10s} {words}: none"
    cells = [
        f"{100 * np.median(e):8.3f} /{100 * np.quantile(e, 0.9):7.2f} /{100 * e.max():8.2f} %" for e in table.T[:2]
    ]
    trusted = table[table[:, 3] > 0]
    worst = trusted[:, :2].max(axis=1) if len(trusted) else np.zeros(1)
    ratio = (worst / trusted[:, 2]).max() if len(trusted) else 0.0
    beyond = int((worst > limit).sum())
    return (
        f"      {name:10s} {words:7s} {cells[0]}  {cells[1]} {len(trusted):5d}/{len(table)} "
        f"{100 * worst.max():6.2f} % {ratio:5.2f}" + (f"  {beyond} beyond its limit" if beyond else "")
    )


def _lost(model: vs.Touch, point: np.ndarray, depth: float) -> float:
    """What a random closed polygon of displacements takes or gives, as a part of the work along its sides."""
    random = np.random.default_rng(1)
    corners = depth * unit_vectors(6, random) * random.uniform(0.3, 1.0, (6, 1))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    work = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        forces = np.array([model(point, start + 0.5 * (1.0 + x) * (end - start)).force for x in nodes])
        work.append(0.5 * float(weights @ forces @ (end - start)))
    return abs(sum(work)) / sum(map(abs, work))


def _gap(value: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm(value - truth) / np.linalg.norm(truth))


if __name__ == "__main__":
    words = sys.argv[1:] + ["40", "6", "0.2"][len(sys.argv) - 1 :]
    main(int(words[0]), int(words[1]), float(words[2]))
