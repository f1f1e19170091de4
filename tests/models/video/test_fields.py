"""Interlaced pictures are found by what moves in them, and delivered as they were at one moment."""

import io
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from humanmm.models.records.video import Field, VideoFacts
from humanmm.models.video.container import PacketLog, decoded, open_video
from humanmm.models.video.fields import FieldSearch, judged, one_field
from humanmm.models.video.frames import frames, frames_at, joined, planar_frames
from humanmm.models.video.reading import read_facts

Clip = Callable[..., io.BytesIO]

FINE = {"crf": "4"}
NUM, WIDTH, HEIGHT = 30, 160, 256


def _moment(time: float) -> np.ndarray:
    """A smooth picture with a disc that goes back and forth; `time` in frames of the interlaced video."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    picture = np.stack([60 + 0.5 * x, 190 - 0.2 * y, 80 + 0.2 * x + 0.15 * y], axis=-1)
    picture[np.hypot(x - 80 - 40 * np.sin(time / 4), y / 2 - 60) < 36] = (230, 40, 60)
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 2.0).round(), np.uint8)


def _woven(first: Field = "top", of: range | tuple[int, ...] = range(NUM)) -> list[np.ndarray]:
    """Pictures whose later field is half a frame period late; whole ones where the number is not in `of`."""
    pictures = []
    for number in range(NUM):
        picture = _moment(number)
        later = slice(1, None, 2) if first == "top" else slice(0, None, 2)
        if number in of:
            picture[later] = _moment(number + 0.5)[later]
        pictures.append(picture)
    return pictures


def _film(clip: Clip, pictures: list[np.ndarray], **how: object) -> io.BytesIO:
    how = {"options": FINE, **how}
    return clip(pictures=pictures, times=[40 * number for number in range(len(pictures))], **how)


def _error(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(one.astype(int) - other).mean())


def _gray(rgb: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY))


def _errors(found: np.ndarray, first: np.ndarray, later: np.ndarray) -> tuple[int, float, float]:
    """How many samples differ between two moments, and how far a picture is from each of both there."""
    moving = np.abs(first.astype(int) - later) > 20
    if not moving.any():
        return 0, 0.0, 0.0
    return int(moving.sum()), _error(found[moving], first[moving]), _error(found[moving], later[moving])


def _marked(first: str) -> dict[str, str]:
    return FINE | {"x264-params": "tff=1" if first == "top" else "bff=1"}


@pytest.mark.parametrize("first", ["top", "bottom"])
@pytest.mark.parametrize("marked", [False, True], ids=["unmarked", "marked"])
def test_woven_pictures_are_found_and_delivered_as_the_first_field_shows_them(
    first: Field, marked: bool, clip: Clip
) -> None:
    file = _film(clip, _woven(first), options=_marked(first) if marked else FINE)
    facts = read_facts(file)
    assert (facts.first_field, facts.interlaced, facts.warnings) == (first, True, ())
    for frame in frames(file, facts, pixels="gray"):
        moving, to_first, to_later = _errors(frame.image, *(_gray(_moment(frame.index + t)) for t in (0, 0.5)))
        assert moving < 100 or to_first < 0.25 * to_later


def test_a_film_of_whole_pictures_that_is_marked_keeps_them(clip: Clip) -> None:
    pictures = _woven(of=())
    marked, plain = (_film(clip, pictures, options=mark | {"crf": "0"}) for mark in (_marked("top"), {}))
    facts, expected = read_facts(marked), read_facts(plain)
    with open_video(marked) as (container, video):
        assert next(decoded(container, video, PacketLog())).interlaced_frame
    assert (facts.first_field, facts.warnings) == (None, ()) == (expected.first_field, expected.warnings)
    for side in (None, 64):  # swscale would resample both fields of a marked picture separately
        both = (planar_frames(*of, 0, NUM, max_side_px=side) for of in ((marked, facts), (plain, expected)))
        assert max(_error(one.planes[0], other.planes[0]) for one, other in zip(*both, strict=True)) < 0.1
        pairs = zip(*(frames(*of, max_side_px=side) for of in ((marked, facts), (plain, expected))), strict=True)
        assert max(_error(one.image, other.image) for one, other in pairs) < 1  # chroma lies a quarter of a pixel off


def test_whole_square_pictures_are_those_of_the_decoder(clip: Clip) -> None:
    file = _film(clip, _woven(of=()))
    facts = read_facts(file)
    delivered = list(frames(file, facts)), list(planar_frames(file, facts, 0, NUM))
    file.seek(0)
    with av.open(file) as container:
        for number, picture in enumerate(container.decode(video=0)):
            assert np.array_equal(
                delivered[0][number].image, picture.to_ndarray(format="rgb24", interpolation="BICUBIC")
            )
            assert np.array_equal(joined(delivered[1][number].planes), picture.to_ndarray())


@pytest.mark.parametrize("how", [{}, {"rotation_deg": 90}, {"sample_aspect_ratio": Fraction(16, 11)}], ids=str)
@pytest.mark.parametrize("pix_fmt", ["yuv420p", "yuv422p", "yuv444p", "yuv420p10le"])
def test_every_way_of_reading_delivers_the_same_moment(pix_fmt: str, how: dict[str, object], clip: Clip) -> None:
    woven, still = (_film(clip, p, pix_fmt=pix_fmt, **how) for p in (_woven("bottom"), _woven(of=())))
    facts, expected = read_facts(woven), read_facts(still)
    assert facts.first_field == "bottom" and expected.first_field is None
    ways: tuple[dict[str, object], ...] = ({}, {"pixels": "gray"}, {"pixels": "bgr"}, {"max_side_px": 90})
    for way in ways:
        pairs = zip(frames(woven, facts, 4, 9, **way), frames(still, expected, 4, 9, **way), strict=True)  # type: ignore[arg-type]
        assert max(_error(one.image, other.image) for one, other in pairs) < 2, way
    for side in (None, 90):
        found, true = (
            [joined(f.planes) for f in planar_frames(of, f_, 4, 9, max_side_px=side)]
            for of, f_ in ((woven, facts), (still, expected))
        )
        assert max(map(_error, found, true)) < 2


def test_seeking_does_not_change_a_picture(clip: Clip) -> None:
    file = _film(clip, _woven(), options=_marked("top") | {"g": "5"})
    facts = read_facts(file)
    assert facts.keyframe.sum() > 3
    every = [frame.image for frame in frames(file, facts)]
    for frame in frames_at(file, facts, [3, 11, 12, 27]):
        assert np.array_equal(frame.image, every[frame.index])
    mirrored = replace(facts, mirrored=True)
    assert all(np.array_equal(f.image, every[f.index][:, ::-1]) for f in frames(file, mirrored, 5, 7))


def test_telecine_is_delivered_by_one_field_with_a_warning(clip: Clip) -> None:
    facts = read_facts(_film(clip, _woven(of=tuple(n for n in range(NUM) if n % 5 in (2, 3)))))
    assert facts.first_field == "top"
    assert len(facts.warnings) == 1 and "are interlaced, the others whole (telecine" in facts.warnings[0]


@pytest.mark.parametrize(
    ("votes", "field", "warned"),
    [
        (["top"] * 9 + ["whole"], "top", None),
        (["bottom"] * 2, "bottom", None),
        (["top"], None, None),
        (["whole"] * 20 + ["top"] * 2 + ["bottom"], None, None),
        (["whole"] * 17 + ["top"] * 2 + ["bottom"], None, None),
        (
            ["whole"] * 17 + ["top"] * 3,
            None,
            "3 of 20 moving pictures that were looked at are interlaced, the others whole: all are taken",
        ),
        (["whole"] * 6 + ["top"] * 4, "top", "4 of 10 moving pictures that were looked at are interlaced"),
        (["bottom"] * 9 + ["top"] * 2, "bottom", None),
        (["bottom"] * 6 + ["top"] * 4, None, "now one field first and now the other"),
    ],
)
def test_the_share_of_woven_pictures_decides(votes: list[str], field: str | None, warned: str | None) -> None:
    found, warnings = judged(votes, marked=False)  # type: ignore[arg-type]
    assert found == field and len(warnings) == (warned is not None)
    assert warned is None or warned in warnings[0]


def test_a_mark_that_nothing_moving_confirms_is_doubtful(clip: Clip) -> None:
    facts = read_facts(_film(clip, [_moment(0)] * NUM, options=_marked("top")))
    assert facts.first_field is None and len(facts.warnings) == 1 and "too little moves" in facts.warnings[0]
    assert read_facts(_film(clip, [_moment(0)] * NUM)).warnings == ()


def test_a_picture_no_higher_than_a_field_is_whole() -> None:
    search = FieldSearch()
    for picture in _woven():
        search.look(av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:240]), "rgb24"))
    assert search.found() == (None, []) and not search.votes


def test_noise_and_fine_stripes_are_no_fields() -> None:
    rng = np.random.default_rng(0)
    for stripes in (0, 60):
        search = FieldSearch()
        for number in range(NUM):
            luma = rng.normal(120, 12, (HEIGHT, WIDTH)) + stripes * (np.indices((HEIGHT, WIDTH))[0] % 2)
            luma += 40 * (np.arange(WIDTH) // 8 % 2 == number % 2)
            search.look(av.VideoFrame.from_ndarray(np.asarray(luma.clip(0, 255), np.uint8), "gray"))
        assert search.found() == (None, []) and len(search.votes) > 3


@pytest.mark.parametrize("field", ["top", "bottom"])
@pytest.mark.parametrize(
    "pixels", ["gray", "yuv420p", "nv12", "yuyv422", "rgb24", "yuv422p10le", "gray12le", "rgb565le"]
)
def test_rows_of_a_field_stay_in_every_format_of_pixels(pixels: str, field: Field) -> None:
    picture = av.VideoFrame.from_ndarray(_moment(3)[:-2], "rgb24").reformat(format=pixels)
    taken = one_field(picture, field)
    assert (taken.format.name, taken.width, taken.height) == (pixels, WIDTH, HEIGHT - 2)
    first = 0 if field == "top" else 1
    for source, target in zip(picture.planes, taken.planes, strict=True):
        rows = [np.frombuffer(p, np.uint8).reshape(-1, p.line_size)[: p.height] for p in (source, target)]  # type: ignore[call-overload]
        common = min(source.line_size, target.line_size)
        width = min(common, rows[0].shape[1]) * WIDTH // max(source.width, WIDTH)
        assert np.array_equal(rows[0][first::2, :width], rows[1][first::2, :width])
    if pixels != "rgb565le":
        shown = [p.reformat(format="rgb24").to_ndarray() for p in (picture, taken)]
        assert _error(*shown) < 1


@pytest.mark.parametrize("field", ["top", "bottom"])
def test_colours_are_those_of_the_same_moment(field: Field) -> None:
    """Of a camera that halves the chroma of each field, as interlaced 4:2:0 demands."""
    moments = [av.VideoFrame.from_ndarray(_moment(time), "rgb24") for time in (0, 1)]
    woven = moments[0].reformat(format="yuv420p")
    later = 1 if field == "top" else 0
    for plane, other in zip(woven.planes, moments[1].reformat(format="yuv420p").planes, strict=True):
        rows, others = (np.frombuffer(p, np.uint8).reshape(-1, p.line_size) for p in (plane, other))  # type: ignore[call-overload]
        rows[later::2] = others[later::2]
    taken = one_field(woven, field).to_ndarray(format="rgb24")
    moving, to_first, to_later = _errors(taken, _moment(0), _moment(1))
    assert moving > 1000 and to_first < 0.15 * to_later


def test_real_clips_are_whole() -> None:
    clip = Path(__file__).parents[3] / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"
    with clip.open("rb") as stream:
        facts = read_facts(stream)
    assert isinstance(facts, VideoFacts) and facts.first_field is None and facts.warnings == ()
