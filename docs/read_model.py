"""Reads a model file and answers a touch with NumPy alone: the proof of docs/model-file.md."""

import json
import struct
import zlib
from itertools import product

import numpy as np

TYPES = {"F64": "<f8", "F32": "<f4", "U32": "<u4", "I16": "<i2"}


def read(path):
    with open(path, "rb") as file:
        header, data = json.loads(file.read(struct.unpack("<Q", file.read(8))[0])), file.read()
    text = header.pop("__metadata__")["viscera"]
    about, parts = json.loads(text), {name: data[slice(*h["data_offsets"])] for name, h in header.items()}
    found = {name: zlib.crc32(part) for name, part in parts.items()}
    whole = zlib.crc32(text.rpartition(',"crc32":')[0].encode())
    is_sealed = about["format_version"] > 1 or "crc32" in about  # the first version had no checksums
    if is_sealed and (found, whole) != (about["array_crc32"], about["crc32"]):
        raise ValueError("the model file is damaged: a checksum differs")
    return about, {k: np.frombuffer(parts[k], TYPES[h["dtype"]]).reshape(h["shape"]) for k, h in header.items()}


def exponents(P):
    return np.array([a for n in range(1, P + 1) for a in product(range(n, -1, -1), repeat=3) if sum(a) == n])


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


def pade(sketch, monomials, degree):
    """How much each order counts (P,) in the Padé form, from sketches of the fields (terms, 24)."""
    parts = np.array([(monomials[:, None] * sketch)[degree == n].sum(axis=0) for n in range(1, degree[-1] + 1)])
    size = np.linalg.norm(parts, axis=1)
    unit = parts / size[:, None]
    c = np.linalg.solve(unit[:-1] @ unit[:-1].T + 1e-3 * np.eye(len(unit) - 1), -unit[:-1] @ unit[-1])
    sums = np.cumsum([1.0, *(c * size[-1] / size[:-1])[::-1]])
    t = np.clip((sums[-1] - 0.1) / 0.2, 0.0, 1.0)
    return 1.0 + t * t * (3.0 - 2.0 * t) * (sums[::-1] / sums[-1] - 1.0)


def second_order(m, alpha, triangle, w, g, C, places):
    """What the second order adds under the first-order force g (3,), exactly: its force (3,), the displacements (3, 3)
    that the corners' linear rows get, and the monomials (6, 6) of corners and edge midpoints times shape functions."""
    corners, edges, pairs = m["touchable"][triangle], m["triangle_edges"][triangle], w * np.roll(w, -1)
    shape = np.append(w * (2 * w - 1), 4 * pairs)
    monomials = shape[:, None] * np.prod((places @ g)[:, None] ** alpha[3:9], axis=2)
    at_corners = m["force"].reshape(len(m["positions"]), -1, 3)[corners, 3:9]
    at_edges = m["edge_force"].reshape(len(m["edges"]), -1, 3)[edges, :6]
    forces = np.einsum("km,kmi->ki", monomials, np.append(at_corners, at_edges, axis=0))
    rise = np.where(m["edges"][edges, 0] == corners, 1, -1) * (w - np.roll(w, -1))
    energy = np.prod(w) * m["triangle_energy"][triangle] + (pairs * rise) @ m["edge_energy"][edges]
    cubic = exponents(3)[9:]
    slope = [energy * cubic[:, i] @ np.prod(g ** np.maximum(cubic - np.eye(3)[i], 0), axis=1) for i in range(3)]
    force = np.linalg.solve(C, np.einsum("kij,kj->i", places, forces) + slope)
    of_edges = 0.5 * (forces[3:] + np.roll(forces[3:], 1, axis=0))
    return force, np.einsum("kij,kj->ki", places[:3], w[:, None] * force - forces[:3] - of_edges), monomials


def touch(about, m, point, d):
    """Force (3,) [N] and displacement (n, 3) [m] for a contact point (3,) and its displacement d (3,) [m]."""
    alpha = exponents(about["order"])
    monomials, degree = np.prod(np.asarray(d) ** alpha, axis=1), alpha.sum(axis=1)
    triangle, w = locate(m["points"][m["positions"]][m["touchable"]], np.asarray(point))
    corners, edges, pairs = m["touchable"][triangle], m["triangle_edges"][triangle], w * np.roll(w, -1)
    own, cross = (m[name].reshape(-1, 3, 3) for name in ("compliance", "cross_compliance"))
    own, cross = own[corners], cross[edges] + cross[edges].transpose(0, 2, 1)
    C = np.tensordot(w**2, own, 1) + np.tensordot(pairs, cross, 1)
    places = np.append(own, 0.25 * (own + np.roll(own, -1, axis=0) + cross), axis=0)
    first = np.linalg.solve(C, d)
    weights = np.ones(about["order"])
    if "sketch" in m and about["order"] > 2:
        sketch = np.tensordot(w, m["sketch"].reshape(-1, len(alpha), 24).astype(float)[corners], 1)
        weights = pade(sketch, monomials, degree)
    start, second, held, of_second = 3, 0.0, 0.0, np.empty((6, 0))
    if "edge_energy" in m:
        start, (second, held, of_second) = 9, second_order(m, alpha, triangle, w, first, C, places)
    force = first + weights[1] * second
    linear = w[:, None] * (own @ first) + weights[1] * held
    higher, is_quadratic = (monomials * weights[degree - 1])[start:], degree[start:] <= about["edge_order"]
    amplitudes, starts = np.zeros(len(m["mode_scale"])), m["region_start"].astype(int)
    for k, corner in enumerate(corners):
        shape = np.where(is_quadratic, w[k] * (2 * w[k] - 1), w[k])
        for kind, table, place, low, high in (
            ("position", "force", corner, np.append(linear[k], weights[1] * of_second[k]), shape * higher),
            ("edge", "edge_force", edges[k], weights[1] * of_second[3 + k], 4 * pairs[k] * higher[is_quadratic]),
        ):
            both, regions = np.append(low, high), m[f"{kind}_region"]
            force = force + high @ m[table].reshape(-1, len(both), 3)[place, len(low) :]
            before, size = np.diff(starts)[regions[:place]].sum(), np.diff(starts)[regions[place]]
            rows = m[f"{kind}_coefficients"][len(both) * before :][: len(both) * size].reshape(len(both), size)
            amplitudes[starts[regions[place]] :][:size] += both @ rows
    amplitudes *= m["mode_scale"]
    amplitudes[np.abs(amplitudes) * 32767 <= 1e-5 * np.linalg.norm(d)] = 0
    field, is_surface = np.empty_like(m["points"]), np.isin(np.arange(len(m["points"])), m["surface_nodes"])
    for name, nodes in (("surface_modes", is_surface), ("interior_modes", ~is_surface)):
        field[nodes] = np.tensordot(amplitudes, m[name].reshape(len(amplitudes), -1, 3), 1)
    return force, field
