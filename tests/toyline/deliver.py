"""A recording and a picture that is none."""

import numpy as np

from humanmm.models.motion.assemble import assemble
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.recording import Delivery
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act


def deliver(inputs: StageInputs) -> Delivery:
    act("deliver", inputs)
    facts, shots = inputs.read("decode", VideoFacts), inputs.read("shots", ShotList)
    motion = inputs.read("refine", WorldMotion)
    joints = {0: np.repeat(motion.people[0].pelvis_world[:, None], 24, 1).astype(np.float32)}
    recording = assemble(
        facts, shots, inputs.read_all("people", ScenePeople), motion, rest_pelvis={0: np.zeros(3)}, joints_world=joints
    )
    (inputs.blob_dir / "overlay.mp4").write_bytes(bytes(str(inputs.config.deliver.overlay_max_side_px), "ascii"))
    return Delivery(recording, ("overlay.mp4",))
