"""Reads a model file and answers a touch with NumPy alone: the proof of docs/model-file.md."""

import json
import struct
import zlib

import numpy as np

TYPES = {"F64": "<f8", "F32": "<f4", "U32": "<u4", "I16": "<i2"}


def read(path):
    with open(path, "rb") as file:
        header = json.loads(file.read(struct.unpack("<Q", file.read(8))[0]))
        data = file.read()
    text = header.pop("__metadata__")["viscera"]
    about, parts = json.loads(text), {name: data[slice(*h["data_offsets"])] for name, h in header.items()}
    if about["format_version"] > 1:  # the first had no checksums
        found = {name: zlib.crc32(part) for name, part in parts.items()}
        metadata = zlib.crc32(text.rpartition(',"crc32":')[0].encode())
        if (metadata, found) != (about["crc32"], about["array_crc32"]):
            raise ValueError("the model file is damaged: a checksum differs")
    arrays = {name: np.frombuffer(part, TYPES[header[name]["dtype"]]) for name, part in parts.items()}
    return about, {name: array.reshape(header[name]["shape"]) for name, array in arrays.items()}


def locate(corners, x):
    """Triangle and barycentric weights (3,) of the point closest to x: the foot inside, or one on the three edges."""
    v, w = np.einsum("qji,qj->iq", np.linalg.pinv(corners[:, 1:] - corners[:, :1]), x - corners[:, 0])
    feet = [np.where((v >= 0) & (w >= 0) & (v + w <= 1), [1 - v - w, v, w], np.nan).T]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        side = corners[:, j] - corners[:, i]
        t = np.clip(((x - corners[:, i]) * side).sum(1) / (side * side).sum(1), 0, 1)[:, None]
        feet.append(np.eye(3)[i] * (1 - t) + np.eye(3)[j] * t)
    distance = np.linalg.norm(np.einsum("kqi,qij->kqj", feet, corners) - x, axis=2)
    kind, triangle = np.unravel_index(np.nanargmin(distance), distance.shape)
    return triangle, feet[kind][triangle]


def weights(about, m, corners, w, d):
    """How much each order counts (P,): all alike, or as in the Padé form where the file has sketches."""
    P = about["order"]
    alpha = [(i, j, n - i - j) for n in range(1, P + 1) for i in range(n, -1, -1) for j in range(n - i, -1, -1)]
    if "sketch" not in m or P < 3:
        return np.ones(P)
    sketch = np.tensordot(w, m["sketch"].reshape(-1, len(alpha), 24).astype(float)[corners], 1)
    terms = np.prod(d ** np.array(alpha), axis=1)[:, None] * sketch
    parts = np.array([terms[np.sum(alpha, axis=1) == n].sum(axis=0) for n in range(1, P + 1)])
    size = np.linalg.norm(parts, axis=1)
    unit = parts / size[:, None]
    c = np.linalg.solve(unit[:-1] @ unit[:-1].T + 1e-3 * np.eye(P - 1), -unit[:-1] @ unit[-1])
    sums = np.cumsum([1.0, *(c * size[-1] / size[:-1])[::-1]])
    t = np.clip((sums[-1] - 0.1) / 0.2, 0.0, 1.0)
    return 1.0 + t * t * (3.0 - 2.0 * t) * (sums[::-1] / sums[-1] - 1.0)


def touch(about, m, point, d):
    """Force (3,) [N] and displacement (n, 3) [m] for a contact point (3,) and its displacement d (3,) [m]."""
    degrees = range(2, about["order"] + 1)
    exponents = np.array([(i, j, n - i - j) for n in degrees for i in range(n, -1, -1) for j in range(n - i, -1, -1)])
    monomials, is_quadratic = np.prod(np.asarray(d) ** exponents, axis=1), exponents.sum(axis=1) <= about["edge_order"]
    triangle, w = locate(m["points"][m["positions"]][m["touchable"]], np.asarray(point))
    corners, edges, pairs = m["touchable"][triangle], m["triangle_edges"][triangle], w * np.roll(w, -1)
    own, cross = (m[name].reshape(-1, 3, 3) for name in ("compliance", "cross_compliance"))
    C = np.tensordot(w**2, own[corners], 1) + np.tensordot(pairs, cross[edges] + cross[edges].transpose(0, 2, 1), 1)
    force = first = np.linalg.solve(C, d)
    monomials *= weights(about, m, corners, w, np.asarray(d))[exponents.sum(axis=1) - 1]
    terms = []  # array names, place, amplitudes of the linear terms, amplitudes of the higher ones
    for k in range(3):
        shape = np.where(is_quadratic, w[k] * (2 * w[k] - 1), w[k])
        terms.append(("position", "force", corners[k], w[k] * own[corners[k]] @ first, shape * monomials))
        terms.append(("edge", "edge_force", edges[k], np.empty(0), 4 * pairs[k] * monomials[is_quadratic]))
    amplitudes = np.zeros(len(m["mode_scale"]))
    for kind, table, place, linear, higher in terms:
        both = np.append(linear, higher)
        force = force + higher @ m[table].reshape(-1, len(both), 3)[place, len(linear) :]
        starts, regions = m["region_start"].astype(int), m[f"{kind}_region"]
        before, size = np.diff(starts)[regions[:place]].sum(), np.diff(starts)[regions[place]]
        rows = m[f"{kind}_coefficients"][len(both) * before :][: len(both) * size].reshape(len(both), size)
        amplitudes[starts[regions[place]] :][:size] += both @ rows
    amplitudes *= m["mode_scale"]
    amplitudes[np.abs(amplitudes) * 32767 <= 1e-5 * np.linalg.norm(d)] = 0
    field, is_surface = np.empty_like(m["points"]), np.isin(np.arange(len(m["points"])), m["surface_nodes"])
    for name, nodes in (("surface_modes", is_surface), ("interior_modes", ~is_surface)):
        field[nodes] = np.tensordot(amplitudes, m[name].reshape(len(amplitudes), -1, 3), 1)
    return force, field
