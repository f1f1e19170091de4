"""Changes nothing."""

from humanmm.models.records.motion import WorldMotion
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act


def refine(inputs: StageInputs) -> WorldMotion:
    act("refine", inputs)
    return inputs.read("align", WorldMotion)
