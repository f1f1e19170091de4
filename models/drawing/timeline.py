"""The run along time: shots, who was observed, feet on the floor; below it the seconds of each stage, and warnings."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, UInt8
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from humanmm.models.drawing import palette
from humanmm.models.drawing.figure import DPI, GRID, SOFT, TEXT, axes_at, hex_color, new_figure, picture, quiet_axes
from humanmm.models.drawing.overlay import CONTACT_PROBABILITY, Mark
from humanmm.models.geometry.intervals import runs_of_true
from humanmm.models.records.camera import SOURCES
from humanmm.models.records.recording import RecordedPerson, Recording

WIDTH_PX = 1500
_LEFT_PX, _RIGHT_PX = 92, 10
"""Room for the names of rows, and for half of the last tick's label."""
_TITLE_PX, _TICKS_PX, _LABEL_PX = 32, 24, 44
"""Room above each row of the picture; below one with ticks; below one with ticks and a label."""
_MOST_WARNINGS = 8
_MOST_PEOPLE = 12
_CONTACT_NAMES = ("left ankle", "left toes", "right ankle", "right toes")
_STATES = {"computed": "#4a7fd0", "cached": "#c3ccd8", "failed": hex_color(palette.CUT), "skipped": "#f2d3d3"}


@dataclass(frozen=True)
class StageTime:
    """What one stage took in this run, all its units together."""

    stage: str
    seconds: float
    units: int
    cached_units: int
    failed_units: int


def timeline(
    recording: Recording, marks: Sequence[Mark], stages: Sequence[StageTime], warnings: Sequence[str]
) -> UInt8[np.ndarray, "H W 3"]:
    """The picture, RGB. Its height grows with the number of people, stages and warnings."""
    people = recording.people[:_MOST_PEOPLE]
    sentences = _wrapped(warnings)
    along_px, below_px, text_px = 52 + 96 * len(people), 22 * max(len(stages), 2), 17 * max(len(sentences), 1)
    figure = new_figure(
        WIDTH_PX, 3 * _TITLE_PX + along_px + _LABEL_PX + below_px + _TICKS_PX + text_px + _TITLE_PX // 2
    )
    top = _TITLE_PX
    _draw_video(_row(figure, top, along_px), recording, marks, people)
    top += along_px + _LABEL_PX + _TITLE_PX
    _draw_stages(_row(figure, top, below_px), stages)
    top += below_px + _TICKS_PX + _TITLE_PX
    _write_warnings(figure, top, sentences, len(warnings))
    return picture(figure)


def _row(figure: Figure, top_px: int, height_px: int) -> Axes:
    return axes_at(figure, _LEFT_PX, top_px, _RIGHT_PX, height_px)


def _draw_video(axes: Axes, recording: Recording, marks: Sequence[Mark], people: Sequence[RecordedPerson]) -> None:
    quiet_axes(axes)
    axes.spines["left"].set_visible(False)
    edges = _frame_edges(recording.time_s)
    axes.set_xlim(edges[0], edges[-1])
    ticks, labels = [0.0], ["shots"]
    _draw_shots(axes, recording, marks, edges)
    for row, person in enumerate(people):
        top = -0.75 - 1.55 * row
        _draw_person(axes, person, edges, top)
        ticks += [top, *(top - 0.42 - 0.22 * k for k in range(4))]
        labels += [f"person {person.person}", *_CONTACT_NAMES]
    axes.set_ylim(-0.75 - 1.55 * len(people) + 0.35, 0.5)
    axes.set_yticks(ticks, labels, fontsize=8)
    for label in axes.get_yticklabels():
        small = label.get_text() in _CONTACT_NAMES
        label.set_fontsize(6.5 if small else 9)
        label.set_color(SOFT if small else TEXT)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("seconds", color=TEXT, fontsize=9)
    axes.grid(axis="x", color=GRID, linewidth=0.8)
    axes.set_title(
        f"{recording.num_frames} frames, {recording.time_s[-1] - recording.time_s[0]:.1f} s, {recording.cast}"
        + (f" (the first {len(people)} shown)" if len(people) < len(recording.people) else ""),
        loc="left", fontsize=11, color=TEXT,
    )  # fmt: skip
    pale = hex_color(palette.NOT_OBSERVED)
    handles = [
        Patch(facecolor=pale, alpha=0.4, hatch="////", edgecolor="white", label="not observed"),
        Patch(facecolor=hex_color(palette.CONTACT), label="foot on the floor"),
        Patch(facecolor=hex_color(palette.CUT), label="cut or transition"),
    ]
    axes.legend(handles=handles, ncols=3, fontsize=8, frameon=False, loc="lower right", bbox_to_anchor=(1, 1))


def _draw_shots(axes: Axes, recording: Recording, marks: Sequence[Mark], edges: np.ndarray) -> None:
    for shot, (start, end) in enumerate(recording.shot_spans):
        left, width = edges[start], edges[end] - edges[start]
        axes.broken_barh([(left, width)], (-0.22, 0.44), color=hex_color(palette.shot_color(shot)))
        source = SOURCES[int(np.bincount(recording.camera_source[start:end]).argmax())].replace("_", " ")
        name = f"{shot}  {source}"
        room = width / (edges[-1] - edges[0]) * WIDTH_PX * 0.88
        if room > 20:
            text = name if room > 7.5 * len(name) else str(shot)
            axes.text(left + width / 2, 0, text, color="white", fontsize=8.5, ha="center", va="center", weight="bold")
    for mark in marks:
        color = hex_color(palette.CUT)
        left, right = edges[mark.start], edges[mark.end]
        if mark.end > mark.start:
            axes.axvspan(left, right, color=color, alpha=0.15, linewidth=0)
            axes.broken_barh([(left, right - left)], (-0.22, 0.44), facecolor=color, hatch="////", edgecolor="white")
        else:
            axes.axvline(left, color=color, linewidth=1.3)
        axes.text((left + right) / 2, 0.27, mark.name, color=color, fontsize=7.5, ha="center", va="bottom")


def _draw_person(axes: Axes, person: RecordedPerson, edges: np.ndarray, top: float) -> None:
    first = int(person.frame[0]) if len(person.frame) else 0
    color = hex_color(palette.person_color(person))
    axes.broken_barh(_runs(person.observed, edges, first), (top - 0.16, 0.32), color=color, linewidth=0)
    axes.broken_barh(
        _runs(~person.observed, edges, first), (top - 0.16, 0.32), facecolor=hex_color(palette.NOT_OBSERVED),
        alpha=0.4, hatch="////", edgecolor="white", linewidth=0,
    )  # fmt: skip
    for foot in range(4):
        touching = person.contacts[:, foot] >= CONTACT_PROBABILITY
        y = top - 0.42 - 0.22 * foot
        axes.broken_barh(_runs(touching, edges, first), (y - 0.07, 0.14), color=hex_color(palette.CONTACT), linewidth=0)


def _draw_stages(axes: Axes, stages: Sequence[StageTime]) -> None:
    quiet_axes(axes)
    longest = max([s.seconds for s in stages], default=0.0)
    for row, stage in enumerate(stages):
        state = "failed" if stage.failed_units else "cached" if stage.cached_units == stage.units else "computed"
        axes.barh(row, stage.seconds, height=0.68, color=_STATES[state])
        note = f"{stage.seconds:.2f} s"
        if stage.units > 1:
            note += f"   {stage.units} units"
        if stage.cached_units:
            note += (
                "   from the store" if stage.cached_units == stage.units else f"   {stage.cached_units} from the store"
            )
        if stage.failed_units:
            note += f"   {stage.failed_units} failed"
        axes.text(stage.seconds + max(longest, 1e-3) * 0.008, row, note, va="center", fontsize=8, color=TEXT)
    axes.set_yticks(range(len(stages)), [stage.stage for stage in stages], fontsize=8.5)
    axes.set_ylim(len(stages) - 0.4, -0.6)
    axes.set_xlim(0, max(longest, 1e-3) * 1.15)
    axes.set_title(stages_title(stages), loc="left", fontsize=11, color=TEXT)
    axes.grid(axis="x", color=GRID, linewidth=0.8)


def stages_title(stages: Sequence[StageTime]) -> str:
    """What the seconds below it add up to, which is more than the run took where stages ran beside others."""
    total = sum(stage.seconds for stage in stages)
    return f"seconds in each stage, added up {total:.1f}; stages may run beside others, so that a run takes less"


def _write_warnings(figure: Figure, top_px: int, sentences: Sequence[str], count: int) -> None:
    height_px = figure.get_figheight() * DPI
    title = "no warnings" if count == 0 else f"{count} warning{'s' * (count > 1)}"
    left, top = _LEFT_PX / WIDTH_PX, 1 - top_px / height_px
    figure.text(left, top + 8 / height_px, title, fontsize=11, color=TEXT)
    figure.text(left, top, "\n".join(sentences), va="top", fontsize=8.5, color=TEXT)


def _wrapped(warnings: Sequence[str]) -> list[str]:
    shown = [w.replace("$", r"\$") for w in warnings[:_MOST_WARNINGS]]  # a dollar would start mathematics
    lines = [line for w in shown for line in textwrap.wrap(w, int(WIDTH_PX / DPI * 13), initial_indent="•  ")]
    if len(warnings) > _MOST_WARNINGS:
        lines.append(f"and {len(warnings) - _MOST_WARNINGS} more in run.json")
    return lines


def _frame_edges(time_s: np.ndarray) -> np.ndarray:
    """(F+1,) when each frame begins and the last one ends, seconds from the first frame."""
    last = time_s[-1] - time_s[-2] if len(time_s) > 1 else 1.0
    return np.asarray(np.append(time_s, time_s[-1] + last) - time_s[0])


def _runs(flags: Bool[np.ndarray, " N"], edges: np.ndarray, first: int) -> list[tuple[float, float]]:
    """(start, width) in seconds of every run of true flags; the flags begin at frame `first`."""
    return [(float(edges[first + a]), float(edges[first + b] - edges[first + a])) for a, b in runs_of_true(flags)]
