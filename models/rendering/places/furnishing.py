"""What places are furnished with: walls with things in a row, stands with seats, crowds, chairs, the sky."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.rendering.background_scene import (
    SKY_HEIGHT_M,
    SKY_M,
    Block,
    Light,
    Panel,
    box_about,
    ceiling_panel,
    faces_of_block,
    floor_panel,
    random_lamp,
    rotation_2d,
    wall_panel,
)
from humanmm.models.rendering.places import surfaces
from humanmm.models.rendering.places.figures import FIGURE_M
from humanmm.models.rendering.textures import Texture

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Ground:
    """What a place is built for."""

    keep_in: Float[Array, "n 3"]
    """Bodies and cameras."""
    paths: Float[Array, "m 2"]
    """Where nothing may stand."""
    walked: Float[Array, "k 2"]
    """Where people and cameras are: nothing low may stand there either."""
    figures: Sequence[Texture]
    """Cut-outs of people for a crowd."""
    pictures: Sequence[Texture]
    """Pictures of people."""


@dataclass(frozen=True, eq=False)
class Hall:
    """A rectangle rotated by `yaw`, its walls and its light."""

    low: Array
    high: Array
    yaw: float
    height: float
    light: Light

    @classmethod
    def about(cls, ground: Ground, light: Light, *, margin: float, lowest_m: float, rng: np.random.Generator) -> "Hall":
        yaw = rng.uniform(0, 2 * np.pi)
        low, high = box_about(ground.keep_in, yaw, margin=margin)
        return cls(low, high, yaw, max(lowest_m, float(ground.keep_in[:, 2].max()) + 0.6), light)

    def wall(self, side: int, texture: Texture) -> Panel:
        """Seen from inside its texture runs to the right, so that letters can be read."""
        panel = wall_panel(self.low, self.high, self.yaw, side, self.height, texture, self.light)
        return replace(panel, corner=panel.corner + panel.along * panel.size[0], along=-panel.along)

    def floor(self, texture: Texture) -> Panel:
        return floor_panel(self.low, self.high, self.yaw, texture, self.light)

    def shell(self, floor: Texture, walls: Sequence[Texture], ceiling: Texture) -> list[Panel]:
        """Floor, ceiling and four walls; the walls repeat if there are fewer than four textures."""
        sides = [self.wall(side, walls[side % len(walls)]) for side in range(4)]
        return [
            self.floor(floor),
            ceiling_panel(self.low, self.high, self.yaw, self.height, ceiling, self.light),
            *sides,
        ]


def inwards(along: Array) -> Array:
    """Where those stand who see `along` run to the right."""
    return np.array([along[1], -along[0], 0.0])


def row_along(wall: Panel, hung: Sequence[Texture], size: tuple[float, float], pitch: float, top: float) -> list[Panel]:
    """The same pictures, windows or boards along a wall at one pitch, `top` metres below its upper edge."""
    panels = []
    for number in range(int((wall.size[0] - size[0]) / pitch) + 1):
        texture = hung[number % len(hung)]
        fitted = Texture(texture.image, texture.image.shape[1] / size[0])
        corner = wall.corner + wall.along * (0.05 + number * pitch) + wall.across * top
        panels.append(Panel(corner, wall.along, wall.across, size, fitted, min(1.1, wall.light * 1.05)))
    return panels


def lines_of_field(hall: Hall, rng: np.random.Generator) -> list[Panel]:
    """Lines of a field: one around it, one across."""
    paint = Texture(np.full((8, 8, 3), 235, np.uint8), 8)
    (x0, y0), (x1, y1) = hall.low + 1.0, hall.high - 1.0
    xm = rng.uniform(0.3, 0.7) * (x0 + x1)
    spans = [
        ((x0, y0), (x1, y0 + 0.1)), ((x0, y1 - 0.1), (x1, y1)), ((x0, y0), (x0 + 0.1, y1)), ((x1 - 0.1, y0), (x1, y1)),
        ((xm, y0), (xm + 0.1, y1)),
    ]  # fmt: skip
    return [floor_panel(np.array(a), np.array(b), hall.yaw, paint, hall.light) for a, b in spans]


def sky_panels(hall: Hall, light: Light, sky: Texture) -> list[Panel]:
    """The sky, far away on four sides and above."""
    middle = (hall.low + hall.high) / 2
    low, high = middle - SKY_M / 2, middle + SKY_M / 2
    stretched = Texture(sky.image, sky.image.shape[0] / SKY_HEIGHT_M)
    sides = [wall_panel(low, high, hall.yaw, side, SKY_HEIGHT_M, stretched, light) for side in range(4)]
    zenith = Texture(np.ascontiguousarray(np.repeat(sky.image[:2], 128, axis=0)), 2.0)
    return [
        *(replace(panel, light=1.0) for panel in sides),
        ceiling_panel(low, high, hall.yaw, SKY_HEIGHT_M, zenith, light),
    ]


def wide_floor(hall: Hall, texture: Texture) -> Panel:
    """Ground as far as the sky."""
    middle = (hall.low + hall.high) / 2
    return floor_panel(middle - SKY_M / 2, middle + SKY_M / 2, hall.yaw, texture, hall.light)


def stands(
    hall: Hall, ground: Ground, boards: Sequence[Texture], rng: np.random.Generator, *, sides: Sequence[int], rows: int
) -> tuple[list[Block], list[Panel]]:
    """Steps with seats behind a row of boards, and people on them."""
    seat = surfaces.seats(rng)
    blocks: list[Block] = []
    crowd: list[Panel] = []
    full = rng.uniform(0.15, 0.5)
    for side in sides:
        line = replace(hall.wall(side, seat), texture=seat)
        inside = inwards(line.along)
        length, foot = line.size[0], line.corner * [1, 1, 0]
        board = box_along(foot, line.along, 0.0, (length, 0.1), 0.9, hall, boards[0])
        blocks.append(_with_texture(board, boards, rng))
        for row in range(rows):
            away, height = -(0.9 + 0.85 * row), 0.55 + 0.45 * row
            blocks.append(box_along(foot, line.along, away, (length, 0.85), height, hall, seat))
            for x in np.arange(0.5, length - 0.5, 0.75):
                if ground.figures and rng.random() < full and len(crowd) < 60:
                    spot = foot + line.along * x + inside * (away - 0.2) + np.array([0, 0, height])
                    crowd.append(_standing(ground.figures, spot, line.along, hall.light, rng))
    return blocks, crowd


def _with_texture(block: Block, boards: Sequence[Texture], rng: np.random.Generator) -> Block:
    chosen = boards[int(rng.integers(len(boards)))]
    fitted = Texture(chosen.image, chosen.image.shape[0] / block.height)
    return replace(block, panels=tuple(replace(panel, texture=fitted) for panel in block.panels))


def spectators(
    hall: Hall, ground: Ground, rng: np.random.Generator, *, sides: Sequence[int], depth: float
) -> list[Panel]:
    """People who stand along walls and look into the room."""
    crowd = []
    for side in sides:
        line = hall.wall(side, surfaces.nothing(rng))
        inside = inwards(line.along)
        for x in np.arange(0.6, line.size[0] - 0.6, 0.7):
            if ground.figures and rng.random() < 0.75:
                spot = line.corner * [1, 1, 0] + line.along * x + inside * rng.uniform(0.2, depth)
                if np.linalg.norm(ground.paths - spot[:2], axis=1).min() > 0.7:
                    crowd.append(_standing(ground.figures, spot, line.along, hall.light, rng))
    return crowd


def people_about(ground: Ground, rng: np.random.Generator, *, count: int) -> list[Panel]:
    """People who stand about, far away."""
    crowd = []
    middle = ground.keep_in[:, :2].mean(axis=0)
    reach = float(np.linalg.norm(ground.keep_in[:, :2] - middle, axis=1).max())
    light = random_lamp(rng, ambient=(0.5, 0.65), lamp=(0.45, 0.65), elevation=(38, 68))
    for _ in range(count if ground.figures else 0):
        angle = rng.uniform(0, 2 * np.pi)
        spot = np.append(middle + (reach + rng.uniform(3, 12)) * np.array([np.cos(angle), np.sin(angle)]), 0.0)
        crowd.append(_standing(ground.figures, spot, np.array([np.sin(angle), -np.cos(angle), 0.0]), light, rng))
    return crowd


def _standing(figures: Sequence[Texture], spot: Array, along: Array, light: Light, rng: np.random.Generator) -> Panel:
    """A cut-out with its soles at `spot`, seen from the side from which `along` points to the right."""
    figure, size = figures[int(rng.integers(len(figures)))], float(rng.uniform(0.9, 1.05))
    wide, tall = 0.7 * FIGURE_M * size, FIGURE_M * size
    corner = spot - along * wide / 2 + np.array([0, 0, tall])
    fitted = Texture(figure.image, figure.image.shape[0] / tall)
    inside = inwards(along)
    return Panel(corner, along, np.array([0.0, 0.0, -1.0]), (wide, tall), fitted, float(light.on(inside)))


def columns(hall: Hall, ground: Ground, rng: np.random.Generator) -> list[Block]:
    """The same column at one pitch, where nobody walks."""
    texture, blocks = surfaces.tiling(rng), []
    if rng.random() < 0.5:
        return []
    for x in np.arange(hall.low[0] + 1.5, hall.high[0] - 1.0, 3.0):
        for y in (hall.low[1] + 0.6, hall.high[1] - 0.6):
            spot = rotation_2d(hall.yaw) @ [x, y]
            if np.linalg.norm(ground.paths - spot, axis=1).min() > 0.9:
                blocks.append(box(spot, (0.25, 0.25), hall.height, hall, texture))
    return blocks


def chair(spot: Array, hall: Hall, texture: Texture) -> list[Block]:
    """A seat and its back."""
    back = spot + rotation_2d(hall.yaw) @ [0.0, -0.22]
    return [box(spot, (0.22, 0.22), 0.45, hall, texture), box(back, (0.22, 0.03), 0.9, hall, texture)]


def box(centre: Array, half: tuple[float, float], height: float, hall: Hall, texture: Texture) -> Block:
    """A box in the hall's axes."""
    sides = np.asarray(half)
    faces = faces_of_block(centre, sides, height, hall.yaw, texture, hall.light)
    return Block(centre, sides, height, hall.yaw, faces)


def box_along(
    start: Array,
    along: Array,
    away: float,
    size: tuple[float, float],
    height: float,
    hall: Hall,
    texture: Texture,
) -> Block:
    """A box from `start` along a wall; `away` metres (negative: behind it) to its nearer face, `size` long and deep."""
    centre = start + along * size[0] / 2 + inwards(along) * (away - size[1] / 2)
    half = np.array([size[0] / 2, size[1] / 2])
    yaw = float(np.arctan2(along[1], along[0]))
    faces = faces_of_block(centre[:2], half, height, yaw, texture, hall.light)
    return Block(centre[:2], half, height, yaw, faces)
