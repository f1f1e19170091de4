"""Cut pairs of known people, and the links that are made of them."""

from dataclasses import replace

import numpy as np

from humanmm.models.benchmark.identity import (
    CutPair,
    Seen,
    View,
    cut_pairs,
    linked,
    views_of,
)
from humanmm.models.perception.clothing import HISTOGRAM_BINS
from humanmm.models.records.landmarks import NUM_LANDMARKS
from humanmm.models.records.shots import Shot
from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes

TIME_S = np.arange(180) / 30
LEFT, RIGHT = np.array([0.0, 0, 50, 100]), np.array([200.0, 0, 250, 100])


def track(first: int, last: int, box: np.ndarray, seed: int) -> PersonTrack:
    """Somebody in clothes of his own."""
    count = last - first
    histogram = np.zeros((count, HISTOGRAM_BINS), np.float32)
    histogram[:, [seed, seed + 40]] = 0.5
    parts = np.random.default_rng(seed).uniform([10, -40, -40], [90, 40, 40], (9, 3))
    return PersonTrack(
        frame=np.arange(first, last, dtype=np.int32),
        keypoints2d=np.ones((count, NUM_LANDMARKS, 3), np.float32),
        landmarks3d=np.random.default_rng(0).normal(0, 0.3, (count, NUM_LANDMARKS, 3)).astype(np.float32),
        bbox=np.repeat(box[None], count, axis=0).astype(np.float32),
        confidence=np.full(count, 0.9, np.float32),
        masks=Silhouettes.pack(np.zeros((count, 128, 128))),
        mask_affine=np.zeros((count, 2, 3), np.float32),
        color_frame=np.arange(first, last, dtype=np.int32),
        color_histogram=histogram,
        color_parts=np.repeat(parts[None], count, axis=0).astype(np.float32),
    )


def views(recording: str = "a", seeds: tuple[int, ...] = (1, 2), num_frames: int = 180) -> list[View]:
    """What one long shot shows of a man on the left, and of a poster on the right that nobody is."""
    tracks = tuple(track(0, num_frames, box, seed) for box, seed in zip((LEFT, RIGHT), seeds, strict=True))
    boxes = {"man": np.repeat(LEFT[None], num_frames, axis=0)}
    return views_of(
        recording, [Shot(0, 0, num_frames, 0, None, ())], [ScenePeople(0, num_frames, tracks)], boxes, TIME_S
    )


def test_a_long_shot_is_divided_into_pieces_that_are_apart_and_a_short_one_is_not() -> None:
    found = views()
    assert [[(one.who, one.sighting.num_frames) for one in view.people] for view in found] == [
        [("a/man", 45), (None, 45)]
    ] * 3
    assert len(views(num_frames=50)) == 1


def test_who_lies_on_somebody_in_half_of_the_frames_is_left_out() -> None:
    boxes = {"man": np.repeat(LEFT[None], 40, axis=0), "woman": np.repeat(RIGHT[None], 40, axis=0)}
    wanders = track(0, 40, LEFT, 1)
    moved = np.where(np.arange(40)[:, None] < 20, LEFT, RIGHT).astype(np.float32)
    scene = ScenePeople(0, 40, (replace(wanders, bbox=moved),))
    assert views_of("a", [Shot(0, 0, 40, 0, None, ())], [scene], boxes, TIME_S) == []


def test_half_of_the_pairs_are_of_unrelated_recordings() -> None:
    pairs = cut_pairs([*views("a"), *views("b", (3, 4))])
    assert [pair.unrelated for pair in pairs] == [False] * 4 + [True] * 6


def test_links_of_one_person_are_right_and_those_of_strangers_in_the_same_clothes_wrong() -> None:
    first, second = views("a")[:2]
    stranger = views("b")[0]
    unlike = views("c", (5, 6))[0]
    right, wrong, none = (linked(CutPair(first, other)) for other in (second, stranger, unlike))
    assert right.true == 1 and [link.right for link in right.made] == [True]  # of the poster nothing is known
    assert wrong.true == 0 and [link.right for link in wrong.made] == [False]
    assert none.made == ()


def test_a_link_without_colours_is_made_and_not_claimed() -> None:
    (seen,) = views(seeds=(1, 2), num_frames=50)
    blank = tuple(Seen(replace(one.sighting, colours=np.zeros(HISTOGRAM_BINS)), one.who) for one in seen.people)
    assert all(link.probability <= 0.8 for link in linked(CutPair(seen, replace(seen, people=blank))).made)
