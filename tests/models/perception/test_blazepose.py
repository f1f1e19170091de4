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

NOSE, LEFT_WRIST, RIGHT_WRIST, LEFT_ANKLE, RIGHT_ANKLE = 0, 15, 16, 27, 28


class Network:
    """All points in the middle of the crop but the right wrist; hip centre in the middle, the circle 100 px around.

    Heat maps are cold but for those of both ankles and the nose.
    """

    def __init__(self) -> None:
        self.heat = np.full((1, 64, 64, 39), -50, np.float32)
        self.heat[0, 33, 30:33, RIGHT_ANKLE] = 0, 50, 0  # in cells 30 to 32 of row 33: 0.5, 1 and 0.5
        self.heat[0, 40, 40, LEFT_ANKLE] = 50  # not near
        self.heat[0, 31, 31, NOSE] = -1  # hardly warm

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
        outputs = {
            "Identity": points.reshape(1, -1), "Identity_1": np.array([[0.75]], np.float32), "Identity_2": mask,
            "Identity_3": self.heat, "Identity_4": world.reshape(1, -1),
        }  # fmt: skip
        return [outputs[name] for name in names]


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


def test_a_landmark_is_in_the_middle_of_what_its_heat_map_shows_near_it_and_as_sure_as_that_is_warm() -> None:
    found = located(Region(128.0, 128.0, 256.0))
    np.testing.assert_allclose(found.keypoints[RIGHT_ANKLE, :2], [4 * 31, 4 * 33], atol=1e-6)
    np.testing.assert_allclose(found.keypoints[[NOSE, LEFT_ANKLE], :2], 128)
    sigma = found.keypoint_sigma
    assert sigma is not None and 0.25 < sigma[RIGHT_ANKLE] < 1
    assert sigma[RIGHT_ANKLE] < sigma[NOSE] < sigma[LEFT_ANKLE] == sigma[RIGHT_WRIST]
    mirrored = located(Region(128.0, 128.0, 256.0), mirrored=True)
    np.testing.assert_allclose(mirrored.keypoints[LEFT_ANKLE, :2], [256 - 4 * 31, 4 * 33], atol=1e-6)
    assert mirrored.keypoint_sigma is not None and mirrored.keypoint_sigma[LEFT_ANKLE] == sigma[RIGHT_ANKLE]


@pytest.mark.parametrize("corner", [-9.0, 0.0, 255.9, 300.0])
def test_a_landmark_beside_the_crop_stays_where_it_is(corner: float) -> None:
    heat = np.zeros((64, 64, 39), np.float32)
    points, peaks = blazepose._refined(np.full((33, 2), corner), heat)
    inside = 0 <= corner < 256
    assert (peaks > 0.4).all() == inside
    np.testing.assert_allclose(points, points[0, 0])
    assert abs(points[0, 0] - corner) < 10 if inside else points[0, 0] == corner


def test_a_mirrored_crop_is_the_crop_from_right_to_left() -> None:
    random = np.random.default_rng(0)
    image = Picture(tuple(random.integers(16, 236, size).astype(np.uint8) for size in ((80, 120), (40, 60), (40, 60))))
    region = Region(60.0, 40.0, 70.0, 0.3)
    plain, mirrored = (crop_of(image, region, mirrored=side) for side in (False, True))
    np.testing.assert_array_equal(mirrored, plain[:, ::-1])
