"""One small clip with two people, planned and rendered once for all tests."""

from dataclasses import replace
from pathlib import Path

import pytest

from humanmm.models.rendering.renderer import Frame, render_frames
from humanmm.models.rendering.script import Clip, ClipPlan, plan_clip
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.storage.readers.mocap_pack import read_pack

PACK = Path(__file__).parents[3] / "data" / "mocap" / "cmu_val.npz"
PLAN = ClipPlan("small", (3, 11), seconds=(2.0, 2.0), size=(256, 144), transitions=(1, 1))


@pytest.fixture(scope="session")
def sequences() -> tuple[MocapSequence, ...]:
    return read_pack(PACK)


@pytest.fixture(scope="session")
def clip(sequences: tuple[MocapSequence, ...]) -> Clip:
    """The first plan with two people."""
    for seed in range(100):
        clip = plan_clip(sequences, replace(PLAN, seed=(3, seed)))
        if len(clip.actors) == 2 and clip.changes[0].type == "cut":
            return clip
    raise AssertionError("no plan has two people")


@pytest.fixture(scope="session")
def rendered(clip: Clip) -> dict[int, Frame]:
    """Frames 0, 2, 4."""
    return {number: frame for number, frame in zip(range(5), render_frames(clip), strict=False) if number % 2 == 0}
