"""Every second cut is found by colour."""

import json

from humanmm.models.records.shots import Scenes, Transition
from humanmm.models.records.video import VideoFacts
from humanmm.models.shot_detection.corrected_cuts import corrected_scenes
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act


def scenes(inputs: StageInputs) -> Scenes:
    act("scenes", inputs)
    with inputs.open_video() as file:
        cuts = json.load(file)["cuts"][::2]
    num_frames = inputs.read("decode", VideoFacts).num_frames
    found = Scenes(num_frames, tuple(Transition("cut", cut, cut, "scene") for cut in cuts))
    return corrected_scenes(found, inputs.corrections)
