"""Parts of 4:2:0 pictures, seen as RGB."""

import cv2
import numpy as np

from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.regions import Region, transform
from humanmm.models.video.colors import Colors


def _of_rgb(image: np.ndarray, colors: Colors) -> Picture:
    samples = colors.samples(image)
    cb, cr = (cv2.resize(samples[..., k], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for k in (1, 2))
    return Picture((np.ascontiguousarray(samples[..., 0]), cb, cr), colors)


def test_a_crop_of_the_same_scale_returns_the_picture_unshifted_and_in_its_colours() -> None:
    smooth = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8), (0, 0), 4)
    for matrix in (1, 6, 9):
        picture = _of_rgb(smooth, Colors(matrix=matrix))
        difference = np.abs(picture.crop(whole(picture), 64).astype(int) - smooth)
        assert difference[1:-1, 1:-1].max() <= 6  # chroma is half as fine; at the border it mixes with that of black


def test_nothing_of_the_picture_is_black() -> None:
    white = _of_rgb(np.full((64, 64, 3), 255, np.uint8), Colors())
    seen = white.crop(Region(0, 0, 64), 64)
    assert (seen[:30] == 0).all() and (seen[34:, 34:] >= 254).all()


def test_a_bright_pixel_appears_where_the_affine_map_says() -> None:
    image = np.zeros((200, 200, 3), np.uint8)
    image[120, 80] = 255
    region = Region(90.0, 110.0, 64.0, 0.4)
    picture = _of_rgb(image, Colors()).crop(region, 256).astype(float)[..., 0]
    rows, columns = np.nonzero(picture)
    weights = picture[rows, columns]
    found = transform(region.to_source(256), np.array([columns @ weights, rows @ weights]) / weights.sum() + 0.5)
    np.testing.assert_allclose(found, [80.5, 120.5], atol=0.05)  # bilinear footprint sampled at 4 pixels a pixel


def test_paint_covers_what_the_mask_covers_on_a_copy_only() -> None:
    image = np.zeros((48, 64, 3), np.uint8)
    image[...] = (200, 30, 60)
    picture = _of_rgb(image, Colors())
    canvas = picture.copy()
    canvas.paint(16, 8, np.full((20, 24), 255, np.uint8), 127)
    painted, bare = canvas.reduced(1.0).astype(int), picture.reduced(1.0).astype(int)
    assert np.abs(painted[10:26, 18:38] - 127).max() <= 1
    assert np.abs(painted[:, 42:] - (200, 30, 60)).max() <= 2
    assert np.abs(bare - (200, 30, 60)).max() <= 2


def test_a_reduced_picture_has_the_means_of_its_pixels() -> None:
    image = np.random.default_rng(1).integers(0, 255, (40, 60, 1), np.uint8).repeat(3, 2)
    small = _of_rgb(image, Colors()).reduced(0.5).astype(int)
    assert small.shape == (20, 30, 3)
    assert np.abs(small - image.reshape(20, 2, 30, 2, 3).mean(axis=(1, 3))).max() <= 3


REGION = Region(24.0, 16.0, 16.0)


def _dark() -> Picture:
    filmed = _of_rgb(np.full((32, 48, 3), (60, 24, 12), np.uint8), Colors())
    return Picture(filmed.planes, filmed.colors, gain=3.0)


def test_networks_see_a_dark_picture_in_more_light() -> None:
    image = _dark()
    np.testing.assert_allclose(image.crop(REGION, 16)[8, 8], (180, 72, 36), atol=9)
    part = image.part(np.zeros(2), np.array([32.0, 32.0]))[0].copy()
    np.testing.assert_allclose(part.reduced(1.0)[8, 8], (180, 72, 36), atol=9)
    part.paint(0, 0, np.full((16, 16), 255, np.uint8), 120)
    np.testing.assert_allclose(part.reduced(1.0)[8, 8], (120, 120, 120), atol=9)


def test_colours_of_clothes_are_those_that_were_filmed() -> None:
    np.testing.assert_allclose(_dark().as_filmed.crop(REGION, 16)[8, 8], (60, 24, 12), atol=3)
