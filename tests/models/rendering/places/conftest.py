"""A small library of takes, and the first clips of a set, planned."""

from pathlib import Path

import numpy as np
import pytest

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
def edits(library: Library) -> list[Edit]:
    """Six clips with one to three cuts."""
    return [
        plan_edit(library, ClipPlan(f"c{k}", (5, k), (3.0, 4.0), (192, 108), (1, 3)), split="dev") for k in range(6)
    ]
