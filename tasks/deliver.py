"""Stage `deliver`: the recording as it is handed out, the overlay video and the top view."""

from collections.abc import Iterator

import numpy as np

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.motion.recording import Delivery, Recording, assemble
from humanmm.models.motion.results import WorldMotion
from humanmm.models.perception.tracks import ScenePeople
from humanmm.models.pictures.overlay import Overlay, marks_of
from humanmm.models.pictures.top_view import top_view
from humanmm.models.shots.boundaries import ShotList
from humanmm.models.video.facts import VideoFacts
from humanmm.models.video.frames import frames, scaled_size
from humanmm.storage.picture_files import write_png, write_video
from humanmm.tasks.inputs import StageInputs

OVERLAY = "overlay.mp4"
TOP_VIEW = "top.png"


def deliver(inputs: StageInputs) -> Delivery:
    """Everything that the run folder shows of the motion."""
    facts = inputs.read("decode", VideoFacts)
    shot_list = inputs.read("shots", ShotList)
    recording = _recording(inputs, facts, shot_list)
    width, height = scaled_size(facts, inputs.config.deliver.overlay_max_side_px)
    overlay = Overlay(recording, marks_of(shot_list), width, height)
    pictures = _drawn(inputs, facts, overlay)
    write_video(inputs.blob_dir / OVERLAY, pictures, width=width, height=height, fps=facts.fps)
    write_png(inputs.blob_dir / TOP_VIEW, top_view(recording))
    return Delivery(recording, (OVERLAY, TOP_VIEW))


def _recording(inputs: StageInputs, facts: VideoFacts, shot_list: ShotList) -> Recording:
    motion = inputs.read("refine", WorldMotion)
    body = load_body()
    rest = {person.person: body.rest_joints(person.betas) for person in motion.people}
    joints = {
        person.person: forward_kinematics(
            rest[person.person], person.R_world_root, person.body_pose, person.pelvis_world
        )[0]
        for person in motion.people
    }
    pelvis = {person: joints_at_rest[0] for person, joints_at_rest in rest.items()}
    scenes = inputs.read_all("people", ScenePeople)
    return assemble(facts, shot_list, scenes, motion, rest_pelvis=pelvis, joints_world=joints)


def _drawn(inputs: StageInputs, facts: VideoFacts, overlay: Overlay) -> Iterator[tuple[float, np.ndarray]]:
    """Time and picture of every frame with the people drawn on it, one at a time."""
    with inputs.open_video() as stream:
        for frame in frames(stream, facts, max_side_px=inputs.config.deliver.overlay_max_side_px):
            image = frame.image.copy()
            overlay.draw(image, frame.index)
            inputs.progress(frame.index + 1, facts.num_frames)
            yield frame.time_s, image
