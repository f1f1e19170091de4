"""Paints a clip frame by frame, and tells the truth about it.

Each picture is the mean of samples at several instants while the shutter is open and several places inside the pixel
(the accumulation buffer of Haeberli and Akeley 1990): one sum gives motion blur and smooth edges.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from humanmm.models.body.body24 import Body, load_body
from humanmm.models.body.kinematics import skinning_transforms
from humanmm.models.drawing.surface import dense_weights, load_drawn_mesh, vertex_normals
from humanmm.models.geometry.rotations import nearest_rotation
from humanmm.models.rendering.clothing import WIDTH, doll_coordinates, dress
from humanmm.models.rendering.rasteriser import (
    FIRST_PERSON,
    PosedSkin,
    Sample,
    View,
    paint_person,
    paint_set,
    paint_shadow,
)
from humanmm.models.rendering.script import Clip, Shot
from humanmm.models.synthetic.mocap import Actor

Array = np.ndarray

SAMPLES = ((-0.375, -0.125), (-0.125, 0.375), (0.125, -0.375), (0.375, 0.125))
"""Instant (share of the shutter's time) and place (x is that of another sample) of each: a rotated grid."""
STANDING_PX = 0.02
"""A camera that moves the picture by less is painted once."""
VISIBLE_MARGIN_M = 0.25
"""A joint is hidden if something stands this far before it: joints lie inside the body."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One finished picture with what can only be known by painting it."""

    image: UInt8[Array, "h w 3"]
    masks: Bool[Array, "people h w"]
    """Visible silhouettes: most of the samples show the person."""
    joint_seen: Bool[Array, "people 24"]
    """In the picture, and neither another person nor a thing of the set stands before it."""


class Wearer:
    """One person's dressed skin over a clip."""

    def __init__(self, actor: Actor, body: Body, rng: np.random.Generator) -> None:
        outfit = dress(body, rng)
        rest = body.rest_vertices(actor.betas)
        normals = vertex_normals(body, rest)
        self._rest = rest + outfit.stand_off_m[:, None] * normals
        self._normals = normals
        self._weights = dense_weights(body, np.arange(len(rest)))
        self._transforms = skinning_transforms(body.rest_joints(actor.betas), actor.joints, actor.R_world_joint)
        template = body.v_template.astype(np.float64)
        doll_px = doll_coordinates(template)[body.faces]
        corners = template[body.faces]
        backward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] < 0
        doll_px[backward, :, 0] += WIDTH
        self._faces, self._doll_px, self._doll = body.faces, doll_px.astype(np.float32), outfit.doll
        self._kept: dict[int, tuple[Array, Array]] = {}

    def at(self, frame: float) -> PosedSkin:
        """The skin between two frames (linear)."""
        last = len(self._transforms) - 1
        first = int(np.clip(np.floor(frame), 0, last))
        share = np.float32(np.clip(frame, 0, last) - first)
        one, other = self._posed(first), self._posed(min(first + 1, last))
        vertices, normals = ((1 - share) * a + share * b for a, b in zip(one, other, strict=True))
        return PosedSkin(vertices, normals, self._faces, self._doll_px, self._doll)

    def _posed(self, frame: int) -> tuple[Array, Array]:
        if frame not in self._kept:
            self._kept = {k: v for k, v in self._kept.items() if abs(k - frame) <= 1}
            T = (self._weights @ self._transforms[frame].reshape(24, 12).astype(np.float32)).reshape(-1, 3, 4)
            rotated = (np.matmul(T[..., :3], v[..., None])[..., 0] for v in (self._rest, self._normals))
            vertices, normals = rotated
            self._kept[frame] = (vertices + T[..., 3], normals)
        return self._kept[frame]


def film_clip(clip: Clip) -> Iterator[Frame]:
    """All frames of a clip, in order."""
    body = load_body()
    wearers = [
        Wearer(actor, body, np.random.default_rng((*clip.texture_seed, number)))
        for number, actor in enumerate(clip.actors)
    ]
    rng = np.random.default_rng((*clip.plan.seed, 2))
    grain = rng.normal(0, clip.noise, (4, clip.height + 64, clip.width + 64, 3)).round().astype(np.int16)
    sets = [_Set(clip, shot) for shot in clip.shots]
    own = clip.shot_index()
    for frame in range(clip.num_frames):
        pictures = [
            (number, *_expose(clip, sets[number], wearers, frame))
            for number, shot in enumerate(clip.shots)
            if shot.start <= frame < shot.end
        ]
        _, image, masks, seen = next(one for one in pictures if one[0] == own[frame])
        if len(pictures) == 2:
            change = clip.changes[pictures[0][0]]
            share = (frame - change.start + 1) / (change.end - change.start + 1)
            image = (1 - share) * pictures[0][1] + share * pictures[1][1]
        tile = grain[int(rng.integers(4))]
        y, x = (int(v) for v in rng.integers(0, 64, 2))
        noisy = image + tile[y : y + clip.height, x : x + clip.width]
        yield Frame(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), masks, seen)


class _Set:
    """The set as one shot sees it; painted once where the camera stands."""

    def __init__(self, clip: Clip, shot: Shot) -> None:
        self.clip, self.shot = clip, shot
        moved = np.ptp(shot.t_world_cam, axis=0).max() + np.ptp(shot.R_world_cam, axis=0).max()
        self.stands = moved * shot.focal_px.max() < STANDING_PX and np.ptp(shot.focal_px) == 0
        self._kept: dict[tuple[int, int], Sample] = {}

    def view(self, frame: int, number: int) -> View:
        """The camera at one sample of a frame."""
        shot, row = self.shot, frame - self.shot.start
        instant = SAMPLES[number][0] * self.clip.shutter
        other = int(np.clip(row + np.sign(instant), 0, len(shot.t_world_cam) - 1))
        share = abs(instant) if other != row else 0.0
        t = (1 - share) * shot.t_world_cam[row] + share * shot.t_world_cam[other]
        R = nearest_rotation((1 - share) * shot.R_world_cam[row] + share * shot.R_world_cam[other])
        K = self.clip.K(shot, frame).copy()
        f = (1 - share) * shot.focal_px[row] + share * shot.focal_px[other]
        K[0, 0] = K[1, 1] = f
        K[:2, 2] += SAMPLES[(number + 2) % 4][0], SAMPLES[number][1]
        return View(R, t, K, self.clip.width, self.clip.height)

    def empty(self, frame: int, number: int) -> Sample:
        """The set without people: painted once for a standing camera, else for every second sample."""
        key = (0, number) if self.stands else (frame, number // 2)
        if key not in self._kept:
            self._kept = {k: v for k, v in self._kept.items() if k[0] == key[0]}
            self._kept[key] = paint_set(self.view(frame, number), self.clip.scenery)
        return self._kept[key].copy()


def _expose(
    clip: Clip, stage: _Set, wearers: list[Wearer], frame: int
) -> tuple[Float[Array, "h w 3"], Bool[Array, "people h w"], Bool[Array, "people 24"]]:
    total = np.zeros((clip.height, clip.width, 3), np.float32)
    counts = np.zeros((len(wearers), clip.height, clip.width), np.uint8)
    coarse = load_drawn_mesh()
    shadow_faces = coarse.vertices[coarse.faces]
    seen = np.zeros((len(wearers), 24), bool)
    for number in range(len(SAMPLES)):
        view = stage.view(frame, number)
        sample = stage.empty(frame, number)
        skins = [wearer.at(frame + SAMPLES[number][0] * clip.shutter) for wearer in wearers]
        for skin in skins:
            paint_shadow(sample, view, skin, shadow_faces, clip.scenery)
        for person, skin in enumerate(skins):
            paint_person(sample, view, skin, clip.scenery, FIRST_PERSON + person)
        cv2.accumulate(sample.image, total)
        for person in range(len(wearers)):
            counts[person] += sample.owner == FIRST_PERSON + person
        if number == 1:
            seen = _joints_seen(clip, sample, view, frame)
    total *= (stage.shot.gain / len(SAMPLES)).astype(np.float32)
    return total, counts * 2 >= len(SAMPLES), seen


def _joints_seen(clip: Clip, sample: Sample, view: View, frame: int) -> Bool[Array, "people 24"]:
    joints = np.stack([actor.joints[frame] for actor in clip.actors])
    in_camera = view.see(joints)
    depth = in_camera[..., 2]
    pixels = view.project(np.where(depth[..., None] > 0.1, in_camera, [0, 0, 1.0]))
    inside = (pixels >= 0).all(-1) & (pixels < [clip.width, clip.height]).all(-1) & (depth > 0.1)
    x, y = (np.clip(pixels[..., k].astype(int), 0, side - 1) for k, side in ((0, clip.width), (1, clip.height)))
    front, owner = sample.inverse_depth[y, x], sample.owner[y, x]
    own = owner == FIRST_PERSON + np.arange(len(joints))[:, None]
    before = front > 1 / np.maximum(depth - VISIBLE_MARGIN_M, 0.1)
    return np.asarray(inside & (own | ~before))
