"""Stage `people`: keypoints, 3D landmarks, masks and tracks of everybody in one scene."""

from dataclasses import replace
from functools import lru_cache, partial

from humanmm.config import GivenFile, LiftingConfig
from humanmm.errors import InputError
from humanmm.models.perception.interfaces import Lifter, Networks
from humanmm.models.perception.tracking.given_bodies import people_of_bodies
from humanmm.models.perception.tracking.keypoint_tracks import people_of_keypoints
from humanmm.models.perception.tracking.people import track_people
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.opened import Video
from humanmm.parts import load
from humanmm.storage.readers.given.bodies import read_bodies
from humanmm.storage.readers.given.keypoints import read_keypoints
from humanmm.storage.readers.given.regions import read_detections, read_masks
from humanmm.tasks.inputs import StageInputs


def people(inputs: StageInputs) -> ScenePeople:
    """The tracks of all people in the scene's frames; what the user brought along takes the place of what finds it."""
    settings = inputs.config.people
    facts = inputs.read("decode", VideoFacts)
    video = facts.num_frames, facts.sizes
    if settings.keypoints_from is not None:
        keypoints = read_keypoints(settings.keypoints_from, *video)
        lift_keypoints = load("lifting.keypoints", inputs.config.lifting.keypoints)
        return people_of_keypoints(keypoints, facts, inputs.span, max_people=settings.max_people, lifter=lift_keypoints)
    if settings.hmr_from is not None:
        bodies = read_bodies(settings.hmr_from, *video)
        return people_of_bodies(bodies, facts, inputs.span, max_people=settings.max_people)
    given = None
    if settings.detections_from is not None:
        given = read_detections(settings.detections_from, *video)
    elif settings.masks_from is not None:
        given = read_masks(settings.masks_from, *video)
    if given is not None and settings.trust_numbers:
        given = replace(given, lasting=True)
    networks = Networks(load("people.detector", settings.detector), load("people.pose", settings.pose))
    with inputs.open_video() as stream:
        return track_people(
            Video(stream, facts),
            inputs.span,
            max_people=settings.max_people,
            max_side_px=settings.max_side_px,
            max_rate_hz=settings.looks_hz,
            networks=networks,
            lifter=lifter_of(inputs.config.lifting),
            given=given,
            hands=settings.hands,
            progress=inputs.progress,
        )


def lifter_of(settings: LiftingConfig) -> Lifter:
    """The lifter that the settings name, with the network that they give."""
    if settings.weights is not None:
        return _transformer_with(settings.weights)
    lifter: Lifter = load("lifting.method", settings.method)
    return lifter


@lru_cache(maxsize=1)
def _transformer_with(weights: GivenFile) -> Lifter:
    from humanmm.models.perception.lifting.lift import lift  # only now: torch takes two seconds to import
    from humanmm.models.perception.lifting.network import LifterNetwork
    from humanmm.storage.training.networks import network_of

    contents = list(weights.read().values())
    if len(contents) != 1:
        raise InputError(f"{weights.path} is a folder; expected the file that `humanmm train lifter` wrote")
    return partial(lift, network=network_of(contents[0], weights.path, LifterNetwork.shaped_as))
