"""A small library of takes, and the first clips of a set, planned."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from grey_clothing import grey_clothing

from humanmm.models.rendering import renderer
from humanmm.models.rendering.places.plan import Edit, plan_edit
from humanmm.models.rendering.places.takes import Library
from humanmm.models.rendering.script import ClipPlan
from humanmm.models.synthetic.mocap import Actor, pose_actor
from humanmm.storage.readers.mocap_pack import read_pack

PACK = Path(__file__).parents[4] / "data" / "mocap" / "cmu_val.npz"


@pytest.fixture(scope="session")
def library() -> Library:
    return Library(read_pack(PACK))


@pytest.fixture(scope="session")
def actor(library: Library) -> Actor:
    return pose_actor(library.takes[0].cropped(0, 20), np.random.default_rng(0))


@pytest.fixture(scope="session")
def planned(library: Library) -> Callable[[int], Edit]:
    """Plans clip k of a set, with one to three cuts; whoever is on its walls wears grey, which is drawn quickly."""

    def plan(number: int) -> Edit:
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(renderer, "random_clothing", grey_clothing)
            clip = ClipPlan(f"c{number}", (5, number), (3.0, 4.0), (192, 108), (1, 3))
            return plan_edit(library, clip, split="dev")

    return plan


@pytest.fixture(scope="session")
def edits(planned: Callable[[int], Edit]) -> list[Edit]:
    """The first six clips."""
    return [planned(number) for number in range(6)]
