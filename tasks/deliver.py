"""Stage `deliver`: the recording as it is handed out, the overlay video and the top view."""

from humanmm.models.body.body24 import load_body
from humanmm.models.drawing.overlay import marks_of
from humanmm.models.drawing.top_view import top_view
from humanmm.models.motion.assemble import assemble, world_joints
from humanmm.models.records.motion import WorldMotion
from humanmm.models.records.recording import Delivery, Recording
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.storage.run_folder.picture_files import write_png
from humanmm.tasks.inputs import StageInputs
from humanmm.tasks.pictures import OVERLAY, TOP_VIEW, write_overlay


def deliver(inputs: StageInputs) -> Delivery:
    """Everything that the run folder shows of the motion."""
    facts = inputs.read("decode", VideoFacts)
    shot_list = inputs.read("shots", ShotList)
    recording = _recording(inputs, facts, shot_list)
    with inputs.open_video() as stream:
        write_overlay(
            inputs.blob_dir / OVERLAY,
            stream,
            facts,
            recording,
            marks_of(shot_list),
            settings=inputs.config.deliver,
            progress=inputs.progress,
        )
    write_png(inputs.blob_dir / TOP_VIEW, top_view(recording))
    return Delivery(recording, (OVERLAY, TOP_VIEW))


def _recording(inputs: StageInputs, facts: VideoFacts, shot_list: ShotList) -> Recording:
    motion = inputs.read("refine", WorldMotion)
    scenes = inputs.read_all("people", ScenePeople)
    body = load_body()
    rest = {person.person: body.rest_joints(person.betas) for person in motion.people}
    joints = {person.person: world_joints(person, rest[person.person]) for person in motion.people}
    pelvis = {number: joints_at_rest[0] for number, joints_at_rest in rest.items()}
    return assemble(facts, shot_list, scenes, motion, rest_pelvis=pelvis, joints_world=joints)
