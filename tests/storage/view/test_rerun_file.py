"""The file for rerun's viewer, read back."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.models.records.recording import Recording
from humanmm.storage.view.rerun_file import write_rrd


def test_without_rerun_a_sentence_says_what_to_install(
    recording: Recording, record: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(InputError, match=r"pip install 'humanmm\[rerun\]'"):
        write_rrd(tmp_path / "run.rrd", recording, record, None)


def test_joints_and_times_can_be_read_back(
    recording: Recording, record: dict[str, Any], numbered_video: Path, tmp_path: Path
) -> None:
    rerun = pytest.importorskip("rerun", reason="the extra `rerun`")
    path = tmp_path / "run.rrd"
    write_rrd(path, recording, record, numbered_video)
    found: dict[int, np.ndarray] = {}
    entities = set()
    for chunk in rerun.chunk.RrdReader(str(path)).stream():
        entities.add(chunk.entity_path)
        if chunk.entity_path == "/world/person_01/joints":
            table = chunk.to_record_batch()
            if "Points3D:positions" in table.schema.names:
                frames, points = table.column("frame").to_pylist(), table.column("Points3D:positions").to_pylist()
                found |= {frame: np.array(one) for frame, one in zip(frames, points, strict=True) if one}
    person = recording.people[1]
    assert sorted(found) == person.frame.tolist()
    np.testing.assert_allclose([found[frame] for frame in sorted(found)], person.joints, atol=1e-6)
    assert {"/video", "/world/camera_1/picture", "/world/person_00/body", "/warnings/1"} <= entities
