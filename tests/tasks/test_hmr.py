"""Stage `hmr`: the body of one shot's people, from what was seen of them in it."""

from typing import Any

import numpy as np
import three_shots
from held_results import inputs_of, scenes_of

from humanmm.models.body.body24 import load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.records.motion import PersonShotMotion, ShotMotion
from humanmm.models.records.video import VideoFacts
from humanmm.tasks.hmr import hmr

SEEN = three_shots.results()


def _joints(motion: PersonShotMotion) -> np.ndarray:
    rest = load_body().rest_joints(motion.betas)
    return forward_kinematics(rest, motion.R_cam_root, motion.body_pose, motion.pelvis_cam)[0]


def _fitted(shot: int, **settings: Any) -> ShotMotion:
    results = {
        "decode": VideoFacts(960, 540, SEEN.time_s, SEEN.time_s == 0, 0, "h264", "mp4"),
        "scenes": scenes_of(SEEN.shots),
        "people": SEEN.scenes,
        "shots": SEEN.shots,
        "camera": SEEN.cameras,
    }
    return hmr(inputs_of("hmr", results, shot, hmr=settings))


def test_the_body_of_a_shot_is_that_which_its_camera_saw_and_the_prior_pulls_at_it_as_the_user_wants() -> None:
    fitted, truth = _fitted(1), SEEN.motions[1]
    assert (fitted.start, fitted.end) == (20, 40) and truth is not None
    exact = _joints(truth.people[0])

    def error_m(motion: ShotMotion) -> float:
        (person,) = motion.people
        np.testing.assert_array_equal(person.frame, np.arange(20, 40))
        return float(np.linalg.norm(_joints(person) - exact, axis=-1).mean())

    assert error_m(fitted) < 0.03
    assert error_m(_fitted(1, pose_prior=10.0)) > 1.5 * error_m(fitted), "it says more than what was seen"
