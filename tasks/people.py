"""Stage `people`: keypoints, 3D landmarks, masks and tracks of everybody in one scene."""

from humanmm.models.perception.interfaces import Networks
from humanmm.models.perception.tracking.keypoint_tracks import people_of_keypoints
from humanmm.models.perception.tracking.people import track_people
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.opened import Video
from humanmm.parts import load
from humanmm.storage.readers.keypoints import read_keypoints
from humanmm.tasks.inputs import StageInputs


def people(inputs: StageInputs) -> ScenePeople:
    """The tracks of all people in the scene's frames."""
    settings = inputs.config.people
    facts = inputs.read("decode", VideoFacts)
    if settings.keypoints_from is not None:
        keypoints = read_keypoints(settings.keypoints_from, facts.num_frames, (facts.width, facts.height))
        lift_keypoints = load("lifting.keypoints", inputs.config.lifting.keypoints)
        return people_of_keypoints(keypoints, facts, inputs.span, max_people=settings.max_people, lifter=lift_keypoints)
    networks = Networks(load("people.detector", settings.detector), load("people.pose", settings.pose))
    with inputs.open_video() as stream:
        return track_people(
            Video(stream, facts),
            inputs.span,
            max_people=settings.max_people,
            max_side_px=settings.max_side_px,
            networks=networks,
            lifter=load("lifting.method", inputs.config.lifting.method),
            progress=inputs.progress,
        )
