"""Result dataclasses ⇄ a json tree and named arrays, led by type hints alone.

Knows numpy arrays, bool, int, float, str, None, Literal, tuples, Optional and nested (frozen) dataclasses; anything
else is an error on writing. No pickles. `Encoded.digest` is the content digest of the store: equal values have equal
digests, whatever compression or chunking the files have.
"""

import dataclasses
import functools
import hashlib
import json
import math
import types
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

T = TypeVar("T")
Json = None | bool | int | float | str | list["Json"] | dict[str, "Json"]

_SCALARS = (bool, int, float, str)
_NOT_FINITE = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


@dataclass(frozen=True)
class Encoded:
    """A value taken apart: `tree` holds everything but the arrays, which are named by their path in the value."""

    tree: Json
    arrays: Mapping[str, np.ndarray]

    def digest(self, files: Mapping[str, str] | None = None) -> str:
        """sha256 of the decoded content, together with the sha256 of the files that belong to it."""
        total = hashlib.sha256(canonical_json([self.tree, dict(files or {})]).encode())
        for path in sorted(self.arrays):
            array = np.ascontiguousarray(self.arrays[path])
            total.update(f"\n{path} {array.dtype.str} {array.shape}\n".encode())
            total.update(array.reshape(-1).view(np.uint8).data if array.size else b"")
        return total.hexdigest()


def encode(value: object, hint: Any) -> Encoded:
    """Take a value apart. `hint` is its declared type; TypeError names the field of a value that does not fit."""
    arrays: dict[str, np.ndarray] = {}
    return Encoded(_encode(value, hint, "", arrays), arrays)


def decode(encoded: Encoded, hint: type[T]) -> T:
    """Put a value together again."""
    return cast(T, _decode(encoded.tree, hint, encoded.arrays))


def canonical_json(tree: Any) -> str:
    """Text of a json tree that is the same for equal trees: sorted keys, no spaces."""
    return json.dumps(tree, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def warnings_in(tree: Json) -> list[str]:
    """All sentences in fields named `warnings`, at any depth."""
    if isinstance(tree, list):
        return [sentence for item in tree for sentence in warnings_in(item)]
    if not isinstance(tree, dict):
        return []
    own = tree.get("warnings")
    sentences = [str(item) for item in own] if isinstance(own, list) else []
    return sentences + [s for name, item in tree.items() if name != "warnings" for s in warnings_in(item)]


def _encode(value: Any, hint: Any, path: str, arrays: dict[str, np.ndarray]) -> Json:
    where = path or "the result"
    if _is_array(hint):
        if not isinstance(value, np.ndarray):
            raise TypeError(f"{where} must be a numpy array, is {type(value).__name__}")
        if value.dtype.kind not in "biuf":
            raise TypeError(f"{where} has dtype {value.dtype}; only booleans and real numbers are stored")
        arrays[path or "value"] = value.astype(value.dtype.newbyteorder("<"), copy=False)
        return path or "value"
    if dataclasses.is_dataclass(hint):
        if type(value) is not hint:
            raise TypeError(f"{where} must be {_name(hint)}, is {type(value).__name__}")
        parts = _fields(cast(Any, hint))
        return {name: _encode(getattr(value, name), kind, _join(path, name), arrays) for name, kind in parts}
    origin = get_origin(hint)
    if origin is tuple:
        if not isinstance(value, tuple):
            raise TypeError(f"{where} must be a tuple, is {type(value).__name__}")
        kinds = _item_types(hint, len(value), where)
        items = zip(value, kinds, strict=True)
        return [_encode(item, kind, _join(path, str(i)), arrays) for i, (item, kind) in enumerate(items)]
    if origin in (Union, types.UnionType):
        return None if value is None else _encode(value, _optional(hint), path, arrays)
    if origin is Literal:
        if value not in get_args(hint):
            raise TypeError(f"{where} must be one of {get_args(hint)}, is {value!r}")
        return cast(Json, value)
    if hint in _SCALARS:
        return _encode_scalar(value, hint, where)
    raise TypeError(f"{where} has type {hint}, which the store cannot hold")


def _encode_scalar(value: Any, hint: type, where: str) -> Json:
    if isinstance(value, np.generic):
        value = value.item()
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not hint:
        raise TypeError(f"{where} must be {hint.__name__}, is {type(value).__name__}")
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else ("inf" if value > 0 else "-inf")
    return cast(Json, value)


def _decode(tree: Any, hint: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    if _is_array(hint):
        return arrays[tree]
    if dataclasses.is_dataclass(hint):
        fields = {name: _decode(tree[name], kind, arrays) for name, kind in _fields(cast(Any, hint))}
        return cast(Any, hint)(**fields)
    origin = get_origin(hint)
    if origin is tuple:
        kinds = _item_types(hint, len(tree), "a stored tuple")
        return tuple(_decode(item, kind, arrays) for item, kind in zip(tree, kinds, strict=True))
    if origin in (Union, types.UnionType):
        return None if tree is None else _decode(tree, _optional(hint), arrays)
    if hint is float and isinstance(tree, str):
        return _NOT_FINITE[tree]
    return tree


def _is_array(hint: Any) -> bool:
    return hint is np.ndarray or get_origin(hint) is np.ndarray or getattr(hint, "array_type", None) is np.ndarray


@functools.cache
def _fields(cls: Hashable) -> tuple[tuple[str, Any], ...]:
    hints = get_type_hints(cast(type, cls))
    return tuple((field.name, hints[field.name]) for field in dataclasses.fields(cast(Any, cls)) if field.init)


def _item_types(hint: Any, length: int, where: str) -> tuple[Any, ...]:
    kinds = get_args(hint)
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        return (kinds[0],) * length
    if len(kinds) != length:
        raise TypeError(f"{where} must have {len(kinds)} items, has {length}")
    return kinds


def _optional(hint: Any) -> Any:
    kinds = [kind for kind in get_args(hint) if kind is not type(None)]
    if len(kinds) != 1:
        raise TypeError(f"{hint} is not `X | None`; the store holds no other union")
    return kinds[0]


def _join(path: str, name: str) -> str:
    return f"{path}/{name}" if path else name


def _name(hint: Any) -> str:
    return str(getattr(hint, "__name__", hint))
