"""What a test may make a toy stage do beside its work: be counted, be slow, fail. Not part of any result."""

import errno
import os
import time
from dataclasses import MISSING, fields
from pathlib import Path
from typing import TypeVar

import numpy as np

from humanmm.errors import InputError, StageError
from humanmm.tasks.inputs import StageInputs

T = TypeVar("T")


def act(stage: str, inputs: StageInputs) -> None:
    """Count this execution, then sleep and fail as the environment says."""
    name = f"{stage}:{inputs.span[0]}" if inputs.shot or stage in ("people", "points") else stage
    log = Path(os.environ["TOY_LOG"])
    with log.open("a") as file:
        file.write(f"{name}\n")
    if pause_s := _reported("TOY_SLEEP", name):
        time.sleep(float(pause_s))
    kind, _, times = (_reported("TOY_FAIL", name) or "").partition(":")
    if kind == "stage" and (not times or log.read_text().split().count(name) <= int(times)):
        raise StageError(f"{name} cannot be done")
    if kind == "input":
        raise InputError(f"{name} does not like its input")
    if kind == "bug":
        raise ZeroDivisionError("a defect")
    if kind == "disk" and log.read_text().split().count(name) <= int(times):
        raise OSError(errno.EIO, "Input/output error")
    if kind == "memory" and log.read_text().split().count(name) <= int(times):
        raise MemoryError("Unable to allocate 2 GiB")


def filled(cls: type[T], n: int, **given: object) -> T:
    """A result whose other fields are blank, arrays zeros of n: the toy keeps up with new fields of real classes."""
    missing = [f for f in fields(cls) if f.default is MISSING and f.name not in given]  # type: ignore[arg-type]
    blank = {float: 0.0, int: 0, bool: False, str: "", np.ndarray: np.zeros(n, np.float32)}
    return cls(**given, **{f.name: blank.get(f.type, ()) for f in missing})  # type: ignore[arg-type]


def _reported(variable: str, name: str) -> str | None:
    for entry in os.environ.get(variable, "").split(";"):
        who, _, what = entry.partition("=")
        if who in (name, name.partition(":")[0]):
            return what
    return None
