"""Films of a finished run: the world from the side, alone or in one picture with the original and the overlay."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from humanmm.models.drawing.canvas import Canvas
from humanmm.models.drawing.overlay import OPACITY, Mark, Overlay
from humanmm.models.drawing.world_view import WorldView
from humanmm.models.records.recording import Recording
from humanmm.models.records.video import VideoFacts
from humanmm.models.video.colors import BT601, Colors, read_colors
from humanmm.models.video.frames import PlanarFrame, joined, planar_frames, planar_size
from humanmm.models.video.prefetch import prefetched
from humanmm.storage.run_folder.picture_files import write_video

WORLD_SIZE = 1280, 720
_SIDE_PX, _TALL_PX = 640, 720
"""Largest side of the original beside the world: of a wide video, of a tall one."""
_QUALITY = 23
_PREFETCHED = 4


@dataclass(frozen=True)
class Layout:
    """Where the pictures of a film are: x and y of their upper left corners, widths and heights; all even."""

    original: tuple[int, int]
    overlay: tuple[int, int]
    cell: tuple[int, int]
    world: tuple[int, int]
    world_size: tuple[int, int]
    size: tuple[int, int]


def layout_of(facts: VideoFacts) -> Layout:
    """A wide video stands over its overlay, left of the world; a tall one beside it."""
    wide = facts.width >= facts.height
    width, height = planar_size(facts, _SIDE_PX if wide else _TALL_PX)
    total_height = 2 * height if wide else height
    left = width if wide else 2 * width
    world_width = max(total_height * 16 // 9 - left, total_height * 2 // 3) // 2 * 2
    below = (0, height) if wide else (width, 0)
    return Layout(
        (0, 0), below, (width, height), (left, 0), (world_width, total_height), (left + world_width, total_height)
    )


def write_world(
    path: Path,
    recording: Recording,
    place_of_shot: Sequence[int],
    *,
    opacity: float = OPACITY,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """The world alone, from the side, at the times of the video's frames."""
    width, height = WORLD_SIZE
    world = WorldView(recording, place_of_shot, width, height, opacity=opacity)
    canvases = [np.empty((height * 3 // 2, width), np.uint8) for _ in range(_PREFETCHED)]

    def drawn() -> Iterator[tuple[float, np.ndarray]]:
        for frame, time_s in enumerate(recording.time_s):
            image = canvases[frame % _PREFETCHED]
            world.draw(image, frame)
            progress(frame + 1, len(recording.time_s))
            yield float(time_s), image

    with prefetched(drawn(), _PREFETCHED) as pictures:
        _write(path, pictures, (width, height), recording, BT601)


def write_side_by_side(
    path: Path,
    stream: BinaryIO,
    facts: VideoFacts,
    recording: Recording,
    marks: Sequence[Mark],
    place_of_shot: Sequence[int],
    *,
    opacity: float = OPACITY,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """The original, the overlay and the world in one picture; three threads, as for the overlay."""
    layout, colors = layout_of(facts), read_colors(stream)
    width, height = layout.size
    overlay = Overlay(recording, tuple(marks), *layout.cell, colors, opacity=opacity)
    world = WorldView(recording, place_of_shot, *layout.world_size, colors, opacity=opacity)
    canvases = [np.empty((height * 3 // 2, width), np.uint8) for _ in range(_PREFETCHED)]
    cell, side = (np.empty((size[1] * 3 // 2, size[0]), np.uint8) for size in (layout.cell, layout.world_size))

    def drawn(decoded: Iterator[PlanarFrame]) -> Iterator[tuple[float, np.ndarray]]:
        for frame in decoded:
            canvas = Canvas(image := canvases[frame.index % _PREFETCHED], colors)
            canvas.put(*layout.original, frame.planes)
            overlay.draw(joined(frame.planes, cell), frame.index)
            canvas.put(*layout.overlay, Canvas(cell, colors).planes)
            world.draw(side, frame.index)
            canvas.put(*layout.world, Canvas(side, colors).planes)
            progress(frame.index + 1, facts.num_frames)
            yield frame.time_s, image

    planes = planar_frames(stream, facts, 0, facts.num_frames, max_side_px=max(layout.cell))
    with prefetched(planes, _PREFETCHED) as decoded, prefetched(drawn(decoded), _PREFETCHED) as pictures:
        _write(path, pictures, layout.size, recording, colors)


def _write(
    path: Path,
    pictures: Iterator[tuple[float, np.ndarray]],
    size: tuple[int, int],
    recording: Recording,
    colors: Colors,
) -> None:
    write_video(path, pictures, width=size[0], height=size[1], fps=recording.fps, colors=colors, quality=_QUALITY)
