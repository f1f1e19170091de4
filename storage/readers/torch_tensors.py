"""Reads dictionaries of plain tensors from torch's files of strangers, without executing anything they hold."""

import zipfile
from typing import Any, BinaryIO

from humanmm.errors import InputError
from humanmm.storage.readers.archives import damage
from humanmm.storage.readers.restricted_pickle import MAX_BYTES


def read_tensors(file: BinaryIO, *wanted: str) -> dict[str, Any]:
    """Of the file's dictionary those of the wanted keys that it has, tensors as arrays, also in dictionaries inside.

    InputError says in one sentence what is wrong.
    """
    import torch

    if zipfile.is_zipfile(file):
        with damage("it is damaged"), zipfile.ZipFile(file) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > MAX_BYTES:
            raise InputError(f"it declares {size:,} bytes; expected at most {MAX_BYTES:,}")
    file.seek(0)
    with damage("it cannot be read: it is no file of torch, is damaged, or holds more than plain tensors"):
        tree = torch.load(file, map_location="cpu", weights_only=True)
    if not isinstance(tree, dict):
        raise InputError(f"it holds a {type(tree).__name__}; expected a dictionary of tensors")
    return _arrays_of({name: tree[name] for name in wanted if name in tree})


def _arrays_of(tree: dict[Any, Any]) -> dict[str, Any]:
    return {
        str(name): _arrays_of(value) if isinstance(value, dict) else _array_of(str(name), value)
        for name, value in tree.items()
    }


def _array_of(name: str, value: Any) -> Any:
    """A tensor as an array; the error for anything else names it."""
    import torch

    if not isinstance(value, torch.Tensor):
        return value
    is_plain = not (value.is_nested or value.is_quantized) and value.layout == torch.strided
    if not is_plain or value.device.type != "cpu":
        kind = (
            "nested"
            if value.is_nested
            else "quantized"
            if value.is_quantized
            else f"{value.device.type} {value.layout}"
        )
        raise InputError(f"{name} is a tensor of another kind ({kind}); expected plain numbers")
    if value.numel() * 8 > MAX_BYTES:
        raise InputError(f"{name} declares {value.numel():,} numbers")
    return (value.detach().double() if value.is_floating_point() else value).numpy()
