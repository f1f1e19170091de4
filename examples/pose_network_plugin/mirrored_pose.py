"""A pose network from another package: BlazePose looks at every crop and at its mirror image, and the mean counts.

Its errors on a picture and on the mirror image differ, so the mean is better, at twice the time. A network of your own
gets its input by `image.crop(region, side)`, RGB pixels of the crop, and brings what it finds in them to source pixels
by `transform(region.to_source(side), points)`.
"""

from dataclasses import replace

import numpy as np

from humanmm.models.perception.blazepose import locate_full
from humanmm.models.perception.interfaces import Landmarks
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region


def locate(image: Picture, region: Region, *, mirrored: bool = False) -> Landmarks:
    """Landmarks of the person who fills a region of the picture (a `PoseNetwork` of humanmm)."""
    plain = locate_full(image, region, mirrored=mirrored)
    other = locate_full(image, region, mirrored=not mirrored)
    return replace(
        plain,
        keypoints=(plain.keypoints + other.keypoints) / 2,  # (33, 3): x, y in source pixels, visibility 0..1
        landmarks3d=(plain.landmarks3d + other.landmarks3d) / 2,  # (33, 3): metres about the mid-hip
        presence=min(plain.presence, other.presence),
        mask=np.maximum(plain.mask, other.mask),  # (128, 128) uint8: probability x 255
    )
