"""Places with what makes shots hard to join: the same thing several times, mirror twins, nothing at all, a crowd.

Each place is built around the points that must be inside it (people and cameras); nothing stands on their paths.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from humanmm.models.rendering import textures
from humanmm.models.rendering.background_scene import (
    SKY_HEIGHT_M,
    SKY_M,
    BackgroundScene,
    Block,
    Light,
    Panel,
    add_block,
    box_about,
    build_outdoors,
    build_room,
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

OPEN_AIR = ("stadium", "street", "night street", "park")
HIGH = (*OPEN_AIR, "sports hall", "tiled hall")
"""Places in which a camera may fly."""


@dataclass(frozen=True, eq=False)
class Ground:
    """What a place is built for."""

    keep_in: Float[Array, "n 3"]
    """Bodies and cameras."""
    paths: Float[Array, "m 2"]
    """Where nothing may stand."""
    figures: Sequence[Texture]
    """Cut-outs of people for a crowd."""
    pictures: Sequence[Texture]
    """Pictures of people."""


@dataclass(frozen=True, eq=False)
class _Hall:
    """A rectangle rotated by `yaw`, its walls and its light."""

    low: Array
    high: Array
    yaw: float
    height: float
    light: Light

    @classmethod
    def about(
        cls, ground: Ground, light: Light, *, margin: float, lowest_m: float, rng: np.random.Generator
    ) -> "_Hall":
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


def build_place(kind: str, ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """A place of one of the `PLACES`."""
    return replace(PLACES[kind](ground, rng), kind=kind)


def _tiled_hall(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Tiles, bricks or panels that repeat exactly; opposite walls are twins, with the same posters at one pitch."""
    hall = _Hall.about(ground, _indoors(rng), margin=rng.uniform(1.0, 2.5), lowest_m=3.0, rng=rng)
    pair = [_one(rng, surfaces.bricks, surfaces.wall_panels, surfaces.tiling) for _ in range(2)]
    shell = hall.shell(surfaces.tiling(rng), pair, textures.plaster(rng))
    for side, seen in enumerate(shell[2:]):
        if side < 2:
            hung = [_one(rng, textures.poster, surfaces.window), textures.poster(rng)][: int(rng.integers(1, 3))]
            wide, pitch, top = rng.uniform(0.7, 1.2), rng.uniform(1.6, 2.8), rng.uniform(0.5, 1.0)
            twins = [(0, hung, wide, pitch, top)] if side == 0 else [*twins, (1, hung, wide, pitch, top)]
        _, hung, wide, pitch, top = twins[side % 2]
        shell += _row(seen, hung, (wide, wide), pitch, top)
    return BackgroundScene("", tuple(shell), tuple(_columns(hall, ground, rng)), hall.light)


def _sports_hall(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """A court with lines, sponsors' boards in a row, seats and a crowd on two sides."""
    hall = _Hall.about(ground, _indoors(rng), margin=rng.uniform(3.5, 6.0), lowest_m=6.0, rng=rng)
    wall = _one(rng, surfaces.wall_panels, surfaces.bricks)
    shell = hall.shell(surfaces.court(rng), [wall], surfaces.wall_panels(rng))
    shell += _lines(hall, rng)
    boards = [surfaces.board(rng) for _ in range(int(rng.integers(1, 3)))]
    blocks, crowd = _stands(hall, ground, boards, rng, sides=(0, 2), rows=int(rng.integers(2, 4)))
    shell += [panel for side in (1, 3) for panel in _row(shell[2 + side], boards, (2.7, 0.9), 2.7, hall.height - 1.0)]
    return BackgroundScene("", tuple(shell), tuple(blocks), hall.light, tuple(crowd))


def _studio(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """White walls and floor with almost nothing to see."""
    light = random_lamp(rng, ambient=(0.8, 0.95), lamp=(0.1, 0.2), elevation=(65, 85))
    hall = _Hall.about(ground, light, margin=rng.uniform(1.0, 3.0), lowest_m=4.0, rng=rng)
    paint = surfaces.nothing(rng) if rng.random() < 0.75 else surfaces.nothing(rng, value=(0.2, 0.6))
    shell = hall.shell(paint, [paint], paint)
    if rng.random() < 0.6:  # lit from all sides: even the corners are hard to see
        shell = [replace(panel, light=0.97 - 0.02 * (k == 0)) for k, panel in enumerate(shell)]
    return BackgroundScene("", tuple(shell), (), light)


def _stadium(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Grass with lines, boards, stands with seats and a crowd, sky."""
    light = _daylight(rng)
    hall = _Hall.about(ground, light, margin=rng.uniform(5.0, 9.0), lowest_m=5.0, rng=rng)
    shell = [*_sky(hall, light, textures.sky(rng)), _wide_floor(hall, textures.grass(rng)), *_lines(hall, rng)]
    boards = [surfaces.board(rng) for _ in range(int(rng.integers(1, 3)))]
    blocks, crowd = _stands(hall, ground, boards, rng, sides=(0, 1, 2, 3), rows=int(rng.integers(3, 6)))
    return BackgroundScene("", tuple(shell), tuple(blocks), light, tuple(crowd))


def _street(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Paving that repeats, and the same house several times, with signs."""
    light = _daylight(rng)
    return _houses(ground, light, textures.facade(rng), surfaces.tiling(rng), textures.sky(rng), rng)


def _night_street(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Asphalt and dark houses; lit windows and a few lamps are all that can be seen well."""
    light = random_lamp(rng, ambient=(0.22, 0.34), lamp=(0.3, 0.5), elevation=(50, 75))
    black = Texture(np.full((64, 64, 3), 12, np.uint8), 1)
    scene = _houses(ground, light, surfaces.lit_facade(rng), surfaces.asphalt(rng), black, rng, glow=3.0)
    return scene


def _park(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Grass and hedges between houses."""
    scene = build_outdoors(ground.keep_in, ground.paths, rng)
    floor = textures.grass(rng)
    shell = tuple(replace(panel, texture=floor) if panel.is_floor else panel for panel in scene.shell)
    return replace(scene, shell=shell, cutouts=tuple(_bystanders(ground, rng, count=int(rng.integers(0, 6)))))


def _gallery(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Pictures of people on plain walls, some of them several times."""
    hall = _Hall.about(ground, _indoors(rng), margin=rng.uniform(1.0, 2.0), lowest_m=3.0, rng=rng)
    wall = textures.plaster(rng)
    shell = hall.shell(_one(rng, textures.planks, surfaces.tiling), [wall], textures.plaster(rng))
    for seen in shell[2:6]:
        tall = rng.uniform(1.0, 1.9)
        chosen = [ground.pictures[int(k)] for k in rng.permutation(len(ground.pictures))[: int(rng.integers(1, 4))]]
        shell += _row(seen, chosen, (0.7 * tall, tall), rng.uniform(1.7, 2.6), max(0.2, hall.height - 0.9 - tall))
    return BackgroundScene("", tuple(shell), (), hall.light)


def _stage(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """A dark stage with a screen that shows a person, and a crowd before it."""
    light = random_lamp(rng, ambient=(0.35, 0.5), lamp=(0.4, 0.6), elevation=(55, 75))
    hall = _Hall.about(ground, light, margin=rng.uniform(1.5, 3.0), lowest_m=4.5, rng=rng)
    curtain = surfaces.nothing(rng, value=(0.12, 0.35))
    folds = (1 + 0.35 * np.sin(np.arange(256) * 2 * np.pi / 32))[None, :, None]
    curtain = Texture(np.clip(curtain.image * folds, 0, 255).astype(np.uint8), 64)
    shell = hall.shell(_one(rng, surfaces.court, surfaces.tiling), [curtain], surfaces.nothing(rng, value=(0.1, 0.2)))
    for side in (0, 2) if rng.random() < 0.5 else (0,):
        wall, tall = shell[2 + side], min(hall.height - 0.6, 3.6)
        screens = [replace(p, light=1.15) for p in _row(wall, ground.pictures[:1], (0.7 * tall, tall), 1.6 * tall, 0.3)]
        shell += screens[: int(rng.integers(1, 4))]
    crowd = _spectators(hall, ground, rng, sides=(1,), depth=0.6)
    return BackgroundScene("", tuple(shell), (), light, tuple(crowd))


def _classroom(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Rows of the same chair and desk, the same window on two sides, a board with letters."""
    hall = _Hall.about(ground, _indoors(rng), margin=rng.uniform(2.5, 4.0), lowest_m=2.9, rng=rng)
    shell = hall.shell(
        _one(rng, surfaces.tiling, surfaces.court, textures.carpet), [textures.plaster(rng)], textures.plaster(rng)
    )
    pane = surfaces.window(rng)
    for side in (0, 2):
        shell += _row(shell[2 + side], [pane], (1.3, 1.3), 1.9, 0.6)
    shell += _row(shell[3], [surfaces.sign(rng)], (3.2, 0.8), 5.0, 0.5)
    shell += _row(shell[5], [textures.poster(rng)], (0.8, 0.8), 1.5, 0.8)
    wood, shell_colour = textures.planks(rng), surfaces.nothing(rng, value=(0.2, 0.8))
    blocks = []
    for x in np.arange(hall.low[0] + 0.8, hall.high[0] - 0.5, 1.3):
        for y in np.arange(hall.low[1] + 0.8, hall.high[1] - 0.5, 1.5):
            spot = rotation_2d(hall.yaw) @ [x, y]
            if np.linalg.norm(ground.paths - spot, axis=1).min() > 1.1:
                blocks += _chair(spot, hall, shell_colour)
                desk = rotation_2d(hall.yaw) @ [x, y + 0.55]
                if np.linalg.norm(ground.paths - desk, axis=1).min() > 1.1:
                    blocks.append(_box(desk, (0.5, 0.25), 0.72, hall, wood))
    return BackgroundScene("", tuple(shell), tuple(blocks[:40]), hall.light)


def _room(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """A furnished room in which one poster hangs several times."""
    scene = build_room(ground.keep_in, ground.paths, rng)
    same = textures.poster(rng)
    shell = [
        replace(p, texture=Texture(same.image, same.px_per_m / p.size[0])) if k > 5 and rng.random() < 0.5 else p
        for k, p in enumerate(scene.shell)
    ]
    return replace(scene, shell=tuple(shell))


PLACES: dict[str, Callable[[Ground, np.random.Generator], BackgroundScene]] = {
    "tiled hall": _tiled_hall, "stadium": _stadium, "studio": _studio, "street": _street, "gallery": _gallery,
    "sports hall": _sports_hall, "night street": _night_street, "classroom": _classroom, "stage": _stage,
    "park": _park, "room": _room,
}  # fmt: skip


def _indoors(rng: np.random.Generator) -> Light:
    return random_lamp(rng, ambient=(0.5, 0.75), lamp=(0.25, 0.5), elevation=(55, 80))


def _daylight(rng: np.random.Generator) -> Light:
    return random_lamp(rng, ambient=(0.5, 0.65), lamp=(0.45, 0.65), elevation=(38, 68))


def _one(rng: np.random.Generator, *kinds: Callable[[np.random.Generator], Texture]) -> Texture:
    return kinds[int(rng.integers(len(kinds)))](rng)


def _inwards(along: Array) -> Array:
    """Where those stand who see `along` run to the right."""
    return np.array([along[1], -along[0], 0.0])


def _row(wall: Panel, hung: Sequence[Texture], size: tuple[float, float], pitch: float, top: float) -> list[Panel]:
    """The same pictures, windows or boards along a wall at one pitch, `top` metres below its upper edge."""
    panels = []
    for number in range(int((wall.size[0] - size[0]) / pitch) + 1):
        texture = hung[number % len(hung)]
        fitted = Texture(texture.image, texture.image.shape[1] / size[0])
        corner = wall.corner + wall.along * (0.05 + number * pitch) + wall.across * top
        panels.append(Panel(corner, wall.along, wall.across, size, fitted, min(1.1, wall.light * 1.05)))
    return panels


def _lines(hall: _Hall, rng: np.random.Generator) -> list[Panel]:
    """Lines of a field: one around it, one across."""
    paint = Texture(np.full((8, 8, 3), 235, np.uint8), 8)
    (x0, y0), (x1, y1) = hall.low + 1.0, hall.high - 1.0
    xm = rng.uniform(0.3, 0.7) * (x0 + x1)
    spans = [
        ((x0, y0), (x1, y0 + 0.1)), ((x0, y1 - 0.1), (x1, y1)), ((x0, y0), (x0 + 0.1, y1)), ((x1 - 0.1, y0), (x1, y1)),
        ((xm, y0), (xm + 0.1, y1)),
    ]  # fmt: skip
    return [floor_panel(np.array(a), np.array(b), hall.yaw, paint, hall.light) for a, b in spans]


def _sky(hall: _Hall, light: Light, sky: Texture) -> list[Panel]:
    middle = (hall.low + hall.high) / 2
    low, high = middle - SKY_M / 2, middle + SKY_M / 2
    stretched = Texture(sky.image, sky.image.shape[0] / SKY_HEIGHT_M)
    sides = [wall_panel(low, high, hall.yaw, side, SKY_HEIGHT_M, stretched, light) for side in range(4)]
    zenith = Texture(np.ascontiguousarray(np.repeat(sky.image[:2], 128, axis=0)), 2.0)
    return [
        *(replace(panel, light=1.0) for panel in sides),
        ceiling_panel(low, high, hall.yaw, SKY_HEIGHT_M, zenith, light),
    ]


def _wide_floor(hall: _Hall, texture: Texture) -> Panel:
    middle = (hall.low + hall.high) / 2
    return floor_panel(middle - SKY_M / 2, middle + SKY_M / 2, hall.yaw, texture, hall.light)


def _stands(
    hall: _Hall, ground: Ground, boards: Sequence[Texture], rng: np.random.Generator, *, sides: Sequence[int], rows: int
) -> tuple[list[Block], list[Panel]]:
    """Steps with seats behind a row of boards, and people on them."""
    seat, blocks, crowd = surfaces.seats(rng), [], []
    full = rng.uniform(0.15, 0.5)
    for side in sides:
        line = replace(hall.wall(side, seat), texture=seat)
        inwards = _inwards(line.along)
        length, foot = line.size[0], line.corner * [1, 1, 0]
        board = _box_along(foot, line.along, inwards, 0.0, (length, 0.1), 0.9, hall, boards[0])
        blocks.append(_with_texture(board, boards, rng))
        for row in range(rows):
            away, height = -(0.9 + 0.85 * row), 0.55 + 0.45 * row
            blocks.append(_box_along(foot, line.along, inwards, away, (length, 0.85), height, hall, seat))
            for x in np.arange(0.5, length - 0.5, 0.75):
                if ground.figures and rng.random() < full and len(crowd) < 60:
                    spot = foot + line.along * x + inwards * (away - 0.2) + np.array([0, 0, height])
                    crowd.append(_standing(ground.figures, spot, line.along, hall.light, rng))
    return blocks, crowd


def _with_texture(block: Block, boards: Sequence[Texture], rng: np.random.Generator) -> Block:
    chosen = boards[int(rng.integers(len(boards)))]
    fitted = Texture(chosen.image, chosen.image.shape[0] / block.height)
    return replace(block, panels=tuple(replace(panel, texture=fitted) for panel in block.panels))


def _spectators(
    hall: _Hall, ground: Ground, rng: np.random.Generator, *, sides: Sequence[int], depth: float
) -> list[Panel]:
    """People who stand along walls and look into the room."""
    crowd = []
    for side in sides:
        line = hall.wall(side, surfaces.nothing(rng))
        inwards = _inwards(line.along)
        for x in np.arange(0.6, line.size[0] - 0.6, 0.7):
            if ground.figures and rng.random() < 0.75:
                spot = line.corner * [1, 1, 0] + line.along * x + inwards * rng.uniform(0.2, depth)
                if np.linalg.norm(ground.paths - spot[:2], axis=1).min() > 0.7:
                    crowd.append(_standing(ground.figures, spot, line.along, hall.light, rng))
    return crowd


def _bystanders(ground: Ground, rng: np.random.Generator, *, count: int) -> list[Panel]:
    """People who stand about, far away."""
    crowd = []
    middle = ground.keep_in[:, :2].mean(axis=0)
    reach = float(np.linalg.norm(ground.keep_in[:, :2] - middle, axis=1).max())
    light = _daylight(rng)
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
    inwards = _inwards(along)
    return Panel(corner, along, np.array([0.0, 0.0, -1.0]), (wide, tall), fitted, float(light.on(inwards)))


def _houses(
    ground: Ground,
    light: Light,
    facade: Texture,
    floor: Texture,
    sky: Texture,
    rng: np.random.Generator,
    *,
    glow: float = 1.0,
) -> BackgroundScene:
    """A square between houses of one kind, with shops' signs, lamps and hedges."""
    hall = _Hall.about(ground, light, margin=rng.uniform(4.0, 8.0), lowest_m=4.0, rng=rng)
    shell = [*_sky(hall, light, sky), _wide_floor(hall, floor)]
    if glow > 1.0:
        shell = [replace(panel, light=min(panel.light, 1.0)) for panel in shell]
    letters, blocks, signs = surfaces.sign(rng), [], []
    for side in range(4):
        line = hall.wall(side, facade)
        inwards = _inwards(line.along)
        foot, storey = line.corner * [1, 1, 0], 3.2
        at = rng.uniform(-1.0, 1.0)
        while at < line.size[0]:
            wide, storeys = 6.4 * float(rng.integers(1, 3)), int(rng.integers(2, 5))
            if rng.random() < 0.85:
                start = foot + line.along * at
                house = _box_along(start, line.along, inwards, -6.0, (wide, 6.0), storey * storeys, hall, facade)
                lit = tuple(replace(panel, light=min(1.1, panel.light * glow)) for panel in house.panels)
                blocks.append(replace(house, panels=lit))
                if rng.random() < 0.6:
                    corner = start + line.along * 0.5 + inwards * 0.12 + np.array([0, 0, 3.1])
                    fitted = Texture(letters.image, letters.image.shape[1] / 3.2)
                    signs.append(
                        Panel(corner, line.along, line.across, (3.2, 0.8), fitted, min(1.1, line.light * glow * 1.5))
                    )
            at += wide + float(rng.choice([0.0, 0.0, 2.5]))
    if glow > 1.0:
        lamp = Texture(np.full((16, 16, 3), (255, 240, 200), np.uint8), 64)
        for _ in range(5):
            spot = rotation_2d(hall.yaw) @ rng.uniform(hall.low, hall.high)
            if np.linalg.norm(ground.paths - spot, axis=1).min() > 1.2:
                for axis in (
                    np.array([1.0, 0, 0]),
                    np.array([-1.0, 0, 0]),
                    np.array([0, 1.0, 0]),
                    np.array([0, -1.0, 0]),
                ):
                    corner = np.append(spot, 3.4) - axis * 0.15
                    signs.append(Panel(corner, axis, np.array([0, 0, -1.0]), (0.3, 0.3), lamp, 1.0))
    area = (hall.low, hall.high, hall.yaw)
    crate = textures.foliage(rng) if rng.random() < 0.5 else surfaces.bricks(rng)
    for _ in range(int(rng.integers(2, 7))):
        half = rng.uniform([0.3, 0.2], [1.5, 0.4])
        add_block(blocks, half, rng.uniform(0.4, 1.2), area, ground.paths, 0.9, crate, light, rng)
    return BackgroundScene("", tuple(shell), tuple(blocks), light, tuple(signs))


def _columns(hall: _Hall, ground: Ground, rng: np.random.Generator) -> list[Block]:
    """The same column at one pitch, where nobody walks."""
    texture, blocks = surfaces.tiling(rng), []
    if rng.random() < 0.5:
        return []
    for x in np.arange(hall.low[0] + 1.5, hall.high[0] - 1.0, 3.0):
        for y in (hall.low[1] + 0.6, hall.high[1] - 0.6):
            spot = rotation_2d(hall.yaw) @ [x, y]
            if np.linalg.norm(ground.paths - spot, axis=1).min() > 0.9:
                blocks.append(_box(spot, (0.25, 0.25), hall.height, hall, texture))
    return blocks


def _chair(spot: Array, hall: _Hall, texture: Texture) -> list[Block]:
    back = spot + rotation_2d(hall.yaw) @ [0.0, -0.22]
    return [_box(spot, (0.22, 0.22), 0.45, hall, texture), _box(back, (0.22, 0.03), 0.9, hall, texture)]


def _box(centre: Array, half: tuple[float, float], height: float, hall: _Hall, texture: Texture) -> Block:
    sides = np.asarray(half)
    faces = faces_of_block(centre, sides, height, hall.yaw, texture, hall.light)
    return Block(centre, sides, height, hall.yaw, faces)


def _box_along(
    start: Array,
    along: Array,
    inwards: Array,
    away: float,
    size: tuple[float, float],
    height: float,
    hall: _Hall,
    texture: Texture,
) -> Block:
    """A box from `start` along a wall; `away` metres (negative: behind it) to its nearer face, `size` long and deep."""
    centre = start + along * size[0] / 2 + inwards * (away - size[1] / 2)
    half = np.array([size[0] / 2, size[1] / 2])
    yaw = float(np.arctan2(along[1], along[0]))
    faces = faces_of_block(centre[:2], half, height, yaw, texture, hall.light)
    return Block(centre[:2], half, height, yaw, faces)
