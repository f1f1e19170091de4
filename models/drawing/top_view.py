"""The scene from above: everybody's path on the floor in metres, the cameras of every shot, and where the cuts fall."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil, sqrt

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import MultipleLocator
from scipy.spatial.transform import Rotation

from humanmm.models.drawing import palette
from humanmm.models.drawing.figure import GRID, SOFT, TEXT, axes_at, hex_color, new_figure, picture, quiet_axes
from humanmm.models.motion.worlds import title_of_shots, world_of_person
from humanmm.models.records.recording import RecordedPerson, Recording

SIZE_PX = 1000
_LABELS_PX, _TITLE_PX, _MARGIN_PX = 72, 28, 8
"""Room on the left, above, and on the right; below there is what makes the axes square."""
_HEADING_PX, _TICKS_PX, _FOOTNOTE_PX, _LEGEND_COLUMNS = 30, 36, 22, 6
"""Of a picture of several worlds."""
_MOST_WORLDS = 16
_TICK_SPACING_S = 0.5
_TICK_LENGTH = 0.03
"""Length of heading ticks, as a fraction of the picture's side."""
_MOST_POINTS = 4000
"""Longer paths are drawn with fewer points."""


def top_view(recording: Recording) -> UInt8[np.ndarray, "H W 3"]:
    """The picture, RGB. Each world (`motion.worlds`) in which people are seen has axes of its own."""
    figure = new_figure(SIZE_PX, SIZE_PX)
    worlds = _worlds(recording)
    if len(worlds) > 1:
        _draw_worlds(figure, recording, worlds)
        return picture(figure)
    axes = axes_at(figure, _LABELS_PX, _TITLE_PX, _MARGIN_PX, SIZE_PX - _LABELS_PX - _MARGIN_PX)
    _draw_world(axes, recording, worlds[0])
    axes.set_xlabel("x, metres", color=TEXT, fontsize=9)
    axes.set_ylabel("y, metres (the first camera looks this way)", color=TEXT, fontsize=9)
    axes.set_title(_title(recording), color=TEXT, fontsize=11, loc="left")
    axes.legend(handles=_legend(recording), fontsize=8, frameon=True, framealpha=0.9, edgecolor=GRID, loc="best")
    return picture(figure)


@dataclass(frozen=True, eq=False)
class _World:
    people: tuple[RecordedPerson, ...]
    shots: tuple[tuple[int, int, int], ...]
    """Number, first frame and end of each."""

    @property
    def title(self) -> str:
        return title_of_shots([shot for shot, _, _ in self.shots])


def _worlds(recording: Recording) -> list[_World]:
    """All worlds; of several those with people, the longest ones if they are too many for a picture."""
    found = []
    shots = [(shot, start, end) for shot, (start, end) in enumerate(recording.shot_spans)]
    for world in range(max(recording.worlds, default=0) + 1):
        inside = tuple(one for one in shots if recording.world_of_shot(one[0]) == world)
        people = tuple(person for person in recording.people if world_of_person(recording, person) == world)
        found.append(_World(people, inside))
    with_people = [world for world in found if any(len(person.frame) for person in world.people)]
    longest = sorted(with_people, key=lambda one: -sum(end - start for _, start, end in one.shots))[:_MOST_WORLDS]
    return [world for world in with_people if world in longest] or found[:1]


def _draw_worlds(figure: Figure, recording: Recording, worlds: Sequence[_World]) -> None:
    """The worlds side by side, and one legend below."""
    handles = _legend(recording)
    below = 14 + 20 * ceil(len(handles) / _LEGEND_COLUMNS)
    columns = ceil(sqrt(len(worlds)))
    rows = ceil(len(worlds) / columns)
    width, height = SIZE_PX / columns, (SIZE_PX - _HEADING_PX - _FOOTNOTE_PX - below) / rows
    for index, world in enumerate(worlds):
        left, top = width * (index % columns) + _TICKS_PX, _HEADING_PX + height * (index // columns) + _TITLE_PX
        right = SIZE_PX - left - (width - _TICKS_PX - 2 * _MARGIN_PX)
        axes = axes_at(figure, left, top, right, height - _TITLE_PX - _TICKS_PX)
        _draw_world(axes, recording, world)
        axes.set_title(world.title, color=TEXT, fontsize=10, loc="left")
    say = partial(figure.text, color=TEXT, va="center")
    drawn, known = len(worlds), max(recording.worlds) + 1
    others = f", {drawn} of them with people drawn" if drawn < known else ""
    heading = f"{_title(recording)}, {known} worlds that nothing joins{others}"
    say(_TICKS_PX / SIZE_PX, 1 - _HEADING_PX / 2 / SIZE_PX, heading, fontsize=11)
    footnote = "metres; each world has an origin of its own, and its first camera looks along y"
    say(_TICKS_PX / SIZE_PX, (below + _FOOTNOTE_PX / 2) / SIZE_PX, footnote, fontsize=9)
    figure.legend(
        handles=handles, fontsize=8, frameon=False, loc="lower left", ncols=_LEGEND_COLUMNS,
        bbox_to_anchor=(_TICKS_PX / SIZE_PX, 0), borderaxespad=0.3,
    )  # fmt: skip


def _draw_world(axes: Axes, recording: Recording, world: _World) -> None:
    quiet_axes(axes)
    side = _frame_axes(axes, recording, world)
    _draw_cameras(axes, recording, world, side)
    for person in reversed(world.people):
        _draw_person(axes, recording, person, side)


def _title(recording: Recording) -> str:
    seconds = float(recording.time_s[-1] - recording.time_s[0])
    return f"From above   {recording.cast}, {seconds:.1f} s"


def _frame_axes(axes: Axes, recording: Recording, world: _World) -> float:
    """Set limits, as wide to high as the axes, that hold all paths and cameras; returns their shorter side, metres."""
    points = [p.pelvis[:, :2] for p in world.people if len(p.frame)]
    points += [recording.t_world_cam[start:end, :2] for _, start, end in world.shots]
    low = np.min([p.min(0) for p in points], axis=0)
    high = np.max([p.max(0) for p in points], axis=0)
    box = np.array(axes.get_position().size)
    shape = box / box.min()
    side = max(float(((high - low) / shape).max()), 1.0) * 1.2
    middle = (low + high) / 2
    (left, bottom), (right, top) = middle - side * shape / 2, middle + side * shape / 2
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_aspect("equal")
    most = 14 * float(box.max())
    longest = float((side * shape).max())
    step = next(s for s in (0.5, 1, 2, 5, 10, 20, 50, 100, 1000) if longest / s <= most or s == 1000)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(step))
    axes.grid(color=GRID, linewidth=0.8)
    return side


def _draw_person(axes: Axes, recording: Recording, person: RecordedPerson, side: float) -> None:
    if len(person.frame) == 0:
        return
    color = hex_color(palette.person_color(person))
    path = person.pelvis[:, :2]
    thin = slice(None, None, max(1, len(path) // _MOST_POINTS))
    hidden = np.where(person.observed[:, None], np.nan, path)
    axes.plot(*np.where(person.observed[:, None], path, np.nan)[thin].T, color=color, linewidth=2.4, zorder=4)
    axes.plot(*hidden[thin].T, color=color, linewidth=1.4, linestyle=(0, (1.2, 1.6)), zorder=4)
    rows = _rows_every(recording.time_s[person.frame], _TICK_SPACING_S)
    rows = rows[person.observed[rows]]
    heading = Rotation.from_rotvec(person.root_orient[rows]).as_matrix()[:, :2, 2]  # the body faces its own +z
    length = np.linalg.norm(heading, axis=1, keepdims=True)
    tips = path[rows] + heading / np.maximum(length, 1e-6) * side * _TICK_LENGTH
    axes.plot(
        *np.stack([path[rows], tips, np.full_like(tips, np.nan)], axis=1).reshape(-1, 2).T, color=color, linewidth=1.1,
        alpha=0.75, zorder=3,
    )  # fmt: skip
    axes.plot(
        *path[0], "o", markersize=9, markerfacecolor="white", markeredgecolor=color, markeredgewidth=2.2, zorder=6
    )
    axes.plot(*path[-1], "s", markersize=8, color=color, zorder=6)
    for cut in recording.cut_frames:
        row = cut - int(person.frame[0])
        if 0 < row < len(path) and person.observed[row - 1 : row + 1].any():
            axes.plot(*path[row], "X", markersize=8, color=hex_color(palette.CUT), markeredgecolor="white", zorder=7)


def _draw_cameras(axes: Axes, recording: Recording, world: _World, side: float) -> None:
    """Each shot's camera: its path, and its field of view at the shot's first frame."""
    for shot, start, end in world.shots:
        color = hex_color(palette.shot_color(shot))
        thin = slice(start, end, max(1, (end - start) // _MOST_POINTS))
        path = recording.t_world_cam[thin, :2]
        axes.plot(*path.T, color=color, linewidth=1.6, zorder=2)
        axes.plot(*path[-1], ".", color=color, markersize=5, zorder=2)
        corners = _field_of_view(recording, start, side * 0.11)
        axes.add_patch(Polygon(corners, closed=True, facecolor=color, edgecolor=color, alpha=0.35, zorder=2))
        back = corners[0] - (corners[1:].mean(0) - corners[0]) * 0.28
        axes.annotate(
            str(shot), back, color="white", fontsize=8, fontweight="bold", ha="center", va="center", zorder=8,
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": color, "edgecolor": "white", "linewidth": 0.8},
        )  # fmt: skip


def _field_of_view(recording: Recording, frame: int, length: float) -> Float[np.ndarray, "3 2"]:
    """Corners of the triangle that a camera sees, from above: its centre, and the ends of its left and right border."""
    K, R = recording.K[frame], recording.R_world_cam[frame]
    borders = np.array([[-K[0, 2] / K[0, 0], 0, 1], [(recording.width - K[0, 2]) / K[0, 0], 0, 1]])
    rays = (borders @ R.T)[:, :2]
    middle = max(float(np.linalg.norm(rays.mean(0))), 0.2)  # a camera that looks straight down has no heading
    center = recording.t_world_cam[frame, :2]
    return np.stack([center, center + rays[0] / middle * length, center + rays[1] / middle * length])


def _rows_every(time_s: np.ndarray, spacing_s: float) -> np.ndarray:
    """Row nearest after every multiple of a spacing."""
    wanted = np.arange(time_s[0], time_s[-1] + 1e-9, max(spacing_s, float(time_s[-1] - time_s[0]) / 200))
    return np.unique(np.searchsorted(time_s, wanted).clip(0, len(time_s) - 1))


def _legend(recording: Recording) -> list[Line2D]:
    handles = [
        Line2D([], [], color=hex_color(palette.person_color(p)), linewidth=2.4, label=f"person {p.person}")
        for p in recording.people
    ]
    handles += [
        Line2D([], [], color=SOFT, linewidth=1.4, linestyle=(0, (1.2, 1.6)), label="not observed"),
        Line2D([], [], marker="o", ls="", color=SOFT, markerfacecolor="white", markeredgewidth=2, ms=8, label="start"),
        Line2D([], [], marker="s", ls="", color=SOFT, ms=7, label="end"),
    ]
    if recording.cut_frames:
        handles.append(
            Line2D([], [], marker="X", linestyle="none", color=hex_color(palette.CUT), markersize=8, label="cut")
        )
    handles.append(Line2D([], [], marker=(3, 0, 180), ls="", color=SOFT, ms=8, alpha=0.6, label="camera, shot number"))
    return handles
