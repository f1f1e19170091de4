"""Stage `intrinsics`: one focal length for all shots."""

from humanmm.corrections import Focal
from humanmm.models.camera.background.keyframes import KeyFrameFeatures
from humanmm.models.camera.focal_length.intrinsics import estimate_intrinsics
from humanmm.models.records.camera import Intrinsics, PointTracks
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.storage.readers.given.cameras import read_cameras
from humanmm.tasks.inputs import StageInputs


def intrinsics(inputs: StageInputs) -> Intrinsics:
    """The user's focal length, or the background's estimate, or the default."""
    settings = inputs.config.intrinsics
    corrected_px = next((one.px for one in inputs.corrections.of(Focal)), None)
    facts = inputs.read("decode", VideoFacts)
    return estimate_intrinsics(
        facts,
        inputs.read("shots", ShotList),
        inputs.read_all("people", ScenePeople),
        inputs.read_all("points", PointTracks),
        inputs.read("keyframes", KeyFrameFeatures),
        focal_px=settings.focal_px if corrected_px is None else corrected_px,
        fov_deg=settings.fov_deg,
        cameras=read_cameras(settings.cameras_from, facts) if settings.cameras_from else None,
        progress=inputs.progress,
    )
