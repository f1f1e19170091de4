"""Rooms and open places: flat panels with textures, built around the people and cameras that must fit in.

A scene has a shell (floor, walls, ceiling or sky: always behind everything else) and blocks (furniture, houses, hedges)
that stand on the floor and may hide people. World: z up, metres, floor at z = 0.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from humanmm.models.rendering import textures
from humanmm.models.rendering.textures import Texture

Array = np.ndarray

SKY_M, SKY_HEIGHT_M = 180.0, 45.0
"""The sky is a box; its sides are as long as the clouds repeat, so that no discontinuity shows in the corners."""


@dataclass(frozen=True, eq=False)
class Panel:
    """A textured rectangle: corner + a·along + b·across, 0 ≤ a ≤ size[0], 0 ≤ b ≤ size[1]."""

    corner: Float[Array, "3"]
    along: Float[Array, "3"]
    """Unit vector to the texture's right."""
    across: Float[Array, "3"]
    """Unit vector down the texture."""
    size: tuple[float, float]
    """Metres."""
    texture: Texture
    light: float
    """What the texture's colours are multiplied with."""
    is_floor: bool = False

    def faces(self, eye: Float[Array, "3"]) -> bool:
        """Whether it is seen from its front."""
        return bool(self._normal @ (eye - self.corner) < 0)

    @cached_property
    def _normal(self) -> Float[Array, "3"]:
        return np.cross(self.along, self.across)

    @property
    def corners(self) -> Float[Array, "4 3"]:
        a, b = self.along * self.size[0], self.across * self.size[1]
        return np.stack([self.corner, self.corner + a, self.corner + a + b, self.corner + b])


@dataclass(frozen=True, eq=False)
class Block:
    """An upright box on the floor."""

    centre: Float[Array, "2"]
    half: Float[Array, "2"]
    height: float
    yaw: float
    panels: tuple[Panel, ...]

    @property
    def reach(self) -> float:
        return float(np.hypot(*self.half))

    def hides(self, eye: Float[Array, "n 3"], target: Float[Array, "n 3"]) -> Bool[Array, " n"]:
        """Whether the block stands between each eye and its target (slabs: Kay and Kajiya 1986)."""
        R = np.eye(3)
        R[:2, :2] = rotation_2d(self.yaw)
        middle = np.append(self.centre, self.height / 2)
        start, end = (eye - middle) @ R, (target - middle) @ R
        ray = np.where(np.abs(end - start) < 1e-9, 1e-9, end - start)
        half = np.append(self.half, self.height / 2)
        one, other = (-half - start) / ray, (half - start) / ray
        enter, leave = np.minimum(one, other).max(axis=1), np.maximum(one, other).min(axis=1)
        return np.asarray((enter < leave) & (leave > 0) & (enter < 1))

    @property
    def top_corners(self) -> Float[Array, "4 3"]:
        R = rotation_2d(self.yaw)
        ground = self.centre + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * self.half @ R.T
        return np.concatenate([ground, np.full((4, 1), self.height)], axis=1)


@dataclass(frozen=True, eq=False)
class Light:
    """One far lamp (or the sun) and the light from all sides."""

    direction: Float[Array, "3"]
    """Unit vector from the scene to the lamp."""
    lamp: float
    ambient: float

    @property
    def shadow(self) -> float:
        """Fraction of the floor's light that a shadow takes away."""
        return float(self.lamp * self.direction[2] / self.on(np.array([0.0, 0.0, 1.0])))

    def on(self, normal: Float[Array, "*n 3"]) -> Float[Array, "*n"]:
        """Light on a surface with this normal."""
        sky = 0.75 + 0.25 * normal[..., 2]
        return np.asarray(self.ambient * sky + self.lamp * np.maximum(normal @ self.direction, 0.0))


@dataclass(frozen=True, eq=False)
class BackgroundScene:
    """What stands and lies around the people, and its light."""

    kind: str
    shell: tuple[Panel, ...]
    blocks: tuple[Block, ...]
    light: Light
    cutouts: tuple[Panel, ...] = ()
    """Upright panels that may hide people but cast no shadow: figures of a crowd, signs."""


def build_room(keep_in: Float[Array, "n 3"], paths: Float[Array, "m 2"], rng: np.random.Generator) -> BackgroundScene:
    """A furnished room that holds the points `keep_in`; nothing stands on the `paths` of people and cameras."""
    yaw, light = rng.uniform(0, 2 * np.pi), random_lamp(rng, ambient=(0.55, 0.75), lamp=(0.25, 0.5), elevation=(58, 80))
    low, high = box_about(keep_in, yaw, margin=rng.uniform(0.8, 2.0))
    height = max(2.7, float(keep_in[:, 2].max()) + 0.5)
    wall, floor = pick(textures.WALLS, rng), pick(textures.FLOORS, rng)
    shell = [
        floor_panel(low, high, yaw, floor, light),
        ceiling_panel(low, high, yaw, height, textures.plaster(rng), light),
    ]
    for side in range(4):
        own = wall if rng.random() < 0.7 else pick(textures.WALLS, rng)
        panel = wall_panel(low, high, yaw, side, height, own, light)
        shell.append(panel)
        shell += _hangings(panel, rng)
    blocks: list[Block] = []
    for _ in range(int(rng.integers(5, 11))):
        half = rng.uniform([0.2, 0.15], [0.9, 0.4])
        add_block(
            blocks, half, rng.uniform(0.4, 2.0), (low, high, yaw), paths, 0.7, pick(textures.SURFACES, rng), light, rng
        )
    return BackgroundScene("room", tuple(shell), tuple(blocks), light)


def build_outdoors(
    keep_in: Float[Array, "n 3"], paths: Float[Array, "m 2"], rng: np.random.Generator
) -> BackgroundScene:
    """A square or a meadow between houses and hedges under the sky."""
    yaw, light = rng.uniform(0, 2 * np.pi), random_lamp(rng, ambient=(0.5, 0.65), lamp=(0.45, 0.65), elevation=(38, 68))
    low, high = box_about(keep_in, yaw, margin=0.0)
    middle = (low + high) / 2
    low, high = middle - SKY_M / 2, middle + SKY_M / 2
    near_low, near_high = box_about(keep_in, yaw, margin=12.0)
    clouds = textures.sky(rng)
    shell = []
    for side in range(4):
        panel = wall_panel(low, high, yaw, side, SKY_HEIGHT_M, clouds, light)
        stretched = Texture(clouds.image, clouds.image.shape[0] / SKY_HEIGHT_M)
        shell.append(Panel(panel.corner, panel.along, panel.across, panel.size, stretched, 1.0))
    zenith = Texture(np.ascontiguousarray(np.repeat(clouds.image[:2], 128, axis=0)), 2.0)
    shell.append(ceiling_panel(low, high, yaw, SKY_HEIGHT_M, zenith, light))
    shell.append(floor_panel(low, high, yaw, pick(textures.GROUNDS, rng), light))
    blocks: list[Block] = []
    for _ in range(int(rng.integers(4, 8))):  # houses
        half = rng.uniform([3.0, 2.5], [7.0, 4.0])
        wide = (near_low - 10, near_high + 10, yaw)
        add_block(blocks, half, 3.2 * int(rng.integers(2, 6)), wide, paths, 6.0, textures.facade(rng), light, rng)
    for _ in range(int(rng.integers(4, 10))):  # hedges, walls, crates
        half, height = rng.uniform([0.3, 0.2], [2.0, 0.5]), rng.uniform(0.5, 2.2)
        texture = textures.foliage(rng) if rng.random() < 0.4 else pick(textures.SURFACES, rng)
        add_block(blocks, half, height, (near_low, near_high, yaw), paths, 1.0, texture, light, rng)
    return BackgroundScene("outdoors", tuple(shell), tuple(blocks), light)


def random_lamp(
    rng: np.random.Generator, *, ambient: tuple[float, float], lamp: tuple[float, float], elevation: tuple[float, float]
) -> Light:
    """A lamp or the sun somewhere at these elevations, degrees, with strengths in these ranges."""
    up, azimuth = np.deg2rad(rng.uniform(*elevation)), rng.uniform(0, 2 * np.pi)
    direction = np.array([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)])
    strength = rng.uniform(*lamp)
    return Light(direction, strength, rng.uniform(*ambient))


def pick(kinds: tuple, rng: np.random.Generator) -> Texture:  # type: ignore[type-arg]
    """A texture of one of these kinds."""
    texture: Texture = kinds[int(rng.integers(len(kinds)))](rng)
    return texture


def rotation_2d(yaw: float) -> Float[Array, "2 2"]:
    """Counter-clockwise seen from above."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]])


def box_about(points: Float[Array, "n 3"], yaw: float, *, margin: float) -> tuple[Array, Array]:
    """Lowest and highest x, y of the points in axes rotated by `yaw`."""
    own = points[:, :2] @ rotation_2d(yaw)
    return own.min(axis=0) - margin, own.max(axis=0) + margin


def _world(yaw: float, x: float, y: float, z: float) -> Float[Array, "3"]:
    return np.append(rotation_2d(yaw) @ [x, y], z)


def floor_panel(low: Array, high: Array, yaw: float, texture: Texture, light: Light) -> Panel:
    """A rectangle on the floor, in axes rotated by `yaw`."""
    size = (float(high[0] - low[0]), float(high[1] - low[1]))
    up = np.array([0.0, 0.0, 1.0])
    along, across = _world(yaw, 1, 0, 0), _world(yaw, 0, 1, 0)
    return Panel(_world(yaw, low[0], low[1], 0.0), along, across, size, texture, float(light.on(up)), is_floor=True)


def ceiling_panel(low: Array, high: Array, yaw: float, height: float, texture: Texture, light: Light) -> Panel:
    """The rectangle above the floor."""
    floor = floor_panel(low, high, yaw, texture, light)
    return Panel(floor.corner + np.array([0, 0, height]), floor.along, floor.across, floor.size, texture, 1.0)


def wall_panel(low: Array, high: Array, yaw: float, side: int, height: float, texture: Texture, light: Light) -> Panel:
    """Wall number `side` of the box, seen from inside; the texture's top is the wall's."""
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    first, second = corners[side], corners[(side + 1) % 4]
    start, end = _world(yaw, *first, height), _world(yaw, *second, height)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    inwards = np.array([-along[1], along[0], 0.0])
    return Panel(start, along, np.array([0.0, 0.0, -1.0]), (length, height), texture, float(light.on(inwards)))


def _hangings(wall: Panel, rng: np.random.Generator) -> list[Panel]:
    """Posters and windows on a wall, side by side."""
    hangings = []
    at = rng.uniform(0.2, 1.0)
    while at + 1.0 < wall.size[0]:
        side = rng.uniform(0.5, 1.3)
        top = rng.uniform(0.3, max(0.35, wall.size[1] - side - 0.9))
        if at + side < wall.size[0] and rng.random() < 0.7:
            picture = textures.poster(rng)
            texture = Texture(picture.image, picture.px_per_m / side)
            corner = wall.corner + wall.along * at + wall.across * top
            hangings.append(Panel(corner, wall.along, wall.across, (side, side), texture, wall.light * 1.05))
        at += side + rng.uniform(0.3, 1.6)
    return hangings


def add_block(
    blocks: list[Block],
    half: Array,
    height: float,
    area: tuple[Array, Array, float],
    paths: Float[Array, "m 2"],
    clear_m: float,
    texture: Texture,
    light: Light,
    rng: np.random.Generator,
) -> None:
    """Try to add a block that stands clear of the paths and of other blocks; none is added where there is no room."""
    low, high, yaw_of_area = area
    reach = float(np.hypot(*half))
    for _ in range(30):
        centre = rotation_2d(yaw_of_area) @ rng.uniform(low, high)
        free = np.linalg.norm(paths - centre, axis=1).min() > reach + clear_m
        if free and all(np.linalg.norm(b.centre - centre) > b.reach + reach for b in blocks):
            yaw = yaw_of_area + rng.normal(0, 0.15)
            blocks.append(Block(centre, half, height, yaw, faces_of_block(centre, half, height, yaw, texture, light)))
            return


def faces_of_block(
    centre: Array, half: Array, height: float, yaw: float, texture: Texture, light: Light
) -> tuple[Panel, ...]:
    """The four sides and the top of a block."""
    x, y = np.append(rotation_2d(yaw)[:, 0], 0.0), np.append(rotation_2d(yaw)[:, 1], 0.0)
    down, up = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
    middle = np.append(centre, height)
    faces = []
    for normal, along, out, wide in (
        (y, -x, half[1], half[0]),
        (-y, x, half[1], half[0]),
        (x, y, half[0], half[1]),
        (-x, -y, half[0], half[1]),
    ):
        corner = middle + normal * out - along * wide
        faces.append(Panel(corner, along, down, (2 * float(wide), height), texture, float(light.on(normal))))
    top = Panel(
        middle - x * half[0] - y * half[1], x, y, (2 * float(half[0]), 2 * float(half[1])), texture, float(light.on(up))
    )
    return (*faces, top)
