from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from quick_networks import QUICK

from humanmm.models.perception.interfaces import Landmarks, Networks
from humanmm.models.perception.lifting.lifted import keep
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.perception.tracking.given_regions import GivenRegions
from humanmm.models.perception.tracking.people import track_people
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.video.opened import Video
from humanmm.models.video.reading import read_facts

CLIP = Path(__file__).parents[4] / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"
SPAN = (4, 34)
"""Of one shot of the clip, which has 60 frames a second."""
LIMBS = list(landmarks.LIMBS)


@lru_cache(maxsize=4)
def looked(max_rate_hz: float) -> tuple[ScenePeople, int]:
    """The man, and how often the pose network looked."""
    looks = 0

    def locate(image: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
        nonlocal looks
        looks += 1
        return QUICK.locate(image, region, mirrored=mirrored)

    with CLIP.open("rb") as stream:
        video = Video(stream, read_facts(stream))
        counted = Networks(QUICK.detect, locate)
        people = track_people(video, SPAN, max_people=1, max_rate_hz=max_rate_hz, networks=counted, lifter=keep)
    return people, looks


def test_fewer_looks_give_every_frame_and_nearly_the_same_man() -> None:
    (often, many), (seldom, few) = looked(60), looked(15)
    assert few < 0.8 * many, "both ends are looked at in full"
    (here,), (there,) = often.tracks, seldom.tracks
    assert (seldom.start, seldom.end) == SPAN
    np.testing.assert_array_equal(there.frame, np.arange(*SPAN))
    height = np.median(here.bbox[:, 3] - here.bbox[:, 1])
    apart = np.linalg.norm((here.keypoints2d - there.keypoints2d)[:, LIMBS, :2], axis=-1)
    assert np.median(apart) < 0.01 * height
    assert np.abs(here.color_frame - there.color_frame[: len(here.color_frame)]).max() < 60


def in_boxes(frames: np.ndarray) -> ScenePeople:
    """Whom the networks see at 15 looks a second in the man's boxes, which are given in some frames."""
    (man,) = looked(60)[0].tracks
    box = man.bbox[np.isin(man.frame, frames)].astype(float)
    given = GivenRegions(frames, np.zeros(len(frames), np.int64), box, np.ones(len(frames)))
    with CLIP.open("rb") as stream:
        video = Video(stream, read_facts(stream))
        return track_people(video, SPAN, max_rate_hz=15, networks=QUICK, lifter=keep, given=given)


def test_every_frame_in_which_somebody_is_given_is_looked_at() -> None:
    (man,) = looked(60)[0].tracks
    odd = np.arange(SPAN[0] + 1, SPAN[1], 2)  # at 15 looks a second few of these are due
    people = in_boxes(odd)
    (found,) = people.tracks
    assert people.looks is None or np.isin(odd, people.looks).all()
    assert np.isin(odd, found.frame).mean() > 0.9
    rows = found.frame - SPAN[0]
    centre, there = ((box[:, :2] + box[:, 2:]) / 2 for box in (found.bbox, man.bbox[rows]))
    assert np.linalg.norm(centre - there, axis=1).max() < 0.1 * np.ptp(man.bbox[0, 1::2])
    assert found.confidence == pytest.approx(man.confidence[rows], abs=0.3)
