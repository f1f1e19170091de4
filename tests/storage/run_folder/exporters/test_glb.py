"""The container of glTF: a file that is read back by the specification's own words."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from humanmm.storage.run_folder.exporters.glb import INDICES, Arrays


def read(path: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON chunk and the binary chunk."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    num_json, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON" and num_json % 4 == 0
    num_binary, kind = struct.unpack_from("<I4s", data, 20 + num_json)
    assert kind == b"BIN\0" and num_binary % 4 == 0
    return json.loads(data[20 : 20 + num_json]), data[28 + num_json :]


def test_arrays_come_back_from_their_views(tmp_path: Path) -> None:
    points = np.array([[1, 2, 3], [-4, 5, 6]], np.float32)
    indices = np.array([0, 1, 2], np.uint16)
    matrix = np.arange(16, dtype=np.float32).reshape(1, 4, 4)
    arrays = Arrays()
    added = [arrays.add(points, bounds=True), arrays.add(indices, target=INDICES), arrays.add(matrix)]
    arrays.write(tmp_path / "a.glb", {"asset": {"version": "2.0"}})
    tree, binary = read(tmp_path / "a.glb")
    assert added == [0, 1, 2] and tree["asset"] == {"version": "2.0"}
    assert [one["byteOffset"] for one in tree["bufferViews"]] == [0, 24, 32]  # 6 bytes of indices are padded to 8
    assert tree["bufferViews"][1]["target"] == INDICES and "target" not in tree["bufferViews"][0]
    assert [(one["type"], one["count"]) for one in tree["accessors"]] == [("VEC3", 2), ("SCALAR", 3), ("MAT4", 1)]
    assert tree["accessors"][0]["min"] == [-4, 2, 3] and tree["accessors"][0]["max"] == [1, 5, 6]
    assert tree["buffers"] == [{"byteLength": len(binary)}]
    np.testing.assert_array_equal(np.frombuffer(binary, "<f4", 6).reshape(2, 3), points)
    np.testing.assert_array_equal(np.frombuffer(binary, "<u2", 3, 24), indices)
    np.testing.assert_array_equal(np.frombuffer(binary, "<f4", 16, 32).reshape(4, 4), matrix[0].T)  # columns


def test_an_array_that_gltf_has_no_type_for_is_refused() -> None:
    with pytest.raises(KeyError):
        Arrays().add(np.zeros((2, 3)))  # doubles
    with pytest.raises(KeyError):
        Arrays().add(np.zeros((2, 5), np.float32))
