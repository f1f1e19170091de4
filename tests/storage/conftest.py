"""What tests of storage share: a small recording with numbers of its own, and a writer of joblib dumps."""

import pickle
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from humanmm.models.records.recording import RecordedPerson, Recording


@pytest.fixture
def recording() -> Recording:
    """12 frames at a variable rate, a cut in the middle; person 1 enters two frames late."""
    num_frames = 12
    rng = np.random.default_rng(7)
    cut = num_frames // 2

    def person(number: int) -> RecordedPerson:
        frame = np.arange(2 * number, num_frames, dtype=np.int32)
        n = len(frame)
        joints = rng.normal(size=(n, 24, 3)).astype(np.float32)
        observed = np.ones(n, bool)
        observed[cut - 2 * number] = False
        return RecordedPerson(
            person=number,
            frame=frame,
            observed=observed,
            root_orient=rng.normal(size=(n, 3)).astype(np.float32),
            body_pose=rng.normal(size=(n, 23, 3)).astype(np.float32),
            betas=rng.normal(size=10).astype(np.float32),
            transl=rng.normal(size=(n, 3)).astype(np.float32),
            joints=joints,
            contacts=rng.uniform(size=(n, 4)).astype(np.float32),
            keypoints2d=rng.uniform(size=(n, 33, 3)).astype(np.float32),
            bbox=rng.uniform(size=(n, 4)).astype(np.float32),
            confidence=rng.uniform(size=n).astype(np.float32),
        )

    return Recording(
        width=640,
        height=360,
        time_s=np.cumsum(rng.uniform(0.02, 0.05, num_frames)),
        shot_index=(np.arange(num_frames) >= cut).astype(np.int32),
        cut_frames=(cut,),
        R_world_cam=np.tile(np.eye(3, dtype=np.float32), (num_frames, 1, 1)),
        t_world_cam=np.zeros((num_frames, 3), np.float32),
        K=np.tile(np.array([[500, 0, 320], [0, 500, 180], [0, 0, 1]], np.float32), (num_frames, 1, 1)),
        camera_source=np.full(num_frames, 4, np.uint8),
        people=tuple(person(number) for number in range(2)),
    )


class NumpyArrayWrapper:
    """What joblib puts before an array's bytes; the test writes it as joblib.numpy_pickle.NumpyArrayWrapper."""


NumpyArrayWrapper.__module__, NumpyArrayWrapper.__qualname__ = "joblib.numpy_pickle", "NumpyArrayWrapper"


class _JoblibPickler(pickle._Pickler):  # type: ignore[name-defined,misc]
    """Writes arrays as joblib does: a note, the length of a padding, the padding, the bytes."""

    def __init__(self, stream: Any) -> None:
        super().__init__(stream, protocol=3)  # no frames: joblib flushes them before the bytes
        self.stream = stream

    def save(self, value: Any, save_persistent_id: bool = True) -> None:
        if type(value) is not np.ndarray:
            return super().save(value, save_persistent_id)
        self.write(b"cjoblib.numpy_pickle\nNumpyArrayWrapper\n)\x81")
        fortran = value.flags.f_contiguous and not value.flags.c_contiguous
        super().save(
            {
                "subclass": np.ndarray, "shape": value.shape, "order": "F" if fortran else "C", "dtype": value.dtype,
                "allow_mmap": True, "numpy_array_alignment_bytes": 16,
            }
        )  # fmt: skip
        self.write(pickle.BUILD)
        padding = 16 - (self.stream.tell() + 1) % 16
        self.stream.write(struct.pack("B", padding) + b"\xff" * padding + value.tobytes("F" if fortran else "C"))
        return None


@pytest.fixture
def dump_like_joblib() -> Callable[[object, Path], None]:
    """Writes a value as `joblib.dump` does."""

    def dump(value: object, path: Path) -> None:
        with path.open("wb") as stream:
            _JoblibPickler(stream).dump(value)

    return dump
