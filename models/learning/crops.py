"""Pictures of one person's crop, rendered at the size that the pose networks look at: a tenth of a whole frame's cost.

A crop is a picture of its own camera: it has the frame's position, its optical axis rolled by the region's angle, and
a principal point off its centre.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from humanmm.models.body.body24 import Body
from humanmm.models.geometry.intrinsics import K_from_focal
from humanmm.models.geometry.rotations import rotvec_to_rotmat
from humanmm.models.perception.blazepose import LANDMARK_SIDE
from humanmm.models.perception.regions import Region, invert, transform
from humanmm.models.rendering.background_scene import BackgroundScene
from humanmm.models.rendering.panels import draw_background
from humanmm.models.rendering.people import draw_person
from humanmm.models.rendering.renderer import ClothedActor
from humanmm.models.rendering.script import Shot
from humanmm.models.rendering.shadows import draw_person_shadow
from humanmm.models.rendering.view import FIRST_PERSON, Sample, View
from humanmm.models.synthetic.mocap import Actor

Array = np.ndarray

SMALLEST_PX = 48
"""A person far away is drawn with so many pixels at least."""


@dataclass(frozen=True)
class Degradation:
    """What a cheap camera and a low bit rate do to a picture."""

    shutter: float
    """Fraction of a frame's time in which the shutter is open."""
    noise: float
    """Standard deviation of the grain, grey levels."""
    quality: int
    """Of JPEG, which stands for the video's compression; 100 for none."""

    @classmethod
    def random(cls, rng: np.random.Generator) -> "Degradation":
        """From clean to bad."""
        quality = 100 if rng.random() < 0.3 else int(rng.integers(15, 90))
        return cls(float(rng.uniform(0.0, 0.9)), float(rng.uniform(0.0, 6.0)), quality)

    def applied(self, image: UInt8[Array, "h w 3"], rng: np.random.Generator) -> UInt8[Array, "h w 3"]:
        """The picture with grain, compressed."""
        noisy = image + rng.normal(0, self.noise, image.shape)
        image = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
        if self.quality == 100:
            return image
        _, packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self.quality])
        return np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR))


@dataclass(frozen=True, eq=False)
class CropRenderer:
    """One shot of one or more people, the first of whom is looked at. Frames of a take and a shot begin at 0."""

    actors: tuple[Actor, ...]
    body: Body
    shot: Shot
    scene: BackgroundScene
    size: tuple[int, int]
    """Width and height of the whole picture."""
    degradation: Degradation
    seed: tuple[int, ...]

    @cached_property
    def _clothed(self) -> list[ClothedActor]:
        return [
            ClothedActor(actor, self.body, np.random.default_rng((*self.seed, number)), mesh="drawn")
            for number, actor in enumerate(self.actors)
        ]

    def intrinsics(self, frame: int) -> Float[Array, "3 3"]:
        """Of the whole picture."""
        return K_from_focal(float(self.shot.focal_px[frame]), *self.size)

    def crop(self, frame: int, region: Region, rng: np.random.Generator) -> UInt8[Array, "256 256 3"]:
        """What the networks are shown of a region of a frame; black outside the picture."""
        side = int(np.clip(round(region.side), SMALLEST_PX, LANDMARK_SIDE))
        shot, K = self.shot, self.intrinsics(frame)
        view = crop_view(shot.R_world_cam[frame], shot.t_world_cam[frame], K, region, side)
        background = draw_background(view, self.scene)
        total = np.zeros((side, side, 3), np.float32)
        for instant in (-0.25, 0.25):
            total += self._drawn(frame + instant * self.degradation.shutter, view, background.copy())
        total *= (self.shot.gain / 2).astype(np.float32)
        image = self.degradation.applied(np.clip(total, 0, 255).astype(np.uint8), rng)
        image = cv2.copyTo(image, self._inside(region, side))
        return cv2.resize(image, (LANDMARK_SIDE, LANDMARK_SIDE), interpolation=cv2.INTER_LINEAR)

    def _drawn(self, instant: float, view: View, sample: Sample) -> UInt8[Array, "side side 3"]:
        """Everybody at an instant, in units of frames, before the background."""
        people = [clothed.at(instant) for clothed in self._clothed]
        for person in people:
            draw_person_shadow(sample, view, person.vertices, person.faces, self.scene)
        for number, person in enumerate(people):
            draw_person(sample, view, person, self.scene.light, FIRST_PERSON + number)
        return sample.image

    def _inside(self, region: Region, side: int) -> UInt8[Array, "side side"]:
        """255 where the crop shows the picture, 0 beyond its edges."""
        width, height = self.size
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], float)
        polygon = transform(invert(region.to_source(side)), corners) - 0.5
        mask = np.zeros((side, side), np.uint8)
        cv2.fillConvexPoly(mask, np.rint(np.clip(polygon, -9999, 9999) * 16).astype(np.int32), 255, shift=4)
        return mask


def crop_view(
    R_world_cam: Float[Array, "3 3"], t_world_cam: Float[Array, "3"], K: Float[Array, "3 3"], region: Region, side: int
) -> View:
    """The camera whose picture of side × side pixels is the region of the picture of another one (square pixels)."""
    R = R_world_cam @ rotvec_to_rotmat(np.array([0.0, 0.0, region.angle]))
    scale = side / region.side
    centre = transform(invert(region.to_source(side)), K[:2, 2][None])[0]
    own = np.array([[K[0, 0] * scale, 0, centre[0]], [0, K[1, 1] * scale, centre[1]], [0, 0, 1.0]])
    return View(R, t_world_cam, own, side, side)
