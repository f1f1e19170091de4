"""Pickles of strangers: plain arrays are read, everything else is refused before it runs."""

import bz2
import gzip
import lzma
import pickle
import zlib
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.storage.readers.restricted_pickle import read_pickle

ARRAYS = {
    "floats": np.arange(6, dtype=np.float32).reshape(2, 3),
    "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "big-endian": np.arange(4, dtype=">i2"),
    "empty": np.zeros((0, 3)),
}


@pytest.mark.parametrize("protocol", range(6))
def test_plain_arrays_come_back_from_every_protocol(tmp_path: Path, protocol: int) -> None:
    value = defaultdict(dict, {1: {**ARRAYS, "scalar": np.float64(2.5), "words": ["a", None, 3]}})
    (tmp_path / "file.pkl").write_bytes(pickle.dumps(value, protocol=protocol))
    _assert_equal(read_pickle(tmp_path / "file.pkl"), value)


def test_arrays_behind_joblibs_notes_come_back(
    tmp_path: Path, dump_like_joblib: Callable[[object, Path], None]
) -> None:
    value = defaultdict(dict, {0: dict(ARRAYS), 7: dict(ARRAYS)})
    dump_like_joblib(value, tmp_path / "file.pkl")
    _assert_equal(read_pickle(tmp_path / "file.pkl"), value)


def _assert_equal(found: Any, value: Any) -> None:
    assert found.keys() == value.keys()
    for track, arrays in value.items():
        for name, array in arrays.items():
            assert (
                np.array_equal(found[track][name], array)
                if isinstance(array, np.ndarray)
                else (found[track][name] == array)
            )


class _Malicious:
    """A pickle that would make a file when it is read."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return exec, (f"open({str(self.path)!r}, 'w').close()",)


def test_a_pickle_that_asks_for_code_is_refused_and_nothing_runs(tmp_path: Path) -> None:
    trap = tmp_path / "owned"
    (tmp_path / "file.pkl").write_bytes(pickle.dumps({0: {"pose_world": _Malicious(trap)}}))
    with pytest.raises(InputError, match=r"names builtins\.exec"):
        read_pickle(tmp_path / "file.pkl")
    assert not trap.exists()


@pytest.mark.parametrize(
    "text",
    [
        b"cos\nsystem\n(S'true'\ntR.",
        b"cbuiltins\ngetattr\n.",
        b"\x80\x04\x8c\x05numpy\x8c\x05array\x93.",
        b"cnumpy.core.multiarray\n_reconstruct\n(cbuiltins\ndict\n(I0\ntS'b'\ntR.",
        b"\x80\x04\x8c\x08builtins\x8c\x0bdict.update\x93.",
        b"\x80\x04\x95\xff\xff\xff\xff\xff\xff\xff\x7f.",
        b"(lp0\nP1\n.",
        b"c__builtin__\nbytes\n(I4000000000\ntR.",
        b"\x80\x04}",
        b"no pickle",
        b"",
    ],
)
def test_other_names_and_damaged_streams_are_one_plain_error(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "file.pkl").write_bytes(text)
    with pytest.raises(InputError, match=r"file\.pkl cannot be read as a pickle of plain arrays"):
        read_pickle(tmp_path / "file.pkl")


def test_arrays_of_objects_and_absurd_sizes_are_refused(tmp_path: Path) -> None:
    (tmp_path / "objects.pkl").write_bytes(pickle.dumps({0: np.array([{}, None], dtype=object)}))
    with pytest.raises(InputError, match="numbers"):
        read_pickle(tmp_path / "objects.pkl")
    note = pickle.dumps({"shape": (2**40,), "dtype": np.dtype("f8"), "order": "C"}, protocol=3)[2:-1]
    (tmp_path / "huge.pkl").write_bytes(b"\x80\x03cjoblib.numpy_pickle\nNumpyArrayWrapper\n)\x81" + note + b"b.")
    with pytest.raises(InputError, match="claims"):
        read_pickle(tmp_path / "huge.pkl")


@pytest.mark.parametrize("compress", [zlib.compress, gzip.compress, bz2.compress, lzma.compress])
def test_a_compressed_dump_is_called_one(tmp_path: Path, compress: Callable[[bytes], bytes]) -> None:
    (tmp_path / "file.pkl").write_bytes(compress(pickle.dumps(ARRAYS)))
    with pytest.raises(InputError, match="it is compressed; dump it without compress"):
        read_pickle(tmp_path / "file.pkl")
