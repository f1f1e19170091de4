"""Frames come out exactly as announced, from wherever decoding starts."""

import io
from collections.abc import Callable
from fractions import Fraction

import cv2
import numpy as np
import pytest

from humanmm.errors import VideoError
from humanmm.models.video.colors import Colors
from humanmm.models.video.frames import frames, frames_at, joined, planar_frames, planar_size, scaled_size
from humanmm.models.video.reading import read_facts


def _rgb(planes: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.cvtColor(planes, cv2.COLOR_YUV2RGB_I420))


Clip = Callable[..., io.BytesIO]
NumberOf = Callable[[np.ndarray], int]
Numbered = Callable[..., np.ndarray]

X264 = "keyint=12:min-keyint=12:scenecut=0"
VARIABLE_TIMES = np.cumsum([0, *np.random.default_rng(5).choice([17, 33, 40, 120], 59)]).tolist()

CLIPS = {
    "H.264 with B-frames in mp4": dict(options={"bf": "3", "x264-params": X264}),
    "H.264 with open groups of pictures": dict(options={"bf": "3", "x264-params": X264 + ":open-gop=1"}),
    "H.264 with intra refresh": dict(options={"x264-params": "keyint=12:intra-refresh=1:bframes=0"}),
    "variable frame rate": dict(options={"x264-params": X264}, times=VARIABLE_TIMES),
    "mkv": dict(container="matroska", options={"bf": "2", "x264-params": X264}),
    "mov, MPEG-4": dict(container="mov", codec="mpeg4", options={"bf": "2", "g": "12"}),
    "avi, MPEG-4": dict(container="avi", codec="mpeg4", options={"g": "12"}),
    "avi, H.264 with B-frames": dict(container="avi", options={"bf": "2", "x264-params": X264 + ":open-gop=1"}),
    "mpegts": dict(container="mpegts", options={"bf": "2", "x264-params": X264}),
    "H.265": dict(codec="libx265", options={"x265-params": "keyint=12:open-gop=1:bframes=3:log-level=none"}),
    "H.265, 10 bit": dict(codec="libx265", pix_fmt="yuv420p10le", options={"x265-params": "keyint=12:log-level=none"}),
    "VP9 in webm": dict(
        container="webm", codec="libvpx-vp9", options={"g": "12", "deadline": "realtime", "cpu-used": "8"}
    ),
    "AV1": dict(codec="libsvtav1", options={"preset": "12", "g": "12"}),
}


@pytest.mark.parametrize("name", CLIPS)
def test_every_announced_frame_is_delivered_once_in_order_and_upright(
    name: str, clip: Clip, number_of: NumberOf
) -> None:
    file = clip(**CLIPS[name])
    facts = read_facts(file)
    delivered = list(frames(file, facts))
    assert facts.num_frames == 60
    assert [f.index for f in delivered] == list(range(60))
    assert [number_of(f.image) for f in delivered] == list(range(60))


@pytest.mark.parametrize("name", CLIPS)
def test_starting_anywhere_gives_the_pictures_of_a_run_from_the_beginning(
    name: str, clip: Clip, number_of: NumberOf
) -> None:
    file = clip(**CLIPS[name])
    facts = read_facts(file)
    whole = [f.image for f in frames(file, facts, pixels="gray")]
    for start in (1, 11, 12, 13, 23, 30, 47, 48, 59):
        part = list(frames(file, facts, start, min(start + 3, 60), pixels="gray"))
        assert [f.index for f in part] == list(range(start, min(start + 3, 60)))
        for frame in part:
            assert np.array_equal(frame.image, whole[frame.index])


@pytest.mark.parametrize("name", CLIPS)
def test_chosen_frames_are_those_of_a_whole_run(name: str, clip: Clip) -> None:
    file = clip(**CLIPS[name])
    facts = read_facts(file)
    whole = [f.image for f in frames(file, facts, pixels="gray")]
    for wanted in ([0, 59], [5, 6, 40], [11, 12, 13, 35, 36], [30], []):
        part = list(frames_at(file, facts, wanted, pixels="gray"))
        assert [f.index for f in part] == wanted
        assert all(np.array_equal(f.image, whole[f.index]) for f in part)


def test_variable_frame_times_are_exact(clip: Clip) -> None:
    for container in ("mp4", "matroska"):
        facts = read_facts(clip(container, times=VARIABLE_TIMES))
        assert np.abs(facts.time_s * 1000 - VARIABLE_TIMES).max() < 1e-6
    assert facts.fps == pytest.approx(59 / (VARIABLE_TIMES[-1] / 1000))


def test_the_time_of_a_first_frame_that_is_not_zero_is_kept(clip: Clip) -> None:
    facts = read_facts(clip("matroska", times=[500 + 40 * i for i in range(10)]))
    assert facts.time_s[0] == pytest.approx(0.5)


@pytest.mark.parametrize(("counter_clockwise_deg", "expected"), [(0, 0), (-90, 90), (180, 180), (90, 270)])
def test_rotation_metadata_makes_the_picture_upright(
    counter_clockwise_deg: int, expected: int, clip: Clip, numbered: Numbered
) -> None:
    stored = numbered(37)
    file = clip(pictures=[stored] * 3, times=[0, 40, 80], rotation_deg=counter_clockwise_deg)
    facts = read_facts(file)
    upright = np.rot90(stored, -expected // 90)
    assert facts.rotation_deg == expected
    assert (facts.height, facts.width) == upright.shape[:2]
    image = next(frames(file, facts)).image
    assert image.shape == upright.shape
    assert np.abs(image.astype(int) - upright).mean() < 4
    small = next(frames(file, facts, max_side_px=64)).image
    assert small.shape[:2] == scaled_size(facts, 64)[::-1]
    planes = joined(next(planar_frames(file, facts, 0, 1)).planes)
    assert np.abs(_rgb(planes).astype(int) - upright).mean() < 4


@pytest.mark.parametrize("pix_fmt", ["yuv420p", "yuv420p10le", "yuv444p"])
@pytest.mark.parametrize("full_range", [False, True])
def test_limited_and_full_range_give_the_same_colours_and_grays(pix_fmt: str, full_range: bool, clip: Clip) -> None:
    gray_ramp = np.repeat(np.linspace(0, 255, 128).astype(np.uint8)[None, :, None], 64, 0).repeat(3, 2)
    file = clip(pictures=[gray_ramp] * 2, times=[0, 40], pix_fmt=pix_fmt, full_range=full_range, options={"crf": "1"})
    facts = read_facts(file)
    rgb = next(frames(file, facts)).image.astype(int)
    gray = next(frames(file, facts, pixels="gray")).image.astype(int)
    assert np.abs(rgb - gray_ramp).max() <= 4
    assert np.abs(gray - gray_ramp[..., 0]).max() <= 4
    planes = joined(next(planar_frames(file, facts, 0, 1)).planes)
    assert np.abs(_rgb(planes).astype(int) - gray_ramp).max() <= 4


def test_bgr_is_rgb_backwards(clip: Clip) -> None:
    orange = np.full((64, 64, 3), (250, 120, 10), np.uint8)
    file = clip(pictures=[orange] * 2, times=[0, 40])
    facts = read_facts(file)
    rgb = next(frames(file, facts)).image
    assert np.abs(rgb[32, 32].astype(int) - orange[0, 0]).max() < 6
    assert np.array_equal(rgb[..., ::-1], next(frames(file, facts, pixels="bgr")).image)


@pytest.mark.parametrize("pix_fmt", ["yuv420p", "yuv444p"])
def test_planes_are_in_the_colours_of_the_video(pix_fmt: str, clip: Clip) -> None:
    orange = np.full((64, 64, 3), (250, 120, 10), np.uint8)
    file = clip(pictures=[orange] * 2, times=[0, 40], pix_fmt=pix_fmt)
    planes = joined(next(planar_frames(file, read_facts(file), 0, 1)).planes)
    y, cb, cr = Colors().samples(orange[0, 0]).astype(int)
    assert abs(int(planes[32, 32]) - y) < 4
    assert abs(int(planes[70, 32]) - cb) < 4
    assert abs(int(planes[90, 32]) - cr) < 4


def test_planes_have_even_sides(clip: Clip) -> None:
    picture = np.full((51, 77, 3), 128, np.uint8)
    file = clip(pictures=[picture] * 3, times=[0, 40, 80], pix_fmt="yuv444p")
    facts = read_facts(file)
    assert planar_size(facts, None) == (76, 50)
    image = joined(next(planar_frames(file, facts, 0, 1)).planes)
    assert image.shape == (75, 76)
    assert np.abs(_rgb(image).astype(int) - 128).max() < 4


def test_odd_sizes_survive(clip: Clip) -> None:
    picture = np.full((51, 77, 3), 128, np.uint8)
    file = clip(pictures=[picture] * 3, times=[0, 40, 80], pix_fmt="yuv444p")
    facts = read_facts(file)
    assert (facts.width, facts.height) == (77, 51)
    for pixels in ("rgb", "gray"):
        assert next(frames(file, facts, pixels=pixels)).image.shape[:2] == (51, 77)


def test_frames_outside_the_video_are_a_programming_error(clip: Clip) -> None:
    file = clip(num_frames=5)
    facts = read_facts(file)
    with pytest.raises(ValueError, match=r"frames \[3, 9\)"):
        next(frames(file, facts, 3, 9))


def test_fine_time_bases_do_not_lose_frames(clip: Clip, number_of: NumberOf) -> None:
    start = 90_000 * 3600 * 10  # ten hours in
    file = clip(
        "mp4", times=[start + 3003 * i for i in range(30)], time_base=Fraction(1, 90_000), options={"x264-params": X264}
    )
    facts = read_facts(file)
    assert [number_of(f.image) for f in frames(file, facts, 17, 20)] == [17, 18, 19]


def test_a_picture_that_does_not_decode_again_is_told_with_both_causes_and_what_to_do(clip: Clip) -> None:
    """As of damaged AV1, of which each pass gives other pictures, or of a file that was changed meanwhile."""
    facts = read_facts(clip())
    with pytest.raises(VideoError, match=r"frame 50 .* damaged, .* changed meanwhile; give an intact copy, .*ffmpeg"):
        list(frames(clip(num_frames=50), facts))
