"""Stage `align`: all shots in one world."""

from humanmm.errors import NoUsablePersonError
from humanmm.models.camera.background.keyframes import KeyFrameFeatures
from humanmm.models.motion.world.align import ShotResults
from humanmm.models.motion.world.align import align as align_shots
from humanmm.models.records.camera import Intrinsics, ShotCamera
from humanmm.models.records.motion import ShotMotion, WorldMotion
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.parts import load
from humanmm.tasks.inputs import StageInputs


def align(inputs: StageInputs) -> WorldMotion:
    """People and cameras of every shot, rotated, levelled and placed in one world."""
    shots = inputs.read("shots", ShotList)
    if not shots.people:
        raise NoUsablePersonError(
            "no usable person: nobody's motion can be recovered; `humanmm camera` gives the cameras"
        )
    seen = inputs.read("keyframes", KeyFrameFeatures)
    results = ShotResults(
        shots=shots,
        scenes=inputs.read_all("people", ScenePeople),
        cameras=inputs.read_all("camera", ShotCamera),
        motions=inputs.read_all("hmr", ShotMotion),
        time_s=inputs.read("decode", VideoFacts).time_s,
        intrinsics=inputs.read("intrinsics", Intrinsics),
        key_frames=seen.of_shot,
        ground=seen.ground,
        pictures=seen.pictures,
    )
    return align_shots(results, method=load("align.method", inputs.config.align.method), progress=inputs.progress)
