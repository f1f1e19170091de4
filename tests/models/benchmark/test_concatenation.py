"""The paper's baseline: shots laid one after the other."""

import numpy as np

from humanmm.models.benchmark.methods import MethodMotion
from humanmm.models.synthetic.multishot import BenchVideo


def test_concat_goes_on_where_the_shot_before_ended(video: BenchVideo, motion_of: dict[str, MethodMotion]) -> None:
    motion = motion_of["concat"].motion
    assert motion is not None
    person = motion.people[0]
    for cut in video.truth.cut_frames:
        step = person.pelvis_world[cut - person.frame[0]] - person.pelvis_world[cut - 1 - person.frame[0]]
        assert np.linalg.norm(step) < 1e-6
