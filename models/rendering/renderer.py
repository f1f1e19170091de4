"""Renders a clip frame by frame, with what only the pictures show: silhouettes and visible joints.

Each picture is the mean of samples at several instants while the shutter is open and several positions inside the pixel
(the accumulation buffer of Haeberli and Akeley 1990): one sum gives motion blur and smooth edges.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from humanmm.models.body.body24 import Body, load_body
from humanmm.models.body.kinematics import skinning_transforms
from humanmm.models.drawing.surface import dense_weights, load_drawn_mesh, vertex_normals
from humanmm.models.geometry.rotations import nearest_rotation
from humanmm.models.rendering.clothing import WIDTH, atlas_coordinates, random_clothing
from humanmm.models.rendering.panels import draw_background
from humanmm.models.rendering.people import PosedPerson, draw_person
from humanmm.models.rendering.script import Clip, Shot
from humanmm.models.rendering.shadows import draw_person_shadow
from humanmm.models.rendering.view import FIRST_PERSON, Sample, View
from humanmm.models.synthetic.mocap import Actor

Array = np.ndarray

SAMPLES = ((-0.375, -0.125), (-0.125, 0.375), (0.125, -0.375), (0.375, 0.125))
"""Instant (fraction of the shutter's time) and y inside the pixel (x is that of another sample): a rotated grid."""
STATIC_PX = 0.02
"""The background of a camera that moves the picture by less is drawn once."""
VISIBLE_MARGIN_M = 0.25
"""A joint is hidden if something is this far in front of it: joints lie inside the body."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One rendered picture."""

    image: UInt8[Array, "h w 3"]
    masks: Bool[Array, "people h w"]
    """Visible silhouettes: most of the samples show the person."""
    joint_seen: Bool[Array, "people 24"]
    """In the picture, and neither another person nor a block is in front of it."""


class ClothedActor:
    """One actor's clothed mesh over a clip."""

    def __init__(
        self,
        actor: Actor,
        body: Body,
        rng: np.random.Generator,
        *,
        mesh: Literal["full", "drawn"] = "full",
        loose: float = 1.0,
    ) -> None:
        clothing = random_clothing(body, rng)
        kept, faces = np.arange(len(body.v_template)), body.faces
        if mesh == "drawn":
            kept, faces = load_drawn_mesh().vertices, load_drawn_mesh().faces
        rest = body.rest_vertices(actor.betas)
        normals = vertex_normals(body, rest)
        self._normals = normals[kept]
        self._rest = (rest + loose * clothing.displacement_m[:, None] * normals)[kept]
        self._weights = dense_weights(body, kept)
        self._transforms = skinning_transforms(body.rest_joints(actor.betas), actor.joints, actor.R_world_joint)
        template = body.v_template.astype(np.float64)[kept]
        corners = template[faces]
        atlas_px = atlas_coordinates(template)[faces]
        backward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] < 0
        atlas_px[backward, :, 0] += WIDTH
        self._faces, self._atlas_px, self._atlas = faces, atlas_px.astype(np.float32), clothing.atlas
        self._kept: dict[int, tuple[Array, Array]] = {}

    def at(self, frame: float) -> PosedPerson:
        """The mesh between two frames (linear)."""
        last = len(self._transforms) - 1
        first = int(np.clip(np.floor(frame), 0, last))
        fraction = np.float32(np.clip(frame, 0, last) - first)
        pairs = zip(self._posed(first), self._posed(min(first + 1, last)), strict=True)
        vertices, normals = ((1 - fraction) * a + fraction * b for a, b in pairs)
        return PosedPerson(vertices, normals, self._faces, self._atlas_px, self._atlas)

    def _posed(self, frame: int) -> tuple[Array, Array]:
        if frame not in self._kept:
            self._kept = {k: v for k, v in self._kept.items() if abs(k - frame) <= 1}
            T = (self._weights @ self._transforms[frame].reshape(24, 12).astype(np.float32)).reshape(-1, 3, 4)
            vertices, normals = (np.matmul(T[..., :3], v[..., None])[..., 0] for v in (self._rest, self._normals))
            self._kept[frame] = (vertices + T[..., 3], normals)
        return self._kept[frame]


def render_frames(clip: Clip) -> Iterator[Frame]:
    """All frames of a clip, in order."""
    body = load_body()
    actors = [
        ClothedActor(actor, body, np.random.default_rng((*clip.texture_seed, number)), mesh=clip.mesh, loose=clip.loose)
        for number, actor in enumerate(clip.actors)
    ]
    rng = np.random.default_rng((*clip.plan.seed, 2))
    grain = rng.normal(0, clip.noise, (4, clip.height + 64, clip.width + 64, 3)).round().astype(np.int16)
    backgrounds = [_Background(clip, shot) for shot in clip.shots]
    own = clip.shot_index()
    for frame in range(clip.num_frames):
        shown = [number for number, shot in enumerate(clip.shots) if shot.start <= frame < shot.end]
        pictures = [_expose(clip, backgrounds[number], actors, frame) for number in shown]
        image, masks, seen = pictures[shown.index(own[frame])]
        if len(pictures) == 2:
            change = clip.changes[shown[0]]
            fraction = (frame - change.start + 1) / (change.end - change.start + 1)
            image = (1 - fraction) * pictures[0][0] + fraction * pictures[1][0]
        tile = grain[int(rng.integers(4))]
        y, x = (int(v) for v in rng.integers(0, 64, 2))
        noisy = image + tile[y : y + clip.height, x : x + clip.width]
        yield Frame(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), masks, seen)


class _Background:
    """The background scene as one shot shows it."""

    def __init__(self, clip: Clip, shot: Shot) -> None:
        self.clip, self.shot = clip, shot
        moved = np.ptp(shot.t_world_cam, axis=0).max() + np.ptp(shot.R_world_cam, axis=0).max()
        self._is_static = moved * shot.focal_px.max() < STATIC_PX and np.ptp(shot.focal_px) == 0
        self._kept: dict[tuple[int, int], Sample] = {}

    def view(self, frame: int, number: int) -> View:
        """The camera at one sample of a frame."""
        shot, row = self.shot, frame - self.shot.start
        instant = SAMPLES[number][0] * self.clip.shutter
        other = int(np.clip(row + np.sign(instant), 0, len(shot.t_world_cam) - 1))
        fraction = abs(instant) if other != row else 0.0
        t = (1 - fraction) * shot.t_world_cam[row] + fraction * shot.t_world_cam[other]
        R = nearest_rotation((1 - fraction) * shot.R_world_cam[row] + fraction * shot.R_world_cam[other])
        K = self.clip.K(shot, frame).copy()
        K[0, 0] = K[1, 1] = (1 - fraction) * shot.focal_px[row] + fraction * shot.focal_px[other]
        K[:2, 2] += SAMPLES[(number + 2) % 4][0], SAMPLES[number][1]
        return View(R, t, K, self.clip.width, self.clip.height)

    def sample(self, frame: int, number: int) -> Sample:
        """The scene without people: drawn once for a static camera, else for every second sample."""
        key = (0, number) if self._is_static else (frame, number // 2)
        if key not in self._kept:
            self._kept = {k: v for k, v in self._kept.items() if k[0] == key[0]}
            self._kept[key] = draw_background(self.view(frame, number), self.clip.scene)
        return self._kept[key].copy()


def _expose(
    clip: Clip, background: _Background, actors: list[ClothedActor], frame: int
) -> tuple[Float[Array, "h w 3"], Bool[Array, "people h w"], Bool[Array, "people 24"]]:
    """The mean of all samples of one frame, the silhouettes, and which joints are visible."""
    total = np.zeros((clip.height, clip.width, 3), np.float32)
    counts = np.zeros((len(actors), clip.height, clip.width), np.uint8)
    coarse = load_drawn_mesh()
    shadow_faces = coarse.faces if clip.mesh == "drawn" else coarse.vertices[coarse.faces]
    seen = np.zeros((len(actors), 24), bool)
    for number in range(len(SAMPLES)):
        view = background.view(frame, number)
        sample = background.sample(frame, number)
        shot = background.shot  # a motion goes on over a cut, but its blur does not
        instant = float(np.clip(frame + SAMPLES[number][0] * clip.shutter, shot.start, shot.end - 1))
        people = [actor.at(instant) for actor in actors]
        for person in people:
            draw_person_shadow(sample, view, person.vertices, shadow_faces, clip.scene)
        for index, person in enumerate(people):
            draw_person(sample, view, person, clip.scene.light, FIRST_PERSON + index)
        cv2.accumulate(sample.image, total)
        for index in range(len(actors)):
            counts[index] += sample.owner == FIRST_PERSON + index
        if number == 1:
            seen = _visible_joints(clip, sample, view, frame)
    total *= (background.shot.gain / len(SAMPLES)).astype(np.float32)
    return total, counts * 2 >= len(SAMPLES), seen


def _visible_joints(clip: Clip, sample: Sample, view: View, frame: int) -> Bool[Array, "people 24"]:
    joints = np.stack([actor.joints[frame] for actor in clip.actors])
    in_camera = view.to_camera(joints)
    depth = in_camera[..., 2]
    pixels = view.project(np.where(depth[..., None] > 0.1, in_camera, [0, 0, 1.0]))
    inside = (pixels >= 0).all(-1) & (pixels < [clip.width, clip.height]).all(-1) & (depth > 0.1)
    x, y = (np.clip(pixels[..., k].astype(int), 0, side - 1) for k, side in ((0, clip.width), (1, clip.height)))
    front, owner = sample.inverse_depth[y, x], sample.owner[y, x]
    own = owner == FIRST_PERSON + np.arange(len(joints))[:, None]
    hidden = front > 1 / np.maximum(depth - VISIBLE_MARGIN_M, 0.1)
    return np.asarray(inside & (own | ~hidden))
