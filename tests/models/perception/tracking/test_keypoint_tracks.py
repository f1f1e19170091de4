"""People are followed by where their keypoints are, and become tracks that the rest of the pipeline takes."""

from pathlib import Path

import numpy as np

from humanmm.models.perception.lifting.keypoints import lift_keypoints
from humanmm.models.perception.tracking.keypoint_tracks import PictureKeypoints, link, people_of_keypoints
from humanmm.models.records.video import VideoFacts
from humanmm.storage.readers.aist import read_aist_sequence

SEQUENCE = read_aist_sequence(Path(__file__).parents[4] / "examples" / "aist" / "gBR_sBM_cAll_d06_mBR2_ch06.npz")
N = 40
TIME_S = np.arange(N) / 30


def _two() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frame, keypoints and owner of two dancers side by side, the second gone in frames 10 to 19; rows shuffled within
    each frame."""
    a, b = SEQUENCE.keypoints[0, :N].copy(), SEQUENCE.keypoints[0, 50 : 50 + N].copy()
    b[..., 0] += 500
    rng = np.random.default_rng(0)
    rows = []
    for f in range(N):
        here = [(f, 0, a[f])] + ([] if 10 <= f < 20 else [(f, 1, b[f])])
        rows += [here[k] for k in rng.permutation(len(here))]
    return np.array([r[0] for r in rows]), np.stack([r[2] for r in rows]), np.array([r[1] for r in rows])


def test_everybody_is_followed_through_gaps_whatever_the_order_in_the_file() -> None:
    frame, keypoints, owner = _two()
    people = link(frame, keypoints, TIME_S)
    assert sorted(len(rows) for rows in people) == [30, 40]
    assert all(len(set(owner[rows])) == 1 for rows in people)


def test_who_is_away_for_long_comes_back_as_somebody_else() -> None:
    frame, keypoints, _ = _two()
    assert len(link(frame, keypoints, 4 * TIME_S)) == 3


def test_of_a_limited_number_of_people_the_best_are_taken() -> None:
    frame, keypoints, owner = _two()
    keypoints[owner == 1, :, 2] *= 0.5
    facts = VideoFacts(*SEQUENCE.size, TIME_S, np.ones(N, bool), 0, "h264", "mp4")
    scene = people_of_keypoints(PictureKeypoints(frame, keypoints), facts, (0, N), max_people=1, lifter=lift_keypoints)
    (track,) = scene.tracks
    best = keypoints[owner == 0, :, :2]
    assert len(track.frame) == N and np.abs(track.bbox[:, :2] - best.min(axis=1)).max() < np.ptp(best, axis=1).max()
    (other,) = scene.unfollowed
    assert other.crowded and (other.first, other.last) == (int(frame[owner == 1].min()), int(frame[owner == 1].max()))


def test_tracks_of_one_scene_begin_and_end_with_it() -> None:
    frame, keypoints, _ = _two()
    facts = VideoFacts(*SEQUENCE.size, TIME_S, np.ones(N, bool), 0, "h264", "mp4")
    scene = people_of_keypoints(PictureKeypoints(frame, keypoints), facts, (5, 35), max_people=6, lifter=lift_keypoints)
    assert (scene.start, scene.end) == (5, 35)
    assert sorted(len(track.frame) for track in scene.tracks) == [20, 30]
    for track in scene.tracks:
        assert track.lifted and track.frame.min() == 5 and track.frame.max() == 34
        assert np.isfinite(track.landmarks3d).all() and np.isfinite(track.keypoints2d).all()


def test_a_scene_without_people_is_empty() -> None:
    facts = VideoFacts(*SEQUENCE.size, TIME_S, np.ones(N, bool), 0, "h264", "mp4")
    nobody = PictureKeypoints(np.zeros(0, np.int64), np.zeros((0, 17, 3)))
    assert people_of_keypoints(nobody, facts, (0, N), max_people=6, lifter=lift_keypoints).tracks == ()


def test_what_is_odd_about_keypoints_is_told_by_every_scene() -> None:
    frame, keypoints, _ = _two()
    facts = VideoFacts(*SEQUENCE.size, TIME_S, np.ones(N, bool), 0, "h264", "mp4")
    found = PictureKeypoints(frame, keypoints, ("odd",))
    scene = people_of_keypoints(found, facts, (0, N), max_people=6, lifter=lift_keypoints)
    assert scene.warnings == ("odd",)
