"""Hard cuts in pans at irregular times: a long time between frames moves the picture far, and is no cut."""

import cv2
import numpy as np
from places import Place, marbled

from humanmm.models.shot_detection.scenes import find_scenes

STEPS_S = np.full(60, 0.03)
STEPS_S[[20, 38]] = 1.0  # a recorder that stalls
TIME_S = np.cumsum(STEPS_S)
MEAN_RATE_TIME_S = np.arange(60) * STEPS_S.mean()
SPEED_PX_S = 15.0


def pan(jump_px: float = 0.0) -> list[np.ndarray]:
    """The camera turns steadily, and looks elsewhere in the same place from frame 50 on."""
    offsets = SPEED_PX_S * (TIME_S - TIME_S[0]) + jump_px * (np.arange(60) >= 50)
    return [marbled(float(offset)) for offset in offsets]


def cuts(pictures: list[np.ndarray], time_s: np.ndarray) -> list[int]:
    return [transition.start for transition in find_scenes(pictures, time_s).transitions]


def test_a_steady_pan_whose_recorder_stalls_is_no_cut() -> None:
    assert cuts(pan(), TIME_S) == []
    assert cuts(pan(), MEAN_RATE_TIME_S) == [20, 38]  # as if the camera had jumped


def test_a_jump_in_that_pan_is_one() -> None:
    assert cuts(pan(jump_px=15.0), TIME_S) == [50]


def test_a_cut_to_another_part_of_the_same_wall_is_found_while_the_camera_pans() -> None:
    """The views overlap, so that a displacement is found, and the pan's own changes hide the size of the cut's."""
    offsets = 3.0 * np.arange(60) + 60.0 * (np.arange(60) >= 30)
    assert cuts([marbled(float(offset)) for offset in offsets], np.arange(60) / 30) == [30]


def test_a_view_that_is_lit_and_moved_at_once_is_a_cut_and_one_that_is_lit_is_none() -> None:
    """Cameras of one room are exposed differently; their views overlap."""
    place, time_s = Place(4), np.arange(60) / 30
    lit = [cv2.add(place.picture(t), (50.0, 50.0, 50.0, 0)) for t in range(30, 60)]
    moved = [cv2.add(place.picture(t, (12, 0)), (50.0, 50.0, 50.0, 0)) for t in range(30, 60)]
    assert cuts(place.still(30) + lit, time_s) == []
    assert cuts(place.still(30) + moved, time_s) == [30]
