"""What fills the picture beside a film of another format: black bars, or its own enlarged and blurred copy.

Black bars are where no pixel is lit. A blurred copy has borders that cross the whole picture, hardly any detail, and
shows what the enlarged film shows, at every height the same from left to right.
"""

from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

BLACK, EDGE_PX = 32, 2
"""Grey levels that no pixel of a bar reaches, and how far its edge is seen in a small picture."""
COMPARED = 8
"""Pictures of a scene in which a blurred copy is looked for."""
FILM_FROM, LEAST_PX = 0.45, 6
"""The film begins before this part of the picture, and what is narrower is no copy."""
STEP, STEPS = 4.0, 0.6
"""Grey levels from one row to the next at the film's border, and the part of its length that must have them."""
BLUR = 0.04
"""Of the picture's width, the blur at which copy and film are compared,"""
COPY = 0.8
"""the correlation from which it is one (0.96 to 1 of twelve scenes; of 60 scenes without one, with edges that cross
them, up to 0.89), and"""
CONTRAST = 1.0
"""the grey levels from left to right, standard deviation, that it needs."""
DETAIL_PX, SOFT = 1.5, 0.3
"""What this blur takes away is a picture's detail; a copy has less than this part of the film's (0.05 to 0.11; others
have 0.56 and more)."""

Mask = Bool[np.ndarray, "height width"]
Gray = UInt8[np.ndarray, "height width"]


def border(pictures: Sequence[Gray]) -> Mask:
    """What was not filmed of a scene, from small grey pictures of it; nothing where nothing else would be left."""
    found = np.asarray(black_bars(np.max(pictures, axis=0)) | _blurred_copy(pictures))
    return np.zeros_like(found) if found.all() else found


def black_bars(brightest: Gray) -> Mask:
    """The black rows and columns at the picture's borders, with their edges; nothing of a picture that is black."""
    bars = np.zeros(brightest.shape, bool)
    for across, picture in ((bars, brightest), (bars.T, brightest.T)):
        lit = np.flatnonzero(picture.max(axis=1) >= BLACK)
        if len(lit) and lit[0]:
            across[: lit[0] + EDGE_PX] = True
        if len(lit) and lit[-1] + 1 < len(picture):
            across[lit[-1] + 1 - EDGE_PX :] = True
    return bars


def _blurred_copy(pictures: Sequence[Gray]) -> Mask:
    """Above and below the film, or left and right of it."""
    found = np.zeros(pictures[0].shape, bool)
    some = np.unique(np.linspace(0, len(pictures) - 1, COMPARED).round().astype(int))
    upright = np.stack([pictures[k] for k in some]).astype(np.float32)
    for across, films in ((found, upright), (found.T, upright.transpose(0, 2, 1))):
        first, end = _rows_of_film(films)
        if first >= LEAST_PX and films.shape[1] - end >= LEAST_PX and _shows_film(films, first, end):
            across[: first + EDGE_PX] = across[end - EDGE_PX :] = True
    return found


def _rows_of_film(pictures: Float[np.ndarray, "n height width"]) -> tuple[int, int]:
    """Rows [first, end) between two edges that cross the whole of all pictures; all rows where there are none."""
    height = pictures.shape[1]
    steps = np.abs(np.diff(pictures, axis=1))
    around = np.pad(steps, ((0, 0), (2, 2), (0, 0)))
    outstanding = np.mean(steps - np.maximum(around[:, :-4], around[:, 4:]), axis=(0, 2))  # what is blurred has slopes
    reach, crossed = int(FILM_FROM * height), np.mean(steps > STEP, axis=(0, 2))
    first, last = int(np.argmax(outstanding[:reach])), height - 2 - int(np.argmax(outstanding[::-1][:reach]))
    return (first + 1, last + 1) if min(crossed[first], crossed[last]) >= STEPS else (0, height)


def _shows_film(pictures: Float[np.ndarray, "n height width"], first: int, end: int) -> bool:
    """Whether the rows outside [first, end) show what is inside, enlarged to the whole picture."""
    height, width = pictures.shape[1:]
    parts = np.s_[: first - 1], np.s_[end + 1 :]
    outside = [one[part] for one in pictures for part in parts]
    if _detail(outside) > SOFT * _detail(pictures[:, first + 1 : end - 1]):
        return False
    shown = _from_left_to_right([_blurred(one, width) for one in outside])
    covering = round(width * (end - first) / height)
    for columns in {covering, width}:  # those of the film's columns that fill the picture; or all, out of proportion
        left = (width - columns) // 2
        film = pictures[:, first:end, left : left + columns]
        copies = [_blurred(cv2.resize(one, (width, height)), width)[part] for one in film for part in parts]
        if _correlation(shown, _from_left_to_right(copies)) >= COPY:
            return True
    return False


def _detail(pictures: Iterable[Float[np.ndarray, "h w"]]) -> float:
    """Grey levels."""
    return float(np.mean([np.mean(np.abs(one - cv2.GaussianBlur(one, (0, 0), DETAIL_PX))) for one in pictures]))


def _blurred(picture: Float[np.ndarray, "h width"], width: int) -> Float[np.ndarray, "h width"]:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), BLUR * width))


def _from_left_to_right(parts: Sequence[Float[np.ndarray, "h width"]]) -> Float[np.ndarray, "n width"]:
    """How the pixels of all rows differ from the mean of their row."""
    rows = np.concatenate(parts)
    return np.asarray(rows - rows.mean(axis=1, keepdims=True))


def _correlation(first: Float[np.ndarray, "n width"], second: Float[np.ndarray, "n width"]) -> float:
    """-1..1; 0 where one has no contrast."""
    spread = float(first.std()), float(second.std())
    return 0.0 if min(spread) < CONTRAST else float((first * second).mean()) / (spread[0] * spread[1])
