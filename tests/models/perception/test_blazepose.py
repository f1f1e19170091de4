"""What the landmark networks return, decoded to the source: by hand, in a rotated region, and in a mirror."""

import numpy as np
import pytest

from humanmm.models.perception import blazepose
from humanmm.models.perception.blazepose import LANDMARK_SIDE, crop_of, decode
from humanmm.models.perception.interfaces import Landmarks
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.records import landmarks
from humanmm.models.records.tracks import MASK_SIDE

LEFT_WRIST, RIGHT_WRIST = 15, 16


class Network:
    """All points in the middle of the crop but the right wrist; hip centre in the middle, the circle 100 px around."""

    def run(self, crop: np.ndarray, names: tuple[str, ...]) -> list[np.ndarray]:
        assert crop.shape == (1, LANDMARK_SIDE, LANDMARK_SIDE, 3) and crop.dtype == np.float32 and crop.max() <= 1
        points = np.zeros((39, 5), np.float32)
        points[:, :2] = LANDMARK_SIDE / 2
        points[RIGHT_WRIST, :4] = 64, 128, 0, 100  # certainly seen
        points[34, 1] = LANDMARK_SIDE / 2 - 100
        world = np.zeros((39, 3), np.float32)
        world[RIGHT_WRIST] = -0.5, 0, 0.1
        mask = np.full((1, 256, 256, 1), -50, np.float32)
        mask[:, :, :128] = 50  # the left half of what the network sees
        return [points.reshape(1, -1), np.array([[0.75]], np.float32), mask, world.reshape(1, -1)]


@pytest.fixture(autouse=True)
def _network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blazepose, "network", lambda model: Network())


def located(region: Region, *, mirrored: bool = False) -> Landmarks:
    crop = np.zeros((LANDMARK_SIDE, LANDMARK_SIDE, 3), np.uint8)
    return decode(blazepose.FULL, crop, region, mirrored=mirrored)


def test_points_of_the_crop_are_points_of_its_region() -> None:
    found = located(Region(500.0, 300.0, 512.0))
    np.testing.assert_allclose(found.keypoints[RIGHT_WRIST], [500 - 2 * 64, 300, 1])
    np.testing.assert_allclose(found.keypoints[LEFT_WRIST], [500, 300, 0.5])  # logit 0
    np.testing.assert_allclose(found.landmarks3d[RIGHT_WRIST], [-0.5, 0, 0.1], atol=1e-6)
    assert found.presence == 0.75 and found.mask.shape == (MASK_SIDE, MASK_SIDE)
    assert (found.mask[:, : MASK_SIDE // 2] == 255).all() and (found.mask[:, MASK_SIDE // 2 :] == 0).all()
    assert (found.next_region.x, found.next_region.y, found.next_region.angle) == (500, 300, 0)
    assert found.next_region.side == pytest.approx(2 * 200 * 1.25)  # the circle in source pixels, and the margin


def test_a_rotated_region_rotates_its_points_and_the_axes_of_the_landmarks() -> None:
    found = located(Region(500.0, 300.0, 512.0, np.pi / 2))  # its up is the picture's right
    np.testing.assert_allclose(found.keypoints[RIGHT_WRIST, :2], [500, 300 - 2 * 64], atol=1e-9)
    np.testing.assert_allclose(found.landmarks3d[RIGHT_WRIST], [0, -0.5, 0.1], atol=1e-6)


def test_a_mirrored_crop_names_left_and_right_as_the_picture_shows_them() -> None:
    found = located(Region(500.0, 300.0, 512.0), mirrored=True)
    np.testing.assert_allclose(found.keypoints[LEFT_WRIST], [500 + 2 * 64, 300, 1])
    np.testing.assert_allclose(found.landmarks3d[LEFT_WRIST], [0.5, 0, 0.1], atol=1e-6)
    assert (found.mask[:, : MASK_SIDE // 2] == 0).all() and (found.mask[:, MASK_SIDE // 2 :] == 255).all()
    assert found.keypoints.shape == (landmarks.NUM_LANDMARKS, 3)


def test_a_mirrored_crop_is_the_crop_from_right_to_left() -> None:
    random = np.random.default_rng(0)
    image = Picture(tuple(random.integers(16, 236, size).astype(np.uint8) for size in ((80, 120), (40, 60), (40, 60))))
    region = Region(60.0, 40.0, 70.0, 0.3)
    plain, mirrored = (crop_of(image, region, mirrored=side) for side in (False, True))
    np.testing.assert_array_equal(mirrored, plain[:, ::-1])
