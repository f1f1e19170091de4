"""A truth of another video is an error, not a table of figures."""

import hashlib
import json
from pathlib import Path

import pytest

from humanmm.errors import TruthError
from humanmm.models.records.sequence import MotionSequence
from humanmm.storage.readers.same_video import check_same_video


def _sequence(num_frames: int = 100, fps: float = 30.0) -> MotionSequence:
    return MotionSequence(num_frames, fps, ("pelvis",), (), ())


def _run(folder: Path, content: bytes) -> Path:
    folder.mkdir()
    video = {"sha256": hashlib.sha256(content).hexdigest()}
    (folder / "run.json").write_text(json.dumps({"schema": "humanmm.run/1", "video": video}))
    return folder


def test_a_truth_of_another_length_or_rate_is_refused_and_a_frame_at_the_end_is_not(tmp_path: Path) -> None:
    truth = tmp_path / "truth.npz"
    check_same_video(tmp_path, truth, _sequence(98), _sequence(100))
    with pytest.raises(TruthError, match=r"another video than that of .*: the run has 80 frames and the truth 100"):
        check_same_video(tmp_path, truth, _sequence(80), _sequence(100))
    with pytest.raises(TruthError, match=r"25\.000 frames a second and the truth 30\.000"):
        check_same_video(tmp_path, truth, _sequence(fps=25.0), _sequence(fps=30.0))


def test_equally_long_videos_are_distinguished_by_their_content(tmp_path: Path) -> None:
    run, other = _run(tmp_path / "run", b"film"), _run(tmp_path / "other", b"another film")
    check_same_video(run, run, _sequence(), _sequence())
    with pytest.raises(TruthError, match="differ in content"):
        check_same_video(run, other, _sequence(), _sequence())
    truth = tmp_path / "clip_gt.npz"
    check_same_video(run, truth, _sequence(), _sequence())
    (tmp_path / "clip.mp4").write_bytes(b"film")
    check_same_video(run, truth, _sequence(), _sequence())
    (tmp_path / "clip.mp4").write_bytes(b"another film")
    with pytest.raises(TruthError, match=r"clip_gt\.npz is the truth of another video"):
        check_same_video(run, truth, _sequence(), _sequence())
