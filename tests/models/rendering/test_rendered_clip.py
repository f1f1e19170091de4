"""A rendered clip's truth: boxes are those of the silhouettes, in the order of the people, part after part."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.rendering import rendered_clip
from humanmm.models.rendering.rendered_clip import RenderedClip
from humanmm.models.rendering.renderer import Frame
from humanmm.models.rendering.script import Clip


@pytest.fixture(autouse=True)
def _pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures of one grey; the first actor is a small square that is gone after frame 3, the second a large one."""

    def frames(clip: Clip) -> Iterator[Frame]:
        for number in range(clip.num_frames):
            masks = np.zeros((2, clip.height, clip.width), bool)
            masks[0, 10:20, 30:40] = number < 3
            masks[1, 50:100, 60 + number : 110 + number] = True
            seen = np.stack([np.full(24, number < 3), np.ones(24, bool)])
            yield Frame(np.full((clip.height, clip.width, 3), 128, np.uint8), masks, seen)

    monkeypatch.setattr(rendered_clip, "render_frames", frames)


def test_a_picture_is_planes_and_its_time(clip: Clip) -> None:
    (first, _), (second, planes) = list(RenderedClip(clip).pictures())[:2]
    assert first == 0 and second == 1 / clip.fps
    assert planes.shape == (clip.height * 3 // 2, clip.width) and planes.dtype == np.uint8


def test_boxes_hold_the_silhouettes_and_the_largest_person_comes_first(clip: Clip) -> None:
    rendered = RenderedClip(clip)
    assert sum(1 for _ in rendered.pictures()) == clip.num_frames
    truth, masks = rendered.truth(), rendered.silhouettes()
    np.testing.assert_array_equal(truth["people/00/bbox"][4], [64, 50, 114, 100])
    np.testing.assert_array_equal(truth["people/01/bbox"][[2, 3]], [[30, 10, 40, 20], [0, 0, 0, 0]])
    np.testing.assert_array_equal(truth["people/01/observed"], np.arange(clip.num_frames) < 3)
    small = np.unpackbits(masks["people/01/mask"], axis=-1)[..., : clip.width]
    assert small.shape == (clip.num_frames, clip.height, clip.width)
    assert small[0].sum() == 100 and small[3:].sum() == 0


def test_parts_follow_each_other_and_their_people_are_numbered_on(clip: Clip) -> None:
    alone = replace(clip, subjects=1)  # the second actor passes by
    rendered = RenderedClip(clip, alone, features={"cuts": 1}, lost_s=[0.0] * (2 * len(clip.changes) + 1))
    times = [time_s for time_s, _ in rendered.pictures()]
    np.testing.assert_allclose(times, np.arange(2 * clip.num_frames) / clip.fps)
    truth = rendered.truth()
    assert truth["num_frames"] == 2 * clip.num_frames and str(truth["features"]) == '{"cuts": 1}'
    assert {key.split("/")[1] for key in truth if key.startswith("people/")} == {"00", "01", "02"}
    np.testing.assert_array_equal(truth["people/02/frame"], np.arange(clip.num_frames) + clip.num_frames)
    assert list(rendered.silhouettes()) == [f"people/{k:02d}/mask" for k in range(3)]
