"""How deep a reduced model reaches: the same series summed as a polynomial and in its Padé form, against Newton.

    python benchmarks/depth.py [TOUCHES [ORDER [ELEMENT]]]

The built-in liver, neo-Hookean, E = 0.17 MPa, nu = 0.48, linear cells by default; random touches of the anterior face
in any direction at 5, 10 and 15 % of the diagonal. A touch at which Newton passed an instability may have several
answers: errors are given with such touches and without.
"""

from __future__ import annotations

import json
import struct
import sys
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter

import numpy as np
from machine import describe

import viscera as vs
from viscera.check import Full, allowed_error, surface_points, unit_vectors
from viscera.touch import load_bytes

DEPTHS = (0.05, 0.10, 0.15)


def without(data: bytes, name: str) -> bytes:
    """A safetensors file without one of its arrays."""
    size = struct.unpack("<Q", data[:8])[0]
    header, body, kept = json.loads(data[8 : 8 + size]), data[8 + size :], b""
    for key, about in [*header.items()]:
        if key == name:
            del header[key]
        elif key != "__metadata__":
            start, end = about["data_offsets"]
            about["data_offsets"] = [len(kept), len(kept) + end - start]
            kept += body[start:end]
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + kept


def main(touches: int, order: int, element: str) -> None:
    """Reduce, then ask everything once."""
    liver = vs.organs.liver()
    organ = vs.Organ(liver, vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element=element)
    print(describe())
    began = perf_counter()
    pade = organ.reduce("anterior", depth=max(DEPTHS) * liver.diagonal, order=order)
    seconds, data = perf_counter() - began, pade._model.to_bytes()
    models = {"polynomial": load_bytes(without(data, "sketch")), "Padé": pade}
    print(
        f"order {order}, {element}, {pade.summary()['positions']} positions, {1e-6 * len(data):.0f} MB, "
        f"reduced in {seconds:.0f} s; errors off-line {pade.metadata['errors']}",
        flush=True,
    )
    random = np.random.default_rng(0)
    points, directions = surface_points(pade, touches, random), unit_vectors(touches, random)
    full = Full(pade)

    def ask(k: int) -> list[tuple[float, bool, list[tuple[float, float, float, bool]]]]:
        patch, state, rows = pade.patch(points[k]), None, []
        for depth in DEPTHS:
            push = depth * liver.diagonal * directions[k]
            state = full.solve(patch, push, state)
            if not state.is_converged:
                break
            field, force = full.added(state), state.reaction(patch)
            answers = [model(points[k], push) for model in models.values()]
            rows.append(
                (
                    depth,
                    state.status == "converged",
                    [
                        (_gap(a.displacement, field), _gap(a.force, force), a.error_estimate, a.is_trusted)
                        for a in answers
                    ],
                )
            )
        return rows

    with ThreadPoolExecutor() as pool:
        rows = [row for some in pool.map(ask, range(touches)) for row in some]
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


def _gap(value: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm(value - truth) / np.linalg.norm(truth))


if __name__ == "__main__":
    words = sys.argv[1:] + ["50", "6", "P1"][len(sys.argv) - 1 :]
    main(int(words[0]), int(words[1]), words[2])
