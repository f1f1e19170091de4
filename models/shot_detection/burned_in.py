"""What is drawn over a film and was not filmed: logos, captions, clocks, the bars beside another format.

It stays where it is while everything filmed changes. Left in, it would say of any two shots that one camera took them
from one place.
"""

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from humanmm.models.records.shots import Box, Scenes
from humanmm.models.shot_detection.borders import black_bars, border
from humanmm.models.shot_detection.similarity import TEXTURE, WINDOW_PX, local_correlation

SAME = 0.85
"""Local correlation from which a place of two pictures shows the same thing, unmoved."""
UNCHANGED = 6.0
"""Grey levels by which the mean of a window may differ of a thing that is the same."""
ONE_VIEW = 0.7
"""Part of the picture that is unchanged in two pictures of one view: more than 0.9 across jump cuts. Of what two
cameras film 0.06 to 0.3 is, at night 0.5."""
AROUND_PX = 8
"""So far around what is burned in, another thing was filmed;"""
AROUND = 0.5
"""around what stays in one view because nobody passes, more than this part of the picture stays as well."""
LARGEST = 0.4
"""More of the picture than this is never drawn over: a large part that stays is one view, with much going on in it."""
FILLED, LEAST_BOX_PX = 0.6, 8
"""Part of a box that what is drawn fills, and how long a box is that is not cut any more."""
GAIN = (0.5, 2.0)
"""Of the light, from one picture of a view to another."""
FAINT, FOUND_AGAIN = 7.0, 0.5
"""Grey levels of contrast from which a place has something that could change, and the correlation if it does not."""
NEIGHBOURS = 2
"""Scenes on either side with which a scene is compared."""
WITHIN, FEWEST_WITHIN, OFTEN = 6, 3, 0.7
"""Pictures of a scene that are compared with its first one, how many of these must show another view, and the part of
them in which something stays that is burned in."""


def burned_into(
    samples: Mapping[int, UInt8[np.ndarray, "height width"]], scenes: Scenes, width_px: int
) -> tuple[tuple[Box, ...], ...]:
    """By scene, boxes (x0, y0, x1, y1 in pixels of the video) in which something is burned into its pictures.

    `samples`: small grey pictures by frame, in order; `width_px`: of the video. A scene is compared with its
    neighbours, and within itself, where a camera that moves shows it.
    """
    of_scene = [[small for frame, small in samples.items() if first <= frame < end] for first, end in _clear(scenes)]
    return tuple(_boxes(k, of_scene, width_px) for k in range(len(of_scene)))


def _clear(scenes: Scenes) -> list[tuple[int, int]]:
    """Frames [first, end) of each scene outside transitions."""
    begins = [0, *(t.end for t in scenes.transitions)]
    ends = [*(t.start for t in scenes.transitions), scenes.num_frames]
    return list(zip(begins, ends, strict=True))


def _boxes(scene: int, of_scene: Sequence[Sequence[np.ndarray]], width_px: int) -> tuple[Box, ...]:
    """One for each side that was not filmed of a scene, and those that cover every piece that is drawn over it, in
    pixels of the video, which is `width_px` wide. `of_scene`: samples of every scene."""
    own = of_scene[scene]
    if not own:
        return ()
    beside = border(own)
    drawn = _drawn_over(scene, of_scene) & ~beside
    number, pieces = cv2.connectedComponents(drawn.astype(np.uint8))
    covers = [cover(pieces == piece) for piece in range(1, number)]
    boxes = np.concatenate([_sides(beside), *covers])
    return tuple((float(x0), float(y0), float(x1), float(y1)) for x0, y0, x1, y1 in boxes * width_px / beside.shape[1])


def _sides(beside: Bool[np.ndarray, "height width"]) -> np.ndarray:
    """(n,4) boxes of whole rows and columns."""
    height, width = beside.shape
    rows, columns = np.flatnonzero(~beside.all(axis=1)), np.flatnonzero(~beside.all(axis=0))
    sides = np.array([
        (0, 0, width, rows[0]), (0, rows[-1] + 1, width, height),
        (0, 0, columns[0], height), (columns[-1] + 1, 0, width, height),
    ])  # fmt: skip
    return sides[(sides[:, 2] > sides[:, 0]) & (sides[:, 3] > sides[:, 1])]


def cover(piece: Bool[np.ndarray, "height width"]) -> np.ndarray:
    """(n,4) boxes x0 y0 x1 y1 that cover a piece and not much else: what a frame or an angle surrounds was filmed.

    The box around it is cut where the boxes around both parts are smallest, and the parts are filled most differently,
    and so are these, until FILLED of a box belongs to the piece, or it is LEAST_BOX_PX long.
    """
    x0, y0, x1, y1 = around = _around(piece)
    inside = piece[y0:y1, x0:x1]
    if inside.mean() >= FILLED or max(inside.shape) <= LEAST_BOX_PX:
        return around[None]
    cuts = [(axis, at) for axis in (0, 1) for at in range(1, inside.shape[axis])]
    parts = [np.split(inside, [at], axis) for axis, at in cuts]
    area = [sum(_area(_around(part)) for part in both) for both in parts]
    alike = [-abs(both[0].mean() - both[1].mean()) for both in parts]
    best = int(np.lexsort(np.array([alike, area]))[0])
    (axis, at), both = cuts[best], parts[best]
    moved = np.array([x0, y0, x0, y0])
    beyond = moved + np.array([0, at, 0, at] if axis == 0 else [at, 0, at, 0])
    return np.concatenate([cover(both[0]) + moved, cover(both[1]) + beyond])


def _around(piece: Bool[np.ndarray, "height width"]) -> np.ndarray:
    """(4,) the box around a piece."""
    rows, columns = np.flatnonzero(piece.any(axis=1)), np.flatnonzero(piece.any(axis=0))
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1])


def _area(box: np.ndarray) -> int:
    return int((box[2] - box[0]) * (box[3] - box[1]))


def _drawn_over(scene: int, of_scene: Sequence[Sequence[np.ndarray]]) -> Bool[np.ndarray, "height width"]:
    """Where something is drawn over the pictures of a scene that has some."""
    own = of_scene[scene]
    before, after = of_scene[max(0, scene - NEIGHBOURS) : scene], of_scene[scene + 1 : scene + 1 + NEIGHBOURS]
    found = [np.zeros(own[0].shape, bool)]
    found += [burned_in(own[0], other[-1]) for other in before if other]
    found += [burned_in(own[-1], other[0]) for other in after if other]
    steps = np.unique(np.linspace(0, len(own) - 1, WITHIN + 1).round().astype(int))[1:]
    within = [drawn for k in steps if (drawn := burned_in(own[0], own[k])).any()]
    if len(within) >= FEWEST_WITHIN:
        found.append(np.mean(within, axis=0) >= OFTEN)
    return np.asarray(np.any(found, axis=0))


def burned_in(
    first: UInt8[np.ndarray, "height width"], second: UInt8[np.ndarray, "height width"]
) -> Bool[np.ndarray, "height width"]:
    """Where two small grey pictures (about 200 pixels wide) show the same thing though what was filmed differs; nowhere
    if they show one view, or nothing."""
    bars = black_bars(np.maximum(first, second))
    local, fainter, stronger = local_correlation(first, second)
    clearly = (local > SAME) & (fainter > TEXTURE) & ~bars
    unlit = _change(first, second, clearly) < UNCHANGED
    unchanged, stays = unlit & ((local > SAME) | (stronger < TEXTURE)), unlit & (local > FOUND_AGAIN)
    same = _grown(clearly, WINDOW_PX // 2)
    if bars.all() or unchanged[~bars].mean() >= ONE_VIEW or same[~bars].mean() >= LARGEST:
        return np.zeros(first.shape, bool)
    around = ~bars & ~same & (stronger > FAINT)  # two walls in the dark are alike
    found = bars.copy()
    number, parts, stats, _ = cv2.connectedComponentsWithStats(same.astype(np.uint8))
    for k in range(1, number):
        x, y, width, height = (int(value) for value in stats[k, :4])
        near = np.s_[max(0, y - AROUND_PX) : y + height + AROUND_PX, max(0, x - AROUND_PX) : x + width + AROUND_PX]
        one = parts[near] == k
        ring = _grown(one, AROUND_PX) & around[near]
        if stays[near][ring].sum() < AROUND * max(1, ring.sum()):
            found[near] |= one
    return found


def _change(first: np.ndarray, second: np.ndarray, same: Bool[np.ndarray, "height width"]) -> np.ndarray:
    """(H,W) grey levels by which the mean of the window around every pixel differs, but for a change of the light that
    makes the one picture the other where they show the same thing."""
    before, after = (cv2.blur(one.astype(np.float32), (WINDOW_PX, WINDOW_PX)) for one in (first, second))
    if same.any():
        a, b = before[same], after[same]
        gain = float(np.clip(np.cov(a, b)[0, 1] / max(float(a.var()), 1.0), *GAIN)) if len(a) > 1 else 1.0
        before = gain * (before - a.mean()) + b.mean()
    return np.asarray(np.abs(after - before))


def _grown(part: Bool[np.ndarray, "height width"], by_px: int) -> Bool[np.ndarray, "height width"]:
    side = 2 * by_px + 1
    return np.asarray(cv2.dilate(part.astype(np.uint8), np.ones((side, side), np.uint8)) > 0)
