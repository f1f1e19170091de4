"""Pictures are delivered in square pixels, whatever the shape of those that are stored."""

import io
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import av
import cv2
import numpy as np
import pytest

from humanmm.errors import VideoError
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.frames import frames, joined, planar_frames
from humanmm.models.video.reading import read_facts
from humanmm.models.video.square_pixels import shape_of_pixels, square_size

Clip = Callable[..., io.BytesIO]

FINE = {"crf": "4"}
SIZE = (192, 192)
"""Of the drawn picture: 11 sixteenths of a side are a whole, even number."""
PAL_WIDE = Fraction(16, 11)


def _drawn(number: int) -> np.ndarray:
    """A disc that moves over a slanted gradient, in square pixels."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    picture = np.stack([60 + 0.5 * x, 190 - 0.4 * y, 80 + 0.2 * x + 0.3 * y], axis=-1)
    disc = np.hypot(x - 70 - 8 * number, y - 80) < 45
    picture[disc] = (230, 40, 60)
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 2.0).round(), np.uint8)


def _stored(picture: np.ndarray, aspect: Fraction) -> np.ndarray:
    """The picture in pixels of this shape."""
    width, height = SIZE
    size = (round(width / aspect), height) if aspect > 1 else (width, round(height * aspect))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))


def _both(clip: Clip, aspect: Fraction, **how: object) -> tuple[io.BytesIO, io.BytesIO]:
    """The same content in pixels of this shape and in square ones."""
    drawn = [_drawn(number) for number in range(4)]
    times = [40 * number for number in range(4)]
    stored = [_stored(picture, aspect) for picture in drawn]
    return (
        clip(pictures=stored, times=times, options=FINE, sample_aspect_ratio=aspect, **how),
        clip(pictures=drawn, times=times, options=FINE, **how),
    )


def _without_file(facts: VideoFacts) -> dict[str, object]:
    """What stages read of the facts, the frames aside."""
    alike = replace(facts, coded_size=None, sample_aspect_ratio=(1, 1))
    return {name: value for name, value in vars(alike).items() if not isinstance(value, np.ndarray)}


@pytest.mark.parametrize("rotation_deg", [None, -90, 180, 90])
@pytest.mark.parametrize("aspect", [PAL_WIDE, 1 / PAL_WIDE], ids=["16:11", "11:16"])
def test_the_same_content_gives_the_same_facts_and_pictures(
    aspect: Fraction, rotation_deg: int | None, clip: Clip
) -> None:
    wide, square = _both(clip, aspect, rotation_deg=rotation_deg)
    facts, expected = read_facts(wide), read_facts(square)
    assert _without_file(facts) == _without_file(expected) and facts.warnings == ()
    assert np.array_equal(facts.time_s, expected.time_s) and np.array_equal(facts.keyframe, expected.keyframe)
    assert facts.coded_size == ((132, 192) if aspect > 1 else (192, 132)) and expected.coded_size == SIZE
    assert Fraction(*facts.sample_aspect_ratio) == aspect
    for how in (dict(), dict(pixels="gray"), dict(pixels="bgr"), dict(max_side_px=150), dict(max_side_px=80)):
        pairs = zip(frames(wide, facts, **how), frames(square, expected, **how), strict=True)  # type: ignore[arg-type]
        for one, other in pairs:
            assert one.image.shape == other.image.shape and one.time_s == other.time_s
            assert np.abs(one.image.astype(int) - other.image).mean() < 2, how
    for max_side_px in (None, 150):
        pair = [planar_frames(*of, 2, 3, max_side_px=max_side_px) for of in ((wide, facts), (square, expected))]
        (one_planes,), (other_planes,) = ([joined(frame.planes) for frame in these] for these in pair)
        assert np.abs(one_planes.astype(int) - other_planes).mean() < 2


def test_a_disc_is_round_and_where_it_was_drawn(clip: Clip) -> None:
    wide, _ = _both(clip, PAL_WIDE)
    image = next(frames(wide, read_facts(wide))).image.astype(int)
    disc = image[..., 0] - image[..., 1] > 100
    rows, columns = np.flatnonzero(disc.any(axis=1)), np.flatnonzero(disc.any(axis=0))
    assert len(columns) == pytest.approx(90, abs=3) and len(rows) == pytest.approx(90, abs=3)
    assert np.argwhere(disc).mean(axis=0) + 0.5 == pytest.approx((80, 70), abs=0.5)


@pytest.mark.parametrize("container", ["mp4", "matroska", "mpegts", "mov"])
def test_every_container_tells_the_shape_of_pixels(container: str, clip: Clip) -> None:
    facts = read_facts(_both(clip, PAL_WIDE, container=container)[0])
    assert (facts.width, facts.height) == SIZE and facts.sizes.coded == (132, 192)


def test_odd_stored_sides_give_even_ones_where_pictures_are_resampled(clip: Clip) -> None:
    picture = np.full((50, 77, 3), 128, np.uint8)
    file = clip(pictures=[picture] * 3, times=[0, 40, 80], pix_fmt="yuv444p", sample_aspect_ratio=Fraction(4, 3))
    facts = read_facts(file)
    assert (facts.width, facts.height) == (102, 50)
    assert next(frames(file, facts, pixels="gray")).image.shape == (50, 102)


def _remuxed(file: io.BytesIO, declared: Fraction) -> io.BytesIO:
    """The same packets in an mp4 whose container declares this shape of pixels."""
    new = io.BytesIO()
    with av.open(file) as source, av.open(new, "w", format="mp4") as out:
        stream = out.add_stream_from_template(source.streams.video[0])
        stream.codec_context.sample_aspect_ratio = declared
        for packet in source.demux(source.streams.video[0]):
            if packet.dts is not None:
                packet.stream = stream
                out.mux(packet)
    new.seek(0)
    return new


@pytest.mark.parametrize(("coded", "doubtful"), [(None, False), (Fraction(1), False), (Fraction(12, 11), True)])
def test_the_container_has_the_last_word(coded: Fraction | None, doubtful: bool, clip: Clip) -> None:
    facts = read_facts(_remuxed(clip(num_frames=4, sample_aspect_ratio=coded), Fraction(4, 3)))
    assert (facts.width, facts.height) == (170, 96)
    assert len(facts.warnings) == doubtful
    if doubtful:
        assert "(4:3 and 12:11): the container's is used" in facts.warnings[0]
        assert "scale=140:96,setsar=1" in facts.warnings[0]


def test_what_no_camera_has_is_taken_as_square_with_a_warning(clip: Clip) -> None:
    facts = read_facts(clip(num_frames=4, sample_aspect_ratio=Fraction(5)))
    assert (facts.width, facts.height, facts.sample_aspect_ratio) == (128, 96, (1, 1))
    assert facts.warnings == ("pixels of 5:1, as the file says, are no camera's: they are taken as square",)
    assert shape_of_pixels(Fraction(4), [], (64, 48)) == (4, [])


def test_rounding_of_a_writer_is_no_reason_to_resample(clip: Clip) -> None:
    file = clip(num_frames=4, sample_aspect_ratio=Fraction(404, 405))
    facts = read_facts(file)
    assert (facts.width, facts.height, facts.sample_aspect_ratio, facts.warnings) == (128, 96, (1, 1), ())


def test_a_shape_that_changes_inside_the_video_is_doubtful() -> None:
    aspect, warnings = shape_of_pixels(Fraction(16, 15), [Fraction(16, 15), Fraction(64, 45)], (720, 576))
    assert aspect == Fraction(16, 15)
    assert len(warnings) == 1 and "changes inside the video (16:15, 64:45): 16:15 is used" in warnings[0]


@pytest.mark.parametrize(
    ("coded", "aspect", "size"),
    [
        ((720, 576), Fraction(64, 45), (1024, 576)),  # PAL DV, 16:9
        ((720, 480), Fraction(8, 9), (720, 540)),  # NTSC, 4:3, of 720 columns
        ((1440, 1080), Fraction(4, 3), (1920, 1080)),  # HDV
        ((77, 51), Fraction(1), (77, 51)),
    ],
)
def test_one_side_grows_and_none_shrinks(coded: tuple[int, int], aspect: Fraction, size: tuple[int, int]) -> None:
    assert square_size(coded, aspect) == size


def test_a_side_that_grows_beyond_the_limit_is_refused(clip: Clip) -> None:
    file = clip(num_frames=4, sample_aspect_ratio=Fraction(2))
    assert read_facts(file, max_side_px=256).width == 256
    with pytest.raises(VideoError, match=r"256 px, more than decode\.max_side_px = 200"):
        read_facts(file, max_side_px=200)
