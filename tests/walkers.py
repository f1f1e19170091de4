"""Tracks of people who walk, as a detector sees them."""

import dataclasses

import numpy as np

from humanmm.models.perception.between_looks import in_frames
from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes

BODY = np.column_stack(
    [
        np.where(np.arange(33) % 2, -1, 1) * np.linspace(5, 30, 33),  # left and right of the middle line
        np.r_[np.full(11, -95.0), np.linspace(-75, 95, 22)],  # head above, then shoulders down to the toes
    ]
)
"""A body 190 px tall about its middle: shoulders above hips, left right of right."""


def walker(
    start: int, end: int, at: tuple[float, float], *, speed_px: float = 2.0, height: float = 190, seed: int = 0
) -> PersonTrack:
    """A person who walks to the right through frames [start, end), seen with a detector's jitter of 1 %."""
    generator = np.random.default_rng(seed)
    count = end - start
    time = np.arange(count)
    swing = 0.06 * np.sin(time[:, None] / 4 + np.arange(33) % 2 * np.pi) * (np.arange(33) > 12)
    scale = height / 190
    xy = BODY * scale + np.array(at)
    xy = xy + np.stack([speed_px * time[:, None] + swing * height, np.zeros((count, 33))], axis=-1)
    xy += generator.normal(0, 0.01 * height, xy.shape)
    boxes = np.concatenate([xy.min(axis=1), xy.max(axis=1)], axis=1)
    return PersonTrack(
        frame=np.arange(start, end, dtype=np.int32),
        keypoints2d=np.concatenate([xy, np.full((count, 33, 1), 0.9)], axis=-1).astype(np.float32),
        landmarks3d=np.zeros((count, 33, 3), np.float32),
        bbox=boxes.astype(np.float32),
        confidence=np.full(count, 0.9, np.float32),
        masks=Silhouettes.pack(np.zeros((count, 128, 128))),
        mask_affine=np.zeros((count, 2, 3), np.float32),
        color_frame=np.zeros(0, np.int32),
        color_histogram=np.zeros((0, 8), np.float32),
    )


def joined(first: PersonTrack, second: PersonTrack) -> PersonTrack:
    """One track that the tracker carried on."""
    return dataclasses.replace(
        first,
        masks=first.masks.then(second.masks),
        **{
            name: np.concatenate([getattr(first, name), getattr(second, name)])
            for name in ("frame", "keypoints2d", "landmarks3d", "bbox", "confidence", "mask_affine")
        },
    )


def looked_at_seldom(*tracks: PersonTrack, looks: np.ndarray, time_s: np.ndarray) -> ScenePeople:
    """All of a video in some frames of which alone, `looks`, people are looked at, as stage `people` has them; tracks
    count these."""
    people = ScenePeople(0, len(looks), tracks)
    return in_frames(people, looks, (0, len(time_s)), time_s)
