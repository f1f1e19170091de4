"""The two networks: a known person, no person, mirror images, threads."""

import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path

import numpy as np

from humanmm.models.perception.networks import InterpreterPool, detect, locate
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.records import landmarks
from humanmm.models.video.frames import planar_frames
from humanmm.models.video.reading import read_facts
from humanmm.models.weights.shipped import read_weights

EXAMPLES = Path(__file__).parents[3] / "examples" / "pose2sim_multishot"
CLIP = EXAMPLES / "pose2sim_A_01-02-01.mp4"
FRAME = 36


@lru_cache(maxsize=1)
def first_picture() -> Picture:
    with CLIP.open("rb") as stream:
        frame = next(planar_frames(stream, read_facts(stream), FRAME, FRAME + 1))
        return Picture(frame.planes, frame.colors)


def test_the_detected_person_is_the_one_that_an_independent_detector_sees() -> None:
    with np.load(EXAMPLES / "pose2sim_A_01-02-01_gt.npz") as truth:
        names = [str(name) for name in truth["joint_names"]]
        openpose = truth["openpose2d"][FRAME]
    hips = openpose[[names.index("LHip"), names.index("RHip")], :2].mean(axis=0)
    height = np.ptp(openpose[openpose[:, 2] > 0.3, 1])
    region = detect(first_picture(), whole(first_picture()))[0].region
    assert np.hypot(region.x - hips[0], region.y - hips[1]) < 0.1 * height
    assert 0.9 * height < region.side < 2 * height


def test_the_mirror_image_of_a_crop_gives_the_same_person_with_the_sides_named_alike() -> None:
    image = first_picture()
    region = detect(image, whole(image))[0].region
    region = locate(image, region).next_region
    plain, mirrored = locate(image, region), locate(image, region, mirrored=True)
    limbs = list(landmarks.LIMBS)
    distance = np.linalg.norm(plain.keypoints[limbs, :2] - mirrored.keypoints[limbs, :2], axis=1)
    assert np.median(distance) < 0.03 * region.side


def test_interpreters_may_be_built_in_two_threads_and_give_equal_answers_and_leave_standard_error_alone() -> None:
    pool = InterpreterPool(read_weights("pose_detection.tflite"), threads=1)
    tensor = np.random.default_rng(0).random((1, 224, 224, 3), np.float32)

    def scores(_: int) -> np.ndarray:
        with pool.lend() as interpreter:
            interpreter.set_tensor(interpreter.get_input_details()[0]["index"], tensor)
            interpreter.invoke()
            return np.asarray(interpreter.get_tensor(interpreter.get_output_details()[0]["index"]))

    before = os.fstat(2)
    with ThreadPoolExecutor(2) as threads:
        one, two = threads.map(scores, range(2))
    np.testing.assert_array_equal(one, two)
    assert (os.fstat(2).st_ino, os.fstat(2).st_dev) == (before.st_ino, before.st_dev)
