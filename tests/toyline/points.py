"""One point."""

import numpy as np

from humanmm.models.records.camera import PointTracks
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act, filled


def points(inputs: StageInputs) -> PointTracks:
    act("points", inputs)
    assert inputs.shot is None
    start, end = inputs.span
    n = end - start
    frame = np.arange(start, end, dtype=np.int32)
    return filled(PointTracks, n, start=start, end=end, frame=frame)
