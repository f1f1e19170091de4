"""One person per scene."""

import numpy as np

from humanmm.models.records.tracks import PersonTrack, ScenePeople, Silhouettes
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act, filled
from toyline.science import ramp


def people(inputs: StageInputs) -> ScenePeople:
    act("people", inputs)
    start, end = inputs.span
    n = end - start
    boxes = np.repeat(ramp(start, end)[:, None], 4, 1).astype(np.float32) * inputs.config.people.max_people
    frame = np.arange(start, end, dtype=np.int32)
    masks = Silhouettes.pack(np.zeros((n, 1, 1), np.uint8))
    track = filled(PersonTrack, n, frame=frame, keypoints2d=np.zeros((n, 33, 3), np.float32), bbox=boxes, masks=masks)
    inputs.progress(n, n)
    return ScenePeople(start, end, (track,))
