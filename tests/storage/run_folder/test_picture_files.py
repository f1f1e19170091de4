"""Videos that we write play with the times that we gave."""

from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from humanmm.models.video.colors import BT601, Colors, read_colors
from humanmm.storage.run_folder.picture_files import write_png, write_video


def _planes(picture: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2YUV_I420))


def test_presentation_times_of_a_variable_rate_survive(tmp_path: Path) -> None:
    times = 5.0 + np.cumsum(np.random.default_rng(0).uniform(0.01, 0.08, 25))
    pictures = ((t, _planes(np.full((48, 64, 3), 10 * i, np.uint8))) for i, t in enumerate(times))
    write_video(tmp_path / "out.mp4", pictures, width=64, height=48, fps=25, colors=BT601)
    with av.open(str(tmp_path / "out.mp4")) as container:
        frames = list(container.decode(video=0))
        stream = container.streams.video[0]
        assert (stream.width, stream.height, stream.pix_fmt, stream.codec.name) == (64, 48, "yuv420p", "h264")
    np.testing.assert_allclose([f.time for f in frames], times - times[0], atol=1e-4)


@pytest.mark.parametrize("height", [60, 62, 64, 66])
def test_colours_survive_encoding(height: int, tmp_path: Path) -> None:
    colors = [(200, 30, 30), (30, 200, 30), (30, 30, 200), (240, 240, 240)]
    pictures = ((i / 10, _planes(np.full((height, 64, 3), color, np.uint8))) for i, color in enumerate(colors))
    write_video(tmp_path / "out.mp4", pictures, width=64, height=height, fps=10, colors=BT601)
    with av.open(str(tmp_path / "out.mp4")) as container:
        decoded = [f.to_ndarray(format="rgb24").mean((0, 1)) for f in container.decode(video=0)]
    np.testing.assert_allclose(decoded, colors, atol=6)


def test_a_video_keeps_the_colour_tags_that_it_is_given(tmp_path: Path) -> None:
    bt709 = Colors(matrix=1, primaries=1, transfer=1)
    write_video(
        tmp_path / "out.mp4", [(0.0, np.full((96, 64), 90, np.uint8))], width=64, height=64, fps=10, colors=bt709
    )
    with (tmp_path / "out.mp4").open("rb") as stream:
        assert read_colors(stream) == bt709


def test_the_index_stands_before_the_pictures_so_that_playing_can_start_while_loading(tmp_path: Path) -> None:
    pictures = ((i / 10, _planes(np.full((64, 64, 3), 9 * i, np.uint8))) for i in range(5))
    write_video(tmp_path / "out.mp4", pictures, width=64, height=64, fps=10, colors=BT601)
    data = (tmp_path / "out.mp4").read_bytes()
    assert data.index(b"moov") < data.index(b"mdat")


def test_the_same_pictures_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.mp4", "b.mp4"):
        rng = np.random.default_rng(0)
        pictures = ((i / 30, rng.integers(0, 255, (144, 128), np.uint8)) for i in range(12))
        write_video(tmp_path / name, pictures, width=128, height=96, fps=30, colors=BT601)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_a_png_has_its_colours_in_the_right_order(tmp_path: Path) -> None:
    write_png(tmp_path / "red.png", np.full((4, 4, 3), (255, 0, 0), np.uint8))
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "red.png"))[0, 0], (0, 0, 255))
