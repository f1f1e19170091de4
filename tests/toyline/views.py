"""No views: nothing to see."""

from humanmm.models.camera.keyframes import KeyViews
from humanmm.models.records.shots import ShotList
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act


def views(inputs: StageInputs) -> KeyViews:
    act("views", inputs)
    return KeyViews(of_shot=((),) * len(inputs.read("shots", ShotList).shots))
