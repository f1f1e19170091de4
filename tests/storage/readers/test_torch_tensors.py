"""Files of torch by strangers: plain tensors come out as arrays, and nothing in the file is executed."""

import io
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from humanmm.errors import InputError
from humanmm.storage.readers import torch_tensors
from humanmm.storage.readers.torch_tensors import read_tensors


def _file(tree: object) -> io.BytesIO:
    file = io.BytesIO()
    torch.save(tree, file)
    file.seek(0)
    return file


def test_wanted_tensors_come_out_as_arrays_with_their_values() -> None:
    inner = {"half": torch.tensor([0.5, 0.25], dtype=torch.float16), "note": "body"}
    tree = {"a": torch.arange(6).reshape(2, 3).T, "b": inner, "c": torch.zeros(9), 3: torch.ones(1)}
    found = read_tensors(_file(tree), "a", "b", "d")
    assert set(found) == {"a", "b"}
    np.testing.assert_array_equal(found["a"], [[0, 3], [1, 4], [2, 5]])
    assert found["a"].dtype == np.int64 and found["b"]["note"] == "body"
    assert found["b"]["half"].dtype == np.float64 and found["b"]["half"].tolist() == [0.5, 0.25]
    learnt = torch.nn.Parameter(torch.ones(2))
    assert read_tensors(_file({"a": learnt}), "a")["a"].tolist() == [1.0, 1.0]


class _Harmful:
    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return Path.touch, (self.path,)


@pytest.mark.parametrize("write", [torch.save, lambda tree, file: pickle.dump(tree, file)])
def test_a_file_that_would_execute_something_is_refused_and_executes_nothing(tmp_path: Path, write: Any) -> None:
    file = io.BytesIO()
    write({"a": torch.zeros(1), "b": _Harmful(tmp_path / "executed")}, file)
    with pytest.raises(InputError, match="holds more than plain tensors"):
        read_tensors(file, "a")
    assert not (tmp_path / "executed").exists()


@pytest.mark.parametrize(
    ("tensor", "kind"), [(torch.eye(3).to_sparse(), "sparse_coo"), (torch.zeros(2, device="meta"), "meta")]
)
def test_a_tensor_that_is_no_plain_numbers_is_named(tensor: torch.Tensor, kind: str) -> None:
    with pytest.raises(InputError, match=rf"trans is a tensor of another kind \(.*{kind}.*\); expected plain numbers"):
        read_tensors(_file({"people": {"trans": tensor}}), "people")


def test_a_small_file_that_declares_much_is_refused_before_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch_tensors, "MAX_BYTES", 1 << 16)
    expanded = torch.zeros(1).expand(1 << 20)  # one stored number
    with pytest.raises(InputError, match="a declares 1,048,576 numbers"):
        read_tensors(_file({"a": expanded}), "a")
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("data.pkl", bytes(1 << 20))
    with pytest.raises(InputError, match="it declares 1,048,576 bytes; expected at most 65,536"):
        read_tensors(packed, "a")


def test_what_is_no_dictionary_or_no_file_of_torch_is_told() -> None:
    with pytest.raises(InputError, match="it holds a Tensor; expected a dictionary of tensors"):
        read_tensors(_file(torch.zeros(2)), "a")
    for content in (b"nothing of torch", _file({"a": torch.zeros(99)}).getvalue()[:-60], b""):
        with pytest.raises(InputError, match=r"it cannot be read|it is damaged"):
            read_tensors(io.BytesIO(content), "a")
