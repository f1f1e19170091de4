"""Places with what makes shots hard to join: the same thing several times, mirror twins, nothing at all, a crowd.

Each place is built around the points that must be inside it (people and cameras); nothing stands on their paths.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from humanmm.models.rendering import textures
from humanmm.models.rendering.background_scene import (
    BackgroundScene,
    Block,
    Light,
    Panel,
    add_block,
    build_outdoors,
    build_room,
    random_lamp,
    rotation_2d,
)
from humanmm.models.rendering.places import surfaces
from humanmm.models.rendering.places.furnishing import (
    Ground,
    Hall,
    box,
    box_along,
    chair,
    columns,
    inwards,
    lines_of_field,
    people_about,
    row_along,
    sky_panels,
    spectators,
    stands,
    wide_floor,
)
from humanmm.models.rendering.textures import Texture

OPEN_AIR = ("stadium", "street", "night street", "park")
HIGH = (*OPEN_AIR, "sports hall", "tiled hall")
"""Places in which a camera may fly."""
SEATS = 12


def build_place(kind: str, ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """A place of one of the `PLACES`."""
    return replace(PLACES[kind](ground, rng), kind=kind)


def _tiled_hall(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Tiles, bricks or panels that repeat exactly; opposite walls are twins, with the same posters at one pitch."""
    hall = Hall.about(ground, _indoors(rng), margin=rng.uniform(1.0, 2.5), lowest_m=3.0, rng=rng)
    pair = [_one(rng, surfaces.bricks, surfaces.wall_panels, surfaces.tiling) for _ in range(2)]
    shell = hall.shell(surfaces.tiling(rng), pair, textures.plaster(rng))
    for twins in (shell[2:6:2], shell[3:6:2]):
        hung = [_one(rng, textures.poster, surfaces.window), textures.poster(rng)][: int(rng.integers(1, 3))]
        wide, pitch, top = rng.uniform(0.7, 1.2), rng.uniform(1.6, 2.8), rng.uniform(0.5, 1.0)
        for wall in twins:
            shell += row_along(wall, hung, (wide, wide), pitch, top)
    return BackgroundScene("", tuple(shell), tuple(columns(hall, ground, rng)), hall.light)


def _sports_hall(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """A court with lines, sponsors' boards in a row, seats and a crowd on two sides."""
    hall = Hall.about(ground, _indoors(rng), margin=rng.uniform(3.5, 6.0), lowest_m=6.0, rng=rng)
    wall = _one(rng, surfaces.wall_panels, surfaces.bricks)
    shell = hall.shell(surfaces.court(rng), [wall], surfaces.wall_panels(rng))
    shell += lines_of_field(hall, rng)
    boards = [surfaces.board(rng) for _ in range(int(rng.integers(1, 3)))]
    blocks, crowd = stands(hall, ground, boards, rng, sides=(0, 2), rows=int(rng.integers(2, 4)))
    shell += [
        panel for side in (1, 3) for panel in row_along(shell[2 + side], boards, (2.7, 0.9), 2.7, hall.height - 1.0)
    ]
    return BackgroundScene("", tuple(shell), tuple(blocks), hall.light, tuple(crowd))


def _studio(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """White walls and floor with almost nothing to see."""
    light = random_lamp(rng, ambient=(0.8, 0.95), lamp=(0.1, 0.2), elevation=(65, 85))
    hall = Hall.about(ground, light, margin=rng.uniform(1.0, 3.0), lowest_m=4.0, rng=rng)
    paint = surfaces.nothing(rng) if rng.random() < 0.75 else surfaces.nothing(rng, value=(0.2, 0.6))
    shell = hall.shell(paint, [paint], paint)
    if rng.random() < 0.6:  # lit from all sides: even the corners are hard to see
        shell = [replace(panel, light=0.97 - 0.02 * (k == 0)) for k, panel in enumerate(shell)]
    return BackgroundScene("", tuple(shell), (), light)


def _stadium(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Grass with lines, boards, stands with seats and a crowd, sky."""
    light = _daylight(rng)
    hall = Hall.about(ground, light, margin=rng.uniform(5.0, 9.0), lowest_m=5.0, rng=rng)
    shell = [
        *sky_panels(hall, light, textures.sky(rng)),
        wide_floor(hall, textures.grass(rng)),
        *lines_of_field(hall, rng),
    ]
    boards = [surfaces.board(rng) for _ in range(int(rng.integers(1, 3)))]
    blocks, crowd = stands(hall, ground, boards, rng, sides=(0, 1, 2, 3), rows=int(rng.integers(3, 6)))
    return BackgroundScene("", tuple(shell), tuple(blocks), light, tuple(crowd))


def _street(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Paving that repeats, and the same house several times, with signs."""
    light = _daylight(rng)
    return _houses(ground, light, textures.facade(rng), surfaces.tiling(rng), textures.sky(rng), rng)


def _night_street(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Asphalt and dark houses; lit windows and a few lamps are all that can be seen well."""
    light = random_lamp(rng, ambient=(0.22, 0.34), lamp=(0.3, 0.5), elevation=(50, 75))
    black = Texture(np.full((64, 64, 3), 12, np.uint8), 1)
    return _houses(ground, light, surfaces.lit_facade(rng), surfaces.asphalt(rng), black, rng, glow=3.0)


def _park(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Grass and hedges between houses."""
    scene = build_outdoors(ground.keep_in, ground.paths, rng)
    floor = textures.grass(rng)
    shell = tuple(replace(panel, texture=floor) if panel.is_floor else panel for panel in scene.shell)
    return replace(scene, shell=shell, cutouts=tuple(people_about(ground, rng, count=int(rng.integers(0, 6)))))


def _gallery(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Pictures of people on plain walls, some of them several times."""
    hall = Hall.about(ground, _indoors(rng), margin=rng.uniform(1.0, 2.0), lowest_m=3.0, rng=rng)
    wall = textures.plaster(rng)
    shell = hall.shell(_one(rng, textures.planks, surfaces.tiling), [wall], textures.plaster(rng))
    for seen in shell[2:6]:
        tall = rng.uniform(1.0, 1.9)
        chosen = [ground.pictures[int(k)] for k in rng.permutation(len(ground.pictures))[: int(rng.integers(1, 4))]]
        shell += row_along(seen, chosen, (0.7 * tall, tall), rng.uniform(1.7, 2.6), max(0.2, hall.height - 0.9 - tall))
    return BackgroundScene("", tuple(shell), (), hall.light)


def _stage(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """A dark stage with a screen that shows a person, and a crowd before it."""
    light = random_lamp(rng, ambient=(0.35, 0.5), lamp=(0.4, 0.6), elevation=(55, 75))
    hall = Hall.about(ground, light, margin=rng.uniform(1.5, 3.0), lowest_m=4.5, rng=rng)
    curtain = surfaces.nothing(rng, value=(0.12, 0.35))
    folds = (1 + 0.35 * np.sin(np.arange(256) * 2 * np.pi / 32))[None, :, None]
    curtain = Texture(np.clip(curtain.image * folds, 0, 255).astype(np.uint8), 64)
    shell = hall.shell(_one(rng, surfaces.court, surfaces.tiling), [curtain], surfaces.nothing(rng, value=(0.1, 0.2)))
    for side in (0, 2) if rng.random() < 0.5 else (0,):
        wall, tall = shell[2 + side], min(hall.height - 0.6, 3.6)
        screens = [
            replace(p, light=1.15) for p in row_along(wall, ground.pictures[:1], (0.7 * tall, tall), 1.6 * tall, 0.3)
        ]
        shell += screens[: int(rng.integers(1, 4))]
    crowd = spectators(hall, ground, rng, sides=(1,), depth=0.6)
    return BackgroundScene("", tuple(shell), (), light, tuple(crowd))


def _classroom(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """Rows of the same chair and desk, the same window on two sides, a board with letters."""
    hall = Hall.about(ground, _indoors(rng), margin=rng.uniform(2.5, 4.0), lowest_m=2.9, rng=rng)
    shell = hall.shell(
        _one(rng, surfaces.tiling, surfaces.court, textures.carpet), [textures.plaster(rng)], textures.plaster(rng)
    )
    pane = surfaces.window(rng)
    for side in (0, 2):
        shell += row_along(shell[2 + side], [pane], (1.3, 1.3), 1.9, 0.6)
    shell += row_along(shell[3], [surfaces.sign(rng)], (3.2, 0.8), 5.0, 0.5)
    shell += row_along(shell[5], [textures.poster(rng)], (0.8, 0.8), 1.5, 0.8)
    wood, shell_colour = textures.planks(rng), surfaces.nothing(rng, value=(0.2, 0.8))
    spots = [
        rotation_2d(hall.yaw) @ [x, y]
        for x in np.arange(hall.low[0] + 0.8, hall.high[0] - 0.5, 1.4)
        for y in np.arange(hall.low[1] + 0.8, hall.high[1] - 0.5, 1.7)
    ]
    free = [spot for spot in spots if np.linalg.norm(ground.walked - spot, axis=1).min() > 1.2]
    blocks: list[Block] = []
    for k in rng.permutation(len(free))[:SEATS]:
        blocks += chair(free[k], hall, shell_colour)
        if rng.random() < 0.6:
            blocks.append(box(free[k] + rotation_2d(hall.yaw) @ [0.0, 0.55], (0.5, 0.25), 0.72, hall, wood))
    return BackgroundScene("", tuple(shell), tuple(blocks), hall.light)


def _room(ground: Ground, rng: np.random.Generator) -> BackgroundScene:
    """A furnished room in which one poster hangs several times."""
    scene = build_room(ground.keep_in, ground.paths, rng)
    same = textures.poster(rng)
    shell = [
        replace(p, texture=Texture(same.image, same.px_per_m / p.size[0]))
        if max(p.size) < 1.4 and rng.random() < 0.6
        else p
        for p in scene.shell
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
    hall = Hall.about(ground, light, margin=rng.uniform(4.0, 8.0), lowest_m=4.0, rng=rng)
    shell = [*sky_panels(hall, light, sky), wide_floor(hall, floor)]
    if glow > 1.0:
        shell = [replace(panel, light=min(panel.light, 1.0)) for panel in shell]
    letters = surfaces.sign(rng)
    blocks: list[Block] = []
    lamps: list[Panel] = []
    for side in range(4):
        line = hall.wall(side, facade)
        inside = inwards(line.along)
        foot, storey = line.corner * [1, 1, 0], 3.2
        at = rng.uniform(-1.0, 1.0)
        while at < line.size[0]:
            wide, storeys = 6.4 * float(rng.integers(1, 3)), int(rng.integers(2, 5))
            if rng.random() < 0.85:
                start = foot + line.along * at
                house = box_along(start, line.along, -6.0, (wide, 6.0), storey * storeys, hall, facade)
                lit = tuple(replace(panel, light=min(1.1, panel.light * glow)) for panel in house.panels)
                if rng.random() < 0.6:
                    corner = start + line.along * 0.5 + inside * 0.12 + np.array([0, 0, 3.1])
                    fitted = Texture(letters.image, letters.image.shape[1] / 3.2)
                    shine = min(1.1, line.light * glow * 1.5)
                    lit = (*lit, Panel(corner, line.along, line.across, (3.2, 0.8), fitted, shine))
                blocks.append(replace(house, panels=lit))
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
                    lamps.append(Panel(corner, axis, np.array([0, 0, -1.0]), (0.3, 0.3), lamp, 1.0))
    area = (hall.low, hall.high, hall.yaw)
    crate = textures.foliage(rng) if rng.random() < 0.5 else surfaces.bricks(rng)
    for _ in range(int(rng.integers(2, 7))):
        half = rng.uniform([0.3, 0.2], [1.5, 0.4])
        add_block(blocks, half, rng.uniform(0.4, 1.2), area, ground.paths, 0.9, crate, light, rng)
    return BackgroundScene("", tuple(shell), tuple(blocks), light, tuple(lamps))
