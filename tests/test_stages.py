"""A video that is opened for the stages by themselves (`tests/test_stage_docs.py` chains them all)."""

from pathlib import Path

import numpy as np
import pytest

import humanmm.stages
from humanmm.errors import VideoError
from humanmm.models.video.colors import BT601
from humanmm.stages import open_video
from humanmm.storage.run_folder.picture_files import write_video


def _video(path: Path, num_frames: int) -> Path:
    gray = np.full((72, 64), 128, np.uint8)
    write_video(path, ((k / 25, gray) for k in range(num_frames)), width=64, height=48, fps=25, colors=BT601)
    return path


def test_a_video_is_read_inside_the_block_and_closed_after_it(tmp_path: Path) -> None:
    with open_video(_video(tmp_path / "film.mp4", 5)) as video:
        assert (video.facts.num_frames, video.size) == (5, (64, 48))
        assert not video.stream.closed
    assert video.stream.closed


def test_what_is_no_video_of_two_frames_is_refused(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match="one picture only"), open_video(_video(tmp_path / "one.mp4", 1)):
        pass
    with pytest.raises(VideoError, match="max_side_px = 50"), open_video(_video(tmp_path / "a.mp4", 3), max_side_px=50):
        pass
    with pytest.raises(FileNotFoundError), open_video(tmp_path / "none.mp4"):
        pass


def test_everything_that_is_offered_is_there_and_documented() -> None:
    assert all(getattr(humanmm.stages, name).__doc__ for name in humanmm.stages.__all__)
