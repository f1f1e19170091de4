"""Reads pickles and joblib dumps of plain arrays from strangers, without executing anything they hold.

A pickle is a program. Only what a dump of dictionaries, numbers and arrays needs may be called; every other name is
refused before it is looked up. joblib writes an array's bytes behind a small object that describes it, in the middle of
the stream: these bytes are taken here too (layout of joblib 0.10 to 1.5, uncompressed).
"""

import collections
import io
import math
import pickle
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from humanmm.errors import InputError

MAX_BYTES = 2**31
"""Files and single arrays beyond this are refused."""
COMPRESSED = (b"x", b"\x1f\x8b", b"BZ", b"\xfd7zXZ", b"]\x00", b"\x04\x22\x4d\x18")
"""How joblib's compressed dumps begin (zlib, gzip, bz2, xz, lzma, lz4), and no pickle does."""


def read_pickle(path: Path) -> Any:
    """The value in a pickle or joblib dump. InputError if it is none, is damaged, or names anything but data."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"it is larger than {MAX_BYTES:,} bytes")
        with path.open("rb") as stream:
            return load_pickle(stream, str(path))
    except OSError as error:
        raise InputError(f"{path} cannot be read as a pickle of plain arrays: {error}") from error


def load_pickle(stream: BinaryIO, name: str) -> Any:
    """The same from a stream that errors call by a name."""
    try:
        head = stream.read(8)
        if head.startswith(COMPRESSED):
            raise InputError("it is compressed; dump it without compress")
        stream.seek(-len(head), io.SEEK_CUR)
        return _Reader(stream).load()
    except InputError as error:
        raise InputError(f"{name} cannot be read as a pickle of plain arrays: {error}") from error
    except Exception as error:  # a damaged pickle calls for anything
        raise InputError(f"{name} cannot be read as a pickle of plain arrays: it is none, or it is damaged") from error


class _ArrayNote:
    """What joblib says of an array whose bytes follow; stands for `joblib.numpy_pickle.NumpyArrayWrapper`."""

    def read(self, stream: BinaryIO) -> np.ndarray:
        """The array behind the note."""
        state = vars(self)
        dtype, shape = state["dtype"], tuple(int(side) for side in state["shape"])
        if not isinstance(dtype, np.dtype) or dtype.hasobject:
            raise InputError("an array holds Python objects; only numbers are read")
        size = math.prod(shape) * dtype.itemsize
        if min(shape, default=0) < 0 or size > MAX_BYTES:
            raise InputError(f"an array claims {size:,} bytes")
        if state.get("numpy_array_alignment_bytes") is not None:
            stream.read(stream.read(1)[0])
        data = stream.read(size)
        if len(data) != size:
            raise InputError("the file ends inside an array")
        array = np.frombuffer(data, dtype)
        return array.reshape(shape[::-1]).T if state.get("order") == "F" else array.reshape(shape)


def _reconstruct(subtype: Any, shape: Any, typecode: Any) -> np.ndarray:
    """An empty array that the pickle's next step fills: as numpy does it, for plain arrays only."""
    if subtype is not np.ndarray:
        raise InputError("an array of a class of its own")
    return np.ndarray.__new__(np.ndarray, (0,), "b")


def _scalar(dtype: Any, data: Any = b"") -> Any:
    if not isinstance(dtype, np.dtype) or dtype.hasobject or not isinstance(data, bytes):
        raise InputError("a scalar that is no number")
    return np.frombuffer(data, dtype)[0]


def _frombuffer(data: Any, dtype: Any, shape: Any, order: Any, *ignored: Any) -> np.ndarray:
    """An array of pickle protocol 5."""
    if not isinstance(dtype, np.dtype) or dtype.hasobject or not isinstance(data, (bytes, bytearray)):
        raise InputError("an array holds Python objects; only numbers are read")
    return np.frombuffer(bytes(data), dtype).reshape(shape, order="F" if order == "F" else "C")


def _encode(text: Any, encoding: Any) -> bytes:
    """Bytes, as protocols before 3 write them."""
    if not isinstance(text, str) or encoding != "latin1":
        raise InputError("bytes in an encoding of their own")
    return text.encode("latin1")


def _no_bytes() -> bytes:
    """As protocols before 3 write b""; with a number, `bytes` would allocate as many."""
    return b""


def _dtype(text: Any, *ignored: Any) -> np.dtype[Any]:
    """A type of numbers, as an object of its own: its byte order follows."""
    found = np.dtype(text, copy=True) if isinstance(text, str) else np.dtype(object)
    if found.kind not in "biufc" or found.shape:
        raise InputError("an array holds Python objects; only numbers are read")
    return found


_ALLOWED: dict[tuple[str, str], Any] = {
    ("collections", "defaultdict"): collections.defaultdict,
    ("collections", "OrderedDict"): collections.OrderedDict,
    ("_codecs", "encode"): _encode,
    ("__builtin__", "bytes"): _no_bytes,
    ("builtins", "dict"): dict,
    ("__builtin__", "dict"): dict,
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): _dtype,
    ("joblib.numpy_pickle", "NumpyArrayWrapper"): _ArrayNote,
    **{
        (
            f"numpy.{core}.{module}",
            function.__name__.lstrip("_") if function is _scalar else function.__name__,
        ): function
        for core in ("core", "_core")  # numpy 1, numpy 2
        for module, function in (("multiarray", _reconstruct), ("multiarray", _scalar), ("numeric", _frombuffer))
    },
}


_PythonUnpickler: Any = pickle._Unpickler
"""Written in Python: the one written in C cannot be stopped in the middle, where joblib's bytes lie."""


class _Reader(_PythonUnpickler):  # type: ignore[misc]
    """Python's unpickler with a list of what may be named."""

    dispatch = _PythonUnpickler.dispatch.copy()

    def __init__(self, stream: BinaryIO) -> None:
        super().__init__(stream, encoding="latin1")
        self._stream = stream

    def find_class(self, module: str, name: str) -> Any:
        try:
            return _ALLOWED[module, name]
        except KeyError:
            raise InputError(f"it names {module}.{name}; only plain arrays are read") from None

    def persistent_load(self, pid: Any) -> Any:
        raise InputError("it refers to data outside the file")

    def load_build(self) -> None:
        """joblib's notes are replaced by the arrays that follow them."""
        target = self.stack[-2]
        if isinstance(target, (np.ndarray, np.dtype)):
            self._set_state(target, self.stack.pop())
        elif isinstance(target, _ArrayNote):
            state = self.stack.pop()
            if not isinstance(state, dict):
                raise InputError("an array's note is damaged")
            vars(target).update(state)
            self.stack[-1] = target.read(self._stream)
        else:
            raise InputError(f"it sets the state of a {type(target).__name__}")

    def _set_state(self, target: Any, state: Any) -> None:
        """The state of an array or a type for numpy, after a check: numpy itself checks nothing."""
        if isinstance(target, np.dtype):
            _, order, *rest = state
            if order not in ("<", ">", "|", "=") or tuple(rest) != (None, None, None, -1, -1, 0):
                raise InputError("an array of records; only numbers are read")
        else:
            _, shape, dtype, _, data = state
            plain = isinstance(dtype, np.dtype) and not dtype.hasobject and isinstance(data, bytes)
            if not plain or len(data) != math.prod(shape) * dtype.itemsize:
                raise InputError("an array holds Python objects or is cut off; only numbers are read")
        target.__setstate__(state)

    dispatch[pickle.BUILD[0]] = load_build
