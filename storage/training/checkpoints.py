"""Checkpoints of a training."""

from pathlib import Path
from typing import Any

import torch

from humanmm.errors import InputError
from humanmm.storage.store.files import replace_file

CHECKPOINT = "checkpoint.pt"


def write_checkpoint(folder: Path, state: dict[str, Any]) -> None:
    """Replace the checkpoint by one rename: a process that is killed leaves the one before."""
    replace_file(folder / CHECKPOINT, lambda fresh: torch.save(state, fresh))


def read_checkpoint(folder: Path) -> dict[str, Any] | None:
    """The last checkpoint, None before the first. InputError where it cannot be read."""
    path = folder / CHECKPOINT
    if not path.exists():
        return None
    try:
        state: dict[str, Any] = torch.load(path, weights_only=True)
    except (RuntimeError, ValueError, EOFError, OSError) as error:
        raise InputError(f"{path} is no checkpoint: {error}; delete it to begin anew") from None
    return state
