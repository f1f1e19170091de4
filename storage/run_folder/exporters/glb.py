"""The container of glTF 2.0 (Khronos, "glTF 2.0 specification", sections 3.6 and 4): arrays, their tables, one file.

Written by hand because it is short: pygltflib and trimesh would be a dependency for the hundred lines below, and write
no skinned animation by themselves.
"""

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

_COMPONENT = {"uint8": 5121, "uint16": 5123, "uint32": 5125, "float32": 5126}
_SHAPE = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
VERTICES, INDICES = 34962, 34963
"""What a graphics card uses an array for."""


@dataclass
class Arrays:
    """The binary part of a file, and the lists `bufferViews` and `accessors` that describe it."""

    views: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)
    _parts: list[bytes] = field(default_factory=list)
    size: int = 0

    def add(self, values: np.ndarray, *, target: int | None = None, bounds: bool = False) -> int:
        """Append an array, a row an element; returns its accessor. `bounds` states its least and greatest values.

        Matrices are transposed: glTF stores columns.
        """
        stored = np.ascontiguousarray(np.swapaxes(values, -1, -2) if values.shape[1:] == (4, 4) else values)
        data = stored.astype(stored.dtype.newbyteorder("<")).tobytes()
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self.size, "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        accessor: dict[str, Any] = {
            "bufferView": len(self.views),
            "componentType": _COMPONENT[values.dtype.name],
            "count": len(values),
            "type": _SHAPE[values.shape[1:]],
        }
        if bounds:
            rows = values.reshape(len(values), -1)
            accessor["min"], accessor["max"] = rows.min(0).tolist(), rows.max(0).tolist()
        self.views.append(view)
        self.accessors.append(accessor)
        padded = data + bytes(-len(data) % 4)
        self._parts.append(padded)
        self.size += len(padded)
        return len(self.accessors) - 1

    def write(self, path: Path, tree: Mapping[str, Any]) -> None:
        """Write a .glb: the tree of the scene together with these arrays."""
        whole = {**tree, "bufferViews": self.views, "accessors": self.accessors, "buffers": [{"byteLength": self.size}]}
        text = json.dumps(whole, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        with path.open("wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + self.size))
            file.write(struct.pack("<I4s", len(text), b"JSON") + text)
            file.write(struct.pack("<I4s", self.size, b"BIN\0"))
            for part in self._parts:
                file.write(part)
