"""A video says how light it is, and dark pictures become as light as others, colours and all."""

import io
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.records.video import VideoFacts
from humanmm.models.video.light import LIT, MOST, brightened, gain_of
from humanmm.models.video.reading import read_facts

Clip = Callable[..., io.BytesIO]

FACTS = VideoFacts(64, 48, np.arange(10) / 25, np.arange(10) == 0, 0, "h264", "mp4")


def of_light(*levels: int) -> VideoFacts:
    return replace(FACTS, light=np.array(levels, np.uint8))


FORMATS = {
    "limited range": {},
    "full range": dict(pix_fmt="yuvj420p", full_range=True),
    "10 bit": dict(codec="libx265", pix_fmt="yuv420p10le", options={"x265-params": "log-level=none"}),
    "colours, not luma": dict(container="matroska", codec="ffv1", pix_fmt="bgr0"),
}


@pytest.mark.parametrize("name", FORMATS)
def test_the_light_of_every_frame_is_known_in_any_format(name: str, clip: Clip) -> None:
    pictures = [np.full((96, 128, 3), 20 + 10 * k, np.uint8) for k in range(8)]
    for picture in pictures:
        picture[:, 64:] //= 2
    facts = read_facts(clip(num_frames=8, pictures=pictures, **FORMATS[name]))
    assert facts.light is not None and facts.light.shape == (8,)
    np.testing.assert_allclose(facts.light.astype(int), 20 + 10 * np.arange(8), atol=12)


def test_dark_pictures_get_the_light_of_others_and_light_ones_stay() -> None:
    assert gain_of(of_light(*[60] * 10), 0, 10) == pytest.approx(LIT / 60)
    assert gain_of(of_light(*[160] * 10), 0, 10) == 1.0
    assert gain_of(of_light(*[0] * 10), 0, 10) == MOST
    assert gain_of(FACTS, 0, 10) == 1.0  # not known


def test_a_flash_leaves_a_scene_dark_and_each_scene_has_a_gain_of_its_own() -> None:
    facts = of_light(60, 60, 60, 250, 60, 60, 60, 60, 60, 60, *[240] * 5)
    assert gain_of(facts, 0, 10) == pytest.approx(LIT / 79, abs=0.1)
    assert gain_of(facts, 10, 15) == 1.0
    assert gain_of(facts, 0, 15, shown=1.0) == 1.0


def test_a_brightened_picture_keeps_its_colours_but_for_what_becomes_white() -> None:
    dark = np.array([[[60, 24, 12], [10, 30, 100]]], np.uint8)
    np.testing.assert_array_equal(brightened(dark, 3.0), [[[180, 72, 36], [30, 90, 255]]])
    assert brightened(dark, 1.0) is dark
