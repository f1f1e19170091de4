"""A focal length."""

from humanmm.corrections import Focal
from humanmm.models.records.camera import Intrinsics
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act


def intrinsics(inputs: StageInputs) -> Intrinsics:
    act("intrinsics", inputs)
    facts = inputs.read("decode", VideoFacts)
    corrected_px = sum(one.px for one in inputs.corrections.of(Focal))
    return Intrinsics(
        corrected_px or inputs.config.intrinsics.focal_px or 1000.0, facts.width, facts.height, "default", 0.2
    )
