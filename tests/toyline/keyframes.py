"""No features: there is no picture."""

from humanmm.models.camera.background.keyframes import KeyFrameFeatures
from humanmm.models.records.shots import ShotList
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act


def keyframes(inputs: StageInputs) -> KeyFrameFeatures:
    act("keyframes", inputs)
    return KeyFrameFeatures(of_shot=((),) * len(inputs.read("shots", ShotList).shots))
