"""One frame of the shipped clip, and where an independent detector (OpenPose) saw the person in it."""

from pathlib import Path

import numpy as np
import pytest

from humanmm.models.perception.picture import Picture
from humanmm.models.video.frames import planar_frames
from humanmm.models.video.reading import read_facts

CLIP = Path(__file__).parents[3] / "examples/pose2sim_multishot/pose2sim_A_01-02-01.mp4"
FRAME = 36
LIMBS = [
    f"{side}{joint}" for joint in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle") for side in ("L", "R")
]  # in the order of landmarks.LIMBS


@pytest.fixture(scope="package")
def clip_picture() -> Picture:
    with CLIP.open("rb") as stream:
        frame = next(planar_frames(stream, read_facts(stream), FRAME, FRAME + 1))
        return Picture(frame.planes, frame.colors)


@pytest.fixture(scope="package")
def openpose_limbs() -> np.ndarray:
    """(12, 3) x, y, score."""
    with np.load(CLIP.with_name(f"{CLIP.stem}_gt.npz")) as truth:
        names = [str(name) for name in truth["joint_names"]]
        return np.asarray(truth["openpose2d"][FRAME][[names.index(name) for name in LIMBS]])
