"""A variable-rate video of a real man, whose true motion is that of the constant-rate clip that it was made from."""

import io
from fractions import Fraction
from functools import lru_cache
from pathlib import Path

import av
import numpy as np
from quick_networks import QUICK

from humanmm.models.perception.tracking.people import track_people
from humanmm.models.perception.tracking.track_builder import steadiness
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import PersonTrack
from humanmm.models.video.frames import frames
from humanmm.models.video.opened import Video
from humanmm.models.video.reading import read_facts

CLIP = Path(__file__).parents[3] / "examples" / "pose2sim_multishot" / "pose2sim_A_01-02-01.mp4"
FIRST, LAST = 0, 25
"""One shot of the clip, at 60 Hz."""
KEPT = np.array([0, 1, 2, 3, 7, 8, 12, 13, 14, 15, 19, 23, 24])
"""Frames of it in the variable-rate video: 1/60 s to 4/60 s apart."""
LIMBS = list(landmarks.LIMBS)


@lru_cache(maxsize=1)
def variable_rate_video() -> bytes:
    file = io.BytesIO()
    with CLIP.open("rb") as stream, av.open(file, "w", format="mp4") as out:
        facts = read_facts(stream)
        video = out.add_stream("libx264", rate=60, options={"crf": "8"})
        video.width, video.height, video.pix_fmt = facts.width, facts.height, "yuv420p"
        video.codec_context.time_base = Fraction(1, 600)
        for decoded in frames(stream, facts, FIRST, LAST, pixels="rgb"):
            if decoded.index in KEPT:
                frame = av.VideoFrame.from_ndarray(decoded.image, "rgb24")
                frame.pts, frame.time_base = 10 * decoded.index, Fraction(1, 600)
                out.mux(video.encode(frame))
        out.mux(video.encode(None))
    return file.getvalue()


def tracked(video: bytes, num_frames: int) -> tuple[PersonTrack, np.ndarray]:
    """The man, and the presentation times of the video's frames."""
    stream = io.BytesIO(video)
    facts = read_facts(stream)
    people = track_people(Video(stream, facts), (0, num_frames), max_people=1, networks=QUICK)
    return people.tracks[0], facts.time_s


def test_the_man_is_tracked_with_the_places_the_speeds_and_the_confidence_of_the_constant_rate_clip() -> None:
    truth, _ = tracked(CLIP.read_bytes(), LAST)
    track, time_s = tracked(variable_rate_video(), len(KEPT))
    np.testing.assert_allclose(time_s, KEPT / 60, atol=1e-9)
    np.testing.assert_array_equal(track.frame, np.arange(len(KEPT)))

    height = np.median(truth.bbox[:, 3] - truth.bbox[:, 1])
    true_xy, xy = truth.keypoints2d[KEPT][:, LIMBS, :2], track.keypoints2d[:, LIMBS, :2]
    assert np.median(np.linalg.norm(xy - true_xy, axis=-1)) < 0.01 * height

    def speeds(at_s: np.ndarray) -> np.ndarray:
        """Of the middle of the body over three steps, pixels a second."""
        return np.linalg.norm(xy.mean(axis=1)[3:] - xy.mean(axis=1)[:-3], axis=-1) / (at_s[3:] - at_s[:-3])

    true_speed = np.linalg.norm(true_xy.mean(axis=1)[3:] - true_xy.mean(axis=1)[:-3], axis=-1)
    true_speed = 60 * true_speed / (KEPT[3:] - KEPT[:-3])
    evenly_s = np.linspace(time_s[0], time_s[-1], len(time_s))
    error, error_evenly = (np.median(np.abs(speeds(at_s) - true_speed) / true_speed) for at_s in (time_s, evenly_s))
    assert error < 0.15 < error_evenly

    # steady where the constant-rate track is; as if frames were evenly apart, the man would jerk
    side = np.full(len(KEPT), 1.6 * height)
    ours, evenly = (steadiness(track.keypoints2d, track.frame, side, at_s) for at_s in (time_s, evenly_s))
    assert np.median(ours) > np.median(evenly)
    assert np.abs(np.median(track.confidence) - np.median(truth.confidence)) < 0.1
