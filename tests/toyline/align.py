"""All shots in one world; what is missing stands still."""

import numpy as np

from humanmm.models.records.camera import ShotCamera
from humanmm.models.records.motion import CutAlignment, PersonMotion, ShotMotion, WorldMotion
from humanmm.models.records.shots import ShotList
from humanmm.tasks.inputs import StageInputs
from toyline.behaviour import act, filled


def align(inputs: StageInputs) -> WorldMotion:
    act("align", inputs)
    shots = inputs.read("shots", ShotList)
    cameras = inputs.read_all("camera", ShotCamera)
    motions = inputs.read_all("hmr", ShotMotion)
    F = shots.num_frames
    source, t, K = np.full(F, 4, np.uint8), np.zeros((F, 3)), np.tile(np.eye(3), (F, 1, 1))
    pelvis, observed = np.zeros((F, 3)), np.zeros(F, bool)
    for camera, motion in zip(cameras, motions, strict=True):
        if camera is not None and motion is not None:
            here = slice(camera.start, camera.end)
            source[here], t[here], K[here], observed[here] = 0, camera.t_shot_cam, camera.K, True
            pelvis[here] = motion.people[0].pelvis_cam
    eye = np.tile(np.eye(3), (F, 1, 1))
    person = filled(
        PersonMotion, F, person=0, frame=np.arange(F, dtype=np.int32), observed=observed, R_world_root=eye,
        body_pose=np.zeros((F, 23, 3)), betas=np.zeros(10), pelvis_world=pelvis, contacts=np.zeros((F, 4), np.float32),
    )  # fmt: skip
    cuts = tuple(
        filled(CutAlignment, 1, cut_frame=shot.start, method="bundle", linked=True) for shot in shots.shots[1:]
    )
    return filled(
        WorldMotion, F, R_world_cam=eye, t_world_cam=t, K=K, camera_source=source, people=(person,), cuts=cuts
    )
