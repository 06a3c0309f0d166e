"""Arrays as a GLB file: glTF 2.0 in one piece, with one mesh of one primitive."""

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from digs_warp import __version__

# Numbers of the glTF 2.0 specification: types of components, and what a buffer is for.
_COMPONENTS = {"<f4": 5126, "|u1": 5121, "<u2": 5123, "<u4": 5125}
_VERTICES, _INDICES, POINTS = 34962, 34963, 0


def glb_file(
    name: str,
    attributes: Mapping[str, np.ndarray],
    indices: np.ndarray | None = None,
    primitive: Mapping[str, Any] | None = None,
    document: Mapping[str, Any] | None = None,
) -> bytes:
    """Return a GLB file.

    Args:
        name: of the node.
        attributes: by semantic, ``POSITION`` among them: (n,) or (n, components), little-endian; integers
            stand for shares of a whole. Rows take a multiple of 4 bytes.
        indices: of corners, (m,), uint32; None: points.
        primitive: further keys of the primitive.
        document: further keys of the document.
    """
    buffers = [(values, _VERTICES) for values in attributes.values()]
    keys: dict[str, Any] = {"attributes": {each: i for i, each in enumerate(attributes)}}
    if indices is not None:
        keys["indices"] = len(buffers)
        buffers.append((indices, _INDICES))
    views, accessors, start = [], [], 0
    for number, (values, target) in enumerate(buffers):
        views.append(
            {"buffer": 0, "byteOffset": start, "byteLength": values.nbytes, "target": target}
        )
        width = values.shape[1] if values.ndim == 2 else 1
        accessor = {
            "bufferView": number,
            "componentType": _COMPONENTS[values.dtype.str],
            "count": len(values),
            "type": "SCALAR" if width == 1 else f"VEC{width}",
        }
        is_share = target == _VERTICES and values.dtype.kind == "u"
        accessors.append(accessor | ({"normalized": True} if is_share else {}))
        start += values.nbytes
    place = accessors[keys["attributes"]["POSITION"]]
    points = attributes["POSITION"]
    place |= {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    content = {
        "asset": {"version": "2.0", "generator": f"digs-warp {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"primitives": [keys | dict(primitive or {})]}],
        "buffers": [{"byteLength": start}],
        "bufferViews": views,
        "accessors": accessors,
        **(document or {}),
    }
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    data = b"".join(np.ascontiguousarray(values).tobytes() for values, _ in buffers)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
