"""A person who stands still."""

import numpy as np

from humanmm.models.records.camera import ShotCamera
from humanmm.models.records.motion import PersonShotMotion, ShotMotion
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act, filled
from toyline.science import ramp


def hmr(inputs: StageInputs) -> ShotMotion:
    act("hmr", inputs)
    start, end = inputs.span
    n = end - start
    inputs.read("camera", ShotCamera)
    pelvis = np.repeat(ramp(start, end)[:, None], 3, 1)
    person = filled(PersonShotMotion, n, person=0, frame=np.arange(start, end, dtype=np.int32), pelvis_cam=pelvis)
    return ShotMotion(start, end, (person,))
