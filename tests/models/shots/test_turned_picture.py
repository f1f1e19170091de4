"""Films that lie on their sides."""

import numpy as np
import pytest

from humanmm.models.records.landmarks import HIPS, SHOULDERS
from humanmm.models.shots.turned_picture import turned_picture

N = 60
SHOWN_S = np.full(N, 1 / 30)


def seen(*leaning_deg: float, visibility: float = 0.9) -> tuple[np.ndarray, np.ndarray]:
    """Somebody whose trunk leans so far, clockwise from up, one part of the time after the other."""
    angle = np.radians(np.repeat(leaning_deg, N // len(leaning_deg)))
    keypoints = np.zeros((N, 33, 3))
    keypoints[..., 2] = visibility
    keypoints[:, list(HIPS), :2] = 300.0
    keypoints[:, list(SHOULDERS), :2] = 300 + 100 * np.stack([np.sin(angle), -np.cos(angle)], axis=1)[:, None]
    return keypoints, SHOWN_S


@pytest.mark.parametrize(
    ("leaning_deg", "cure"), [(-80.0, "transpose=1"), (95.0, "transpose=2"), (170.0, "hflip,vflip")]
)
def test_where_nobody_is_ever_upright_the_picture_may_be_turned(leaning_deg: float, cure: str) -> None:
    (warning,) = turned_picture([seen(leaning_deg), seen(leaning_deg + 5)])
    assert f"`ffmpeg -i IN -vf {cure} OUT`" in warning


@pytest.mark.parametrize("leaning_deg", [(0.0,), (30.0,), (-90.0, 0.0), (-90.0, 90.0), (90.0, 90.0, 90.0, 10.0)])
def test_people_who_lie_down_or_roll_are_no_turned_picture(leaning_deg: tuple[float, ...]) -> None:
    assert turned_picture([seen(*leaning_deg)]) == ()


def test_who_is_not_seen_well_or_for_a_moment_only_says_nothing() -> None:
    keypoints, shown_s = seen(90.0)
    assert turned_picture([(keypoints[:20], shown_s[:20])]) == ()
    assert turned_picture([seen(90.0, visibility=0.2)]) == ()
    assert turned_picture([]) == ()
