"""A short video with two cuts, and what every method makes of it: computed once for all tests that look at it."""

import pytest

from humanmm.config import Config
from humanmm.models.benchmark.methods import METHODS, MethodMotion, VideoMotions, run_methods
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.models.synthetic.multishot import BenchVideo, build_video, plan_videos

UNKNOWN = "oracle luck"
"""A method that nobody knows."""


@pytest.fixture(scope="session")
def video(sequences: tuple[MocapSequence, ...]) -> BenchVideo:
    plan = plan_videos(sequences, 1, seed=4, transitions=(2,), longest=60)[0]
    return build_video(sequences[plan.sequence], plan)


@pytest.fixture(scope="session")
def motions(video: BenchVideo) -> VideoMotions:
    """What every method makes of it, and one that is unknown."""
    return run_methods(video, Config(), (*METHODS, UNKNOWN))


@pytest.fixture(scope="session")
def motion_of(motions: VideoMotions) -> dict[str, MethodMotion]:
    """The same by the method's name."""
    return {done.method: done for done in motions.motions}
