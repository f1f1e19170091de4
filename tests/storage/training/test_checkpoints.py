"""Checkpoints: whole, and refused when they are not."""

from pathlib import Path

import pytest
import torch

from humanmm.errors import InputError
from humanmm.storage.training.checkpoints import CHECKPOINT, read_checkpoint, write_checkpoint


def test_a_checkpoint_comes_back(tmp_path: Path) -> None:
    assert read_checkpoint(tmp_path) is None
    state = {"step": 7, "weights": {"a": torch.arange(3.0)}, "rng": {"state": 2**100}}
    write_checkpoint(tmp_path, state)
    found = read_checkpoint(tmp_path)
    assert (
        found is not None
        and found["rng"] == {"state": 2**100}
        and torch.equal(found["weights"]["a"], torch.arange(3.0))
    )


def test_a_damaged_checkpoint_is_reported(tmp_path: Path) -> None:
    (tmp_path / CHECKPOINT).write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(InputError, match="is no checkpoint"):
        read_checkpoint(tmp_path)
