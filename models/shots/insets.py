"""People in a picture within the picture: whom another camera filmed somewhere else.

What is shown in the corner of a film (an interpreter, somebody who comments) stays where it is at every cut, as all
does that is drawn over it (`shot_detection.burned_in`). Its people join no shots.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from humanmm.models.geometry.boxes import covered
from humanmm.models.records.shots import Box, Scenes
from humanmm.models.records.tracks import ScenePeople

COVERED, ALMOST_ALWAYS = 0.9, 0.9
"""Part of somebody's box that lies in what is drawn over the film, and in how many of the frames in which he is seen.
Of people in insets all of it does (24 tracks of 15 clips; of one more 0.64), of people who were filmed 0.65 at most,
where a wall was taken for drawn (some 120 tracks)."""
ENOUGH = 100
"""Frames of a long track that are looked at, evenly spread (twice as many at most)."""
PROBABILITY = 0.3
"""That such a person belongs to what was filmed: he is delivered as doubtful."""


def in_inset(bbox: Float[np.ndarray, "n 4"], burned_in: Sequence[Box]) -> bool:
    """Whether somebody with these boxes (xyxy, at least one) is seen in what is drawn over the film."""
    if not burned_in:
        return False
    some = bbox[:: max(1, len(bbox) // ENOUGH)].astype(np.float64)
    return bool(np.quantile(covered(some, np.array(burned_in)), 1 - ALMOST_ALWAYS) >= COVERED)


def without_insets(people: Sequence[ScenePeople | None], scenes: Scenes) -> list[ScenePeople | None]:
    """The people of each scene but those in a picture within the picture, who go on at a cut as if there were none."""
    if not scenes.burned_in:
        return list(people)
    return [
        None if scene is None
        else replace(scene, tracks=tuple(track for track in scene.tracks if not in_inset(track.bbox, boxes)))
        for scene, boxes in zip(people, scenes.burned_in, strict=True)
    ]  # fmt: skip
