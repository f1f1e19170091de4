"""Archives of strangers: what they claim is looked at before anything is unpacked."""

import io
import json
import os
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numcodecs import Zstd

from humanmm.errors import TruthError
from humanmm.models.records.recording import Recording
from humanmm.storage.readers import archives
from humanmm.storage.readers.archives import NpzArrays, ZarrArrays
from humanmm.storage.run_folder.motion_zarr import write_motion


def npz(path: Path, **arrays: np.ndarray) -> Path:
    np.savez(path, **arrays)  # type: ignore[arg-type]
    return path


@pytest.mark.parametrize("at", [60, 100, 150])
def test_a_flipped_byte_is_told_by_key(tmp_path: Path, at: int) -> None:
    path = npz(tmp_path / "t.npz", first=np.arange(12))
    data = bytearray(path.read_bytes())
    data[at] ^= 0xFF
    path.write_bytes(bytes(data))
    with pytest.raises(TruthError, match="first is damaged, or not as numpy writes arrays"):
        NpzArrays(path)["first"]


def test_an_archive_of_many_files_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "t.npz", "w") as file:
        for number in range(10_001):
            file.writestr(f"{number}.npy", b"")
    with pytest.raises(TruthError, match="holds 10,001 files; expected at most 10,000 arrays"):
        NpzArrays(tmp_path / "t.npz")


def test_an_array_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    path = npz(tmp_path / "t.npz", first=np.arange(12))
    with zipfile.ZipFile(path, "a") as file, pytest.warns(UserWarning, match="Duplicate"):
        file.writestr("first.npy", b"")
    with pytest.raises(TruthError, match="holds first more than once"):
        NpzArrays(path)


def test_an_array_that_declares_terabytes_is_never_allocated(tmp_path: Path) -> None:
    header = io.BytesIO()
    description = {"descr": "<f4", "fortran_order": False, "shape": (10**9, 24, 3)}
    np.lib.format.write_array_header_1_0(header, description)
    with zipfile.ZipFile(tmp_path / "t.npz", "w") as file:
        file.writestr("joints.npy", header.getvalue())
    with pytest.raises(TruthError, match="joints declares 288,000,000,000 bytes"):
        NpzArrays(tmp_path / "t.npz")["joints"]


# ---- motion.zarr


@pytest.fixture
def motion(tmp_path: Path, recording: Recording) -> Path:
    write_motion(tmp_path / "motion.zarr", recording)
    return tmp_path / "motion.zarr"


def chunk_of(motion: Path) -> Path:
    """The file of the first person's joints."""
    return next(path for path in (motion / "people/00/joints/c").rglob("*") if path.is_file())


def test_what_we_write_is_read(motion: Path, recording: Recording) -> None:
    assert np.allclose(ZarrArrays(motion)["people/00/joints"], recording.people[0].joints)


def _link(chunk: Path) -> None:
    chunk.unlink()
    chunk.symlink_to("/dev/zero")


def _pipe(chunk: Path) -> None:
    chunk.unlink()
    os.mkfifo(chunk)


def _bomb(chunk: Path) -> None:
    """A frame of zstd that says it is 2 TB."""
    chunk.write_bytes(b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", 2 * 10**12) + bytes(9))


def _endless(chunk: Path) -> None:
    """A frame that does not say how large it is."""
    chunk.write_bytes(b"\x28\xb5\x2f\xfd\x00\x58" + bytes(9))


def _another_codec(chunk: Path) -> None:
    table = chunk.parents[3] / "zarr.json"
    tree = json.loads(table.read_text())
    tree["codecs"][1:] = [{"name": "gzip", "configuration": {"level": 5}}]
    table.write_text(json.dumps(tree))
    chunk.write_bytes(zlib.compress(bytes(10**6), wbits=31))


def _deep(chunk: Path) -> None:
    (chunk.parents[3] / "zarr.json").write_text("[" * 100_000)


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    ("harm", "sentence"),
    [
        (_link, "people/00/joints/c/0/0/0 is a link or no regular file"),
        (_pipe, "people/00/joints/c/0/0/0 is a link or no regular file"),
        (_bomb, "unpacks to more than 4,294,967,296 bytes"),
        (_endless, "people/00/joints/c/0/0/0 does not say how large it is unpacked"),
        (_another_codec, "people/00/joints is packed by GzipCodec; expected zstd"),
        (_deep, "motion.zarr is damaged|people/00/joints is damaged"),
    ],
)
def test_a_folder_that_would_never_end_is_refused(motion: Path, harm: Any, sentence: str) -> None:
    harm(chunk_of(motion))
    with pytest.raises(TruthError, match=sentence):
        ZarrArrays(motion)["people/00/joints"]


@pytest.mark.parametrize("size", [1, 200, 255, 256, 60_000, 70_000, 20_000_000])
def test_what_a_frame_says_is_what_it_unpacks_to(tmp_path: Path, size: int) -> None:
    (tmp_path / "0").write_bytes(Zstd(level=3).encode(bytes(size)))
    assert archives._unpacked_bytes(tmp_path / "0", "0") == size


@pytest.mark.parametrize("value", [[[1], [2, 3]], [["a"], ["b", "c"]]])
def test_attributes_that_are_no_arrays_are_told_by_key(motion: Path, value: Any) -> None:
    tree = json.loads((motion / "zarr.json").read_text())
    tree["attributes"]["cut_frames"] = value
    (motion / "zarr.json").write_text(json.dumps(tree))
    with pytest.raises(TruthError, match="cut_frames is no array of numbers or names"):
        ZarrArrays(motion)["cut_frames"]
