"""The scene from above: everybody's path on the floor in metres, the cameras of every shot, and where the cuts fall."""

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import MultipleLocator
from scipy.spatial.transform import Rotation

from humanmm.models.drawing import palette
from humanmm.models.drawing.figure import GRID, SOFT, TEXT, axes_at, hex_color, new_figure, picture, quiet_axes
from humanmm.models.records.recording import RecordedPerson, Recording

SIZE_PX = 1000
_LABELS_PX, _TITLE_PX, _MARGIN_PX = 72, 28, 8
"""Room on the left, above, and on the right; below there is what makes the axes square."""
_TICK_SPACING_S = 0.5
_TICK_LENGTH = 0.03
"""Length of heading ticks, as a fraction of the picture's side."""
_MOST_POINTS = 4000
"""Longer paths are drawn with fewer points."""


def top_view(recording: Recording) -> UInt8[np.ndarray, "H W 3"]:
    """The picture, RGB."""
    figure = new_figure(SIZE_PX, SIZE_PX)
    axes = axes_at(figure, _LABELS_PX, _TITLE_PX, _MARGIN_PX, SIZE_PX - _LABELS_PX - _MARGIN_PX)
    quiet_axes(axes)
    side = _frame_axes(axes, recording)
    _draw_cameras(axes, recording, side)
    for person in reversed(recording.people):
        _draw_person(axes, recording, person, side)
    axes.set_xlabel("x, metres", color=TEXT, fontsize=9)
    axes.set_ylabel("y, metres (the first camera looks this way)", color=TEXT, fontsize=9)
    axes.set_title(_title(recording), color=TEXT, fontsize=11, loc="left")
    axes.legend(handles=_legend(recording), fontsize=8, frameon=True, framealpha=0.9, edgecolor=GRID, loc="best")
    return picture(figure)


def _title(recording: Recording) -> str:
    seconds = float(recording.time_s[-1] - recording.time_s[0])
    return f"From above   {recording.cast}, {seconds:.1f} s"


def _frame_axes(axes: Axes, recording: Recording) -> float:
    """Set square limits that hold all paths and cameras; returns the side in metres."""
    points = [p.pelvis[:, :2] for p in recording.people if len(p.frame)] + [recording.t_world_cam[:, :2]]
    low = np.min([p.min(0) for p in points], axis=0)
    high = np.max([p.max(0) for p in points], axis=0)
    side = max(float((high - low).max()), 1.0) * 1.2
    middle = (low + high) / 2
    axes.set_xlim(middle[0] - side / 2, middle[0] + side / 2)
    axes.set_ylim(middle[1] - side / 2, middle[1] + side / 2)
    axes.set_aspect("equal")
    step = next(s for s in (0.5, 1, 2, 5, 10, 20, 50, 100, 1000) if side / s <= 14 or s == 1000)
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


def _draw_cameras(axes: Axes, recording: Recording, side: float) -> None:
    """Each shot's camera: its path, and its field of view at the shot's first frame."""
    starts = [0, *recording.cut_frames]
    for shot, (start, end) in enumerate(zip(starts, [*starts[1:], recording.num_frames], strict=True)):
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
