"""Drawings are to scale and show the moments and methods that they name."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.benchmark.scores import Figure, MethodFigures, VideoFigures
from humanmm.models.benchmark.tables.drawings import (
    case_of,
    drawn_methods,
    error_about_cuts,
    median_cases,
    world_views,
    worst_cases,
)
from humanmm.models.benchmark.traces import OFFSETS_S, VideoTraces

ROWS, MOMENTS, BODIES = 3, 16, 4


@pytest.fixture
def trace() -> VideoTraces:
    """The truth walks 8 m along y, 1 m up; the first method 0.5 m beside it, the second was not found."""
    path = np.zeros((ROWS, MOMENTS, 3), np.float32)
    path[..., 1], path[..., 2] = np.linspace(0, 8, MOMENTS), 1.0
    path[1, :, 0], path[2] = 0.5, np.nan
    bodies = np.repeat(path[:, :: MOMENTS // BODIES, None], 12, axis=2)
    error = np.full((2, 2, len(OFFSETS_S)), np.nan, np.float32)
    error[0] = np.arange(len(OFFSETS_S))
    return VideoTraces(
        video="walk", split="1 transition", methods=("humanmm", "concat"), frame=np.arange(MOMENTS, dtype=np.int32),
        path=path, bodies=bodies, pixels=bodies[..., :2] * 10, picture=(640.0, 480.0), cut_error_mm=error,
    )  # fmt: skip


def figures(video: str, split: str, value: float | None) -> VideoFigures:
    known = () if value is None else (Figure("wa_mpjpe100_mm", value),)
    return VideoFigures(video, split, (MethodFigures("humanmm", known, (), "" if known else "no usable person"),))


def test_a_drawing_keeps_the_ratio_of_its_sides_and_says_its_width(trace: VideoTraces) -> None:
    side, other, above = world_views(trace, [0, 1])
    assert side.title == "from the side, 8.4 m wide"
    assert other.title == "from the other side, 0.9 m wide"
    width, height = above.figure.get_size_inches()
    assert width / height == pytest.approx(8.4 / 0.9, rel=1e-3)
    (axes,) = above.figure.axes
    assert np.ptp(axes.get_xlim()) / np.ptp(axes.get_ylim()) == pytest.approx(width / height, rel=1e-3)
    assert axes.yaxis_inverted()


def test_a_case_draws_the_truth_the_first_method_and_the_baseline(trace: VideoTraces) -> None:
    case = case_of(figures("walk", "1 transition", 80.0), trace)
    assert case.facts == "WA-MPJPE 80 mm"
    assert [name for name, _ in drawn_methods(trace.methods)] == ["the truth", "humanmm", "concat"]
    assert len(case.world_views) == 3
    assert [view.title for view in case.camera_views] == [f"camera, frame {k}" for k in (0, 4, 8, 12)]
    assert case_of(figures("walk", "1 transition", None), None).facts == "failed: no usable person"


def test_the_error_about_cuts_is_the_mean_where_half_of_the_cuts_reach(trace: VideoTraces) -> None:
    short = trace.cut_error_mm.copy()
    short[:, :, 10:] = np.nan
    other = replace(trace, cut_error_mm=short + 2)
    curves = error_about_cuts([trace, other])
    assert curves is not None
    (_, first), (_, second) = curves.series
    assert first[:10] == tuple(float(k + 1) for k in range(10))
    assert first[10:] == tuple(float(k) for k in range(10, len(OFFSETS_S)))
    assert set(second) == {None}
    assert error_about_cuts([replace(trace, cut_error_mm=trace.cut_error_mm[:, :0])]) is None


def test_failures_are_the_worst_and_the_median_is_taken_in_every_split() -> None:
    videos = [figures(name, split, value) for name, split, value in (
        ("a", "x", 10.0), ("b", "x", 30.0), ("c", "x", 20.0), ("d", "y", 5.0), ("e", "y", None),
    )]  # fmt: skip
    assert worst_cases(videos, 3) == [4, 1, 2]
    assert median_cases(videos) == [2, 3]
