"""Who was seen in a video in which nobody could be recovered."""

import numpy as np

from humanmm.models.drawing.candidates import HEIGHT_PX, Candidate, candidates, draw_candidate, side_by_side
from humanmm.models.perception.picture import Picture
from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes


def track(frames: range, probability: float) -> PersonTrack:
    count = len(frames)
    return PersonTrack(
        frame=np.array(frames, np.int32),
        keypoints2d=np.zeros((count, 33, 3), np.float32),
        landmarks3d=np.zeros((count, 33, 3), np.float32),
        bbox=np.tile(np.float32([100, 50, 200, 350]), (count, 1)),
        confidence=np.linspace(0.1, 0.9, count).astype(np.float32),
        masks=Silhouettes.pack(np.zeros((count, 128, 128))),
        mask_affine=np.zeros((count, 2, 3), np.float32),
        color_frame=np.zeros(1, np.int32),
        color_histogram=np.zeros((1, 4), np.float32),
        probability=probability,
    )


def gray(width: int, height: int) -> Picture:
    chroma = np.full((height // 2, width // 2), 128, np.uint8)
    return Picture((np.full((height, width), 60, np.uint8), chroma, chroma.copy()))


def test_the_likeliest_come_first_each_at_his_clearest_moment() -> None:
    scenes = [ScenePeople(0, 30, (track(range(0, 30), 0.05),)), None, ScenePeople(60, 90, (track(range(60, 70), 0.1),))]
    assert [(c.frame, c.probability) for c in candidates(scenes, 90)] == [(69, 0.1), (29, 0.05)]


def test_without_any_track_frames_of_the_video_are_shown() -> None:
    assert [c.frame for c in candidates([ScenePeople(0, 101, ())], 101)] == [25, 50, 75]
    assert [c.frame for c in candidates([], 1)] == [0, 0, 0]


def test_the_box_is_drawn_where_the_candidate_is_in_the_reduced_picture() -> None:
    picture = gray(640, 600)
    box = np.array([160.0, 300.0, 320.0, 560.0])
    plain = draw_candidate(Candidate(7), picture, 1280)
    marked = draw_candidate(Candidate(7, box, 0.1), picture, 1280)
    assert marked.shape == (HEIGHT_PX, 320, 3)
    rows, columns = np.nonzero((plain != marked).any(axis=-1)[30:])  # below the words
    assert abs(columns.min() - 40) <= 2 and abs(columns.max() - 80) <= 2
    assert abs(rows.min() + 30 - 75) <= 2 and abs(rows.max() + 30 - 140) <= 2
    assert side_by_side([marked, marked[:100]]).shape == (HEIGHT_PX, 640, 3)
