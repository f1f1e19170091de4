"""Facts from the text file."""

import json

import numpy as np

from humanmm.models.records.video import VideoFacts
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act


def decode(inputs: StageInputs) -> VideoFacts:
    act("decode", inputs)
    with inputs.open_video() as file:
        num_frames = json.load(file)["num_frames"]
    size = inputs.config.decode.max_side_px
    return VideoFacts(size, 480, np.arange(num_frames) / 25, np.ones(num_frames, bool), 0, "toy", "json", ("a toy",))
