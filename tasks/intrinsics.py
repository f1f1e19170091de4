"""Stage `intrinsics`: one focal length for all shots."""

from humanmm.models.camera.intrinsics import default_intrinsics, given_intrinsics
from humanmm.models.camera.observations import Intrinsics
from humanmm.models.video.facts import VideoFacts
from humanmm.tasks.inputs import StageInputs


def intrinsics(inputs: StageInputs) -> Intrinsics:
    """The user's focal length, or the default."""
    facts = inputs.read("decode", VideoFacts)
    settings = inputs.config.intrinsics
    given = given_intrinsics(facts.width, facts.height, focal_px=settings.focal_px, fov_deg=settings.fov_deg)
    return given or default_intrinsics(facts.width, facts.height)
