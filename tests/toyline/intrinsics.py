"""A focal length."""

from humanmm.models.records.camera import Intrinsics
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act


def intrinsics(inputs: StageInputs) -> Intrinsics:
    act("intrinsics", inputs)
    facts = inputs.read("decode", VideoFacts)
    return Intrinsics(inputs.config.intrinsics.focal_px or 1000.0, facts.width, facts.height, "default", 0.2)
