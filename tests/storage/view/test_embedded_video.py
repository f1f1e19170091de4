"""The small copy of the overlay."""

from pathlib import Path

import av
import numpy as np

from humanmm.models.records.recording import Recording
from humanmm.models.video.colors import BT601
from humanmm.storage.run_folder.picture_files import write_video
from humanmm.storage.view.embedded_video import write_embedded


def test_it_has_all_frames_at_their_times_is_small_and_has_a_keyframe_a_second(
    recording: Recording, numbered_video: Path, tmp_path: Path
) -> None:
    small = tmp_path / "small.mp4"
    write_embedded(numbered_video, small)
    with av.open(str(small)) as container:
        frames = list(container.decode(video=0))
    np.testing.assert_allclose([frame.time for frame in frames], recording.time_s - recording.time_s[0], atol=1e-4)
    assert (frames[0].width, frames[0].height) == (640, 360)
    keyframes = [index for index, frame in enumerate(frames) if frame.key_frame]
    assert np.diff([*keyframes, len(frames)]).max() <= np.ceil(recording.fps)
    luma = frames[5].to_ndarray()[:16, :128]
    assert [int(luma[4, 8 + 16 * bit] > 128) for bit in range(4)] == [1, 0, 1, 0]


def test_a_video_of_pure_noise_keeps_to_the_budget(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    noise, small = tmp_path / "noise.mp4", tmp_path / "small.mp4"
    pictures = ((frame / 30, rng.integers(16, 236, (540, 640), np.uint8)) for frame in range(90))
    write_video(noise, pictures, width=640, height=360, fps=30, colors=BT601)
    write_embedded(noise, small)
    seconds, buffered_s = 3, 2
    assert noise.stat().st_size > 5e6
    assert small.stat().st_size < 2e6 / 8 * (seconds + buffered_s), "30 s take less than 8 MB"
