"""Stage `align`: all shots in one world."""

from humanmm.models.camera.links import without_people
from humanmm.models.camera.observations import Intrinsics, PointTracks, ShotCamera
from humanmm.models.camera.parts import within
from humanmm.models.camera.views import ViewFeatures
from humanmm.models.motion.results import ShotMotion, WorldMotion
from humanmm.models.motion.world import Footage, assemble
from humanmm.models.perception.tracks import ScenePeople
from humanmm.models.shots.boundaries import Shot, ShotList
from humanmm.models.video.facts import VideoFacts
from humanmm.tasks.inputs import StageInputs


def align(inputs: StageInputs) -> WorldMotion:
    """People and cameras of every shot, turned, levelled and placed in one world."""
    shots = inputs.read("shots", ShotList)
    scenes = inputs.read_all("people", ScenePeople)
    points = inputs.read_all("points", PointTracks)
    footage = Footage(
        shots=shots,
        scenes=scenes,
        cameras=inputs.read_all("camera", ShotCamera),
        motions=inputs.read_all("hmr", ShotMotion),
        time_s=inputs.read("decode", VideoFacts).time_s,
        intrinsics=inputs.read("intrinsics", Intrinsics),
        views=[_background(shot, points[shot.scene], scenes[shot.scene]) for shot in shots.shots],
    )
    return assemble(footage, method=inputs.config.align.method)


def _background(shot: Shot, points: PointTracks | None, scene: ScenePeople | None) -> list[ViewFeatures]:
    """A shot's key views outside transitions, features on people left out; nothing where its scene failed."""
    if points is None or scene is None:
        return []
    first, end = shot.clear
    views = within(points, shot.start, shot.end).views
    return [without_people(view, scene.tracks) for view in views if first <= view.frame < end]
