"""Clips cut from other videos: the frames, the crop, the poster, and the same bytes every time."""

from pathlib import Path

import av
import numpy as np
import pytest

from humanmm.errors import InputError
from humanmm.models.benchmark.expectations import Part, Poster
from humanmm.models.video.colors import BT601
from humanmm.storage.run_folder.cut_clip import filling, write_cut_clip
from humanmm.storage.run_folder.picture_files import write_video

WIDTH, HEIGHT, NUM_FRAMES = 64, 48, 12


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """a.mp4: luma 20 more from frame to frame at the left half, black at the right; b.mp4: white."""
    for name, level in (("a.mp4", None), ("b.mp4", 235)):
        planes = np.full((NUM_FRAMES, HEIGHT * 3 // 2, WIDTH), 128, np.uint8)
        for frame in range(NUM_FRAMES):
            planes[frame, :HEIGHT] = 16 if level is None else level
            if level is None:
                planes[frame, :HEIGHT, : WIDTH // 2] = 16 + 18 * frame
        pictures = ((frame / 25, planes[frame]) for frame in range(NUM_FRAMES))
        write_video(tmp_path / name, pictures, width=WIDTH, height=HEIGHT, fps=25, colors=BT601, quality=5)
    return tmp_path


def luma(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="gray") for frame in container.decode(video=0)]


def test_parts_follow_each_other_frame_by_frame_and_are_cropped(folder: Path) -> None:
    left = (0.0, 0.0, 0.5, 1.0)
    parts = [Part(video="a.mp4", frames=(2, 5), crop=left), Part(video="b.mp4", frames=(0, 2), crop=left)]
    write_cut_clip(folder / "cut.mp4", parts, folder)
    pictures = luma(folder / "cut.mp4")
    assert [picture.shape for picture in pictures] == [(HEIGHT, WIDTH // 2)] * 5
    assert [float(np.median(picture)) for picture in pictures] == pytest.approx([42, 63, 84, 255, 255], abs=4)


def test_a_poster_stands_still_where_it_is_put(folder: Path) -> None:
    poster = Poster(video="b.mp4", frame=0, at=(0.5, 0.25, 1.0, 0.75))
    write_cut_clip(folder / "cut.mp4", [Part(video="a.mp4", poster=poster)], folder)
    for picture in luma(folder / "cut.mp4"):
        assert np.median(picture[16:32, 40:60]) > 245
        assert np.median(picture[:8, 40:60]) < 10


def test_the_same_parts_make_the_same_bytes(folder: Path) -> None:
    parts = [Part(video="a.mp4", crop=(0.1, 0.1, 0.9, 0.9))]
    for name in ("one.mp4", "two.mp4"):
        write_cut_clip(folder / name, parts, folder, size=(80, 80))
    assert (folder / "one.mp4").read_bytes() == (folder / "two.mp4").read_bytes()


def test_a_picture_fills_another_shape_and_loses_both_sides() -> None:
    picture = np.zeros((40, 80, 3), np.uint8)
    picture[:, 20:60] = 200
    filled = filling(picture, 20, 20)
    assert filled.shape == (20, 20, 3)
    assert (filled > 150).all()


def test_frames_that_a_video_lacks_are_reported(folder: Path) -> None:
    with pytest.raises(InputError, match=r"frames 5 to 90 are wanted of a\.mp4, which has 12"):
        write_cut_clip(folder / "cut.mp4", [Part(video="a.mp4", frames=(5, 90))], folder)
    poster = Poster(video="b.mp4", frame=90, at=(0, 0, 1, 1))
    with pytest.raises(InputError, match=r"frame 90 is wanted of b\.mp4"):
        write_cut_clip(folder / "cut.mp4", [Part(video="a.mp4", poster=poster)], folder)
