"""Binary models of COLMAP: what is damaged is told; points are skipped."""

import struct

import pytest

from humanmm.errors import InputError
from humanmm.storage.readers.given.colmap import ColmapModel, colmap_model

CAMERAS = struct.pack("<QiiQQ4d", 1, 5, 1, 640, 360, 500, 510, 320, 180)
IMAGES = struct.pack("<Qi7di", 1, 9, 1, 0, 0, 0, 0.1, 0.2, 0.3, 5) + b"frames/00003.png\0" + struct.pack("<Q", 2)
POINTS = struct.pack("<ddqddq", 1, 2, -1, 3, 4, 7)


def _model(cameras: bytes = CAMERAS, images: bytes = IMAGES + POINTS) -> ColmapModel:
    return colmap_model({"cameras.bin": cameras, "images.bin": images})


def test_a_binary_model_is_read_as_it_is_laid_out() -> None:
    model = _model()
    (camera,), (image,) = model.cameras, model.images
    assert (camera.number, camera.width, camera.height, camera.num_focals) == (5, 640, 360, 2)
    assert camera.parameters == (500, 510, 320, 180)
    assert (image.name, image.camera, image.quat_wxyz) == ("frames/00003.png", 5, (1, 0, 0, 0))
    assert image.t_cam_world == (0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    ("cameras", "images", "told"),
    [
        (CAMERAS[:-3], IMAGES + POINTS, "cameras.bin ends in the middle"),
        (CAMERAS, IMAGES + POINTS[:-1], "images.bin ends in the middle"),
        (CAMERAS, IMAGES[:-12], "images.bin ends in the middle"),
        (b"", IMAGES + POINTS, "cameras.bin ends in the middle"),
        (struct.pack("<QiiQQ4d", 1, 5, 8, 640, 360, 1, 1, 1, 1), IMAGES + POINTS, "camera 5 of cameras.bin has lens"),
        (struct.pack("<QiiQQ4d", 1, 5, 1, 640, 360, -1, 1, 1, 1), IMAGES + POINTS, "focal lengths above zero"),
        (CAMERAS, struct.pack("<Qi7di", 1, 9, float("nan"), *[0.0] * 6, 5) + b"a\0", "not finite"),
    ],
)
def test_what_is_damaged_is_told(cameras: bytes, images: bytes, told: str) -> None:
    with pytest.raises(InputError) as caught:
        _model(cameras, images)
    assert told in str(caught.value)
