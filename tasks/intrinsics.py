"""Stage `intrinsics`: one focal length for all shots."""

from humanmm.models.camera.intrinsics import ShotPoints, estimate_intrinsics, given_intrinsics
from humanmm.models.camera.masking import without_transitions
from humanmm.models.camera.shot_points import within
from humanmm.models.records.camera import Intrinsics, PointTracks
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.inputs import StageInputs


def intrinsics(inputs: StageInputs) -> Intrinsics:
    """The user's focal length, or what the background tells, or the default."""
    facts = inputs.read("decode", VideoFacts)
    settings = inputs.config.intrinsics
    given = given_intrinsics(facts.width, facts.height, focal_px=settings.focal_px, fov_deg=settings.fov_deg)
    if given is not None:
        return given
    shots = inputs.read("shots", ShotList).shots
    scenes = inputs.read_all("people", ScenePeople)
    tracks = inputs.read_all("points", PointTracks)
    usable = [
        ShotPoints(without_transitions(within(points, shot.start, shot.end), shot.outside_transitions), scene.tracks)
        for shot in shots
        if (points := tracks[shot.scene]) is not None and (scene := scenes[shot.scene]) is not None
    ]
    return estimate_intrinsics(usable, facts.width, facts.height)
