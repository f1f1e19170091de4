"""A long video made of a short one."""

from pathlib import Path

import numpy as np
import pytest

from humanmm.models.video.colors import BT601
from humanmm.models.video.frames import frames
from humanmm.models.video.reading import read_facts
from humanmm.storage.run_folder.looped_video import write_looped
from humanmm.storage.run_folder.picture_files import write_video


def test_pictures_come_again_in_order_at_an_even_pace(tmp_path: Path) -> None:
    pictures = (np.full((72, 64), 16 + 20 * k, np.uint8) for k in range(10))
    write_video(
        tmp_path / "short.mp4", ((k / 25, p) for k, p in enumerate(pictures)), width=64, height=48, fps=25, colors=BT601
    )
    write_looped(tmp_path / "short.mp4", tmp_path / "long.mkv", seconds=1.0)
    with (tmp_path / "long.mkv").open("rb") as stream:
        facts = read_facts(stream)
        seen = [float(frame.image.mean()) for frame in frames(stream, facts, pixels="gray")]
    assert facts.num_frames == 30  # three times, for the second third ends before one second
    assert np.diff(facts.time_s) == pytest.approx(0.04, abs=0.0011)  # matroska counts milliseconds
    assert np.allclose(seen[:10], seen[10:20], atol=1.0)
    assert np.allclose(seen[:10], seen[20:], atol=1.0)
    assert seen[9] > seen[0] + 150
