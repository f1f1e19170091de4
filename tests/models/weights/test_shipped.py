"""Shipped weight files are what the manifest says, or an error says so."""

from pathlib import Path

import pytest

from humanmm.errors import WeightsError
from humanmm.models.weights import shipped


def test_every_file_of_the_manifest_is_read_whole() -> None:
    for name, entry in shipped.manifest().items():
        assert len(shipped.read_weights(name)) == entry.size


def test_every_weight_file_beside_the_manifest_is_listed_with_a_licence_that_is_shipped() -> None:
    names = {entry.name for entry in shipped.folder().iterdir()}
    weights = {n for n in names - {shipped.MANIFEST} if n.endswith((".tflite", ".npz", ".safetensors", ".json"))}
    assert weights == set(shipped.manifest())
    assert {entry.licence_file for entry in shipped.manifest().values()} <= names


def test_a_changed_byte_is_an_error_that_names_the_file(tmp_path: Path) -> None:
    entry = shipped.manifest()["body24.npz"]
    damaged = bytearray(shipped.read_weights("body24.npz"))
    damaged[1000] ^= 1
    (tmp_path / "body24.npz").write_bytes(damaged)
    with pytest.raises(WeightsError, match=r"body24\.npz has sha256 .* damaged"):
        shipped.read_checked(tmp_path / "body24.npz", entry)


def test_a_missing_file_and_an_unknown_name_are_weight_errors(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match="cannot be read"):
        shipped.read_checked(tmp_path / "body24.npz", shipped.manifest()["body24.npz"])
    with pytest.raises(WeightsError, match="no weight file is called 'smpl'"):
        shipped.read_weights("smpl")
