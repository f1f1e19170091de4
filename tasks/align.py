"""Stage `align`: all shots in one world."""

from humanmm.models.camera.observations import Intrinsics, ShotCamera
from humanmm.models.camera.views import KeyViews
from humanmm.models.motion.results import ShotMotion, WorldMotion
from humanmm.models.motion.world import Footage, assemble
from humanmm.models.perception.tracks import ScenePeople
from humanmm.models.shots.boundaries import ShotList
from humanmm.models.video.facts import VideoFacts
from humanmm.tasks.inputs import StageInputs


def align(inputs: StageInputs) -> WorldMotion:
    """People and cameras of every shot, turned, levelled and placed in one world."""
    footage = Footage(
        shots=inputs.read("shots", ShotList),
        scenes=inputs.read_all("people", ScenePeople),
        cameras=inputs.read_all("camera", ShotCamera),
        motions=inputs.read_all("hmr", ShotMotion),
        time_s=inputs.read("decode", VideoFacts).time_s,
        intrinsics=inputs.read("intrinsics", Intrinsics),
        views=inputs.read("views", KeyViews).of_shot,
    )
    return assemble(footage, method=inputs.config.align.method)
