"""Stage `align`: all shots in one world."""

from humanmm.models.camera.keyframes import KeyViews
from humanmm.models.motion.world.align import Footage, assemble
from humanmm.models.records.camera import Intrinsics, ShotCamera
from humanmm.models.records.motion import ShotMotion, WorldMotion
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
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
