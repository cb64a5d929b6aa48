"""A model as the page needs it: the surface alone. Nothing that the surface shows is lost, half of the bytes are."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viscera.touch import Touch

ARRAYS = [
    "points", "cells", "fixed", "law_parameters", "surface", "surface_nodes", "positions", "touchable", "edges",
    "triangle_edges", "patch_start", "patch_nodes", "patch_weights", "compliance", "cross_compliance", "force",
    "edge_force", "sketch", "norms", "compression", "position_region", "edge_region", "region_start", "mode_scale",
    "surface_modes", "interior_modes", "position_coefficients", "edge_coefficients",
]  # fmt: skip
DTYPES = {"float64": "F64", "float32": "F32", "uint32": "U32", "int16": "I16"}

Arrays = dict[str, NDArray[Any]]


def surface_arrays(touch: Touch) -> Arrays:
    """The arrays of a model whose only nodes are those of the surface; it has no cells, so it cannot be solved.

    Of a model for a range of a parameter, those of the value it is set to.
    """
    arrays = {name: np.asarray(touch._model.array(name)) for name in ARRAYS}
    nodes = arrays["surface_nodes"]
    for name in ("surface", "positions", "patch_nodes"):
        arrays[name] = np.searchsorted(nodes, arrays[name]).astype(np.uint32)
    arrays["fixed"] = np.flatnonzero(np.isin(nodes, arrays["fixed"])).astype(np.uint32)
    arrays["points"] = arrays["points"][nodes]
    arrays["cells"] = np.empty((0, 4), np.uint32)
    arrays["interior_modes"] = np.empty((0, 3), np.int16)
    arrays["surface_nodes"] = np.arange(len(nodes), dtype=np.uint32)
    # Without cells one row of parameters says it; many rows belong to the cells.
    columns = len(touch.metadata["law_parameter_names"])
    parameters = arrays["law_parameters"].reshape(-1)
    arrays["law_parameters"] = parameters if len(parameters) == columns else np.empty(0)
    return arrays


def surface_model(touch: Touch, name: str) -> bytes:
    """The model file (bytes) that the page loads, under the name that it shows."""
    return pack(named(touch.metadata, name), surface_arrays(touch))


def named(metadata: dict[str, Any], name: str, **notes: Any) -> dict[str, Any]:
    """Metadata of the one value the model is set to, with the name to show and further notes among what is added."""
    user = metadata["user"] if isinstance(metadata["user"], dict) else {}
    alone = {key: value for key, value in metadata.items() if key != "parameter"}
    return {**alone, "user": {**user, "name": name, **notes}}


def pack(metadata: dict[str, Any], arrays: Arrays) -> bytes:
    """Metadata and arrays as the bytes of a model file (docs/model-file.md)."""
    header: dict[str, Any] = {"__metadata__": {"viscera": json.dumps(metadata)}}
    end = 0
    # Widest numbers first, as everything then lies aligned.
    ordered = sorted(arrays.items(), key=lambda item: -item[1].itemsize)
    for name, array in ordered:
        offsets = [end, end + array.nbytes]
        header[name] = {"dtype": DTYPES[array.dtype.name], "shape": list(array.shape), "data_offsets": offsets}
        end += array.nbytes
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    little = (np.ascontiguousarray(array, array.dtype.newbyteorder("<")).tobytes() for _, array in ordered)
    return struct.pack("<Q", len(text)) + text + b"".join(little)
