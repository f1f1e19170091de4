"""A picture of a person moves with its wall, a person does not."""

import cv2
import numpy as np
import pytest

from humanmm.models.perception.observation import Observation
from humanmm.models.perception.own_motion import LOST, look, of_track, own_motion
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region

SIZE = 400
REGION = Region(200.0, 200.0, 240.0)
"""A standing person of 150 pixels."""


def texture(seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).uniform(0, 255, (SIZE, SIZE)).astype(np.float32)
    return cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 2.0), None, 20, 235, cv2.NORM_MINMAX)


BODY = np.zeros((SIZE, SIZE), np.uint8)
cv2.ellipse(BODY, (200, 200), (32, 72), 0, 0, 360, 1, -1)


def scene(moved_px: float, view: np.ndarray | None = None, noise: float = 2.0, seed: int = 0) -> Picture:
    """Somebody before a wall, moved to the right; then the camera's homography."""
    shift = np.array([[1.0, 0.0, moved_px], [0.0, 1.0, 0.0]])
    person, mask = (cv2.warpAffine(image, shift, (SIZE, SIZE)) for image in (texture(1), BODY.astype(np.float32)))
    gray = texture(2) * (1 - mask) + person * mask
    if view is not None:
        gray = cv2.warpPerspective(gray, view, (SIZE, SIZE), flags=cv2.INTER_CUBIC)
    gray = gray + np.random.default_rng(seed).normal(0, noise, gray.shape)
    chroma = np.full((SIZE // 2, SIZE // 2), 128, np.uint8)
    return Picture((np.clip(gray, 0, 255).astype(np.uint8), chroma, chroma.copy()))


def seen(region: Region = REGION) -> Observation:
    """The observation whose mask is BODY, seen in a region."""
    mask = cv2.warpAffine(
        BODY, region.to_source(128), (128, 128), flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    )  # fmt: skip
    keypoints = np.zeros((33, 3))
    return Observation(keypoints, keypoints, np.array([168.0, 128, 232, 272]), 0.9, mask, region, region)


CAMERA = np.array([[1.03, 0.02, 6.0], [-0.02, 1.02, -4.0], [2e-5, -3e-5, 1.0]])


@pytest.mark.parametrize("view", [None, CAMERA])
def test_a_picture_moves_with_its_wall_however_the_camera_moves(view: np.ndarray | None) -> None:
    moved = own_motion(look(scene(0.0), seen()), look(scene(0.0, view, seed=1), seen()))
    assert moved is not None
    assert moved < 0.5


@pytest.mark.parametrize("view", [None, CAMERA])
def test_somebody_who_sways_by_a_fiftieth_of_his_height_is_alive(view: np.ndarray | None) -> None:
    moved = own_motion(look(scene(0.0), seen()), look(scene(3.0, view, seed=1), seen()))
    assert moved is not None
    assert moved > 3


def test_a_region_that_jumps_is_not_own_motion() -> None:
    elsewhere = Region(206.0, 195.0, 250.0)
    moved = own_motion(look(scene(0.0), seen()), look(scene(0.0, seed=1), seen(elsewhere)))
    assert moved is not None
    assert moved < 0.5


def test_who_leaves_the_picture_says_nothing() -> None:
    away = np.array([[1.0, 0.0, -200.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    region = Region(0.0, 200.0, 240.0)
    assert own_motion(look(scene(0.0), seen()), look(scene(0.0, away, seed=1), seen(region))) is None


def test_somebody_who_turns_into_another_before_a_wall_that_stays_has_moved() -> None:
    other = scene(0.0)
    gray = other.planes[0]
    gray[BODY > 0] = texture(3)[BODY > 0].astype(np.uint8)
    moved = own_motion(look(scene(0.0), seen()), look(other, seen()))
    assert moved is not None
    assert moved > LOST / 0.01


def test_nothing_is_known_without_texture() -> None:
    flat = Picture((np.full((SIZE, SIZE), 90, np.uint8), *(np.full((200, 200), 128, np.uint8) for _ in range(2))))
    assert own_motion(look(flat, seen()), look(flat, seen())) is None


def test_one_comparison_that_failed_does_not_make_a_picture_alive() -> None:
    assert of_track([0.2, 0.3, 30.0]) == 0.3
    assert of_track([]) is None
