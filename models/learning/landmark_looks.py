"""What the keypoint refiner learns from: rendered people as the pose networks' inner layers see them, beside where
their landmarks really are.

That is where people see them (`body.landmarks.load_keypoints`): landmarks of the body may lie elsewhere, and what reads
keypoints knows by how much. Left and right are as BlazePose names them: a refiner that may exchange them cannot be
believed half of the way.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.learning.crops import CropRenderer
from humanmm.models.learning.pairs import FRAMES, PairSource, WindowArrays, jittered, true_body, true_region
from humanmm.models.perception.blazepose import LANDMARK_SIDE
from humanmm.models.perception.keypoints.fusion import joined_of
from humanmm.models.perception.keypoints.naming import body_named_as
from humanmm.models.perception.keypoints.refine import seen_in_crop
from humanmm.models.perception.keypoints.surroundings import REFINED
from humanmm.models.perception.regions import Region, invert, transform

Array = np.ndarray

EVERY = 4
"""Frames of a shot of which one is looked at: frames beside each other show nearly the same."""
LOOKS = FRAMES // EVERY
"""Of a shot."""
FARTHEST = 150.0
"""Landmarks farther from the crop's middle, in pixels of the crop, teach nothing."""


@dataclass(frozen=True, eq=False)
class LandmarkLooks(WindowArrays):
    """n looks at somebody; see `surroundings.Seen`."""

    precision = np.float16

    windows: Float[Array, "n 22 7 7 74"]
    coarse: Float[Array, "n 22 96"]
    numbers: Float[Array, "n 22 13"]
    shift: Float[Array, "n 22 2"]
    """From the fused keypoints to where the landmarks are seen, pixels of the crop."""
    is_known: Bool[Array, "n 22"]
    """Landmarks in the picture, and not far outside the crop."""


@dataclass(frozen=True)
class LookSource:
    """Where looks are drawn from; the same source and number give the same looks."""

    pairs: PairSource

    def looks(self, number: int) -> tuple[LandmarkLooks, Mapping[str, Any]]:
        """LOOKS looks at somebody in one shot, and what it shows."""
        renderer, _, rng, facts = self.pairs.filmed(number)
        true = true_body(renderer)
        frames = range(int(rng.integers(EVERY)), FRAMES, EVERY)
        regions = [jittered(true_region(true.pixels[frame]), rng) for frame in frames]
        looks = zip(frames, regions, strict=True)
        rows = [_look(renderer, frame, region, true.keypoints[frame], rng) for frame, region in looks]
        return LandmarkLooks(*(np.stack(parts) for parts in zip(*rows, strict=True))), facts


def _look(
    renderer: CropRenderer, frame: int, region: Region, keypoints: Float[Array, "33 2"], rng: np.random.Generator
) -> tuple[Array, ...]:
    """The parts of `LandmarkLooks` of one frame."""
    joined, look = joined_of(renderer.crop(frame, region, rng), region)
    seen = seen_in_crop(joined, look, mirrored=False)
    own = body_named_as(joined.keypoints, keypoints, region.side)[list(REFINED)]
    true = transform(invert(region.to_source(LANDMARK_SIDE)), own)
    in_picture = ((own >= 0) & (own < renderer.size)).all(axis=1)
    is_known = in_picture & (np.abs(true - LANDMARK_SIDE / 2).max(axis=1) < FARTHEST)
    return seen.windows(), seen.coarse(), seen.numbers(), true - seen.fused, is_known
