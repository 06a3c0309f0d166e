"""The numbers in the buffers of a glTF file, as the standard defines them."""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.sim.scene.mesh.gltf import glb_binary, uri_bytes

# glTF 2.0, section 3.6.2.2: types of components, and components per element.
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class GltfNumbers:
    """Reads the accessors of a file.

    Args:
        path: the file; its buffers are read relative to its folder.
        header: of the file, with counts that have been checked.
    """

    def __init__(self, path: Path, header: dict[str, Any]) -> None:
        self._path, self._header = path, header

    def is_plain(self, number: int) -> bool:
        """Whether the stored numbers are the values: no share of a whole, no replacements."""
        accessor = self._header["accessors"][number]
        return not accessor.get("normalized") and "sparse" not in accessor

    def count(self, number: int) -> int:
        """Return the rows of an accessor."""
        return self._header["accessors"][number]["count"]

    def values(self, number: int) -> np.ndarray:
        """Return an accessor, shape (count, components).

        Integers that stand for shares of a whole become float32 (section 3.6.2.2), and what a sparse
        accessor replaces is replaced.
        """
        accessor = self._header["accessors"][number]
        kind, width = np.dtype(_TYPES[accessor["componentType"]]), _COMPONENTS[accessor["type"]]
        count = accessor["count"]
        values = np.zeros((count, width), kind)
        if "bufferView" in accessor:
            values = self._rows(accessor, kind, width, count)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            index_kind = np.dtype(_TYPES[sparse["indices"]["componentType"]])
            rows = self._rows(sparse["indices"], index_kind, 1, sparse["count"])[:, 0]
            values = values.copy()
            values[rows] = self._rows(sparse["values"], kind, width, sparse["count"])
        if accessor.get("normalized") and kind.kind in "iu":
            top = np.iinfo(kind).max
            values = np.maximum(values.astype(np.float32) / np.float32(top), -1.0)
        return values

    def _rows(self, place: dict[str, Any], kind: np.dtype, width: int, count: int) -> np.ndarray:
        view = self._header["bufferViews"][place["bufferView"]]
        start = view.get("byteOffset", 0) + place.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        data = self._buffers[view["buffer"]]
        return np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))

    @cached_property
    def _buffers(self) -> list[bytes]:
        return [
            uri_bytes(self._path, entry["uri"]) if "uri" in entry else glb_binary(self._path)
            for entry in self._header.get("buffers", [])
        ]
